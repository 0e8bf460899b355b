from __future__ import annotations

import numpy as np
import pytest
from reference import ring
from scipy.spatial import Delaunay

from cvtimg.meshes import measure_mesh, measure_triangles


def hexagon() -> tuple[np.ndarray, np.ndarray]:
    return np.vstack([[0, 0], ring(6)]), np.array([[0, 1 + k, 1 + (k + 1) % 6] for k in range(6)])


def test_a_hexagon_of_equilateral_triangles_is_perfect() -> None:
    measures = measure_mesh(*hexagon())
    for name in ("chi", "alpha", "beta", "q"):
        assert getattr(measures, name) == pytest.approx(1), name
    assert measures.p == pytest.approx(0, abs=1e-9)
    assert measures.h == pytest.approx(1 / 3**0.5)
    assert (measures.least_angle, measures.mean_quality) == pytest.approx((60, 1))


def test_cells_are_clipped_to_the_mesh_and_not_to_its_hull() -> None:
    points = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float)
    triangles = np.array([[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]])
    # The cell of (1, 1) has the corner (1, 0) and (0, 1) at distance 1; a cell of the hull would reach (1.5, 1.5).
    assert measure_mesh(points, triangles).h == pytest.approx(1)


@pytest.mark.parametrize("n_dims", [2, 3])
def test_measures_of_triangles_agree_with_their_formulas(n_dims: int) -> None:
    points = np.random.default_rng(0).random((50, n_dims))
    triangles = Delaunay(points[:, :2]).simplices
    found = measure_triangles(points, triangles)
    for k, corners in enumerate(points[triangles]):
        a, b, c = (np.linalg.norm(corners[i] - corners[j]) for i, j in ((1, 2), (2, 0), (0, 1)))
        s = (a + b + c) / 2
        area = (s * (s - a) * (s - b) * (s - c)) ** 0.5
        angles = [np.arccos((y * y + z * z - x * x) / (2 * y * z)) for x, y, z in ((a, b, c), (b, c, a), (c, a, b))]
        assert found.areas[k] == pytest.approx(area)
        assert found.least_angles[k] == pytest.approx(np.degrees(min(angles)))
        assert found.circumradii[k] == pytest.approx(a * b * c / (4 * area))
        assert found.qualities[k] == pytest.approx(2 * (area / s) / (a * b * c / (4 * area)))

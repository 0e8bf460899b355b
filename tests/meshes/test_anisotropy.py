import numpy as np
import pytest

from cvtimg import mesh_region
from cvtimg._shared.types import Floats
from cvtimg.halfedges import edges_around, unique_edges
from cvtimg.meshes import HuangMetric, Mesh, RecoveredHessian
from cvtimg.placement import Box

SQUARE = Box([0, 0], [1, 1])


def interpolation_error(mesh: Mesh, function) -> float:
    """L2 error of linear interpolation, by the middles of edges."""
    corners = mesh.points[mesh.triangles]
    values = function(corners.reshape(-1, 2)).reshape(-1, 3)
    areas = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2
    total = 0.0
    for a, b in ((0, 1), (1, 2), (2, 0)):
        exact = function((corners[:, a] + corners[:, b]) / 2)
        total += (areas / 3 * (exact - (values[:, a] + values[:, b]) / 2) ** 2).sum()
    return float(total**0.5)


def test_edges_have_length_1_in_the_metric() -> None:
    wanted = np.diag([1 / 0.2**2, 1 / 0.025**2])  # edges along x are 8 times as long as those along y
    mesh = mesh_region(SQUARE, metric=lambda points: np.tile(wanted, (len(points), 1, 1)))
    assert mesh.area == pytest.approx(1)
    assert len(mesh.boundary) == pytest.approx(2 / 0.2 + 2 / 0.025, rel=0.02)
    steps = np.subtract(*mesh.points[unique_edges(edges_around(mesh.triangles))[0].T])
    lengths = np.hypot(steps[:, 0] / 0.2, steps[:, 1] / 0.025)
    assert np.median(lengths) == pytest.approx(1, rel=0.1)
    assert ((lengths > 0.7) & (lengths < 1.4)).mean() > 0.9


@pytest.mark.slow
def test_an_anisotropic_mesh_interpolates_a_layer_far_better() -> None:
    def layer(p: Floats) -> Floats:
        return np.exp(-40 * p[:, 0]) + 0.1 * p[:, 1] ** 2

    def hessian(p: Floats) -> Floats:
        found = np.zeros((len(p), 2, 2))
        found[:, 0, 0], found[:, 1, 1] = 1600 * np.exp(-40 * p[:, 0]), 0.2
        return found

    plain = mesh_region(SQUARE, n=250)
    exact = mesh_region(SQUARE, n=250, metric=HuangMetric(hessian, SQUARE))
    recovered = RecoveredHessian(plain.points, plain.triangles, layer(plain.points))
    again = mesh_region(SQUARE, n=250, metric=HuangMetric(recovered, SQUARE))
    assert len(exact.points) == len(again.points) == 250
    assert interpolation_error(exact, layer) < 0.1 * interpolation_error(plain, layer)
    assert interpolation_error(again, layer) < 0.15 * interpolation_error(plain, layer)


def test_hessians_of_quadratics_are_recovered_exactly() -> None:
    mesh = mesh_region([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], n=80)
    x, y = mesh.points.T
    found = RecoveredHessian(mesh.points, mesh.triangles, 3 * x * x - x * y + 2 * y * y + x - 4)
    assert np.abs(found(mesh.points) - [[6, -1], [-1, 4]]).max() < 1e-6

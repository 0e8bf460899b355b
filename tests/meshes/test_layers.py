from __future__ import annotations

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from cvtimg import mesh_region
from cvtimg.halfedges import boundary_edges, edge_keys
from cvtimg.meshes import Mesh, measure_triangles

CHANNEL = shapely.box(0, 0, 4, 2).difference(shapely.Polygon([[1, 1], [2, 0.9], [2, 1.1]]))


def signed_areas(mesh: Mesh) -> NDArray[np.float64]:
    (x, y), (z, w) = (mesh.points[mesh.triangles[:, k]].T - mesh.points[mesh.triangles[:, 0]].T for k in (1, 2))
    return (x * w - y * z) / 2


def test_rows_are_parallel_to_the_border_with_the_wanted_heights_and_number() -> None:
    mesh = mesh_region(CHANNEL, n=1200, layers=(3, 0.01, 1.5), effort="fast")
    assert mesh.layers is not None
    assert len(mesh.points) == len(np.unique(mesh.triangles)) == 1200
    assert signed_areas(mesh).min() > 0
    assert mesh.area == pytest.approx(CHANNEL.area)
    edges = edge_keys(boundary_edges(mesh.triangles), 1200)
    assert set(edges) == set(edge_keys(mesh.edges, 1200))
    in_rows = np.setdiff1d(mesh.triangles[mesh.layers > 0], mesh.edges)
    gaps = shapely.distance(CHANNEL.boundary, shapely.points(mesh.points[in_rows]))
    right = np.isclose(gaps[:, None], [0.01, 0.025, 0.0475]).sum(axis=0)
    assert right.min() > 0.97 * len(in_rows) / 3  # at corners they are farther from the nearest place
    inner = mesh.triangles[mesh.layers == 0]
    assert measure_triangles(mesh.points, inner).least_angles.min() > 20


def test_layers_are_thinner_where_there_is_no_room() -> None:
    wedge = [[0, 0], [4, 0], [4, 1]]
    with pytest.warns(UserWarning, match=r"layers are thinner along \d+ % of the border"):
        mesh = mesh_region(wedge, edge_length=0.1, layers=(4, 0.05, 1.2), effort="fast")
    assert signed_areas(mesh).min() > 0
    assert mesh.area == pytest.approx(2)


def test_layers_of_a_mask_may_have_six_nodes() -> None:
    y, x = np.mgrid[:40, :50]
    mask = np.hypot(x - 25, y - 20) < 15
    mesh = mesh_region(mask, n=300, layers=(2, 0.2, 1.3), order=2, effort="fast")
    assert mesh.quadratic is not None
    assert mesh.quadratic.jacobians.min() > 0
    assert mesh.quadratic.n_straight == 0  # although layers are thinner than edges bend
    assert mesh.area == pytest.approx(mask.sum(), rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"layers": (3, 0.5)}, r"layers of shape \(2,\) must be \(3,\): number, first height, growth"),
        ({"layers": (2.5, 0.1, 1.2)}, "layers has the number 2.5, which must be whole"),
        ({"layers": (3, 0.0, 1.2)}, "first height of layers=0.0 must be"),
        ({"layers": (3, 0.1, 1.2), "boundary": "projected"}, "layers must not be given with"),
        ({"layers": (3, 0.1, 1.2), "fixed": [[0.1, 1]]}, r"fixed has \[0.1, 1.0\] and must be farther inside"),
        ({"layers": (9, 0.01, 1.2), "n": 60}, "n=60 must be at least"),
    ],
)
def test_wrong_layers_are_named(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        mesh_region(CHANNEL, **{"edge_length": None if "n" in arguments else 0.3, **arguments})  # type: ignore[arg-type]

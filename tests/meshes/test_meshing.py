from dataclasses import astuple

import numpy as np
import pytest
import shapely
from images import blobs
from numpy.typing import ArrayLike
from reference import assert_the_guide_tells, ring
from scipy.spatial import Delaunay, cKDTree

from cvtimg import mesh_labels, mesh_region
from cvtimg._shared.types import Floats
from cvtimg.halfedges import edges_around, unique_edges
from cvtimg.meshes import EFFORTS, LocalProjection, Mesh, MeshSize, measure_mesh, measure_triangles
from cvtimg.meshes.borders import Crowding, place_on_borders
from cvtimg.meshes.fields import PictureField
from cvtimg.meshes.mending import mend
from cvtimg.meshes.outlines import label_outline, with_points
from cvtimg.meshes.polygons import Cleaning, outline_of
from cvtimg.meshes.triangulation import FIXED, Borders, PlaneTriangulation, delaunay
from cvtimg.placement import Box, ImplicitRegion, as_region
from cvtimg.sphere import earth_land

pytestmark = pytest.mark.filterwarnings("ignore:the border needs more than")

L_SHAPE = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]


def edges_of(mesh: Mesh) -> Floats:
    """The two ends (E, 2, 2) of each edge."""
    return mesh.points[unique_edges(edges_around(mesh.triangles))[0]]


def edge_lengths(mesh: Mesh) -> Floats:
    return np.linalg.norm(np.subtract(*edges_of(mesh).transpose(1, 0, 2)), axis=1)


def signed_areas(mesh: PlaneTriangulation) -> Floats:
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])


def has_vertices(mesh: Mesh, places: ArrayLike) -> bool:
    return bool((cKDTree(mesh.points).query(places)[0] < 1e-9).all())


def assert_is_a_triangulation(mesh: Mesh) -> None:
    """Each inner edge has two triangles and each outer one, and none overlap; results prove that all turn one way."""
    assert unique_edges(edges_around(mesh.triangles))[2].max() <= 2
    union = shapely.union_all(shapely.polygons(mesh.points[mesh.triangles]))
    assert union.area == pytest.approx(mesh.area, rel=1e-9)


@pytest.mark.parametrize("n", [6, 25, 150])
def test_the_number_of_vertices_is_met_and_the_area_is_that_of_the_polygon(n: int) -> None:
    mesh = mesh_region(L_SHAPE, n=n)
    assert len(mesh.points) == n == mesh.n_wanted
    assert mesh.area == pytest.approx(3)
    assert_is_a_triangulation(mesh)


def test_corners_and_fixed_points_are_vertices() -> None:
    fixed = [[0.5, 0.5], [0.51, 0.5], [0.7, 0.0], [1.0, 1.5]]
    mesh = mesh_region(L_SHAPE, n=300, fixed=fixed)
    assert has_vertices(mesh, [*L_SHAPE, *fixed])
    assert_is_a_triangulation(mesh)


def test_corners_between_long_sides_are_kept_though_they_turn_little() -> None:
    polygon = ring(20)
    mesh = mesh_region(polygon, edge_length=0.5)
    assert has_vertices(mesh, polygon)
    assert mesh.area == pytest.approx(shapely.Polygon(polygon).area)
    for rise, n_lines in ((0.06, 4), (0.12, 5)):  # by 7 and 14 degrees
        roof = as_region([[0, 0], [2, 0], [2, 1], [1, 1 + rise], [0, 1]])
        assert len(outline_of(roof, Cleaning()).lines) == n_lines


def test_vertices_slide_along_borders_but_for_corners() -> None:
    square = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    region = shapely.Polygon(square, [ring(400, 0.4)])
    mesh = mesh_region(region, n=138)
    assert mesh.area == pytest.approx(region.area, rel=1e-8)
    assert has_vertices(mesh, square)
    bottom = np.sort(mesh.points[np.abs(mesh.points[:, 1] + 1) < 1e-12, 0])
    assert np.ptp(np.diff(bottom)) > 0.01 * np.diff(bottom).mean()  # not where they were placed, at equal steps
    assert_is_a_triangulation(mesh)


SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
KITE = [[0, 0], [2, 0], [3, 1], [0, 1]]


@pytest.mark.parametrize(
    "holes",
    [
        [[[0, 0], [1, 2], [2, 1]]],  # at a corner of the outline,
        [[[2, 0], [1, 2], [3, 2]], [[2, 0], [3.5, 1], [3.9, 0.9]]],  # two on a side of it,
        [[[1, 1], [3, 1], [3, 2], [1, 2]], [[2, 2], [3, 3], [1, 3]]],  # on a side of another hole
    ],
)
def test_holes_may_touch_the_outline_and_each_other_at_points(holes: list[list[list[float]]]) -> None:
    region = shapely.Polygon(SQUARE, holes)
    mesh = mesh_region(region, n=400)
    assert mesh.area == pytest.approx(region.area, rel=1e-9)
    assert_is_a_triangulation(mesh)
    assert has_vertices(mesh, np.concatenate(holes))


def test_parts_with_names_share_the_vertices_on_their_borders() -> None:
    disk = shapely.Point(1, 0.5).buffer(0.3, 64)
    right = shapely.box(2, 0, 3, 0.5)  # its corner is on a side of the first
    parts = {"steel": shapely.box(0, 0, 2, 1).difference(disk), "copper": disk, "rubber": right}
    mesh = mesh_region(parts, n=500)
    assert_is_a_triangulation(mesh)
    assert mesh.names == {(2, 1): "steel", (2, 2): "copper", (2, 3): "rubber"}
    areas = np.bincount(mesh.tags, measure_triangles(mesh.points, mesh.triangles).areas)[1:]
    assert areas == pytest.approx([part.area for part in parts.values()], rel=1e-6)
    with pytest.raises(ValueError, match="parts of the region must not overlap"):
        mesh_region({"a": shapely.box(0, 0, 2, 1), "b": right.buffer(0.1)}, n=100)


def test_edges_have_the_wanted_length_angles_are_good_and_energy_falls() -> None:
    mesh = mesh_region(L_SHAPE, edge_length=0.06)
    lengths = edge_lengths(mesh)
    assert np.median(lengths) == pytest.approx(0.06, rel=0.05)
    assert ((lengths > 0.048) & (lengths < 0.072)).mean() > 0.95
    angles = measure_triangles(mesh.points, mesh.triangles).least_angles
    assert angles.min() > 30
    assert mesh.qualities.mean() > 0.97
    assert mesh.energies[-1] < 0.9 * mesh.energies[0]
    assert np.diff(mesh.energies[:10]).max() < 0


def test_vertices_are_as_dense_as_a_function_asks() -> None:
    mesh = mesh_region(Box([0, 0], [1, 1]), size=lambda p: 0.01 + 0.1 * p[:, 0])
    middles = mesh.points[mesh.triangles].mean(axis=1)
    mean_edges = np.sqrt(measure_triangles(mesh.points, mesh.triangles).areas * 4 / 3**0.5)
    ratio = mean_edges / (0.01 + 0.1 * middles[:, 0])
    assert ((ratio > 0.75) & (ratio < 1.25)).mean() > 0.95


def test_with_n_only_ratios_of_sizes_count() -> None:
    def size(p: Floats) -> Floats:
        return 1 + p[:, 0]

    few, many = (mesh_region(Box([0, 0], [1, 1]), n=300, size=lambda p, f=f: f * size(p)) for f in (1, 1000))
    assert len(few.points) == len(many.points) == 300
    left = [(mesh.points[:, 0] < 0.5).mean() for mesh in (few, many)]
    assert left[0] == pytest.approx(left[1], abs=0.02)
    assert left[0] > 0.57


def test_sizes_grow_no_faster_than_the_grade() -> None:
    def spike(p: Floats) -> Floats:
        return np.where(np.hypot(*(p - 0.5).T) < 0.02, 0.005, 0.2)

    mesh = mesh_region(Box([0, 0], [1, 1]), size=spike, grade=0.2)
    middles = mesh.points[mesh.triangles].mean(axis=1)
    mean_edges = np.sqrt(measure_triangles(mesh.points, mesh.triangles).areas * 4 / 3**0.5)
    allowed = 0.005 + 0.2 * np.maximum(np.hypot(*(middles - 0.5).T) - 0.02, 0)
    assert (mean_edges < 2 * allowed + 0.005).all()
    assert mesh.qualities.min() > 0.5


def test_sizes_of_pixels_grow_along_the_shortest_way_from_any_other() -> None:
    random = np.random.default_rng(7)
    sizes = (random.random((17, 23)) ** 4 * 9 + 0.1).astype(np.float32)
    field = PictureField(sizes, np.ones(sizes.shape, bool)).limited(0.3, 0.0)
    y, x = (at.ravel() for at in np.indices(sizes.shape))
    dx, dy = np.abs(x[:, None] - x), np.abs(y[:, None] - y)
    ways = 0.3 * (np.maximum(dx, dy) + (2**0.5 - 1) * np.minimum(dx, dy))
    assert field.sizes.ravel() == pytest.approx((sizes.ravel() + ways).min(axis=1), rel=1e-5)


def test_nine_edges_of_ten_have_nearly_the_wanted_length_where_sizes_vary() -> None:
    sizes = np.clip(np.hypot(*(np.indices((200, 200)) - 60)) * 0.06, 1.0, 8.0)
    mesh = mesh_region([[0, 0], [200, 0], [200, 200], [0, 200]], size=sizes)
    field = PictureField(sizes.astype(np.float32), np.ones(sizes.shape, bool))
    ratios = edge_lengths(mesh) * field.metric(edges_of(mesh).mean(axis=1))[:, 0] ** 0.5
    assert ((ratios > 0.8) & (ratios < 1.25)).mean() > 0.9
    measures = mesh.measures()
    assert measures.mean_quality > 0.95
    assert measures.least_angle > 38  # since narrow triangles are smoothed in the end


@pytest.mark.parametrize(("growth", "counts_as_one"), [(0.15, True), (0.35, False)])
def test_where_sizes_differ_by_less_than_a_fifth_vertices_move_longer(growth: float, counts_as_one: bool) -> None:
    mesh = mesh_region(Box([0, 0], [1, 1]), n=300, size=lambda p: 1 + growth * p[:, 0], effort="fast")
    assert (len(mesh.energies) > 11) == counts_as_one


def test_a_size_image_is_in_the_pixels_of_the_mask() -> None:
    mask = np.zeros((40, 60), bool)
    mask[5:35, 5:55] = True
    size = np.where(np.arange(60) < 30, 1.5, 4.0) * np.ones((40, 1))
    size[~mask] = np.nan
    mesh = mesh_region(mask, size=size)
    assert mesh.area == pytest.approx(1500, rel=0.01)
    assert ((mesh.points[:, 0] < 30).mean()) > 0.7
    assert_is_a_triangulation(mesh)


def test_vertices_move_as_far_as_triangles_keep_area() -> None:
    points = np.random.default_rng(5).random((400, 2))
    mesh = PlaneTriangulation(points, delaunay(points), 60)
    before, areas = mesh.points.copy(), signed_areas(mesh)
    mesh.move(np.random.default_rng(6).normal(0, 0.02, (400, 2)))
    done = mesh.points - before
    assert 0.1 <= (signed_areas(mesh) / areas).min() < 0.15
    assert (done[mesh.fixed == FIXED] == 0).all()
    assert (done != 0).any(axis=1).mean() > 0.5


def test_triangles_do_not_get_flat_where_edges_are_made_even() -> None:
    points = np.random.default_rng(3).random((30, 2))
    mesh = PlaneTriangulation(points, delaunay(points))

    def shapes() -> Floats:
        corners = mesh.points[mesh.triangles]
        squares = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=(1, 2))
        return 2 * 3**0.5 * signed_areas(mesh) / squares  # 1 for an equilateral triangle

    for _ in range(20):
        before = shapes()
        mesh.even(np.tile([1.0, 0.0, 1.0], (30, 1)))
        assert (shapes() > np.minimum(before, 0.498) - 1e-12).all()
        mesh.flip(None)


@pytest.mark.slow
def test_thin_slits_and_necks_leave_no_small_angles() -> None:
    slit = [[[0, 0], [1, 0], [1, 1], [0, 1]], [[0.2, 0.4995], [0.2, 0.5005], [0.8, 0.5005], [0.8, 0.4995]]]
    left = np.array([[1.5, 0.4995], [1, 0.4995], [1, 0], [0, 0], [0, 1], [1, 1], [1, 0.5005], [1.5, 0.5005]])
    right = [[1.5, 1], [2.5, 1], [2.5, 0], [1.5, 0]]
    for region in (slit, [np.concatenate([left, right])[::-1]]):
        mesh = mesh_region(region, n=2000)
        assert measure_triangles(mesh.points, mesh.triangles).least_angles.min() > 29.9


def test_borders_that_crowd_with_nothing_between_them_need_less_short_edges() -> None:
    slit = shapely.box(0, 0, 2, 1).difference(shapely.box(0.5, 0.5, 1.5, 0.505))
    mesh = mesh_region(slit, edge_length=0.1, effort="fast")
    sides = mesh.points[mesh.edges]
    on_slit = (np.abs(sides[..., 1] - 0.5) < 0.01).all(axis=1)
    assert on_slit.sum() < 130  # 260 if both sides made each other short


@pytest.mark.slow
def test_details_below_the_least_size_are_left_out() -> None:
    teeth = np.stack([np.arange(0, 10, 0.01), np.where(np.arange(1000) % 2, 0.0, 0.01)], axis=1)
    comb = [[0.0, 5.0], *teeth.tolist(), [10.0, 5.0]]
    assert len(mesh_region(comb, edge_length=0.5, min_size=0.1).points) < 400
    spit = mesh_region([[0, 0], [1, 0], [1, 0.4], [3, 0.5], [1, 0.6], [1, 1], [0, 1]], min_size=0.1, effort="fast")
    assert spit.points[:, 0].max() == pytest.approx(2, abs=0.1)  # as far as it is 0.1 wide


def test_corners_get_no_sharper_by_edges_that_cut_off_curves_beside_them() -> None:
    horn = [[0, 0], [0.06, -0.02], [0.25, -0.03], [1, -0.3], [1, 0.3], [0.25, 0.02], [0.06, 0.012]]  # of 29.7 degrees
    assert mesh_region(horn, edge_length=0.2).measures().least_angle > 24  # 21 if they did


@pytest.mark.slow
def test_implicit_regions_are_traced() -> None:
    disk = ImplicitRegion(lambda p: np.abs(np.hypot(*p.T) - 0.7) - 0.3, [-1.1, -1.1], [1.1, 1.1])
    mesh = mesh_region(disk, n=300)
    assert mesh.area == pytest.approx(np.pi * (1 - 0.16), rel=1e-4)
    assert np.abs(np.abs(np.hypot(*mesh.points[mesh.boundary].T) - 0.7) - 0.3).max() < 4e-3


def test_sizes_live_on_a_mesh() -> None:
    coarse = mesh_region(Box([0, 0], [1, 1]), n=50)
    size = MeshSize(coarse.points, coarse.triangles, 0.02 + 0.1 * np.hypot(*coarse.points.T))
    at = np.random.default_rng(0).random((200, 2))
    assert size(at) == pytest.approx(0.02 + 0.1 * np.hypot(*at.T), rel=0.2)
    fine = mesh_region(Box([0, 0], [1, 1]), size=size)
    near = np.hypot(*fine.points.T) < 0.2
    assert near.sum() / (np.pi / 4 * 0.04) > 4 * (~near).sum() / (1 - np.pi / 4 * 0.04)


def test_corners_of_labels_are_kept_and_disks_stay_round() -> None:
    labels = np.ones((80, 80), int)
    labels[10:30, 10:40] = 2
    labels[np.hypot(*(np.mgrid[:80, :80] - 54.5)) < 15] = 3
    mesh = mesh_labels(labels, edge_length=4)
    assert has_vertices(mesh, [[10, 10], [40, 10], [40, 30], [10, 30], [0, 0], [80, 80]])
    areas = measure_triangles(mesh.points, mesh.triangles).areas
    assert areas[mesh.tags == 2].sum() == pytest.approx(600, rel=0.003)
    assert areas[mesh.tags == 3].sum() == pytest.approx((labels == 3).sum(), rel=0.003)
    on_disk = np.unique(mesh.triangles[mesh.tags == 3])
    radii = np.hypot(*(mesh.points[np.intersect1d(on_disk, mesh.boundary)] - 55).T)
    assert radii.min() > 14.3
    assert radii.max() < 16


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"region": [[0, 0], [2, 2], [2, 0], [0, 2]], "n": 9}, "cross themselves"),
        ({"region": [[[0, 0], [9, 0], [0, 9]], [[1, 1], [4, 1], [4, 2]], [[2, 1], [5, 1], [5, 2]]], "n": 9}, "other"),
        ({"region": L_SHAPE, "n": 5}, "n=5 must be at least 6"),
        ({"region": ring(200), "n": 150, "keep_points": True}, "n=150 must be at least 200, .* the border needs"),
        ({"region": np.ones((8, 8), bool), "keep_points": True}, "keep_points must be False"),
        ({"region": L_SHAPE, "n": 9, "edge_length": 1}, "n and edge_length must be"),
        ({"region": L_SHAPE, "size": 0}, "size=0.0 must be"),
        ({"region": np.ones((8, 8), bool), "edge_length": 1e-6}, "sizes must ask for at most"),
        ({"region": L_SHAPE, "size": lambda p: 0 * p[:, 0]}, "size is 0 at"),
        ({"region": L_SHAPE, "size": lambda p: np.nan * p[:, 0]}, "size is nan at"),
        ({"region": L_SHAPE, "size": lambda p: p}, "must return"),
        ({"region": np.ones((2, 2), bool), "size": np.array([[1, 1], [np.nan, 1]])}, "size is nan at x=0, y=1"),
        ({"region": [[0, 0], [2, 0], [2, 2]], "size": np.array([[1, np.nan], [1, 1]])}, "size is nan at x=1, y=0"),
        ({"region": np.ones((4, 4), bool), "size": np.ones((3, 4))}, r"must be \(4, 4\)"),
        ({"region": np.ones((1, 1), bool), "n": 3}, "n=3 must be at least 4"),
        ({"region": L_SHAPE, "n": 50, "fixed": [[1.5, 1.5]]}, "must be in the region"),
        ({"region": ring(100), "n": 20, "fixed": [[0.97, 0], [0, 0.985]]}, "near which edges on the border must be"),
        ({"region": Box([0, 0], [1, 1], periodic=True), "n": 50}, "must not be periodic"),
        ({"region": Box([0, 0, 0], [1, 1, 1]), "n": 50}, "must be in the plane"),
        ({"region": L_SHAPE, "n": 99, "fixed": [[0.5, 0.5], [0.5, 0.5 + 1e-12]]}, "fixed has points 0 and 1"),
        ({"region": SQUARE, "n": 50, "metric": lambda p: np.zeros((len(p), 2, 2))}, "be finite and positive"),
        ({"region": SQUARE, "n": 50, "metric": lambda p: np.full((len(p), 2, 2), np.nan)}, "be finite and positive"),
        ({"region": SQUARE, "n": 50, "metric": lambda p: np.ones(len(p))}, r"metric of shape \(\d+,\) must be"),
        ({"region": SQUARE, "edge_length": 0.1, "metric": lambda p: np.eye(2)}, "edge_length and metric must be"),
        ({"region": ring(64), "n": 300, "periodic": "x"}, "periodic='x' must be for borders on the left"),
        ({"region": KITE, "n": 300, "periodic": "x"}, r"the border from \[0.0, 1.0\] to \[0.0, 0.0\] must have a copy"),
        ({"region": SQUARE, "n": 300, "periodic": "x", "fixed": [[0, 0.6]]}, "must have a copy on the other side"),
        ({"points": [[0, 0], [1, 1], [2, 2]], "triangles": [[0, 1, 2]]}, "must have an area"),
        ({"labels": np.zeros((4, 4), int), "n": 9}, "labels must not be 0 everywhere"),
        ({"labels": np.array([[1, 2], [3, 4]]), "n": 8}, "n=8 must be at least 9"),
        ({"labels": 1 + np.indices((8, 8)).sum(axis=0) % 2, "n": 80}, "n=80 must be at least 81"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, object], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        {"labels": mesh_labels, "region": mesh_region, "points": measure_mesh}[next(iter(arguments))](**arguments)


@pytest.mark.slow
def test_borders_are_the_sides_of_pixels_or_the_smoother_the_farther_they_may_move() -> None:
    labels, borders = np.pad(blobs(3, spread=3)[:120], 1, constant_values=9), []
    for tolerance in (0, 0.7, 2.0):
        mesh = mesh_labels(labels, edge_length=2, tolerance=tolerance, effort="fast")
        borders.append(np.linalg.norm(np.subtract(*mesh.points[mesh.edges.T]), axis=1).sum())
    between = sum(np.count_nonzero(np.diff(labels, axis=axis)) for axis in (0, 1))
    assert borders[0] == pytest.approx(between + 2 * sum(labels.shape))
    assert borders[2] < borders[1] < borders[0]


@pytest.mark.slow
def test_the_best_effort_is_no_worse_than_the_balanced_one() -> None:
    labels = blobs(3, spread=3)
    best, balanced = (mesh_labels(labels, n=2500, effort=effort).qualities.mean() for effort in ("best", "balanced"))
    assert best >= balanced


@pytest.mark.slow
def test_small_angles_at_borders_are_mended_with_exact_numbers_and_areas() -> None:
    labels = blobs(0)
    mesh = mesh_labels(labels, n=3000)
    each = measure_triangles(mesh.points, mesh.triangles)
    assert len(mesh.points) == 3000
    assert each.least_angles.min() > 15
    assert (each.least_angles < 30).mean() < 0.004
    areas = np.bincount(mesh.tags, each.areas)
    assert areas == pytest.approx(np.bincount(labels.ravel()), rel=1e-5)
    assert_is_a_triangulation(mesh)  # so that segments share the vertices on their borders


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_without_sizes_a_mesh_has_the_vertices_that_its_borders_need(seed: int) -> None:
    mesh = mesh_labels(blobs(seed))
    measures = mesh.measures()
    assert measures.least_angle > 20
    assert measures.below_30 < 0.001
    assert measures.mean_quality > 0.9
    assert mesh.n_wanted is None
    assert len(mesh_region(L_SHAPE).points) < len(mesh.points)


def test_a_vertex_that_divides_a_narrow_triangle_in_three_goes() -> None:
    corners = np.array([[40.0, 157], [40, 160], [42, 160]])
    borders = Borders(corners, np.int32([[0, 1], [1, 2], [2, 0]]), np.full((3, 2), [0, 1], np.int32), np.ones(3, bool))
    field = PictureField(np.full((200, 200), 2, np.float32), np.ones((200, 200), bool))
    for keep_number, n in ((False, 3), (True, 4)):
        mesh = PlaneTriangulation.constrained(borders, np.array([[40.7, 158.9]]))
        assert len(mend(mesh, field, 0.2, 10, shortest=1.0, keep_number=keep_number).points) == n


def test_an_edge_that_areas_shrink_to_nothing_does_not_make_millions_of_vertices() -> None:
    rows = ["222322222", "222222233", "222223333", "223333232", "233333322", "333333222"]
    labels = np.array([list(row) for row in rows]).astype(np.int32)
    field = PictureField(np.full(labels.shape, 10, np.float32), np.ones(labels.shape, bool))
    assert place_on_borders(label_outline(labels, None, 0.7), field, Crowding(0.2, 0.0))[1].count < 1000


@pytest.mark.slow
def test_corners_of_labels_are_no_narrower_than_their_lines() -> None:
    """On a hook one pixel wide, long edges met at 5 degrees where the contour turns by 64."""
    from skimage import data

    from cvtimg import segment

    labels = segment(data.coffee(), 3, min_size=500).labels
    assert mesh_labels(labels, n=4000).measures().least_angle > 15


def test_outlines_of_which_nothing_may_move_keep_their_points_above_the_least_size() -> None:
    boxes = shapely.union_all([shapely.box(x, 0, x + 1, 1) for x in (0, 2)])
    assert mesh_region(boxes, min_size=0.3, effort="fast").area == pytest.approx(2)


def test_seas_of_islands_have_no_edge_below_half_of_the_least_size() -> None:
    sea = shapely.box(115, -10, 130, 8) - shapely.geometry.shape(earth_land()).buffer(0)
    mesh = mesh_region(sea, min_size=0.5, effort="fast")
    ends = mesh.points[mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]]]
    assert np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2).min() > 0.25


def test_a_number_of_vertices_beyond_the_least_size_is_warned_of() -> None:
    with pytest.warns(UserWarning, match=r"n=400 .* edges of about 0\.21, shorter than half of min_size=0\.5"):
        assert len(mesh_region(SQUARE, n=400, min_size=0.5, effort="fast").points) == 400


def test_too_few_vertices_for_a_jagged_border_are_warned_of() -> None:
    rng, k = np.random.default_rng(0), 100
    waves = (rng.standard_normal(k) + 1j * rng.standard_normal(k)) * np.arange(1, k + 1) ** -1.5
    far = np.fft.irfft(np.append(0, waves), 2 * k)
    coast = (1 + 0.4 * far / np.abs(far).max())[:, None] * ring(2 * k)
    with pytest.warns(UserWarning, match=r"more than n=70 vertices: the least angle is \d\.\d degrees"):
        mesh_region(coast, n=70, effort="fast")


@pytest.mark.parametrize("middle", [0.0, 180.0])
def test_degrees_are_meshed_in_km_also_across_the_date_line(middle: float) -> None:
    def box(west: float, east: float) -> list[list[list[float]]]:
        return [[[west, 50], [east, 50], [east, 60], [west, 60], [west, 50]]]

    parts = [box(-4, 4)] if middle == 0 else [box(176, 180), box(-180, -176)]
    mesh = mesh_region({"type": "MultiPolygon", "coordinates": parts}, edge_length=60, project="auto", effort="fast")
    assert mesh.projection is not None
    assert np.ptp(mesh.points, axis=0) == pytest.approx([8, 10], abs=0.01)
    places = mesh.projection.to_km(mesh.points)
    each = measure_triangles(places, mesh.triangles)
    area = 6371.0072**2 * np.radians(8) * np.diff(np.sin(np.radians([50, 60])))[0]
    assert each.areas.sum() == pytest.approx(area, rel=2e-4)
    assert each.least_angles.min() > 30
    assert len(mesh.points) - len(edges_of(mesh)) + len(mesh.triangles) == 1  # of one piece


def hexagon() -> tuple[np.ndarray, np.ndarray]:
    return np.vstack([[0, 0], ring(6)]), np.array([[0, 1 + k, 1 + (k + 1) % 6] for k in range(6)])


def test_what_borders_crowd_needs_fewest_vertices_at_half_of_the_usual_distance() -> None:
    with pytest.raises(ValueError, match=r"must be at least 1[01]"):  # 54 to 56, or 132 to 138, at other distances
        mesh_region([ring(400), ring(400, 0.97)], n=40)


def test_outlines_may_not_reach_far_around_the_globe() -> None:
    assert LocalProjection(0, 0).to_km(np.array([[110.0, 0]])).shape == (1, 2)
    with pytest.raises(ValueError, match="outlines must reach less far"):
        LocalProjection(0, 0).to_km(np.array([[130.0, 0]]))


def test_points_a_billionth_of_the_diameter_from_a_line_are_on_it() -> None:
    outline = outline_of(Box([0, 0], [3, 4]), Cleaning())
    parted, alone = with_points(outline, np.array([[1, 3.5e-9], [2, 8e-9]]))
    assert len(parted.lines) == len(outline.lines) + 1
    assert alone.tolist() == [[2, 8e-9]]


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


#: A cell of a lattice of holes, one of which is over its sides.
HOLES = shapely.union_all([shapely.Point(x, 0.3).buffer(0.2) for x in (0.1, 0.7, 1.3)])
CELL = shapely.box(0.1, 0, 1.3, 0.7).difference(HOLES)


def shifts(mesh: Mesh) -> set[tuple[float, ...]]:
    """Check that vertices are paired once along each axis; return by how much they are apart."""
    assert mesh.pairs is not None
    steps = mesh.points[mesh.pairs[:, 0]] - mesh.points[mesh.pairs[:, 1]]
    assert ((steps == 0).sum(axis=1) == 1).all()
    for axis in (0, 1):
        copies = mesh.pairs[steps[:, axis] != 0, 0]
        assert len(copies) == len(set(copies.tolist()))
    return set(map(tuple, steps.round(12).tolist()))


def test_vertices_on_periodic_sides_are_equal_by_translation() -> None:
    mesh = mesh_region(CELL, n=300, periodic="xy", effort="fast")
    assert len(mesh.points) == 300
    assert shifts(mesh) == {(1.2, 0), (0, 0.7)}


@pytest.mark.parametrize("edge_length", [0.05, 0.2])  # the latter is mended: edges on the other borders are split
def test_all_vertices_on_periodic_sides_are_in_pairs(edge_length: float) -> None:
    mesh = mesh_region(CELL, edge_length=edge_length, periodic="xy", effort="fast")
    assert mesh.pairs is not None
    for axis in (0, 1):
        for column, bound in zip((1, 0), CELL.bounds[axis::2], strict=True):
            on_bound = np.flatnonzero(np.abs(mesh.points[:, axis] - bound) < 1e-12)
            assert np.isin(on_bound, mesh.pairs[:, column]).all()


def test_periodic_sides_may_bend_and_have_six_nodes() -> None:
    y = np.linspace(0, 1, 40)
    wave = np.stack([0.15 * np.sin(2 * np.pi * y), y], axis=1)
    sides = np.concatenate([wave[::-1], wave + np.array([1.5, 0])])
    mesh = mesh_region(sides, n=120, periodic="x", order=2, effort="fast")
    assert shifts(mesh) == {(1.5, 0)}
    assert mesh.quadratic is not None
    assert mesh.quadratic.pairs is not None
    assert mesh.pairs is not None
    assert len(mesh.quadratic.pairs) == 2 * len(mesh.pairs) - 1
    a, b = mesh.quadratic.nodes[mesh.quadratic.pairs.T]
    assert (a[:, 1] == b[:, 1]).all()
    assert np.allclose(a[:, 0] - b[:, 0], 1.5)


def test_labels_are_periodic_where_their_borders_are() -> None:
    y, x = np.mgrid[:24, :30]
    labels = 1 + (np.hypot((x + 8) % 30 - 8, y - 12) < 7).astype(np.int32)
    labels[:, -1] = labels[:, 0]
    mesh = mesh_labels(labels, edge_length=3, periodic="xy", effort="fast")
    assert shifts(mesh) == {(30, 0), (0, 24)}


def test_sizes_count_where_they_are_small_between_the_cells_of_the_field() -> None:
    # Points doubled 1e-4 apart lower sizes within cells of .02: by the sizes at their centers, other points of the
    # same outline made 40 % more vertices, or angles of 2 degrees.
    angle = np.linspace(0, 2 * np.pi, 500, endpoint=False)
    outline = (1 + 0.3 * np.sin(3 * angle))[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    numbers = []
    for start in (0, 6, 15):
        doubled = np.arange(start, 500, 25)
        steps = np.roll(outline, -1, axis=0)[doubled] - outline[doubled]
        steps *= 1e-4 / np.linalg.norm(steps, axis=1, keepdims=True)
        points = np.insert(outline, doubled + 1, outline[doubled] + steps @ [[1, 1], [-1, 1]], axis=0)
        mesh = mesh_region(points, effort="fast")
        assert measure_triangles(mesh.points, mesh.triangles).least_angles.min() > 25
        numbers.append(len(mesh.points))
    assert max(numbers) < 1.2 * min(numbers)


def test_the_guide_tells_how_much_each_effort_does() -> None:
    assert_the_guide_tells("meshes.md", {name: astuple(effort)[:-1] for name, effort in EFFORTS.items()})

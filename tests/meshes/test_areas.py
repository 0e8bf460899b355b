import numpy as np
import pytest
import shapely
from images import blobs

from cvtimg import find_contours, mesh_labels, mesh_region
from cvtimg._shared.types import Floats
from cvtimg.labels.components import connected_pieces
from cvtimg.meshes import Mesh, measure_triangles


def areas_of(mesh: Mesh, n_tags: int) -> Floats:
    return np.bincount(mesh.tags, measure_triangles(mesh.points, mesh.triangles).areas, n_tags)


@pytest.mark.parametrize(
    ("seed", "left_out"), [(0, None), *(pytest.param(7, part, marks=pytest.mark.slow) for part in (0, 1, 2))]
)
def test_each_segment_keeps_its_area_beside_unmeshed_pixels_too(seed: int, left_out: int | None) -> None:
    labels = connected_pieces(blobs(seed, (64, 64), 4, 3).astype(np.int32))
    labels[labels % 3 == left_out] = 0
    mesh = mesh_labels(labels, n=1000, effort="fast")
    pixels = np.bincount(labels.ravel())
    assert areas_of(mesh, len(pixels))[1:] == pytest.approx(pixels[1:], rel=1e-5)
    assert mesh.area == pytest.approx((labels > 0).sum(), rel=1e-5)


def test_the_pieces_of_a_segment_keep_their_areas_one_by_one() -> None:
    labels = np.ones((60, 80), np.int32)
    y, x = np.mgrid[:60, :80]
    labels[np.hypot(x - 20, y - 30) < 12] = 2
    labels[np.hypot(x - 60, y - 30) < 6] = 2
    mesh = mesh_labels(labels, n=300)
    areas = measure_triangles(mesh.points, mesh.triangles).areas
    left = mesh.points[mesh.triangles].mean(axis=1)[:, 0] < 40
    for side, columns in ((left, slice(0, 40)), (~left, slice(40, 80))):
        pixels = (labels[:, columns] == 2).sum()
        assert areas[(mesh.tags == 2) & side].sum() == pytest.approx(pixels, rel=1e-5)


def test_with_an_image_segments_keep_the_areas_of_its_contours() -> None:
    y, x = np.mgrid[:40, :40]
    image = np.clip(8 - np.hypot(x - 19.3, y - 20.1), -1, 1)
    labels = 1 + (image > 0)
    (disk,) = (each for each in find_contours(labels, image).polygons if each.label == 2)
    mesh = mesh_labels(labels, image, n=150)
    assert areas_of(mesh, 3)[2] == pytest.approx(disk.area, rel=1e-5)
    assert abs(disk.area - (labels == 2).sum()) > 0.1


def test_a_mask_keeps_its_area_and_fixed_points_on_its_border_stay() -> None:
    mask = np.hypot(*(np.mgrid[:40, :40] - 19.5)) < 15
    fixed = [[20.0, 5.0], [20.0, 20.0]]
    mesh = mesh_region(mask, n=100, fixed=fixed)
    assert mesh.area == pytest.approx(mask.sum(), rel=1e-5)
    for place in fixed:
        assert (np.abs(mesh.points - place).max(axis=1) < 1e-12).any(), place


def wave(n: int) -> shapely.Polygon:
    """Bend a ring in and out, with a corner and a hole."""
    turns = 2 * np.pi * np.arange(n) / n
    radii = 1 + 0.2 * np.abs(np.sin(3.5 * turns)) + 0.1 * np.sin(9 * turns)
    ring = radii[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return shapely.Polygon(ring, [0.4 * ring[::-1]])


CURVED = {
    "box with round corners": shapely.box(1e5, 2e6, 1e5 + 4, 2e6 + 2).buffer(0.4),
    "half a disk": shapely.intersection(shapely.Point(0, 0).buffer(1), shapely.box(-2, 0, 2, 2)),
    "two disks": shapely.union(shapely.Point(0, 0).buffer(1, 30), shapely.Point(3, 0).buffer(0.6, 30)),
    "wave": wave(300),
}


@pytest.mark.parametrize("name", CURVED)
def test_polygons_keep_their_area_though_edges_cut_curves(name: str) -> None:
    polygon = CURVED[name]
    mesh = mesh_region(polygon, n=120, effort="fast")
    areas = measure_triangles(mesh.points, mesh.triangles).areas
    for part in shapely.get_parts(polygon):
        inside = shapely.contains_xy(part.convex_hull.buffer(0.1), *mesh.points[mesh.triangles].mean(axis=1).T)
        assert areas[inside].sum() == pytest.approx(part.area, rel=1e-6)
    feet = shapely.get_coordinates(shapely.shortest_line(polygon.boundary, shapely.points(mesh.points)))[::2]
    off, chords_off = (
        shapely.hausdorff_distance(shapely.multilinestrings(ends[mesh.edges]), polygon.boundary, densify=0.2)
        for ends in (mesh.points, feet)
    )
    assert off < 1.8 * chords_off


def test_vertices_on_straight_sides_and_corners_stay() -> None:
    box = CURVED["box with round corners"]
    mesh = mesh_region(box, n=120, effort="fast")
    left, low, right, high = box.bounds
    x, y = mesh.points[mesh.boundary].T
    on_sides = (x == left) | (x == right) | (y == low) | (y == high)
    straight = 2 * (right - left - 0.8) + 2 * (high - low - 0.8)
    assert on_sides.sum() > 0.8 * len(x) * straight / box.length
    half = mesh_region(CURVED["half a disk"], n=50, effort="fast")
    assert np.isin([[1, 0], [-1, 0]], half.points).all()


def test_all_points_of_polygons_are_kept_where_asked() -> None:
    coast = wave(150)
    mesh = mesh_region(coast, n=600, keep_points=True, effort="fast")
    places = {tuple(place) for place in mesh.points.tolist()}
    assert all(tuple(place) in places for place in shapely.get_coordinates(coast).tolist())
    assert mesh.area == pytest.approx(coast.area, rel=1e-12)

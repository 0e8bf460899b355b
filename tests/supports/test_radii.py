from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cvtimg import place_generators, support_radii
from cvtimg.placement import Box, ImplicitRegion, PolygonRegion, Region

SQUARE = Box([0, 0], [1, 1])
ELL = PolygonRegion([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]])
FRAME = PolygonRegion([[[0, 0], [4, 0], [4, 4], [0, 4]], [[1, 1], [3, 1], [3, 3], [1, 3]]])


def cube(n_dims: int) -> Box:
    return Box([0] * n_dims, [1] * n_dims)


@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize(
    "region",
    [SQUARE, FRAME, cube(1), *(pytest.param(other, marks=pytest.mark.slow) for other in (ELL, cube(3), cube(5)))],
)
def test_a_proved_cover_holds_at_each_of_many_places_and_one_by_three_gets_tighter(region: Region, order: int) -> None:
    points, places = region.draw(40, 5), region.draw(1000, 2)
    apart = np.linalg.norm(places[:, None] - points, axis=2)
    supports = support_radii(points, region, order)
    assert supports.proved
    assert ((apart <= supports.radii).sum(axis=1) >= order).all()
    loose = support_radii(points, region, order, tighten=False)
    assert supports.overlap.nnz <= (0.85 if order == 3 and region.n_dims == 2 else 1) * loose.overlap.nnz


@pytest.mark.slow
def test_tessellations_have_fewer_pairs_than_random_points_and_three_fold_covers_shrink() -> None:
    even = place_generators(SQUARE, 128).points
    single = support_radii(even, SQUARE)
    triple = support_radii(even, SQUARE, 3)
    assert single.overlap.nnz < 0.1 * 128**2
    assert triple.overlap.nnz < 0.2 * 128**2
    assert single.overlap.nnz < support_radii(SQUARE.draw(128), SQUARE).overlap.nnz


def test_the_overlap_is_that_of_the_radii() -> None:
    points = SQUARE.draw(50, 1)
    supports = support_radii(points, SQUARE, 2)
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    assert (supports.overlap.toarray() == (apart < supports.radii + supports.radii[:, None])).all()


def test_distances_are_shares_of_the_radii_where_supports_hold_a_place() -> None:
    points, places = SQUARE.draw(30, 1), SQUARE.draw(100, 2)
    supports = support_radii(points, SQUARE, 2)
    shares = np.linalg.norm(places[:, None] - points, axis=2) / supports.radii
    found = supports.distances(places)
    assert (np.diff(found.indptr) >= 2).all()
    assert found.toarray() == pytest.approx(np.where(shares < 1, shares, 0))


# In more dimensions, so few samples come near to too few corners of cells.
@pytest.mark.parametrize("n_dims", [1, 3])
@pytest.mark.parametrize("order", [1, 3])
def test_radii_in_boxes_are_little_larger_than_samples_say(n_dims: int, order: int) -> None:
    region = cube(n_dims)
    points, places = region.draw(40, 5), region.draw(4000, 2)
    apart = np.linalg.norm(places[:, None] - points, axis=2)
    nearest = np.argsort(apart, axis=1)[:, :order]
    sampled = np.zeros(40)
    np.maximum.at(sampled, nearest.ravel(), np.take_along_axis(apart, nearest, axis=1).ravel())
    assert np.median(support_radii(points, region, order, tighten=False).radii / sampled) < 1.25


def test_a_disk_is_covered_by_samples() -> None:
    disk = ImplicitRegion(lambda p: np.hypot(*p.T) - 1, [-1, -1], [1, 1])
    points, places = disk.draw(60, 1), disk.draw(4000, 2)
    supports = support_radii(points, disk, 2)
    assert not supports.proved
    assert ((np.linalg.norm(places[:, None] - points, axis=2) <= supports.radii).sum(axis=1) >= 2).all()
    assert "by samples" in repr(supports)


@pytest.mark.parametrize(
    ("region", "points", "cover"),
    [
        (~np.pad(np.ones((2, 3), bool), ((2, 2), (3, 3))), [[1.5, 1.5], [7.5, 1.5], [4.5, 5.0]], 1),
        (SQUARE, place_generators(SQUARE, 40, on_boundary="auto").points, 2),
        *((region, [[0.5, 0.5]], 1) for region in (SQUARE, np.ones((1, 1), bool), [[0, 0], [1, 0], [1, 1], [0, 1]])),
    ],
)
def test_masks_points_on_the_boundary_and_single_points_are_taken(region: Any, points: Any, cover: int) -> None:
    supports = support_radii(points, region, cover)
    assert supports.proved
    if len(points) == 1:
        assert supports.radii[0] == pytest.approx(0.5**0.5, rel=0.05)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0.5, 0.5], [2, 0.5]], SQUARE), r"points must lie in the region: number 1, \[2.0, 0.5\]"),
        (([[0.5, 0.5], [0.5, 0.5]], SQUARE), r"points must differ from each other: number 1"),
        (([[0.5, 0.5]], SQUARE, 2), r"cover=2 must be in 1\.\.1, the number of points"),
        (([[0.5, 0.5]], Box([0, 0], [1, 1], periodic=True)), "must be not periodic"),
        (([[0.5] * 3], SQUARE), r"points of shape \(1, 3\) must be \(N, 2\)"),
    ],
)
def test_wrong_arguments_are_named(arguments: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        support_radii(*arguments)


@pytest.mark.slow
def test_plots_show_disks(tmp_path: Path) -> None:
    supports = support_radii(SQUARE.draw(20, 1), SQUARE, 2)
    supports.plot(tmp_path / "s.png")
    with Image.open(tmp_path / "s.png") as image:
        assert len(image.convert("RGB").getcolors(1 << 24)) > 20
    with pytest.raises(OSError, match="exists"):
        supports.plot(tmp_path / "s.png")
    with pytest.raises(ValueError, match="suffix"):
        supports.plot(tmp_path / "s.txt")

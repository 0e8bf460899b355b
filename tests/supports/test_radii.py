from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from cvtimg import place_generators, support_radii
from cvtimg.placement import Box, ImplicitRegion, PolygonRegion, Region
from cvtimg.supports.plane import find_reaches
from cvtimg.supports.proof import find_gaps
from cvtimg.supports.sight import sight_in

SQUARE = Box([0, 0], [1, 1])
ELL = PolygonRegion([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]])
FRAME = PolygonRegion([[[0, 0], [4, 0], [4, 4], [0, 4]], [[1, 1], [3, 1], [3, 3], [1, 3]]])
SLIT = [[[0.5, 0.5], [1.0, 0.5]]]
WALLS: list[list[list[float]]] = []
#: Regions and what blocks sight in them.
CASES = [(SQUARE, None), (SQUARE, SLIT), (ELL, None), (ELL, WALLS), (FRAME, None), (FRAME, WALLS)]


def seen_by_segments(outline: Any, points: NDArray[Any], places: NDArray[Any]) -> NDArray[Any]:
    """(m, n) whether straight lines to places cross no barrier, by shapely."""
    import shapely

    barriers = shapely.union_all(shapely.linestrings(outline.barriers.reshape(-1, 2, 2)))
    shapely.prepare(barriers)
    ends = np.stack(np.broadcast_arrays(places[:, None], points), axis=2)
    return np.asarray(~shapely.crosses(barriers, shapely.linestrings(ends)))


def distances(region: Region, slits: Any, points: NDArray[Any], places: NDArray[Any]) -> NDArray[Any]:
    """(m, n) distances of places to the points that see them, else infinity."""
    apart = np.linalg.norm(places[:, None] - points, axis=2)
    if slits is None:
        return apart
    return np.where(seen_by_segments(sight_in(region, slits), points, places), apart, np.inf)


@cache
def scene(case: int, n_points: int, n_places: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return points in a region, and the distances to them of many places."""
    region, slits = CASES[case]
    points = region.draw(n_points, 5)
    return points, distances(region, slits, points, region.draw(n_places, 2))


@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("case", range(len(CASES)))
def test_reaches_are_the_greatest_distances_among_the_nearest_that_see_a_place(case: int, order: int) -> None:
    region, slits = CASES[case]
    points, apart = scene(case, 20, 3000)
    outline = sight_in(region, slits)
    assert outline is not None
    found = find_reaches(points, outline, order)
    nearest = np.argsort(apart, axis=1)[:, :order]
    sampled = np.zeros(len(points))
    np.maximum.at(sampled, nearest.ravel(), np.take_along_axis(apart, nearest, axis=1).ravel())
    assert (found >= sampled).all()
    # Samples come near to most corners of cells.
    assert np.median(found / sampled) < 1.2
    assert not len(find_gaps(points, found * (1 + 1e-6), outline, order).places)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("case", range(len(CASES)))
def test_a_proved_cover_holds_at_each_of_many_places(case: int, order: int) -> None:
    region, slits = CASES[case]
    points, apart = scene(case, 40, 4000)
    supports = support_radii(points, region, order, visible=slits)
    assert supports.proved
    assert ((apart <= supports.radii).sum(axis=1) >= order).all()
    loose = support_radii(points, region, order, visible=slits, tighten=False)
    assert supports.overlap.nnz <= loose.overlap.nnz


@pytest.mark.parametrize("region", [SQUARE, ELL, FRAME])
def test_covers_by_three_get_tighter(region: Region) -> None:
    points = region.draw(60, 5)
    tight, loose = (support_radii(points, region, 3, tighten=tighten).overlap.nnz for tighten in (True, False))
    assert tight < loose


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("case", [0, *(pytest.param(case, marks=pytest.mark.slow) for case in range(1, len(CASES)))])
def test_the_proof_finds_a_gap_where_samples_do_and_no_others(case: int, order: int) -> None:
    region, slits = CASES[case]
    points, apart = scene(case, 40, 4000)
    outline = sight_in(region, slits)
    assert outline is not None
    radii = find_reaches(points, outline, order) * (1 + 1e-6)
    n_with_gaps = 0
    for seed in range(8):
        smaller = radii * np.where(np.random.default_rng(seed).random(40) < 0.1, 0.85, 1)
        sampled = ((apart <= smaller).sum(axis=1) < order).any()
        gaps = find_gaps(points, smaller, outline, order)
        if sampled:
            assert len(gaps.places)
        n_with_gaps += bool(sampled)
        held = distances(region, slits, points, gaps.places) < smaller * (1 - 1e-6)
        assert (held.sum(axis=1) < order).all()
    assert n_with_gaps


def test_disks_without_a_crossing_are_not_taken_for_a_cover() -> None:
    outline = sight_in(SQUARE, None)
    assert outline is not None
    assert len(find_gaps(np.array([[0.5, 0.5]]), np.array([0.2]), outline, 1).places)
    assert not len(find_gaps(np.array([[0.5, 0.5]]), np.array([0.8]), outline, 1).places)


@pytest.mark.slow
def test_tessellations_have_fewer_pairs_than_random_points_and_three_fold_covers_shrink() -> None:
    even = place_generators(SQUARE, 128).points
    single = support_radii(even, SQUARE)
    triple = support_radii(even, SQUARE, 3)
    assert single.overlap.nnz <= 0.05 * 128**2
    assert triple.overlap.nnz <= 0.12 * 128**2
    assert single.overlap.nnz < support_radii(SQUARE.draw(128), SQUARE).overlap.nnz


def test_the_overlap_is_that_of_the_radii() -> None:
    points = SQUARE.draw(50, 1)
    supports = support_radii(points, SQUARE, 2)
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    assert (supports.overlap.toarray() == (apart < supports.radii + supports.radii[:, None])).all()


def test_supports_on_both_sides_of_a_slit_do_not_meet() -> None:
    points = SQUARE.draw(100, 1)
    blocked = support_radii(points, SQUARE, visible=SLIT)
    plain = support_radii(points, SQUARE)
    above, below = (np.flatnonzero((points[:, 0] > 0.8) & side) for side in (points[:, 1] > 0.5, points[:, 1] < 0.5))
    assert plain.overlap[above][:, below].nnz
    assert not blocked.overlap[above][:, below].nnz
    places = np.array([[0.9, 0.501], [0.9, 0.499]])
    over, under = (set(row.indices) for row in blocked.distances(places))
    assert over
    assert under
    assert not over & under


def test_distances_are_shares_of_the_radii_where_supports_hold_a_place() -> None:
    points, places = SQUARE.draw(30, 1), SQUARE.draw(100, 2)
    supports = support_radii(points, SQUARE, 2)
    shares = np.linalg.norm(places[:, None] - points, axis=2) / supports.radii
    found = supports.distances(places)
    assert (np.diff(found.indptr) >= 2).all()
    assert found.toarray() == pytest.approx(np.where(shares < 1, shares, 0))


@pytest.mark.parametrize("n_dims", [1, 3, pytest.param(5, marks=pytest.mark.slow)])
def test_boxes_prove_covers_in_any_number_of_dimensions(n_dims: int) -> None:
    region = Box([0] * n_dims, [1] * n_dims)
    points, places = region.draw(40, 5), region.draw(4000, 2)
    for order in (1, 3):
        supports = support_radii(points, region, order)
        assert supports.proved
        apart = np.linalg.norm(places[:, None] - points, axis=2)
        assert ((apart <= supports.radii).sum(axis=1) >= order).all()
        loose = support_radii(points, region, order, tighten=False)
        assert supports.overlap.nnz <= loose.overlap.nnz


# In more dimensions, so few samples come near to too few corners of cells.
@pytest.mark.parametrize("n_dims", [1, 3])
@pytest.mark.parametrize("order", [1, 3])
def test_radii_in_boxes_are_little_larger_than_samples_say(n_dims: int, order: int) -> None:
    region = Box([0] * n_dims, [1] * n_dims)
    points, places = region.draw(40, 5), region.draw(4000, 2)
    apart = np.linalg.norm(places[:, None] - points, axis=2)
    nearest = np.argsort(apart, axis=1)[:, :order]
    sampled = np.zeros(40)
    np.maximum.at(sampled, nearest.ravel(), np.take_along_axis(apart, nearest, axis=1).ravel())
    assert np.median(support_radii(points, region, order, tighten=False).radii / sampled) < 1.15


def test_a_disk_and_a_function_are_covered_by_samples() -> None:
    disk = ImplicitRegion(lambda p: np.hypot(*p.T) - 1, [-1, -1], [1, 1])
    points, places = disk.draw(60, 1), disk.draw(4000, 2)
    supports = support_radii(points, disk, 2)
    assert not supports.proved
    assert ((np.linalg.norm(places[:, None] - points, axis=2) <= supports.radii).sum(axis=1) >= 2).all()

    def same_side(one: NDArray[Any], other: NDArray[Any]) -> NDArray[Any]:
        return (one[:, 0] > 0) == (other[:, 0] > 0)

    halves = support_radii(points, disk, visible=same_side)
    assert "by samples" in repr(halves)
    sides = points[:, 0] > 0
    apart = np.linalg.norm(places[:, None] - points, axis=2)
    seen = (places[:, :1] > 0) == sides
    assert ((apart <= halves.radii) & seen).any(axis=1).mean() > 0.99


def test_masks_are_polygons() -> None:
    mask = np.ones((6, 9), bool)
    mask[2:4, 3:6] = False
    supports = support_radii([[1.5, 1.5], [7.5, 1.5], [4.5, 5.0]], mask)
    assert supports.proved


def test_points_on_the_boundary_are_taken() -> None:
    placed = place_generators(SQUARE, 40, on_boundary=12).points
    assert support_radii(placed, SQUARE, 2).proved
    assert support_radii(placed, SQUARE, 2, visible=SLIT).proved


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


def test_slits_that_are_none_and_rooms_that_no_point_sees_are_named() -> None:
    with pytest.raises(ValueError, match=r"visible of shape \(2, 2\) must be \(S, 2, 2\)"):
        support_radii([[0.5, 0.5]], SQUARE, visible=[[0, 0], [1, 1]])
    with pytest.raises(ValueError, match="visible must be a function"):
        support_radii([[0.5] * 3], Box([0] * 3, [1] * 3), visible=[[[0, 0], [1, 1]]])
    with pytest.raises(ValueError, match="is seen by fewer"):
        support_radii([[0.2, 0.5], [0.3, 0.5]], SQUARE, visible=[[[0.5, 0], [0.5, 1]]])


@pytest.mark.slow
def test_plots_show_disks_and_slits(tmp_path: Path) -> None:
    supports = support_radii(SQUARE.draw(20, 1), SQUARE, 2, visible=SLIT)
    supports.plot(tmp_path / "s.png")
    with Image.open(tmp_path / "s.png") as image:
        assert len(image.convert("RGB").getcolors(1 << 24)) > 20
    with pytest.raises(OSError, match="exists"):
        supports.plot(tmp_path / "s.png")
    with pytest.raises(ValueError, match="suffix"):
        supports.plot(tmp_path / "s.txt")


@pytest.mark.parametrize("region", [Box([0, 0], [1, 1]), np.ones((1, 1), bool), [[0, 0], [1, 0], [1, 1], [0, 1]]])
def test_one_point_covers_all_of_a_region_of_the_plane(region: object) -> None:
    supports = support_radii([[0.5, 0.5]], region)
    assert supports.proved
    assert supports.radii[0] == pytest.approx(0.5**0.5, rel=1e-5)

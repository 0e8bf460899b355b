"""Claims about borders as lines and polygons."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from reference import covered, shape_of, signed_area
from scipy import ndimage
from scipy.spatial import cKDTree
from skimage import measure

from cvtimg import find_contours, find_edges, write_contours
from cvtimg._shared.types import Array, Bools, Floats
from cvtimg.labels import Contours
from cvtimg.labels.contours import CLEARANCE, EDGE_MODES

LABELS = arrays(np.int32, st.tuples(st.integers(1, 8), st.integers(1, 8)), elements=st.integers(0, 3))
RNG = np.random.default_rng(5)


def smooth_fields(n_fields: int, side: int, sigma: float) -> Floats:
    noise = np.random.default_rng(n_fields).normal(size=(side, side, n_fields))
    return ndimage.gaussian_filter(noise, (sigma, sigma, 0))


def pieces(labels: Array) -> list[tuple[int, Bools]]:
    """List the connected pieces of every label but 0: pixels that share a side."""
    numbers = measure.label(labels, background=0, connectivity=1)
    return [(int(labels[numbers == n][0]), numbers == n) for n in range(1, numbers.max() + 1)]


def assert_rings_are_simple(contours: Contours) -> None:
    for polygon in contours.polygons:
        assert [np.sign(signed_area(ring)) for ring in polygon.rings] == [1] + [-1] * (len(polygon.rings) - 1)
        assert shapely.is_valid(shape_of(polygon)), "a ring that crosses itself or leaves its outer ring"


def assert_neighbors_share_their_borders(contours: Contours) -> None:
    """Check that polygons overlap nowhere and have the same points where they meet."""
    assert shapely.coverage_is_valid([shape_of(polygon) for polygon in contours.polygons])


@given(LABELS)
@settings(max_examples=100)
def test_a_polygon_covers_the_pixels_of_one_piece_and_shares_its_border_with_neighbors(labels: Array) -> None:
    contours = find_contours(labels)
    assert_rings_are_simple(contours)
    assert_neighbors_share_their_borders(contours)
    wanted = sorted((label, piece.tobytes()) for label, piece in pieces(labels))
    found = [(polygon.label, covered(polygon, labels.shape)) for polygon in contours.polygons]
    assert sorted((label, piece.tobytes()) for label, piece in found) == wanted
    for polygon, (_, piece) in zip(contours.polygons, found, strict=True):
        assert polygon.area == piece.sum()


def test_each_border_is_one_line_with_its_labels_to_the_right_and_left() -> None:
    labels = np.array([[1, 1, 2], [1, 1, 2], [3, 3, 3]])
    contours = find_contours(labels)
    lengths = [np.abs(np.diff(line, axis=0)).sum() for line in contours.lines]
    borders = {
        tuple(sorted(pair)): length
        for pair, length in zip(contours.sides.tolist(), lengths, strict=True)
        if -1 not in pair
    }
    assert borders == {(1, 2): 2, (1, 3): 2, (2, 3): 1}
    for line, (right, left) in zip(contours.lines, contours.sides.tolist(), strict=True):
        (x, y), (dx, dy) = (line[0] + line[1]) / 2, np.sign(line[1] - line[0])
        for label, side in ((right, 0.25), (left, -0.25)):
            row, column = int(np.floor(y + side * dx)), int(np.floor(x - side * dy))
            inside = 0 <= row < 3 and 0 <= column < 3
            assert label == (labels[row, column] if inside else -1)


def middles(lines: Iterable[Floats]) -> Floats:
    """Give the middle of every step of lines."""
    return np.concatenate([(line[:-1] + line[1:]) / 2 for line in lines])


def test_borders_between_centers_are_the_level_lines_of_scikit_image() -> None:
    field = smooth_fields(1, 60, 3.0)[:, :, 0]
    level = 0.0
    for _ in range(20):  # until the segments are the cells of their own means
        level = (field[field < level].mean() + field[field > level].mean()) / 2
    expected = middles(line[:, ::-1] + 0.5 for line in measure.find_contours(field, level))
    contours = find_contours(1 + (field > level), field)
    inner = contours.sides.min(axis=1) > 0
    found = middles(line for line, is_inner in zip(contours.lines, inner, strict=True) if is_inner)
    assert len(expected) > 200
    assert cKDTree(found).query(expected)[0].max() < CLEARANCE
    # Those of scikit-image end at the centers of the outermost pixels.
    within = ((found > 0.5) & (found < 59.5)).all(axis=1)
    assert cKDTree(expected).query(found[within])[0].max() < CLEARANCE


def test_a_soft_disc_is_outlined_far_better_than_by_pixels() -> None:
    row, column = np.mgrid[:64, :64] + 0.5
    distance = np.hypot(row - 32.3, column - 31.6)
    image = np.clip(20.25 - distance + 0.5, 0, 1)
    labels = 1 + (image > 0.5)
    (disc,) = (polygon for polygon in find_contours(labels, image).polygons if polygon.label == 2)
    radii = np.hypot(*(disc.rings[0] - (31.6, 32.3)).T)
    assert abs(radii - 20.25).max() < 0.1
    (steps,) = (polygon for polygon in find_contours(labels).polygons if polygon.label == 2)
    assert abs(np.hypot(*(steps.rings[0] - (31.6, 32.3)).T) - 20.25).max() > 0.5


@given(LABELS, st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_borders_between_centers_fill_the_picture_and_keep_every_region(labels: Array, seed: int) -> None:
    image = np.random.default_rng(seed).normal(size=(*labels.shape, 2))
    contours = find_contours(labels, image)
    assert_rings_are_simple(contours)
    wanted = sorted((label, piece.tobytes()) for label, piece in pieces(labels))
    found = [(polygon.label, covered(polygon, labels.shape).tobytes()) for polygon in contours.polygons]
    assert sorted(found) == wanted  # a border passes between the centers of pixels
    if labels.min() > 0:
        assert sum(polygon.area for polygon in contours.polygons) == pytest.approx(labels.size)


def test_masked_pixels_may_be_nan() -> None:
    labels = np.array([[0, 1, 1, 2], [0, 1, 1, 2]])
    image = np.where(labels == 0, np.nan, labels)
    polygons = find_contours(labels, image).polygons
    assert [polygon.area for polygon in polygons] == pytest.approx([2 * 2, 2])
    with pytest.raises(ValueError, match="finite"):
        find_contours(labels + 1, image)


def test_simplified_neighbours_still_share_their_border_and_stay_near_it() -> None:
    labels = smooth_fields(4, 150, 4.0).argmax(axis=2) + 1
    exact, simple = find_contours(labels), find_contours(labels, tolerance=1.5)
    assert sum(map(len, simple.lines)) < 0.5 * sum(map(len, exact.lines))
    assert len(simple.polygons) == len(exact.polygons)
    assert sum(polygon.area for polygon in simple.polygons) == pytest.approx(labels.size)
    assert_rings_are_simple(simple)
    for line, whole in zip(simple.lines, exact.lines, strict=True):
        assert {*map(tuple, line.tolist())} <= {*map(tuple, whole.tolist())}
        for place in whole:
            start, step = line[:-1], np.diff(line, axis=0)
            along = np.clip(((place - start) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-9), 0, 1)
            assert np.hypot(*(start + along[:, None] * step - place).T).min() <= 1.5 + 1e-9


@pytest.mark.parametrize(
    "tolerance", [0.7, pytest.param(1.5, marks=pytest.mark.slow), 5, pytest.param(100, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("between_centers", [False, True])
def test_simplified_borders_cross_no_other_nothing_comes_to_lie_beyond_them_and_no_region_vanishes(
    tolerance: float, between_centers: bool
) -> None:
    fields = smooth_fields(3, 50, 1.2)
    labels = fields.argmax(axis=2) + 1
    exact, contours = (find_contours(labels, fields if between_centers else None, tolerance=t) for t in (0, tolerance))
    assert [polygon.label for polygon in contours.polygons] == [polygon.label for polygon in exact.polygons]
    assert_neighbors_share_their_borders(contours)
    assert_rings_are_simple(contours)
    assert sum(polygon.area for polygon in contours.polygons) == pytest.approx(labels.size)


def test_nothing_to_outline() -> None:
    assert find_contours(np.zeros((3, 4), int)).polygons == ()
    (all_of_it,) = find_contours(np.ones((3, 4), int), np.zeros((3, 4))).polygons
    assert all_of_it.rings[0].tolist() == [[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]]


def test_results_are_read_only_and_inputs_unchanged() -> None:
    labels = RNG.integers(0, 3, (6, 6))
    copy = labels.copy()
    contours = find_contours(labels)
    np.testing.assert_array_equal(labels, copy)
    for array in (contours.sides, contours.lines[0], contours.polygons[0].rings[0]):
        assert not array.flags.writeable


def test_contours_and_polygons_are_shown_in_a_line() -> None:
    contours = find_contours([[1, 1, 1], [1, 2, 1], [1, 1, 1]])
    assert repr(contours) == "Contours(2 polygons, 5 lines of 13 points)"
    assert repr(contours.polygons[0]) == "Polygon(label=1, rings=2, 10 points, area=8)"


def by_hand(labels: Array, mode: str, ignore: int | None) -> Bools:
    """Look at every pixel and each of its neighbours."""
    edges = np.zeros(labels.shape, bool)
    for (row, column), label in np.ndenumerate(labels):
        for (i, j), other in np.ndenumerate(labels):
            if abs(row - i) + abs(column - j) == 1 and ignore not in (label, other):
                wanted = {"inner": label > other, "outer": label < other, "thick": label != other}
                edges[row, column] |= wanted[mode]
    return edges


@given(LABELS, st.sampled_from(list(EDGE_MODES)), st.sampled_from([None, 0, 2]))
@settings(max_examples=60)
def test_an_edge_point_has_a_neighbour_in_another_segment(labels: Array, mode: str, ignore: int | None) -> None:
    found = find_edges(labels, mode=mode, ignore=ignore)
    assert found.dtype == np.bool_
    np.testing.assert_array_equal(found, by_hand(labels, mode, ignore))


def test_labels_and_options_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match=r"mode='wide' must be one of inner, outer, thick"):
        find_edges([[1, 2]], mode="wide")
    with pytest.raises(ValueError, match=r"labels of shape \(2,\)"):
        find_edges([1, 2])
    with pytest.raises(ValueError, match=r"labels in -1\.\.2 must be in 0\.\."):
        find_edges([[-1, 2]])
    with pytest.raises(TypeError, match="labels of type float64 must be integers"):
        find_edges([[0.5, 2]])


def test_labels_are_no_drawing(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"drawing of type ndarray must be a Drawing, such as"):
        write_contours(tmp_path / "a.svg", np.eye(4, dtype=int))  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())

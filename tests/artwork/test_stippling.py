import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree
from skimage import data

from cvtimg import place_generators, stipple
from cvtimg.artwork import Stipples, find_tour, ink_coverage
from cvtimg.artwork.dot_layers import DOTS
from cvtimg.artwork.stipples import draw_dots
from cvtimg.artwork.stippling import _Count
from cvtimg.artwork.tones import process_coverages
from cvtimg.colors.spaces import to_space

PHOTO = data.camera()[::2, ::2]
STRIPES = np.tile(np.where(np.arange(160) % 40 < 10, 225, 60).astype(np.uint8), (160, 1))
RAMP = np.tile(np.linspace(0, 255, 160).astype(np.uint8), (120, 1))


def tone_error(result: Stipples, coverage: np.ndarray, fine: int = 5) -> float:
    """Root mean square over the image of the difference in light, blurred at the distance of dots."""
    height, width = coverage.shape
    drawn = result.coverage(0, fine).reshape(height, fine, width, fine).mean(axis=(1, 3))
    blur = np.sqrt(coverage.size / len(result))
    return float(np.sqrt(((gaussian_filter(drawn, blur) - gaussian_filter(coverage, blur)) ** 2).mean()))


@pytest.mark.parametrize("dots", DOTS)
def test_the_ink_of_dots_adds_up_to_the_tones(dots: str) -> None:
    result = stipple(PHOTO, 3000, dots=dots, max_ink=0.6, tones="true")
    coverage = 0.6 * ink_coverage(PHOTO)
    assert len(result) == 3000
    assert np.pi * (result.radii**2).sum() == pytest.approx(coverage.sum(), rel=2e-3)
    assert result.masses.sum() == pytest.approx(coverage.sum(), rel=1e-5)
    assert tone_error(result, coverage) < {"equal": 0.04, "sized": 0.01}[dots]


def test_light_stripes_beside_dark_ones_keep_their_tone() -> None:
    coverage = np.float32(0.6) * ink_coverage(STRIPES)
    light = coverage[0] < 0.3
    result = stipple(STRIPES, 1000, max_ink=0.6, tones="true")

    def lightness(points: np.ndarray) -> float:
        drawn = draw_dots(points, result.radii, STRIPES.shape, 5).reshape(160, 5, 160, 5).mean(axis=(1, 3))
        difference = gaussian_filter(drawn, 5) - gaussian_filter(coverage, 5)
        return abs(float(difference[:, light].mean()))

    # A plain tessellation of the squared ink leaves the light stripes too light.
    assert lightness(result.points) < 0.25 * lightness(place_generators(None, 1000, density=coverage**2).points)


def test_sizes_stay_in_their_range_and_large_dots_are_dark() -> None:
    result = stipple(RAMP, 400, dots="sized", radius_range=(1.0, 5.0))
    assert result.radii.min() >= 1
    assert result.radii.max() <= 5
    assert np.pi * (result.radii**2).sum() == pytest.approx(result.masses.sum(), rel=0.05)
    assert result.radii[result.points[:, 0] < 40].mean() > 2 * result.radii[result.points[:, 0] > 110].mean()


def test_no_dot_lies_in_white() -> None:
    y, x = np.mgrid[:90, :90]
    rings = np.where(np.abs(np.hypot(x - 45, y - 45) % 20 - 10) < 1, 0, 255).astype(np.uint8)
    for n_dots in (1, 3, 200):
        places = stipple(rings, n_dots).points.astype(int)
        assert not rings[places[:, 1], places[:, 0]].any()


def test_an_image_without_ink_has_no_dots() -> None:
    result = stipple(np.full((5, 6), 255, np.uint8), 10)
    assert len(result) == 0
    assert len(result.order) == 0
    assert result.draw().min() == 255


def test_light_on_dark_paper_is_the_negative() -> None:
    light = stipple(255 - RAMP, 300, invert=True)
    assert light.paper.tolist() == [0, 0, 0]
    assert light.colors.tolist() == [[255, 255, 255]]
    assert light.points[:, 0].mean() < 80


def test_pens_have_the_ink_of_their_colors_where_it_is() -> None:
    image = np.full((60, 120, 3), 255, np.uint8)
    image[:, :60] = (255, 0, 255)
    image[:, 60:] = (0, 0, 0)
    result = stipple(image, 600, layers="cmyk")
    by_pen = [result.points[result.layers == pen] for pen in range(4)]
    assert [len(points) > 0 for points in by_pen] == [False, True, False, True]
    assert by_pen[1][:, 0].max() < 60 < by_pen[3][:, 0].min()


@pytest.mark.parametrize("dots", DOTS)
def test_dots_of_process_colors_keep_apart_and_keep_their_tones(dots: str) -> None:
    blue = np.full((90, 140, 3), 255, np.uint8)
    blue[:, :, 0] = blue[:, :, 1] = np.linspace(60, 220, 140).astype(np.uint8)  # cyan and magenta alike
    result = stipple(blue, 1500, layers="cmyk", dots=dots, max_ink=0.5, tones="true")
    inks = process_coverages(blue, 0.0, 0.5)
    cyan, magenta = (result.points[result.layers == pen] for pen in (0, 1))

    tree = cKDTree(cyan)
    between, within = (np.quantile(gaps, 0.1) for gaps in (tree.query(magenta)[0], tree.query(cyan, 2)[0][:, 1]))
    assert 0.38 < between / within < 0.5  # farther apart, dots of a pen are less even
    for pen, points in enumerate((cyan, magenta)):
        wanted, found = inks[pen].sum(axis=0), np.histogram(points[:, 0], 140, (0, 140))[0]
        off = np.cumsum(found) / len(points) - np.cumsum(wanted) / wanted.sum()
        assert np.abs(off).max() < 0.02


@pytest.mark.slow
def test_a_drawing_in_process_colors_has_the_light_of_the_image() -> None:
    brown = np.tile(np.linspace((90, 50, 20), (230, 190, 150), 150).astype(np.uint8), (80, 1, 1))
    drawn = stipple(brown, 4000, layers="cmyk", max_ink=0.6, tones="true").draw(scale=5)
    light, wanted = (to_space(pixels.reshape(-1, 3), "linear").mean(axis=0) for pixels in (drawn, brown))
    assert light == pytest.approx(1 - 0.6 * (1 - wanted), abs=0.015)


def test_a_light_drawing_keeps_the_order_of_tones_and_covers_a_third_at_most() -> None:
    light = ink_coverage(PHOTO, tones="light")
    true = ink_coverage(PHOTO)
    assert light.mean() < 0.4 < true.mean()
    order = np.argsort(true, axis=None)
    assert (np.diff(light.ravel()[order]) <= 1e-5).all() or (np.diff(light.ravel()[order]) >= -1e-5).all()
    assert light.max() == 1
    assert (light == 0).mean() == pytest.approx(0.02, abs=0.02)


@pytest.mark.parametrize(("side", "n_dots"), [(40, 400), (400, 20_000)])
def test_by_default_dots_are_enough_for_faces_or_a_quarter_of_the_pixels(side: int, n_dots: int) -> None:
    assert _Count(None, None, 1).of(np.ones((side, side), np.float32)) == n_dots


@pytest.mark.parametrize(("other", "is_kept"), [(180, True), (185, True), (200, False)])
def test_images_of_about_one_tone_keep_it(other: int, is_kept: bool) -> None:
    gray = np.full((8, 9), 180, np.uint8)
    gray[4:] = other
    assert (ink_coverage(gray, tones="light") == ink_coverage(gray)).all() == is_kept


@pytest.mark.slow
def test_dots_are_as_wide_as_the_pen_and_as_many_as_the_ink_takes() -> None:
    result = stipple(RAMP, dot_diameter=2.5)
    np.testing.assert_allclose(2 * result.radii, 2.5, rtol=2e-3)
    finer = stipple(RAMP[:40], dot_diameter=0.5)  # finer than pixels
    np.testing.assert_allclose(2 * finer.radii, 0.5, rtol=2e-3)
    assert finer.ink == pytest.approx(result.ink, rel=0.02)
    assert finer.points.max(axis=0) == pytest.approx([155, 40], abs=5)
    pens = stipple(RAMP, dot_diameter=2.5, layers="cmyk")
    np.testing.assert_allclose(2 * pens.radii[pens.layers == 3], 2.5, rtol=5e-2)


@pytest.mark.slow
@given(st.integers(1, 60), st.integers(0, 5), st.integers(1, 1000))
def test_a_tour_visits_each_point_once_wherever_they_are(n_points: int, seed: int, n_places: int) -> None:
    points = np.random.default_rng(seed).integers(0, n_places, (n_points, 2)).astype(np.float64)
    assert sorted(find_tour(points)) == list(range(n_points))


def test_a_tour_of_many_points_is_within_a_tenth_of_the_shortest() -> None:
    n_points = 5000
    points = np.random.default_rng(0).random((n_points, 2))
    # The shortest tour is near 0.7124 sqrt(N A) (1 + 0.33 / N), D. S. Johnson and L. A. McGeoch 1996.
    length = np.linalg.norm(np.diff(points[find_tour(points)], axis=0), axis=1).sum()
    assert length < 1.1 * 0.7124 * np.sqrt(n_points)


def test_a_tour_does_not_cross_itself() -> None:
    points = np.random.default_rng(4).random((1500, 2)) ** [1, 3]
    points[:40] *= 20  # long steps
    path = points[find_tour(points)]
    steps = np.diff(path, axis=0)
    away = path[np.newaxis] - path[:-1, np.newaxis]
    side = np.sign(steps[:, :1] * away[..., 1] - steps[:, 1:] * away[..., 0])  # of each point to each step
    apart = side[:, :-1] * side[:, 1:] < 0
    assert not (apart & apart.T).any()


def test_the_tour_is_the_same_in_any_unit_and_starts_at_the_corner() -> None:
    points = np.random.default_rng(1).random((300, 2))
    order = find_tour(points)
    assert np.array_equal(order, find_tour(1024 * points))
    assert np.hypot(*points[order[0]]) <= np.hypot(*points[order[-1]])

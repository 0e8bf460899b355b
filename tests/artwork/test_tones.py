import numpy as np
import pytest
from PIL import Image

from cvtimg.artwork.stipples import draw_dots
from cvtimg.artwork.tones import disk_area, ink_coverage, pen_coverages
from cvtimg.colors.spaces import from_space, to_space

GRAYS = np.array([[0, 60, 128, 188, 255]], np.uint8)


def test_gray_and_color_and_pillow_agree() -> None:
    expected = ink_coverage(GRAYS)
    in_color = ink_coverage(np.dstack([GRAYS] * 3))
    assert np.allclose(in_color, expected, atol=1e-6)
    assert in_color[0, -1] == 0  # white has no ink at all
    assert np.array_equal(ink_coverage(Image.fromarray(GRAYS)), expected)
    assert np.array_equal(ink_coverage(GRAYS > 100), [[1, 1, 0, 0, 0]])


def test_what_is_transparent_or_masked_is_paper() -> None:
    alpha = np.array([[255, 128, 0, 255, 0]], np.uint8)
    expected = ink_coverage(GRAYS) * alpha / 255
    assert np.allclose(ink_coverage(np.dstack([GRAYS, alpha])), expected, atol=1e-6)
    assert np.allclose(ink_coverage(np.dstack([GRAYS] * 3 + [alpha])), expected, atol=1e-6)
    masked = np.ma.masked_array(GRAYS, alpha == 0)
    assert np.array_equal(ink_coverage(masked), np.where(alpha == 0, 0, ink_coverage(GRAYS)))


def test_inverted_ink_is_the_light_and_the_cutoff_clears_light_tones_alone() -> None:
    assert np.allclose(ink_coverage(GRAYS, invert=True), 1 - ink_coverage(GRAYS), atol=1e-6)
    plain, cut = ink_coverage(GRAYS), ink_coverage(GRAYS, white_cutoff=0.6)
    assert np.array_equal(cut, np.where(plain <= 0.6, 0, plain))


def test_a_light_drawing_of_all_shades_has_ink_on_about_a_third_of_the_paper() -> None:
    ramp = np.tile(np.arange(256, dtype=np.uint8), (4, 1))
    assert ink_coverage(ramp, tones="light").mean() == pytest.approx(0.38, abs=0.03)


@pytest.mark.parametrize("coverage", [0.3, 0.9, 0.95, 0.99])
def test_a_lattice_of_disks_of_this_area_covers_the_share(coverage: float) -> None:
    spacing = 20.0
    rows = np.arange(-2, 30) * spacing * np.sqrt(0.75)
    x = np.arange(-2, 25) * spacing
    points = np.concatenate([np.stack([x + spacing / 2 * (i % 2), np.full_like(x, y)], 1) for i, y in enumerate(rows)])
    area = disk_area(np.array([coverage], np.float32))[0]
    radius = np.sqrt(area * spacing**2 * np.sqrt(0.75) / np.pi)
    drawn = draw_dots(points, np.full(len(points), radius), (round(20 * spacing * np.sqrt(0.75)), 400))
    assert drawn.mean() == pytest.approx(coverage, abs=0.003)


def test_mixtures_of_pens_have_the_light_of_the_image_where_they_can() -> None:
    pens = np.uint8([[0, 0, 0], [228, 0, 43], [0, 87, 184]])
    inks, rng = to_space(pens, "linear"), np.random.default_rng(0)
    shares = rng.dirichlet(np.ones(4), 60)[:, 1:]  # with paper for the rest
    light = 1 - shares.sum(axis=1, keepdims=True) + shares @ inks
    image = from_space(light, "linear", np.dtype(np.float64))[np.newaxis]
    found = np.stack(pen_coverages(image, pens, 0.0, 1.0), axis=-1)[0]
    np.testing.assert_allclose(1 - found.sum(axis=1, keepdims=True) + found @ inks, light, atol=0.02)
    gray = np.stack(pen_coverages(np.full((1, 1), 0.5), pens, 0.0, 1.0), axis=-1)[0, 0]
    assert gray[0] > 0.7
    assert gray[1:].max() < 0.02
    beyond = pen_coverages(np.float64([[[0, 1, 0]]]), pens, 0.0, 1.0)  # no mixture is green
    assert 0 < sum(float(ink[0, 0]) for ink in beyond) <= 1


def test_disks_cover_their_union() -> None:
    rng = np.random.default_rng(0)
    points, radii = rng.random((30, 2)) * [24, 16], rng.random(30) * 3
    lines, fine = 8, 400  # of a pixel, down and across
    x, y = (np.arange(24 * fine) + 0.5) / fine, (np.arange(16 * lines) + 0.5) / lines
    inside = np.zeros((len(y), len(x)), bool)
    for (center, middle), radius in zip(points, radii, strict=True):
        inside |= (x - center) ** 2 + (y[:, np.newaxis] - middle) ** 2 < radius**2
    expected = inside.reshape(16, lines, 24, fine).mean(axis=(1, 3))
    np.testing.assert_allclose(draw_dots(points, radii, (16, 24)), expected, atol=0.005)


def test_the_scale_enlarges_dots_and_paper() -> None:
    drawn = draw_dots(np.array([[5.0, 4.0]]), np.array([2.0]), (8, 10), 5.0)
    assert drawn.shape == (40, 50)
    assert drawn.sum() == pytest.approx(np.pi * 100, rel=2e-3)

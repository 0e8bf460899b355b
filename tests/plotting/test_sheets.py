"""Claims about palette strips and contact sheets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from cvtimg.plotting.sheets import STYLE, Panel, contact_sheet, draw_edges, palette_strip, shown_colors

Bytes = NDArray[np.uint8]


def distinct_colors(n_colors: int) -> Bytes:
    """(n_colors, 3) colors, none twice."""
    numbers = np.arange(n_colors) * 977 + 5
    return np.stack([numbers >> shift & 255 for shift in (0, 8, 16)], axis=1).astype(np.uint8)


def noise(height: int, width: int, *channels: int) -> Bytes:
    image = np.random.default_rng(1).integers(0, 256, (height, width, *channels), dtype=np.uint8)
    image.flags.writeable = False  # no drawing changes what it shows
    return image


def single(image: Any, width: int, **options: Any) -> Bytes:
    """Draw a sheet of one panel, without its margins."""
    sheet = contact_sheet([[Panel(image, **options)]], panel_width=width)
    return sheet[STYLE.margin : -STYLE.margin, STYLE.margin : -STYLE.margin]


def mat_around(sheet: Bytes, picture: Bytes) -> Bytes:
    """Check that a picture stands in the middle of its mat, and return what is below the mat."""
    height, width = picture.shape[:2]
    left = (sheet.shape[1] - width) // 2
    np.testing.assert_array_equal(sheet[:height, left : left + width], picture)
    assert (sheet[:height, :left] == STYLE.mat).all()
    assert (sheet[:height, left + width :] == STYLE.mat).all()
    return sheet[height:]


@given(st.integers(1, 300), st.integers(1, 90), st.integers(1, 40))
def test_a_strip_has_every_color_in_order_and_no_other(n_colors: int, width: int, height: int) -> None:
    colors = distinct_colors(min(n_colors, width * height))
    strip = palette_strip(colors, width=width, height=height)
    assert strip.shape == (height, width, 3)
    assert strip.dtype == np.uint8
    seen = dict.fromkeys(map(tuple, strip.transpose(1, 0, 2).reshape(-1, 3).tolist()))
    assert list(seen) == list(map(tuple, colors.tolist()))


@pytest.mark.parametrize("n_colors", [4, 16, 64, 256])
def test_fields_of_a_strip_are_about_equal_and_wide_enough_to_see(n_colors: int) -> None:
    strip = palette_strip(distinct_colors(n_colors))
    _, areas = np.unique(strip.reshape(-1, 3), axis=0, return_counts=True)
    assert areas.min() >= 24
    assert areas.max() <= 1.3 * areas.min()


def test_deep_and_grey_palettes_are_shown_as_grey_from_black_to_white() -> None:
    for dtype in (np.uint16, np.float32, np.float64):
        strip = palette_strip(np.array([[100], [300], [500]], dtype), width=3, height=1)
        assert strip.tolist() == [[[0] * 3, [128] * 3, [255] * 3]]
    assert palette_strip(np.array([[7]], np.uint8), width=1, height=1).tolist() == [[[7, 7, 7]]]


def test_a_clear_color_shows_the_checkerboard() -> None:
    colors = np.array([[255, 0, 0, 0], [255, 0, 0, 255]], np.uint8)
    strip = palette_strip(colors, width=64, height=16)
    assert set(np.unique(strip[:, :32])) == set(STYLE.checkers)
    assert (strip[:, 32:] == (255, 0, 0)).all()


@pytest.mark.parametrize("image", [noise(30, 60, 3), noise(40, 50, 3), noise(70, 40, 3)])
def test_pixels_of_a_picture_that_fits_are_unaltered(image: Bytes) -> None:
    rest = mat_around(single(image, 60), image)
    assert (rest == STYLE.background).all()


def test_small_pictures_are_enlarged_by_whole_factors() -> None:
    image = noise(5, 7, 3)
    mat_around(single(image, 34), image.repeat(4, axis=0).repeat(4, axis=1))
    dot = noise(1, 1, 3)
    mat_around(single(dot, 40), np.tile(dot, (40, 40, 1)))


@pytest.mark.parametrize(
    ("shape", "height"), [((200, 300), 40), ((600, 400), 90), ((900, 90), 90), ((1, 500), 1), ((9000, 2), 90)]
)
def test_large_pictures_are_reduced_and_a_flat_one_stays_flat(shape: tuple[int, int], height: int) -> None:
    image = np.full((*shape, 3), (10, 130, 250), np.uint8)
    sheet = single(image, 60)
    assert sheet.shape[:2] == (height + STYLE.above_caption, 60)
    assert (sheet[height // 2, 29] == (10, 130, 250)).all()


def test_reduction_averages_and_does_not_pick() -> None:
    lines = np.zeros((64, 64), np.uint8)
    lines[::2] = 200
    middle = single(lines, 32)[8:24, 8:24]
    assert (abs(middle.astype(int) - 100) <= 2).all()


def test_grey_is_shown_as_grey_in_every_type() -> None:
    levels = np.array([[0, 51], [204, 255]])
    picture = np.repeat(levels[:, :, None], 3, axis=2)
    for grey in (levels.astype(np.uint8), (levels * 7 + 1000).astype(np.uint16), levels / 255 - 4, levels):
        np.testing.assert_array_equal(single(grey, 2)[:2], picture)
        np.testing.assert_array_equal(single(grey[:, :, None], 2)[:2], picture)
    mask = levels > 100
    np.testing.assert_array_equal(single(mask, 2)[:2], 255 * mask[:, :, None].repeat(3, axis=2))
    np.testing.assert_array_equal(single(Image.fromarray(levels.astype(np.uint8)), 2)[:2], picture)


def test_deep_pictures_of_a_row_and_their_palettes_share_one_range() -> None:
    wide, narrow = np.array([[0, 1000]], np.uint16), np.array([[500, 500]], np.uint16)
    sheet = contact_sheet([[Panel(wide), Panel(narrow, palette=[[250.0], [1250.0]])]], panel_width=2)
    picture = sheet[STYLE.margin, STYLE.margin :, 0]
    assert picture[:2].tolist() == [0, 255]
    assert picture[2 + STYLE.gap : 4 + STYLE.gap].tolist() == [128, 128]
    strip = sheet[STYLE.margin + 1 + STYLE.above_strip :, STYLE.margin + 2 + STYLE.gap, 0][: STYLE.strip]
    assert sorted(set(strip.tolist())) == [64, 255]


def test_of_many_bands_the_first_are_shown() -> None:
    image = noise(6, 6, 7)
    np.testing.assert_array_equal(single(image, 6)[:6], image[:, :, :3])
    np.testing.assert_array_equal(single(image[:, :, :2], 6)[:6], image[:, :, :1].repeat(3, axis=2))


@pytest.mark.parametrize(("dtype", "opaque"), [(np.uint8, 255), (np.uint16, 65535), (np.float32, 1)])
def test_transparency_is_shown_over_a_checkerboard(dtype: type, opaque: int) -> None:
    side = 2 * STYLE.checker_side
    image: NDArray[Any] = np.zeros((side, side, 4), dtype)
    image[0, 0] = (opaque, 0, 0, opaque)
    shown = single(image, side)[:side]
    assert shown[0, 0].tolist() == [255, 0, 0]
    assert shown[0, 1].tolist() == [STYLE.checkers[0]] * 3
    assert shown[0, -1].tolist() == [STYLE.checkers[1]] * 3
    assert shown[-1, -1].tolist() == [STYLE.checkers[0]] * 3


def test_color_under_full_transparency_does_not_leak_when_a_picture_is_reduced() -> None:
    image = np.zeros((64, 64, 4), np.uint8)
    image[:, ::2] = (0, 0, 255, 255)
    image[:, 1::2] = (255, 255, 0, 0)
    shown = single(image, 32)[8:24, 8:24].astype(int)
    assert (shown[:, :, 2] > 200).all()
    assert (abs(shown[:, :, 0] - shown[:, :, 1]) <= 1).all()
    assert shown[:, :, 0].max() < 125


def test_parts_of_a_row_stand_level_whatever_the_heights() -> None:
    colors = distinct_colors(4)
    low, high = noise(20, 60, 3), noise(80, 60, 3)
    panels = [Panel(low, ("one",), colors), Panel(high, ("one", "two"), colors), Panel(low)]
    sheet = contact_sheet([panels], panel_width=60)[STYLE.margin : -STYLE.margin, STYLE.margin : -STYLE.margin]
    assert sheet.shape == (
        80 + STYLE.above_strip + STYLE.strip + STYLE.above_caption + 2 * STYLE.line,
        3 * 60 + 2 * STYLE.gap,
        3,
    )
    columns = [sheet[:, left : left + 60] for left in (0, 60 + STYLE.gap, 120 + 2 * STYLE.gap)]
    np.testing.assert_array_equal(columns[0][30:50], low)
    np.testing.assert_array_equal(columns[1][:80], high)
    strip = palette_strip(colors, width=60)
    for column in columns[:2]:
        np.testing.assert_array_equal(column[80 + STYLE.above_strip :][: STYLE.strip], strip)
    assert (columns[2][80:] == STYLE.background).all()


def test_captions_touch_neither_picture_nor_strip_nor_neighbour() -> None:
    image, colors = noise(40, 60, 3), distinct_colors(3)
    caption = ("Ågypqj|" * 9, "a line that is far longer than its panel", "three\nfour")
    sheets = [
        contact_sheet([[Panel(image, lines, colors), Panel(image, palette=colors)]], panel_width=60)
        for lines in (caption, ("",) * 3)
    ]
    assert sheets[0].shape == sheets[1].shape
    rows, columns = np.nonzero((sheets[0] != sheets[1]).any(axis=2))
    top = STYLE.margin + 40 + STYLE.above_strip + STYLE.strip
    assert top < rows.min()
    assert set((rows - top - STYLE.above_caption) // STYLE.line) == {0, 1, 2}
    assert columns.min() >= STYLE.margin - 1
    assert columns.max() < STYLE.margin + 60


def test_rows_may_differ_in_length_and_be_empty() -> None:
    image = noise(4, 30, 3)
    sheet = contact_sheet([[Panel(image)], [], [Panel(image), Panel(image)]], panel_width=30)
    assert sheet.shape[1] == 2 * STYLE.margin + 2 * 30 + STYLE.gap
    assert (sheet[STYLE.margin : STYLE.margin + 4, STYLE.margin + 30 :] == STYLE.background).all()
    assert contact_sheet([]).shape == (2 * STYLE.margin, 2 * STYLE.margin, 3)


# Edges over a picture

HALVES = np.repeat([[1] * 6 + [2] * 6], 5, axis=0)


@pytest.mark.parametrize("thickness", [1, 2, 3, 4, 5])
def test_edges_are_as_thick_as_asked_and_nothing_else_changes(thickness: int) -> None:
    image = noise(5, 12, 3) // 2
    drawn = draw_edges(image, HALVES, color=(255, 128, 0), thickness=thickness)
    is_line = (drawn == (255, 128, 0)).all(axis=2)
    assert is_line.sum(axis=1).tolist() == [thickness] * 5
    assert is_line[:, 6].all()
    np.testing.assert_array_equal(drawn[~is_line], image[~is_line])


def test_the_border_of_a_label_to_ignore_is_no_edge() -> None:
    labels = np.where(np.arange(12) < 4, 0, HALVES)
    for ignore, where in ((None, [4, 6]), (0, [6]), (1, []), (2, [4])):
        drawn = draw_edges(np.zeros((5, 12), np.uint8), labels, ignore=ignore)
        assert (drawn[0, :, 0] > 0).nonzero()[0].tolist() == where
    np.testing.assert_array_equal(draw_edges(noise(5, 12, 3), np.ones((5, 12), int)), noise(5, 12, 3))


def test_edges_are_drawn_over_grey_deep_transparent_and_many_bands() -> None:
    levels = np.where(HALVES == 1, 1000.0, 3000.0)
    levels[0, 0] = np.nan
    labels = np.where(np.isnan(levels), 0, HALVES)
    drawn = draw_edges(levels, labels, ignore=0)
    assert drawn[1, 0].tolist() == [0] * 3
    assert drawn[1, -1].tolist() == [255] * 3
    assert draw_edges(noise(5, 12, 7), HALVES)[0, 0].tolist() == noise(5, 12, 7)[0, 0, :3].tolist()
    assert (draw_edges(np.zeros((5, 12, 4), np.uint8), HALVES)[0, 0] == STYLE.checkers[0]).all()


def test_colors_of_segments_are_shown_as_the_picture_is() -> None:
    levels = np.where(HALVES == 1, 1000.0, 3000.0)
    shown = shown_colors([[0.0], [1000.0], [2000.0]], levels, HALVES)
    assert shown.tolist() == [[0] * 3, [0] * 3, [128] * 3]
    means = [[0.0, 0, 0], [10.4, 20.6, 200]]
    assert shown_colors(means, noise(5, 12, 3), HALVES).tolist() == [[0, 0, 0], [10, 21, 200]]


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (
            lambda: palette_strip(distinct_colors(9), width=4, height=2),
            r"=9 must be in 1\.\.8, the pixels of the strip",
        ),
        (lambda: palette_strip(distinct_colors(1), width=0), "width=0 must be"),
        (lambda: contact_sheet([[Panel(np.zeros(3))]]), r"image of shape \(3,\)"),
        (lambda: contact_sheet([[Panel(np.full((2, 2), np.nan))]]), "NaN"),
        (lambda: contact_sheet([[Panel(np.zeros((2, 2)))]], panel_width=0), "panel_width=0"),
        (lambda: draw_edges(np.zeros((2, 2)), HALVES), r"image of shape \(2, 2\) must be \(5, 12\)"),
        (lambda: draw_edges(np.zeros((5, 12)), HALVES, thickness=0), "thickness=0"),
    ],
)
def test_what_cannot_be_drawn_is_refused(draw: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        draw()

"""Claims about sheets, and about edges over images."""

from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from cvtimg import find_contours
from cvtimg.plotting import charts, draw_sheet
from cvtimg.plotting.sheets import CHECKERS, contour_drawing, draw_edges

Bytes = NDArray[np.uint8]


def noise(height: int, width: int, *channels: int) -> Bytes:
    image = np.random.default_rng(1).integers(0, 256, (height, width, *channels), dtype=np.uint8)
    image.flags.writeable = False  # no drawing changes what it shows
    return image


def test_a_sheet_has_all_images_and_captions_and_stretches_a_row_alike() -> None:
    deep = np.array([[0, 1000]], np.uint16)
    content = draw_sheet([[(deep, "one"), (deep // 2, "two")], [(noise(9, 12, 4), "three")]], ".svg").decode()
    assert all(f">{caption}<" in content for caption in ("one", "two", "three"))
    assert content.count("<image") == 3
    sheet = np.asarray(Image.open(BytesIO(draw_sheet([[(deep, ""), (deep // 2, "")]], ".png"))).convert("L"))
    assert {0, 128} < set(np.unique(sheet))


def test_charts_have_150_dots_per_inch_and_say_how_much_they_draw() -> None:
    assert Image.open(BytesIO(charts.draw_spectrum(np.ones(3), 1.0, ".png"))).size == (900, 540)
    assert f"more than {charts.MOST_AXES} axes the first {charts.MOST_AXES}" in str(charts.draw_pairs.__doc__)
    assert f"more than {charts._MANY:,} rows" in str(charts.draw_clusters.__doc__)


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
    assert (draw_edges(np.zeros((5, 12, 4), np.uint8), HALVES)[0, 0] == CHECKERS[0]).all()


def test_colors_of_segments_are_shown_as_the_picture_is() -> None:
    contours = find_contours(HALVES)
    levels = np.where(HALVES == 1, 1000.0, 3000.0)
    assert contour_drawing(contours, HALVES, levels).colors[1:].tolist() == [[0] * 3, [255] * 3]


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda: draw_edges(np.zeros((2, 2)), HALVES), r"image of shape \(2, 2\) must be \(5, 12\)"),
        (lambda: draw_edges(np.zeros((5, 12)), HALVES, thickness=0), "thickness=0"),
    ],
)
def test_what_cannot_be_drawn_is_refused(draw: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        draw()

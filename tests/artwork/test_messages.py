"""What cannot be drawn is refused by name."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cvtimg import mosaic, stipple
from cvtimg.artwork import find_tour
from cvtimg.artwork.tones import linear_light

RAMP = np.tile(np.linspace(0, 255, 160).astype(np.uint8), (120, 1))
DOTS, TILES = stipple(RAMP, 3), mosaic(RAMP, 3, effort="fast")


def tiled(n_cells: int, **options: Any) -> Callable[[], Any]:
    return lambda: mosaic(np.zeros((2, 2), np.uint8), n_cells, **options)


def dotted(n_dots: int | None = 9, **options: Any) -> Callable[[], Any]:
    return lambda: stipple(RAMP, n_dots, **options)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (tiled(0), "n_cells=0 must be in 1..4"),
        (tiled(1, shape="triangles"), "n_cells=1 must be an integer >= 2"),
        (tiled(2, palette=[[1, 2, 3]]), "palette of 3 channels must have 1"),
        (lambda: mosaic(1e308 * np.array([[-1, 1]]), 1), "the range of image=inf must be finite"),
        (dotted(0), "n_dots=0 must be in 1.."),
        (dotted(max_ink=0), "max_ink=0 must be > 0"),
        (dotted(white_cutoff=-1), "white_cutoff=-1 must be in 0..1"),
        (dotted(radius_range=(1, 2)), 'needs dots="sized"'),
        (dotted(dots="sized", radius_range=(3, 2)), "the least first"),
        (dotted(None, dot_diameter=0.001), r"dot_diameter=0.001 must be at least 0.\d+ pixels"),
        (dotted(50, dot_diameter=2), "dot_diameter takes no n_dots"),
        (dotted(None, dot_diameter=2, dots="sized"), "dots of one size"),
        (dotted(pens=["#fff"]), "must not be white"),
        (dotted(pens=["blood"]), "'blood' must be a color"),
        (dotted(pens=["red", "#f00"] * 6), "pens must be different colors"),
        (dotted(pens=["red"] * 13), "pens must be 1 to 12 colors"),
        (dotted(pens=["red"], layers="cmyk"), "pens takes no layers"),
        *(
            (lambda each=each, scale=scale: each.draw(scale=scale), "scale=")
            for each in (DOTS, TILES)
            for scale in (0.0, -1.0, np.nan)
        ),
        (lambda: linear_light(np.zeros((2, 2, 5), np.uint8)), "of 5 channels must have 1, 2, 3 or 4"),
        *((lambda points=points: find_tour(points), "points") for points in ([[0, 1, 2]], [[np.nan, 0]], [])),
    ],
)
def test_wrong_arguments_are_named(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()

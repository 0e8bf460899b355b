"""What cannot be placed is refused by name."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cvtimg import place_generators
from cvtimg.placement import Box, ImplicitRegion, PixelMoments, as_region

SQUARE, CUBE = Box([0, 0], [1, 1]), Box([0] * 3, [1] * 3)
MASK = np.ones((4, 4), bool)


def placed(region: Any = SQUARE, **options: Any) -> Callable[[], Any]:
    return lambda: place_generators(region, 5, **options)


def sampled(density: Any) -> Callable[[], Any]:
    return lambda: SQUARE.sample(10, density=density)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (placed(MASK, density=np.ones((2, 3))), r"density of shape \(2, 3\) must be \(4, 4\)"),
        (placed(None, density=1.0), "region=None needs an image as density"),
        (placed(CUBE, metric=0.5), r"metric=0\.5 must be >= 1"),
        (placed(fixed=[[0.5, 0.5], [0.5, 0.5 + 1e-12]]), "fixed must be .* apart: number 1, .*, lies on number 0"),
        (placed(fixed=np.zeros((5, 2))), "fixed must have fewer than n_generators=5, not 5"),
        (placed(density=lambda p: 0 * p[:, 0]), "density must not be 0 everywhere in the region"),
        (placed(density="dense"), "density of type str must be a number, an image or a function"),
        (lambda: as_region(np.zeros((3, 3), bool)), "mask must be True somewhere: the region is empty"),
        (lambda: as_region([[0, 0], [1, 1]]), r"a ring of shape \(2, 2\) must be \(N, 2\)"),
        (
            lambda: as_region([[0, 0], [2, 2], [2, 0], [0, 2]]),
            r"polygons must not cross themselves or each other, .*Self-intersection\[1 1\]",
        ),
        (
            lambda: as_region([[[0, 0], [1, 0], [1, 1]], [[5, 5], [6, 5], [6, 6]]]),
            r"have holes inside: Hole lies outside shell\[5 5\]",
        ),
        (lambda: as_region([[0, 0], [1, 1], [2, 2]]), "a Polygon of area 0 must be"),
        (lambda: as_region({"type": "Point", "coordinates": [0, 0]}), r"GeoJSON types=\['Point'\] must be"),
        (lambda: as_region(3), "region of type int must be a Region"),
        (lambda: ImplicitRegion(lambda p: np.ones(len(p)), [0, 0], [1, 1]), "function must be <= 0 .* region is empty"),
        (lambda: Box(1, 1), r"lower=\[1\.0\] must be less than upper=\[1\.0\]"),
        (lambda: Box([0, 0], [1e200, 1]), r"upper - lower=.* must be such that energies"),
        (sampled(0), "density=0.0 must be a finite number > 0"),
        (sampled([[1, -1]]), r"density in -1\.\.1 must be finite and >= 0"),
        (sampled(lambda p: p[:, 0] - 10), r"density at \[0\.\d+, 0\.\d+\]=-9\.\d+ must be finite and >= 0"),
        (sampled(lambda p: 1.0), r"density returned shape \(\) and must return \(10,\)"),
        (lambda: PixelMoments(np.zeros((3, 3))), "density must not be 0 everywhere"),
    ],
)
def test_wrong_arguments_are_named(make: Callable[[], Any], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        make()

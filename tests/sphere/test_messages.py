"""Grids, parts and widths that cannot be are refused by name."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cvtimg import sphere_grid
from cvtimg.sphere import (
    Box,
    Cap,
    CellWidth,
    Refinement,
    WidthCircle,
    cull_land,
    limit_area,
    nested_grid,
    triangulate,
    width_map,
)
from cvtimg.sphere.densities import fibonacci

GRID = sphere_grid(642, effort="fast")
LAND = Cap(20, 10, 50)
POINTS = fibonacci(50)
CIRCLE = np.stack([np.cos(np.arange(9)), np.sin(np.arange(9)), np.zeros(9)], axis=1)
NEAR = np.concatenate([POINTS, POINTS + 1e-9])


def nested(parent: Any = GRID, n: int = 10, within: Any = LAND, **options: Any) -> Callable[[], Any]:
    return lambda: nested_grid(parent, n, within=within, **options)


def place(kind: Any, **wrong: float) -> Callable[[], Any]:
    return lambda: kind(**{"lon": 0, "lat": 0, "radius": 10, **({"ratio": 2} if kind is Refinement else {}), **wrong})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sphere_grid(), "n must be given, unless"),
        (lambda: sphere_grid(100, density=np.ones((4, 9))), r"density of shape \(4, 9\) must be twice as wide as high"),
        (lambda: sphere_grid(100, density=np.zeros((4, 8))), "density must"),
        (lambda: sphere_grid(100, density=lambda x: 0 * x[:, 0]), "density must not be 0 everywhere"),
        (nested(within=Cap(3.3, 1.1, 1e-3)), "within must hold a point of the parent"),
        (nested(within=lambda x: x[:, 0] < 2), "within must leave a point of the parent outside"),
        (nested(within=lambda x: x), r"within returned shape \(642, 3\)"),
        (nested(within=lambda x: x[:, 0]), "within must return booleans"),
        (nested(np.eye(3)), "parent must have at least 4 points, not 3"),
        (lambda: cull_land(GRID, lambda points: points[:, 2] < 2), "land must leave a cell of the sea"),
        (lambda: cull_land(GRID, lambda points: points[:, 2]), "land must return booleans"),
        (lambda: cull_land(GRID, LAND, straits=[[[0, 95]]]), "straits must be in degrees"),
        (lambda: limit_area(GRID, Cap(3.3, 1.1, 1e-3)), "within must hold a point"),
        (lambda: Box(0, 10, 10, 0), "north=0 must be above south"),
        *(
            (place(kind, **{name: wrong}), name)
            for kind in (Cap, Refinement)
            for name, wrong in (("lat", 100), ("radius", 180.1), ("radius", 0), ("lon", 400))
        ),
        (place(Refinement, ratio=0.5), "ratio"),
        (lambda: CellWidth(0), "width=0.0 must be a finite number > 0, in km"),
        (lambda: CellWidth(lambda lon, lat: lon), r"width at \[.*\]=.* must be finite and > 0 km"),
        (lambda: CellWidth(lambda lon, lat: lon[1:]), "width returned shape"),
        (lambda: CellWidth(np.zeros((2, 4))), "width must be finite and > 0 km everywhere"),
        (lambda: CellWidth(30, [WidthCircle(0, 95, 1, 1)]), "lat=95 must be in -90..90"),
        (lambda: width_map([0, 90], [0, 1], np.ones((2, 2))), "lon must go around the globe"),
        (lambda: triangulate(np.eye(3)), "points must have at least 4 points, not 3"),
        (lambda: triangulate(2 * POINTS), r"\|points\[\d\]\|=2.* must be 1"),
        (lambda: triangulate(np.repeat(POINTS, 2, axis=0)), r"points \d+ and \d+ must be at least 1e-07 apart, not 0"),
        (lambda: triangulate(NEAR / np.linalg.norm(NEAR, axis=1)[:, None]), "must be at least 1e-07 apart"),
        (lambda: triangulate(CIRCLE), "not be all on one circle"),
    ],
)
def test_wrong_arguments_are_named(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()

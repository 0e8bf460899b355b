"""The domains that meshes are compared on: those of the comparison of 2009, and an ocean with a coast and islands."""

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import find_contours

Points = NDArray[np.float64]


def arc(x: float, y: float, radius: float, start: float, stop: float, n: int) -> Points:
    """Return n points of an arc, in radians."""
    turns = np.linspace(start, stop, n)
    return np.stack([x + radius * np.cos(turns), y + radius * np.sin(turns)], axis=1)


def circle(radius: float, n: int = 720, x: float = 0.0) -> Points:
    """Return a circle as a polygon that is fine enough."""
    return arc(x, 0, radius, 0, 2 * np.pi, n + 1)[:-1]


def regular(n: int, radius: float, turn: float = 0.0) -> Points:
    """Return a regular polygon."""
    return arc(0, 0, radius, turn, turn + 2 * np.pi, n + 1)[:-1]


def comparison() -> dict[str, tuple[list[Points], int]]:
    """Return eleven domains: rings, the outer one first, and the number of vertices."""
    square = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    corner = np.array([[-1.0, 0], [0, 0], [0, -1], [1, -1], [1, 1], [-1, 1]])
    turns = 2 * np.pi * np.arange(720) / 720
    rounded = np.stack([np.sign(f) * np.abs(f) ** 0.5 for f in (np.cos(turns), np.sin(turns))], axis=1)
    horn = np.vstack([arc(0, 0, 1, 0, 0.92 * np.pi, 700), arc(-0.4, 0, 0.55, 0.9 * np.pi, 0, 500)])
    pie = np.vstack([[[0.0, 0.0]], arc(0, 0, 1, np.pi / 10, 1.9 * np.pi, 650)])
    return {
        "circle of 19": ([circle(1)], 19),
        "circle": ([circle(1)], 88),
        "ellipse": ([circle(1) * [2, 1]], 362),
        "square": ([square], 303),
        "L-shape": ([corner], 194),
        "ring": ([circle(1), circle(0.4, 400)], 240),
        "square with hole": ([square, circle(0.4, 400)], 138),
        "hexagon in hexagon": ([regular(6, 1), regular(6, 0.5, np.pi / 6)], 505),
        "superellipse": ([rounded], 203),
        "horn": ([horn], 242),
        "pie with hole": ([pie, circle(0.2, 200, -0.5)], 361),
    }


def ocean(side: int = 1024, seed: int = 3) -> tuple[Any, NDArray[np.float64]]:
    """Return a coast with islands, as a polygon in pixels, and sizes: small at the coast and where energy is high."""
    random = np.random.default_rng(seed)

    def noise(spread: float) -> NDArray[np.float64]:
        field: NDArray[np.float64] = ndimage.gaussian_filter(random.standard_normal((side, side)), spread) * spread
        return field

    scale = side / 1024
    land = sum(part * noise(spread * scale) for spread, part in ((80, 1.0), (30, 0.35), (12, 0.12), (5, 0.03)))
    height = np.pad(land - np.quantile(land, 0.3), 1, constant_values=-1e-3)
    rings = [ring[:, ::-1] - 0.5 for ring in find_contours(height, 0.0) if len(ring) > 8]
    shapes = sorted((shapely.make_valid(shapely.Polygon(ring)) for ring in rings), key=lambda one: -one.area)
    sea = shapes[0]
    for island in shapes[1:]:
        if island.area > 30 * scale**2 and sea.contains(island):
            sea = sea.difference(island)
    sea = max(shapely.get_parts(sea), key=lambda one: one.area)
    energy = np.exp(4.8 * (noise(60 * scale) + 0.5 * noise(15 * scale)))
    x, y = np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5)
    shapely.prepare(sea)
    wet = shapely.contains_xy(sea, x.ravel(), y.ravel()).reshape(x.shape)
    sizes = np.minimum(energy**-0.25, 0.35 + 0.02 / scale * ndimage.distance_transform_edt(wet))
    return sea, np.clip(sizes / sizes.max(), 0.02, 1)

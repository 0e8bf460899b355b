"""Points, meshes and bases do not depend on units, axes or the order of what they are made from."""

from collections.abc import Callable
from typing import Any

import numpy as np
from relations.relation import Relation, close, equal, quick_and_wide
from relations.remembering import remembered
from relations.test_pictures import gray_picture
from shapely import affinity
from shapely.geometry import Polygon

import cvtimg
from cvtimg._shared.types import Floats
from cvtimg.designs import Factor
from cvtimg.placement import Box


def star(rng: np.random.Generator) -> Polygon:
    """Return a polygon around the origin, of size 1."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, 9)) + np.arange(9) * 1e-3
    return Polygon(rng.uniform(0.5, 1, 9)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)).buffer(0.01)


def in_squares(points: int) -> Callable[[Polygon], float]:
    """Return the energy of points in units of the squared area."""
    return lambda region: cvtimg.place_generators(region, points).energy / region.area**2


@remembered
def area(region: Polygon) -> float:
    return cvtimg.mesh_region(region, n=120).area / region.area


def snapshots(rng: np.random.Generator) -> Floats:
    """Return 30 snapshots of four shapes, with noise."""
    return rng.normal(size=(30, 4)) @ rng.normal(size=(4, 200)) + 0.01 * rng.normal(size=(30, 200))


def unexplained(rows: Floats) -> float:
    """Return what four modes leave, as a share of all."""
    return cvtimg.reduced_basis(rows, 4).energies[-1] / float(np.square(rows - rows.mean(axis=0)).sum())


def decades(rng: np.random.Generator) -> tuple[int, float, float]:
    """Return a number of points, and the powers of ten between which a factor is."""
    low, high = np.sort(rng.uniform(-9, 9, 2))
    return int(rng.integers(4, 12)), float(low), float(high)


def along_axes(given: tuple[int, float, float]) -> Floats:
    """Return where points lie along a logarithmic axis, and along another one, from 0 to 1."""
    n, low, high = given
    factors = [Factor("rate", 10**low, 10**high, log=True), Factor("heat", 20, 90)]
    points = cvtimg.design(n, factors, effort="fast").points
    return np.stack([(np.log10(points[:, 0]) - low) / (high - low), (points[:, 1] - 20) / 70])


def places(rng: np.random.Generator) -> Floats:
    return rng.random((30, 2))


def radii(points: Floats) -> Floats:
    """Return the radii of supports in their box, by size, in units of its sides."""
    box = Box(points.min(axis=0), points.max(axis=0))
    return np.sort(cvtimg.support_radii(points, box).radii) / np.hypot(*box.sides)


def areas(labels: Floats) -> Floats:
    """Return the areas of the polygons of segments, by size."""
    return np.sort([polygon.area for polygon in cvtimg.find_contours(labels.astype(int)).polygons])


_UNITS: dict[str, Callable[[Polygon], Polygon]] = {
    "in meters for kilometers": lambda region: affinity.scale(region, 1000, 1000, origin=(0, 0)),
    "far from the origin": lambda region: affinity.translate(region, 1e5, 5e6),
    "turned by 33 degrees": lambda region: affinity.rotate(region, 33, origin=(0, 0)),
    "mirrored": lambda region: affinity.scale(region, -1, 1, origin=(0, 0)),
}
_OUTLINES: dict[str, Callable[[Polygon], Polygon]] = {
    "another start": lambda region: Polygon(np.roll(region.exterior.coords[:-1], 7, axis=0)),
    "the other way around": lambda region: region.reverse(),
    "points doubled within rounding": lambda region: Polygon(
        [place for x, y in region.exterior.coords[:-1] for place in ((x, y), (x + 1e-12, y))]
    ),
}
_ROWS: dict[str, Callable[[Floats], Floats]] = {
    "another order of snapshots": lambda rows: rows[::-1],
    "another order of places": lambda rows: rows[:, ::-1],
    "another unit": lambda rows: rows * 1000,
}
_DECADES: dict[str, Callable[[Any], Any]] = {
    "a logarithmic axis in another unit": lambda given: (given[0], given[1] + 7, given[2] + 7),
    "a logarithmic axis over many decades": lambda given: (given[0], -299, 299),
}
_PLACES: dict[str, Callable[[Any], Any]] = {
    "in meters for kilometers": lambda points: 1000 * points,
    "far from the origin": lambda points: points + 1e4,
    "another order of points": np.flipud,
    "mirrored": lambda points: points * [-1, 1],
}
_TURNS: dict[str, Callable[[Any], Any]] = {"turned": np.rot90, "mirrored": np.fliplr, "other labels": lambda a: 99 - a}
_IN_SQUARES = remembered(in_squares(40))
_ENDS = "descents from other roundings end elsewhere"
_CASES: list[tuple[str, dict[str, Callable[[Any], Any]], Any, Any, Any, str]] = [
    ("place_generators", _UNITS, star, _IN_SQUARES, close(0.03), _ENDS),
    ("place_generators", _OUTLINES, star, _IN_SQUARES, close(0.03), _ENDS),
    ("mesh_region", _UNITS, star, area, close(1e-5), "points within rounding are one"),
    ("reduced_basis", _ROWS, snapshots, unexplained, close(1e-6), "rounding"),
    ("design", _DECADES, decades, along_axes, close(1e-6, 1e-9), "rounding"),
    ("support_radii", _PLACES, places, radii, close(1e-6), "rounding"),
    (
        "latinize",
        {"another order of points": np.flipud},
        places,
        lambda p: np.sort(cvtimg.latinize(p), axis=0),
        equal,
        "",
    ),
    ("find_contours", _TURNS, lambda rng: gray_picture(rng) // 40 + 1, areas, equal, ""),
]
RELATIONS = [
    Relation(verb, change, inputs, result, changed, follows, since="2026-11-28", because=because)
    for verb, changes, inputs, result, follows, because in _CASES
    for change, changed in changes.items()
]
test_units_and_axes_change_nothing, test_units_and_axes_never_change_anything = quick_and_wide(RELATIONS)

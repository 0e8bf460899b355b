"""Sizes of cells in kilometers on the earth: how wide cells are, and how many points that takes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import ENOUGH_SAMPLES
from cvtimg._shared.checks import check_in_range, check_positive, check_shape, check_that, check_values
from cvtimg._shared.types import Floats, Points
from cvtimg.sphere.densities import (
    GROWTH,
    GlobePicture,
    angles_from,
    check_center,
    check_globe,
    fibonacci,
    limit_on_globe,
    to_radians,
)
from cvtimg.sphere.starts import nearest_twelve

#: Radius of the earth in kilometers, as WRF and MPAS-Atmosphere have it; CESM and E3SM say 6371.22.
EARTH_RADIUS = 6371.229
#: Share by which even cells may be more or fewer than asked for, so that all but twelve are hexagons.
_NEAR = 0.01
#: The steepest slope of a transition, by the mean one.
_STEEPEST = 1.5

#: What a width may be: km, a function of longitudes and latitudes in degrees, or a map of the globe.
WidthLike: TypeAlias = "float | Callable[[Any, Any], Any] | ArrayLike"


@dataclass(frozen=True, slots=True)
class WidthCircle:
    """A circle on the earth whose cells have one width.

    Parameters
    ----------
    lon, lat : float
        Its center in degrees.
    radius : float
        In km. Cells have their width as far as that.
    width : float
        Of cells inside, in km.
    transition : float, optional
        Length in km, beyond the radius, on which cells widen to what they are outside. By default they widen by at most
        15 % on the way through a cell.
    """

    lon: float
    lat: float
    radius: float
    width: float
    transition: float | None = None

    def __post_init__(self) -> None:
        check_center(self.lon, self.lat)
        check_in_range("radius", self.radius, 0 < self.radius <= np.pi * EARTH_RADIUS, "in 0..20015 km, > 0")
        check_positive("width", self.width, "in km")
        if self.transition is not None:
            check_positive("transition", self.transition, "in km")

    def within(self, outside: Floats, points: Points) -> Floats:
        """Return widths (N,) at points, where they are `outside` without the circle: the finer counts."""
        beyond = EARTH_RADIUS * angles_from(self.lon, self.lat, points) - self.radius
        wider = np.maximum(outside - self.width, 0)
        length = np.maximum(_STEEPEST / GROWTH * wider, 1e-9) if self.transition is None else self.transition
        part = np.clip(beyond / length, 0, 1)
        return np.minimum(outside, self.width + wider * part**2 * (3 - 2 * part))


class CellWidth:
    """How wide cells are in km, as a density on the sphere that says how many points it takes.

    Parameters
    ----------
    width : float, callable or (H, 2 H) array
        In km: one width; a function of (N,) longitudes and (N,) latitudes in degrees; or a map of the globe,
        longitudes -180..180 from left to right and latitudes 90..-90 from top to bottom. Cells widen by at most 15 % on
        the way through one of a map; how fast they do by a function is up to the function.
    circles : sequence of WidthCircle
        Circles of finer cells.

    Attributes
    ----------
    n_points : int
        Number of points for which cells have these widths.
    is_even : bool
        Whether there is one width everywhere.

    Notes
    -----
    The width of a cell is the mean of the distances from its point to those of its neighbors: what MPAS-Tools calls
    ``cellWidth``, and JIGSAW ``hfun``, the length of edges of triangles. A hexagon of width w has the area
    sqrt(3) / 2 w^2, from which the number of points follows; where cells are even, the nearest one that has twelve
    pentagons only, if it differs by at most 1 %. With another number of points, all widths change by the same factor.

    Examples
    --------
    >>> from cvtimg import sphere_grid
    >>> from cvtimg.sphere import CellWidth, WidthCircle
    >>> CellWidth(30).n_points
    654432
    >>> grid = sphere_grid(density=CellWidth(1000, [WidthCircle(-40, 45, radius=2000, width=500)]), effort="fast")
    >>> near = np.hypot(grid.lon + 40, grid.lat - 45) < 10
    >>> bool(abs(grid.widths()[near] / 500 - 1).max() < 0.1)
    True
    """

    def __init__(self, width: WidthLike, circles: Sequence[WidthCircle] = ()) -> None:
        self.circles = tuple(circles)
        self._outside = _outside(width)
        self.is_even = not callable(width) and np.ndim(width) == 0 and not self.circles
        sums, finest = 0.0, np.inf
        n_places = 4 * ENOUGH_SAMPLES
        for part in np.array_split(fibonacci(n_places), 8):  # a few at a time
            widths = self.at(part)
            sums, finest = sums + float((widths**-2.0).sum()), min(finest, float(widths.min()))
        self._finest = min([finest, *(circle.width for circle in self.circles)])
        hexagon = np.sqrt(3) / 2  # the area, of neighbors that are 1 apart
        n_points = round(4 * np.pi * EARTH_RADIUS**2 / hexagon * sums / n_places)
        near = nearest_twelve(n_points) if self.is_even else n_points
        self.n_points = near if abs(near - n_points) <= _NEAR * n_points else n_points

    def at(self, points: Points) -> Floats:
        """Return widths in km at (N, 3) unit vectors."""
        widths = self._outside(points)
        for circle in self.circles:
            widths = circle.within(widths, points)
        return widths

    def __call__(self, points: Points) -> Floats:
        """Return the density at (N, 3) unit vectors: 1 where cells are finest."""
        return np.asarray((self._finest / self.at(points)) ** 4)

    def __repr__(self) -> str:
        return f"CellWidth(from {self._finest:g} km, {self.n_points} points)"


def width_map(lon: ArrayLike, lat: ArrayLike, widths: ArrayLike) -> Floats:
    """Return a map of the globe, as `CellWidth` takes it, of widths that are given along longitudes and latitudes.

    Parameters
    ----------
    lon : (X,) array
        In degrees, increasing, around the globe.
    lat : (Y,) array
        In degrees, increasing or decreasing.
    widths : (Y, X) array
        In km.

    Returns
    -------
    (H, 2 H) float64 array
        Interpolated bilinearly, with pixels about as large as the steps that were given.

    Examples
    --------
    >>> from cvtimg.sphere import width_map
    >>> width_map([-180, 0, 180], [-90, 90], [[60, 60, 60], [30, 30, 30]]).tolist()
    [[37.5, 37.5, 37.5, 37.5], [52.5, 52.5, 52.5, 52.5]]
    """
    x, y, table = (np.asarray(values, np.float64) for values in (lon, lat, widths))
    check_shape("widths", table.shape, table.shape == (y.size, x.size) and min(table.shape) > 1, "(Y, X), Y, X >= 2")
    steps, order = np.diff(x), np.argsort(y)
    check_that("lon", x[-1] - x[0] <= 360 < x[-1] - x[0] + 2 * steps.max() + 1e-9, "go around the globe")
    height = max(int(np.ceil(180 / min(np.median(steps), np.median(np.diff(y[order]))) - 1e-6)), 2)
    rows, columns = 90 - 180 * (np.arange(height) + 0.5) / height, 180 * (np.arange(2 * height) + 0.5) / height - 180
    along = np.stack([np.interp(columns, x, row, period=360) for row in table[order]])
    return np.stack([np.interp(rows, y[order], column) for column in along.T], axis=1)


def _outside(width: WidthLike) -> Callable[[Points], Floats]:
    """Return a checked function from points to widths."""
    if callable(width):
        return partial(_widths_by, width)
    if np.ndim(width) == 0:
        everywhere = check_positive("width", float(np.asarray(width)), "in km")
        return lambda points: np.full(len(points), everywhere)
    table = check_globe("width", np.atleast_2d(np.array(width, np.float64)))
    check_that("width", bool((np.isfinite(table) & (table > 0)).all()), "be finite and > 0 km everywhere")
    sizes = np.ascontiguousarray(table)
    limit_on_globe(sizes, GROWTH * EARTH_RADIUS)
    picture = GlobePicture.padded(sizes.astype(np.float32))
    return lambda points: picture(points).astype(np.float64)


def _widths_by(width: Callable[[Any, Any], Any], points: Points) -> Floats:
    places = np.degrees(np.stack(to_radians(points), axis=1))
    is_width = "finite and > 0 km"
    return check_values("width", width(*places.T), places, lambda widths: (widths > 0) & (widths < np.inf), is_width)

"""Designs: points that fill a box, or the part of it that is feasible, as evenly as a tessellation does.

Names and bounds of the axes may be a text file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import (
    check_alone,
    check_choice,
    check_count,
    check_density,
    check_in_range,
    check_returned,
    check_shape,
    check_that,
    hints_at_keywords,
)
from cvtimg._shared.choices import EffortName
from cvtimg._shared.records import ReadOnly
from cvtimg._shared.svg import draw_dots
from cvtimg.designs.cells import MOST_EXACT_DIMS, sobol_samples
from cvtimg.designs.descent import EFFORTS, Cube, place, place_for, place_latin
from cvtimg.designs.measures import PointMeasures, point_measures
from cvtimg.designs.swaps import CRITERIA
from cvtimg.files.text_tables import write_csv
from cvtimg.files.whole import StrPath, whole_file

_Floats = NDArray[np.float64]
CriterionName: TypeAlias = Literal["cvt", "maximin", "projection", "discrepancy"]

#: Files that a design is written to.
SUFFIXES = (".csv", ".npy")
_MAX_DIMS = 64
_MAX_POINTS = 1 << 16
#: The least and the most samples in all.
_FEW_SAMPLES, _MANY_SAMPLES = 1 << 14, 1 << 20
#: Where fewer of the samples are feasible, they are spread over a smaller box.
_ENOUGH = 0.1
#: Up to so many dimensions cells are integrated whatever the effort.
_MOST_CHEAP_DIMS = 2


@dataclass(frozen=True, slots=True, eq=False)
class Design(ReadOnly):
    """Points that fill a box, or a part of it, evenly.

    Attributes
    ----------
    points : (n, d) float64 array
        In the units of the bounds; those that existed are not among them.
    unit_points : (n, d) float64 array
        The same in the unit cube.
    bounds : (d, 2) float64 array
        Least and greatest value along each axis.
    existing : (L, d) float64 array
        Points that were there before, in the units of the bounds.
    energy : float
        Mean squared distance in the unit cube from where points may lie to the nearest point, old or new, weighted by
        the density.
    latin : bool
        Whether each of the n + L slices along each axis has at most one of the new points and none beside an old one.
    periodic : bool
        Whether opposite walls meet.
    """

    points: _Floats
    unit_points: _Floats
    bounds: _Floats
    existing: _Floats
    energy: float
    latin: bool
    periodic: bool

    def _repr_html_(self) -> str:
        """Draw all points, old and new, in each pair of the first axes."""
        low, high = self.bounds.T
        return draw_dots(repr(self), np.concatenate([(self.existing - low) / (high - low), self.unit_points]))

    def __repr__(self) -> str:
        n_points, n_dims = self.points.shape
        kind = ("Latin " if self.latin else "") + ("periodic " if self.periodic else "")
        return f"Design({n_points} {kind}points in {n_dims} dimensions, energy {self.energy:.4g})"

    def measures(self) -> PointMeasures:
        """Measure how evenly all points, old and new, fill the unit cube; see `point_measures`."""
        low, high = self.bounds.T
        old = (self.existing - low) / (high - low)
        return point_measures(np.concatenate([old, self.unit_points]), periodic=self.periodic)

    def save(self, path: StrPath, *, names: list[str] | None = None, overwrite: bool = False) -> None:
        """Write the points to a .csv file, with a header, or a .npy file, whole or not at all.

        Raises
        ------
        ValueError
            If the suffix is another, or there are not as many names as axes.
        OSError
            If the file cannot be written, or exists and `overwrite` is false.
        """
        suffix = check_choice("suffix", Path(path).suffix.lower(), SUFFIXES)
        n_dims = self.points.shape[1]
        header = names or [f"x{axis + 1}" for axis in range(n_dims)]
        check_in_range("names", header, len(header) == n_dims, f"{n_dims}, one for each axis")
        if suffix == ".csv":
            write_csv(path, header, self.points.tolist(), overwrite=overwrite)
            return
        with whole_file(path, overwrite=overwrite) as file:
            np.save(file, self.points)


@hints_at_keywords
def design(
    n_points: int,
    bounds: int | ArrayLike,
    *,
    periodic: bool = False,
    latin: bool | None = None,
    density: Callable[[_Floats], ArrayLike] | None = None,
    feasible: Callable[[_Floats], ArrayLike] | None = None,
    existing: ArrayLike | None = None,
    criterion: CriterionName = "cvt",
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
) -> Design:
    """Place points for experiments: as evenly as the cells of a centroidal Voronoi tessellation.

    Parameters
    ----------
    n_points : int
        How many, at most 65536.
    bounds : int or (d, 2) array
        Number of dimensions of a unit cube, at most 64, or least and greatest value along each axis.
    periodic : bool
        Join opposite walls, so that points need not keep away from walls.
    latin : bool, optional
        Give each of n slices along each axis one point, and still be nearly a tessellation: projections on each axis
        are then even as well. That is the default, except with `density` or `feasible`, with which it cannot be.
    density : callable, optional
        From (m, d) points in the units of the bounds to (m,) weights >= 0: points are denser where it is greater.
    feasible : callable, optional
        From (m, d) points to (m,) booleans: where points may lie.
    existing : (L, d) array, optional
        Points that are there already, in the units of the bounds: new ones keep away from them.
    criterion : {"cvt", "maximin", "projection", "discrepancy"}
        What Latin points are placed for: even cells; the largest smallest distance between two points; distances in
        the projections on all sets of axes (maximum projection); or the least centered L2 discrepancy, that with
        wrap-around if `periodic`.
    effort : {"fast", "balanced", "best"}
        "best" moves points in one to three dimensions to a minimum of the exact energy, the best of a few starts.
    rng : int or numpy.random.Generator
        Seed of the starts.

    Returns
    -------
    Design

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it.

    See Also
    --------
    cvtimg.designs.CVTDesign, cvtimg.latinize, cvtimg.point_measures

    Notes
    -----
    A plain tessellation (``latin=False``) has the least energy, but its projections on single axes have gaps, which
    matters where only few of many inputs count.

    References
    ----------
    V. Romero, J. Burkardt, M. Gunzburger, J. Peterson, Reliability Engineering and System Safety 91 (2006) 1266-1280,
    doi 10.1016/j.ress.2005.11.023. Returning to Latin points after each move is our own, as are the swaps of neighbors
    that then lower the discrepancy.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import design
    >>> found = design(8, [[0, 1], [-5, 5]], effort="fast")
    >>> np.sort(found.points[:, 1]).tolist()
    [-4.375, -3.125, -1.875, -0.625, 0.625, 1.875, 3.125, 4.375]
    """
    check_count("n_points", n_points, _MAX_POINTS, "the most points")
    check_choice("effort", effort, EFFORTS)
    low, high = _checked_bounds(bounds)
    check_choice("criterion", criterion, ("cvt", *CRITERIA))
    everywhere = density is None and feasible is None
    if not everywhere:
        given = [name for name, value in (("latin=True", latin), ("periodic=True", periodic)) if value]
        check_alone("density or feasible", given)
    if criterion != "cvt":
        others = {"latin=False": latin is False, "density": density, "feasible": feasible}
        check_alone(f"criterion={criterion!r}", [name for name, value in others.items() if value])
    old = _checked_existing(existing, low, high)
    asked = EFFORTS[effort].samples * (n_points + len(old))
    random = np.random.default_rng(rng)
    samples = sobol_samples(int(np.clip(asked, _FEW_SAMPLES, _MANY_SAMPLES)), len(low), random)
    if feasible is not None:
        samples = _feasible_samples(samples, low, high, feasible, random)
    samples, weights = _weighted(samples, low, high, density)
    enough = f"hold for more of the box than {len(samples)} of its samples, for {n_points} points"
    check_that("feasible", len(samples) >= n_points + len(old), enough)
    worth_it = periodic or effort == "best"
    exact = everywhere and len(low) <= (MOST_EXACT_DIMS if worth_it else _MOST_CHEAP_DIMS)
    cube = Cube(samples, weights, periodic, exact)
    latin = everywhere if latin is None else latin
    if criterion == "cvt":
        found = place(cube, n_points, old, effort, random)
        unit = place_latin(cube, found, old, effort, random) if latin else found[0]
    else:
        unit = place_for(criterion, cube, n_points, old, effort, random)
    energy = cube.moments(np.concatenate([old, unit])).energy
    points, existing = (low + places * (high - low) for places in (unit, old))
    return Design(points, unit, np.stack([low, high], axis=1), existing, energy, latin, periodic)


def _checked_bounds(bounds: int | ArrayLike) -> tuple[_Floats, _Floats]:
    if isinstance(bounds, (int, np.integer)):
        n_dims = check_count("bounds", int(bounds), _MAX_DIMS, "the most dimensions")
        return np.zeros(n_dims), np.ones(n_dims)
    array = np.asarray(bounds, dtype=np.float64)
    fits = array.ndim == 2 and array.shape[1] == 2 and 1 <= len(array) <= _MAX_DIMS
    check_shape("bounds", array.shape, fits, f"(d, 2), d in 1..{_MAX_DIMS}")
    with np.errstate(over="ignore", invalid="ignore"):
        apart = array[:, 1] - array[:, 0]
    ordered = np.isfinite(array).all() and np.isfinite(apart).all() and (apart > 0).all()
    check_in_range("bounds", array.tolist(), ordered, "finite, the first of each axis below the second")
    return array[:, 0].copy(), array[:, 1].copy()


def _checked_existing(existing: ArrayLike | None, low: _Floats, high: _Floats) -> _Floats:
    if existing is None:
        return np.empty((0, len(low)))
    array = np.empty((0, len(low))) if np.size(existing) == 0 else np.asarray(existing)
    fits = array.ndim == 2 and array.shape[1] == len(low)
    check_shape("existing", array.shape, fits, f"(L, {len(low)}), a row for each point")
    unit: _Floats = (array - low) / (high - low)
    check_that("existing", ((unit >= 0) & (unit <= 1)).all(), "be finite and lie within the bounds")
    return unit


def _feasible_samples(
    samples: NDArray[np.float32], low: _Floats, high: _Floats, feasible: Any, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Leave samples that are feasible; where few are, spread all of them over the box around those, and again."""
    n_dims = samples.shape[1]
    start, size, tried = np.zeros(n_dims), np.ones(n_dims), samples
    while True:
        places = (start + tried * size).astype(np.float32)
        allowed = np.asarray(feasible(low + places * (high - low)))
        check_returned("feasible", allowed, len(places))
        found = places[allowed.astype(bool)]
        if len(found) == 0 and len(tried) < _MANY_SAMPLES:
            tried = sobol_samples(_MANY_SAMPLES, n_dims, rng)
            continue
        if len(found) == 0 or len(found) > _ENOUGH * len(tried):
            return found
        # There may be more beyond the outermost ones, by about the distance between samples.
        margin = 3 * np.ptp(found, axis=0) / len(found) + size * len(tried) ** (-1 / n_dims)
        corner = np.clip(found.min(axis=0) - margin, 0, 1)
        smaller = np.clip(found.max(axis=0) + margin, 0, 1) - corner
        if smaller.prod() > size.prod() / 2:
            return found
        start, size, tried = corner, smaller, samples


def _weighted(
    samples: NDArray[np.float32], low: _Floats, high: _Floats, density: Any
) -> tuple[NDArray[np.float32], _Floats | None]:
    """Leave samples that have a density, with their weights."""
    weights = None
    if density is not None and len(samples):
        weights = np.asarray(density(low + samples * (high - low)), dtype=np.float64)
        check_returned("density", weights, len(samples))
        # Only their ratios count, and sums must be finite.
        weights = np.ldexp(weights, -np.frexp(np.max(weights))[1])
        check_density(weights, len(samples))
        samples, weights = samples[weights > 0], weights[weights > 0]
    return samples, weights

"""Designs: points that fill a box, or the part of it that is feasible, as evenly as a tessellation does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import ENOUGH_SAMPLES, MAX_COLORS
from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_density,
    check_in_range,
    check_returned,
    check_shape,
    check_that,
    refuse,
)
from cvtimg._shared.choices import EffortName, Row
from cvtimg._shared.notebooks import drawn
from cvtimg._shared.pixels import array_of
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Indices
from cvtimg.designs.cells import MOST_EXACT_DIMS, Cube, sobol_samples
from cvtimg.designs.descent import EFFORTS, place, place_for, place_latin, place_latin_within
from cvtimg.designs.factors import Factor, check_names
from cvtimg.designs.groups import split_evenly
from cvtimg.designs.latin import CRITERIA
from cvtimg.designs.measures import PointMeasures, point_measures
from cvtimg.files.whole import StrPath, whole_file, write_csv

CriterionName: TypeAlias = Literal["cvt", "maximin", "projection", "discrepancy"]

#: Files that a design is written to.
SUFFIXES = (".csv", ".npy")
_MAX_DIMS = 64
#: Points in a feasible region that become Latin, at most: all pairs of points and slices are tried.
_MOST_WITHIN = 1024


@dataclass(frozen=True, slots=True, eq=False)
class Design(ReadOnly):
    """Points that fill a box, or a part of it, evenly.

    Attributes
    ----------
    points : (n, d) float64 array
        In the units of the bounds, and within 0..1 along factors with levels; those that existed are not among them.
    unit_points : (n, d) float64 array
        The same in the unit cube.
    bounds : (d, 2) float64 array
        Least and greatest value along each axis.
    existing : (L, d) float64 array
        Points that were there before, in the units of the bounds.
    energy : float
        Mean squared distance in the unit cube from where points may lie to the nearest point, old or new, weighted by
        the density; without categories, 0 if there is nothing else.
    latin : bool
        Whether each of the n + L slices along each axis has at most one of the new points and none beside an old one.
    periodic : bool
        Whether opposite walls meet.
    factors : tuple of Factor
        The axes.
    """

    points: Floats
    unit_points: Floats
    bounds: Floats
    existing: Floats
    energy: float
    latin: bool
    periodic: bool
    factors: tuple[Factor, ...]

    def _claims(self) -> Claims:
        yield "points are within the unit cube", (self.unit_points >= 0) & (self.unit_points <= 1)

    def _repr_png_(self) -> bytes | None:
        """Draw all points, old and new, in each pair of the first axes."""
        return drawn(repr(self), self._all_points(), is_place=False)

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        return {
            "n": len(self.points),
            "dimensions": self.points.shape[1],
            "names": [factor.header for factor in self.factors],
            "existing": len(self.existing),
            "latin": self.latin,
            "periodic": self.periodic,
            "energy": self.energy,
        }

    def __repr__(self) -> str:
        n_points, n_dims = self.points.shape
        kind = ("Latin " if self.latin else "") + ("periodic " if self.periodic else "")
        return f"Design({n_points} {kind}points in {n_dims} dimensions, energy {self.energy:.4g})"

    def measures(self) -> PointMeasures:
        """Measure how evenly all points, old and new, fill the unit cube without categories; see `point_measures`."""
        is_axis = [not factor.is_category for factor in self.factors]
        return point_measures(self._all_points()[:, is_axis], periodic=self.periodic)

    def shuffled(self, rng: int | np.random.Generator) -> Design:
        """Return the same points in random order."""
        order = np.random.default_rng(rng).permutation(len(self.points))
        return replace(self, points=self.points[order], unit_points=self.unit_points[order])

    def table(self) -> tuple[list[str], list[list[Any]]]:
        """Return the names of columns, with units, and the rows: numbers, and levels as texts."""
        columns = [factor.values(column) for factor, column in zip(self.factors, self.points.T, strict=True)]
        return [factor.header for factor in self.factors], [list(row) for row in zip(*columns, strict=True)]

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the table to a .csv file, or points without levels to a .npy file, whole or not at all."""
        suffix = check_choice("suffix", Path(path).suffix.lower(), SUFFIXES)
        if suffix == ".csv":
            write_csv(path, *self.table(), overwrite=overwrite)
            return
        if any(factor.levels for factor in self.factors):
            raise ValueError(f"{path} must end in .csv: .npy has no levels")
        with whole_file(path, overwrite=overwrite) as file:
            np.save(file, self.points)

    def _all_points(self) -> Floats:
        return np.concatenate([_units(self.factors, self.existing), self.unit_points])


def design(
    n_points: int,
    bounds: int | ArrayLike | Sequence[Factor],
    *,
    periodic: bool = False,
    latin: bool | None = None,
    density: Callable[[Floats], ArrayLike] | None = None,
    feasible: Callable[[Floats], ArrayLike] | None = None,
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
    bounds : int, (d, 2) array or sequence of Factor
        Number of dimensions of a unit cube, at most 64, or least and greatest value along each axis; or factors, which
        may have levels.
    periodic : bool
        Join opposite walls, so that points need not keep away from walls.
    latin : bool, optional
        Give each of n slices along each axis one point, and still be nearly a tessellation: projections on each axis
        are then even as well. With `feasible`, slices have equal shares of the feasible region, and as many as can
        have one point; at most 1024 points. That is the default, except with `density`, with which it cannot be.
    density : callable, optional
        From (m, d) points in the units of the bounds to (m,) weights >= 0: points are denser where it is greater.
        Functions are given the numbers that are levels, and no categories.
    feasible : callable, optional
        From (m, d) points to (m,) booleans: where points may lie.
    existing : (L, d) array, optional
        Points that are there already, as in `Design.points`: new ones keep away from them.
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

    Notes
    -----
    A plain tessellation (``latin=False``) has the least energy, but its projections on single axes have gaps, which
    matters where only few of many inputs count. Categories share out the points so that those of each are even by
    themselves: batches are categories, too.

    References
    ----------
    V. Romero, J. Burkardt, M. Gunzburger, J. Peterson, Reliability Engineering and System Safety 91 (2006) 1266-1280,
    doi 10.1016/j.ress.2005.11.023. Returning to Latin points after each move is our own, as are the swaps of neighbors
    that then lower the discrepancy.

    Examples
    --------
    >>> from cvtimg import design
    >>> result = design(8, [[0, 1], [-5, 5]], effort="fast")
    >>> np.sort(result.points[:, 1]).tolist()
    [-4.375, -3.125, -1.875, -0.625, 0.625, 1.875, 3.125, 4.375]
    """
    n_points = check_count("n_points", n_points, MAX_COLORS, "the most points")
    check_choice("effort", effort, EFFORTS)
    check_choice("criterion", criterion, ("cvt", *CRITERIA))
    factors = _checked_factors(bounds)
    is_axis = np.array([not factor.is_category for factor in factors])
    if not is_axis.any():
        return _of_categories(n_points, factors, existing, effort, rng)
    region = Region([factor for factor in factors if not factor.is_category], feasible, density)
    held = _checked_existing(existing, factors)
    old, n_all = held[:, is_axis], n_points + len(held)
    _check_together(region, latin, periodic, criterion, n_all)
    random = np.random.default_rng(rng)
    samples, weights = region.samples(EFFORTS[effort].samples * n_all, random)
    enough = f"hold for more of the box than {len(samples)} of its samples, for {n_points} points"
    check_that("feasible", len(samples) >= n_all, enough)
    # In the plane exact cells cost no more than samples do.
    is_worth_it = periodic or effort == "best" or len(region.axes) < MOST_EXACT_DIMS
    exact = region.is_box and len(region.axes) <= MOST_EXACT_DIMS and is_worth_it
    cube = Cube(samples, weights, periodic, exact)
    if latin is None:
        latin = region.may_be_latin and (region.is_box or n_all <= _MOST_WITHIN)
    if criterion == "cvt":
        starts = place(cube, n_points, old, effort, random)
        mended = partial(region.mended, samples=samples)
        unit = mended(starts[0])
        if latin and region.is_box:
            unit = place_latin(cube, starts, old, effort, random)
        elif latin:
            unit, latin = place_latin_within(cube, unit, old, effort, region.allows, mended)
    else:
        unit = place_for(criterion, cube, n_points, old, effort, random)
    energy = cube(np.concatenate([old, unit])).energy
    unit = _with_categories(factors, held, unit, random)
    ends = np.array([(factor.low, factor.high) for factor in factors])
    columns = np.concatenate([unit, held]).T
    points = np.stack([factor.at(column) for factor, column in zip(factors, columns, strict=True)], axis=1)
    return Design(points[:n_points], unit, ends, points[n_points:], energy, latin, periodic, tuple(factors))


def _of_categories(
    n_points: int, factors: list[Factor], existing: ArrayLike | None, effort: EffortName, rng: int | np.random.Generator
) -> Design:
    """Share out levels evenly, each by itself and in pairs, along an axis that is left out again."""
    held = _checked_existing(existing, factors)
    places = (np.arange(len(held)) + 0.5) / max(len(held), 1)
    together = np.column_stack([places, held])
    whole = design(n_points, [Factor(" "), *factors], existing=together, effort=effort, rng=rng)
    parts = {name: getattr(whole, name)[:, 1:] for name in ("points", "unit_points", "existing")}
    return replace(whole, **parts, bounds=whole.bounds[1:], energy=0.0, factors=tuple(factors))


def _checked_factors(bounds: int | ArrayLike | Sequence[Factor]) -> list[Factor]:
    if isinstance(bounds, (int, np.integer)):
        n_dims = check_count("bounds", int(bounds), _MAX_DIMS, "the most dimensions")
        return [Factor(f"x{axis + 1}") for axis in range(n_dims)]
    if isinstance(bounds, Sequence) and bounds and all(isinstance(item, Factor) for item in bounds):
        factors = list(bounds)
        check_names(factors)
    else:
        array = np.asarray(bounds, dtype=np.float64)
        check_shape("bounds", array.shape, array.ndim == 2 and array.shape[1] == 2, f"(d, 2), d in 1..{_MAX_DIMS}")
        factors = [Factor(f"x{axis}", low, high) for axis, (low, high) in enumerate(array.tolist(), 1)]
    check_count("the number of axes", len(factors), _MAX_DIMS, "the most dimensions")
    ends = [[factor.low, factor.high] for factor in factors]
    ordered = all(-np.inf < low < high < np.inf and np.isfinite(high - low) for low, high in ends)
    check_in_range("bounds", ends, ordered, "finite, the first of each axis below the second")
    return factors


def _checked_existing(existing: ArrayLike | None, factors: list[Factor]) -> Floats:
    if existing is None or np.size(existing) == 0:
        return np.empty((0, len(factors)))
    array = array_of(existing)
    fits = array.ndim == 2 and array.shape[1] == len(factors)
    check_shape("existing", array.shape, fits, f"(L, {len(factors)}), a row for each point")
    unit = _units(factors, array)
    outside = ~((unit >= 0) & (unit <= 1))
    if outside.any():
        row, axis = np.argwhere(outside)[0]
        of = factors[axis]
        refuse(f"{of.name} of existing[{row}]", float(array[row, axis]), f"within its bounds, {of.low:g}..{of.high:g}")
    return unit


def _units(factors: Sequence[Factor], points: Array) -> Floats:
    """Return where points (n, d) are in the unit cube."""
    return np.stack([factor.unit_of(column) for factor, column in zip(factors, points.T, strict=True)], axis=1)


def _check_together(region: Region, latin: bool | None, periodic: bool, criterion: str, n_all: int) -> None:
    limits = " or ".join(region.given)
    check_that(limits, not (periodic and limits), "not be given with periodic=True")
    check_that(limits, not latin or region.may_be_latin, "not be given with latin=True")
    if latin and not region.is_box:
        check_in_range("n_points", n_all, n_all <= _MOST_WITHIN, f"at most {_MOST_WITHIN} for latin=True with {limits}")
    if criterion != "cvt":
        others = region.given + ["latin=False"] * (latin is False)
        check_that(f"criterion={criterion!r}", not others, f"not be given with {' or '.join(others)}")


def _with_categories(factors: list[Factor], existing: Floats, unit: Floats, rng: np.random.Generator) -> Floats:
    """Add the columns of categories to points (n, d) of the other axes."""
    is_axis = np.array([not factor.is_category for factor in factors])
    every, n_old = np.empty((len(existing) + len(unit), len(factors))), len(existing)
    every[:n_old], every[n_old:, is_axis] = existing, unit
    along, groups = every[:, is_axis], list[Indices]()
    for axis in np.flatnonzero(~is_axis):
        factor = factors[axis]
        known, n_levels = factor.levels_at(existing[:, axis]), len(factor.levels)
        groups.append(split_evenly(along, n_levels, known=known, others=groups, rng=rng))
        every[:, axis] = (groups[-1] + 0.5) / n_levels
    return every[n_old:]


class Region:
    """The part of the unit cube where points may lie, and how densely."""

    def __init__(self, axes: list[Factor], feasible: object, density: object) -> None:
        self.axes = axes
        self._feasible, self._density = feasible, density
        limits = {"density": density, "feasible": feasible}
        self.given = [name for name, limit in limits.items() if limit is not None]
        self.is_box = not self.given
        self.may_be_latin = density is None

    def samples(self, n: int, rng: np.random.Generator) -> tuple[Floats32, Floats | None]:
        """Draw about the given number of samples (m, d), and their weights, if they differ."""
        n = int(np.clip(n, ENOUGH_SAMPLES // 8, 8 * ENOUGH_SAMPLES))
        samples = sobol_samples(n, len(self.axes), rng)
        if self._feasible is not None:
            samples = _feasible_samples(samples, self.allows, rng)
        if self._density is None or not len(samples):
            return samples, None
        weights = self._called("density", self._density, samples).astype(np.float64)
        # Only their ratios count, and sums must be finite.
        weights = np.ldexp(weights, -np.frexp(np.max(weights))[1])
        check_density(weights, len(samples))
        return samples[weights > 0], weights[weights > 0]

    def allows(self, places: Array) -> Bools:
        """Tell which of (m, d) places are in the region."""
        if self._feasible is None:
            return np.ones(len(places), bool)
        return self._called("feasible", self._feasible, places).astype(bool)

    def mended(self, places: Floats, *, samples: Floats32) -> Floats:
        """Move centers of mass (n, d) that are not in the region into it."""
        outside = ~self.allows(places)
        if outside.any():
            from scipy.spatial import cKDTree

            places = places.copy()
            places[outside] = samples[cKDTree(samples).query(places[outside])[1]]
        return places

    def _called(self, name: str, function: Any, places: Array) -> Array:
        columns = [axis.numbers(axis.at(column)) for axis, column in zip(self.axes, places.T, strict=True)]
        values = np.asarray(function(np.stack(columns, axis=1)))
        check_returned(name, values, len(places))
        return values


def _feasible_samples(samples: Floats32, is_feasible: Callable[[Any], Bools], rng: np.random.Generator) -> Floats32:
    """Leave samples that are feasible; where few are, spread all of them over the box around those, and again."""
    n_dims = samples.shape[1]
    start, size, tried = np.zeros(n_dims), np.ones(n_dims), samples
    while True:
        places = (start + tried * size).astype(np.float32)
        feasible = places[is_feasible(places)]
        if len(feasible) == 0 and len(tried) < 8 * ENOUGH_SAMPLES:
            tried = sobol_samples(8 * ENOUGH_SAMPLES, n_dims, rng)
            continue
        if len(feasible) == 0 or len(feasible) > len(tried) / 10:
            return feasible
        # There may be more beyond the outermost ones, by about the distance between samples.
        margin = 3 * np.ptp(feasible, axis=0) / len(feasible) + size * len(tried) ** (-1 / n_dims)
        corner = np.clip(feasible.min(axis=0) - margin, 0, 1)
        smaller = np.clip(feasible.max(axis=0) + margin, 0, 1) - corner
        if smaller.prod() > size.prod() / 2:
            return feasible
        start, size, tried = corner, smaller, samples

"""The part of a box where points may lie, and samples of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_density, check_returned
from cvtimg._shared.types import Array, Bools, Floats, Floats32
from cvtimg.designs.cells import sobol_samples
from cvtimg.designs.factors import Factor

#: The least and the most samples in all.
_FEW_SAMPLES, MANY_SAMPLES = 1 << 14, 1 << 20
#: Where fewer of the samples are feasible, they are spread over a smaller box.
_ENOUGH = 0.1


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
        n = int(np.clip(n, _FEW_SAMPLES, MANY_SAMPLES))
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
        if len(feasible) == 0 and len(tried) < MANY_SAMPLES:
            tried = sobol_samples(MANY_SAMPLES, n_dims, rng)
            continue
        if len(feasible) == 0 or len(feasible) > _ENOUGH * len(tried):
            return feasible
        # There may be more beyond the outermost ones, by about the distance between samples.
        margin = 3 * np.ptp(feasible, axis=0) / len(feasible) + size * len(tried) ** (-1 / n_dims)
        corner = np.clip(feasible.min(axis=0) - margin, 0, 1)
        smaller = np.clip(feasible.max(axis=0) + margin, 0, 1) - corner
        if smaller.prod() > size.prod() / 2:
            return feasible
        start, size, tried = corner, smaller, samples

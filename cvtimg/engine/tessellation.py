"""Centroidal Voronoi tessellations of weighted samples: the engine that everything else in cvtimg stands on.

A tessellation is a CVT when each generator is the center of mass of its own Voronoi cell. Generators that minimise
the energy, the sum of density times squared distance to the nearest generator, form a CVT.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_density,
    check_generators,
    check_locked,
    check_non_negative,
    check_rows,
)
from cvtimg.engine.methods import METHODS, Callback, Conditions, Method, Watch
from cvtimg.engine.methods.lloyd import lloyd
from cvtimg.engine.methods.optimal1d import optimal1d
from cvtimg.engine.methods.transfer import transfer, weighted_energy
from cvtimg.engine.ordering import MAX_ORDERED_DIMS, along_curve
from cvtimg.engine.points import Points, assign, cell_energies, cell_moments, pack
from cvtimg.engine.samples import WeightedSamples
from cvtimg.engine.search import EFFORTS, search
from cvtimg.engine.seeding import SEEDINGS

#: Rows of a table are sorted along a curve, so that near ones are compared with few generators, where there are
#: generators enough to gain by it and not so many rows that sorting costs more.
_MANY_GENERATORS = 40
_FEW_ENOUGH_TO_SORT = 1 << 23


@dataclass(frozen=True, slots=True, eq=False)
class Tessellation:
    """Generators and their Voronoi cells.

    Attributes
    ----------
    generators : (K, D) float64 array
        In the units of the samples.
    labels : (M,) int32 array
        For each sample the index of its nearest generator, the lowest on a tie; with a `volume_power`, of the
        generator that it was transferred to.
    masses : (K,) float64 array
        Sum of the density over each cell.
    energy : float
        Sum of density times squared distance to the own generator.
    weighted_energy : float
        The same with each cell times its share of the mass to the power `volume_power`.
    energies : tuple of float
        The weighted energy before each move of the generators on all samples, and at the end; it never rises.
    n_iter : int
        Steps between these energies.
    converged : bool
        Whether the energy had come to rest when the iteration stopped.

    Notes
    -----
    In scikit-learn's words: generators are ``cluster_centers_``, labels ``labels_``, energy ``inertia_``.
    """

    generators: NDArray[np.float64]
    labels: NDArray[np.int32]
    masses: NDArray[np.float64]
    energy: float
    weighted_energy: float
    energies: tuple[float, ...]
    n_iter: int
    converged: bool

    def __post_init__(self) -> None:
        for array in (self.generators, self.labels, self.masses):
            array.flags.writeable = False


def tessellate(
    samples: WeightedSamples | ArrayLike,
    n_generators: int,
    *,
    density: ArrayLike | None = None,
    method: str | Method | None = None,
    init: str | ArrayLike = "split",
    effort: str = "balanced",
    volume_power: float = 0,
    locked: ArrayLike | None = None,
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
) -> Tessellation:
    """Compute a centroidal Voronoi tessellation.

    Parameters
    ----------
    samples : WeightedSamples or (N, D) array
        Colors of an image with their density, or the rows of any table: uint8, uint16, float32 or float64; other
        integers are converted to float64.
    n_generators : int
        Number of generators K, at most the number of distinct samples.
    density : (N,) array, optional
        Weights >= 0 for the rows of a table, 1 each by default. WeightedSamples have a density of their own.
    method : {"lloyd", "transfer", "macqueen", "probabilistic", "optimal1d"} or Method, optional
        How generators move: by default "transfer" if `volume_power` is not 0, else "optimal1d", the global optimum,
        for samples of one dimension if neither `locked` nor initial generators are given, else "lloyd".
    init : {"split", "k-means++", "maximin", "random"} or (K, D) array
        Initial generators. "split" and "maximin" draw nothing. From given generators the iteration starts as they
        are, without a search.
    effort : {"fast", "balanced", "best"}
        Each level first searches over fewer points: neighbouring colors of an image taken together, or a part of
        the rows of a table. "fast" then moves the generators at most 4 times. "balanced" breathes in that search,
        which leaves most local minima, and then moves until that lowers the energy by 1e-4 of it or less: up to
        twice the time of "fast". "best" searches up to 12 times (4 from K = 128 on), until three searches end alike,
        breathes longer, and moves until 1e-6: 2 to 10 times the time of "balanced" on photographs, for an energy some
        tenths of a percent lower.
    volume_power : float
        Power p >= 0 of the volume in the weighted energy, the sum of (mass of the cell / mass of all)^p times the
        energy of the cell. With 0 all cells are equal; with 1 or 2 a heavy cell counts for more, so that rare
        colors lose generators to frequent ones. Only the method "transfer" takes another value than 0.
    locked : (L, D) array, optional
        Generators that stay in place: the first L of the K. Those of `init`, if given, come after them.
    rng : int or numpy.random.Generator
        Seed of what is drawn. The same seed gives the same result, bit by bit, whatever the number of threads.
    callback : callable, optional
        Called before each step with its number and the energy; it stops the computation by returning True, and
        the best generators so far are the result. In the search the energy is that of fewer points.

    Returns
    -------
    Tessellation

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here; the message names it.

    References
    ----------
    Q. Du, V. Faber, M. Gunzburger, SIAM Review 41 (1999) 637-676, doi 10.1137/S0036144599352836.

    Examples
    --------
    >>> from cvtimg import tessellate
    >>> result = tessellate([[0, 0], [0, 2], [9, 0], [9, 2]], 2)
    >>> result.generators.tolist(), result.labels.tolist(), result.energy
    ([[0.0, 1.0], [9.0, 1.0]], [0, 0, 1, 1], 4.0)
    """
    settings = EFFORTS[check_choice("effort", effort, EFFORTS)]
    points, order = _points(samples, density, n_generators)
    fixed = points.frame.inward(check_locked(locked, n_generators, points.n_dims))
    power = check_non_negative("volume_power", volume_power)
    move = _method(method, power, exact=points.n_dims == 1 and isinstance(init, str) and not len(fixed))
    watch = Watch(callback, points.frame.energy)
    conditions = Conditions(settings.stopping, np.random.default_rng(rng), len(fixed), power, watch)
    if isinstance(init, str):
        check_choice("init", init, SEEDINGS)
        if move is optimal1d:
            initial = np.zeros((n_generators, points.n_dims))  # it takes no account of them
        else:
            initial = search(points, fixed, n_generators, init, move, settings, conditions)
    else:
        free = check_generators("init", init, n_generators - len(fixed), points.n_dims)
        initial = np.concatenate([fixed, points.frame.inward(free)])
    end = move(points, initial, conditions)
    labels = assign(points, end.generators) if end.labels is None else end.labels
    masses, _ = cell_moments(points, labels, n_generators)
    parts = cell_energies(points, end.generators, labels)
    return Tessellation(
        generators=points.frame.outward(end.generators),
        labels=_given_order(labels[: points.n_points], order),
        masses=masses,
        energy=points.frame.energy(parts.sum()),
        weighted_energy=points.frame.energy(weighted_energy(masses, parts, power)),
        energies=tuple(points.frame.energy(energy) for energy in end.energies),
        n_iter=len(end.energies) - 1,
        converged=end.converged,
    )


def _points(
    samples: WeightedSamples | ArrayLike, density: ArrayLike | None, n_generators: int
) -> tuple[Points, NDArray[np.intp] | None]:
    """Pack samples, checking that there are enough; also the order in which they were taken, if not as given."""
    if not isinstance(samples, WeightedSamples):
        rows = check_rows("samples", samples)
        weights = check_density(density, len(rows))
        check_count("n_generators", n_generators, len(rows), "the number of samples")
        sortable = rows.shape[1] <= MAX_ORDERED_DIMS and len(rows) <= _FEW_ENOUGH_TO_SORT
        if not sortable or n_generators < _MANY_GENERATORS:
            return pack(rows, weights), None
        order = along_curve(rows)
        return pack(rows[order], weights[order], in_order=True), order
    if density is not None:
        raise ValueError("density must not be given with weighted samples, which have one of their own")
    check_count("n_generators", n_generators, samples.n_samples, "the number of distinct samples")
    return pack(samples.rows, samples.density, in_order=samples.in_order), None


def _given_order(labels: NDArray[np.int32], order: NDArray[np.intp] | None) -> NDArray[np.int32]:
    given = labels.copy()
    if order is not None:
        given[order] = labels
    return given


def _method(method: str | Method | None, volume_power: float, exact: bool) -> Method:
    if method is None and volume_power:
        return transfer
    if method is None:
        return optimal1d if exact else lloyd
    if volume_power and method not in ("transfer", transfer):
        raise ValueError(f"volume_power={volume_power} needs method='transfer', not {method!r}")
    return METHODS[check_choice("method", method, METHODS)] if isinstance(method, str) else method

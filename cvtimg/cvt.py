"""Centroidal Voronoi tessellations of weighted samples: the engine that everything else in cvtimg stands on.

A tessellation is a CVT when each generator is the center of mass of its own Voronoi cell. Generators that minimise
the energy, the sum of density times squared distance to the nearest generator, form a CVT.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._checks import check_choice, check_count, check_density, check_generators, check_locked, check_rows
from cvtimg.methods import METHODS, Callback, Conditions, Iteration, Method, Stopping, Watch
from cvtimg.methods.breathing import breathe
from cvtimg.points import Points, assign, cell_energies, cell_moments, coarsen, pack, thin
from cvtimg.samples import ColorSamples
from cvtimg.seeding import SEEDINGS


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to look for a low energy.

    Attributes
    ----------
    n_starts : int
        Searches on coarsened samples, each from seeds of its own; the one that ends lowest is followed.
    breath : float
        Share of the generators that come and go at first when such a search breathes, or 0 if it does not.
    last_breath : float
        The same on all samples, when the descent has come to rest.
    stopping : Stopping
        When that is.
    """

    n_starts: int
    breath: float
    last_breath: float
    stopping: Stopping


#: The registry: names for `effort` and ``--effort``; `tessellate` says what each costs.
EFFORTS: dict[str, Effort] = {
    "fast": Effort(1, 0, 0, Stopping(tolerance=1e-2, max_iterations=4)),
    "balanced": Effort(1, 1 / 4, 0, Stopping(tolerance=1e-4, max_iterations=300)),
    "best": Effort(8, 1 / 2, 1 / 4, Stopping(tolerance=1e-6, max_iterations=1000)),
}

_SEARCHING = Stopping(tolerance=1e-4, max_iterations=100)
#: A search goes over so many times fewer points, the first of these that leaves so many for each generator.
_COARSER = (8, 4, 2)
_POINTS_PER_GENERATOR = 50


@dataclass(frozen=True, slots=True, eq=False)
class Tessellation:
    """Generators and their Voronoi cells.

    Attributes
    ----------
    generators : (K, D) float64 array
        In the units of the samples.
    labels : (M,) int32 array
        For each sample the index of its nearest generator, the lowest on a tie.
    masses : (K,) float64 array
        Sum of the density over each cell.
    energy : float
        Sum of density times squared distance to the nearest generator.
    energies : tuple of float
        The energy before each move of the generators, after each breath, and at the end; it never rises.
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
    energies: tuple[float, ...]
    n_iter: int
    converged: bool

    def __post_init__(self) -> None:
        for array in (self.generators, self.labels, self.masses):
            array.flags.writeable = False


def tessellate(
    samples: ColorSamples | ArrayLike,
    n_generators: int,
    *,
    density: ArrayLike | None = None,
    method: str = "lloyd",
    init: str | ArrayLike = "split",
    effort: str = "balanced",
    locked: ArrayLike | None = None,
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
) -> Tessellation:
    """Compute a centroidal Voronoi tessellation.

    Parameters
    ----------
    samples : ColorSamples or (N, D) array
        Colors of an image with their density, or the rows of any table: uint8, uint16, float32 or float64; other
        integers are converted to float64.
    n_generators : int
        Number of generators K, at most the number of distinct samples.
    density : (N,) array, optional
        Weights >= 0 for the rows of a table, 1 each by default. ColorSamples have a density of their own.
    method : {"lloyd"}
        How generators move.
    init : {"split", "k-means++", "maximin", "random"} or (K, D) array
        Initial generators. "split" and "maximin" draw nothing. From given generators the iteration starts as they
        are, without a search.
    effort : {"fast", "balanced", "best"}
        Each level first searches over fewer points: neighbouring colors of an image taken together, or a part of
        the rows of a table. "fast" then moves the generators at most 4 times. "balanced" breathes in that search,
        which leaves most local minima, and then moves until that lowers the energy by 1e-4 of it or less: about
        twice the time of "fast". "best" searches 8 times and breathes over all samples at the end: about ten
        times the time of "balanced", for an energy some tenths of a percent lower.
    locked : (L, D) array, optional
        Generators that stay in place: the first L of the K. Those of `init`, if given, come after them.
    rng : int or numpy.random.Generator
        Seed of what is drawn. The same seed gives the same result, bit by bit, whatever the number of threads.
    callback : callable, optional
        Called before each step with its number and the energy (of fewer points, in the search); it stops the
        computation by returning True, and the best generators so far are the result.

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
    check_choice("method", method, METHODS)
    settings = EFFORTS[check_choice("effort", effort, EFFORTS)]
    if isinstance(samples, ColorSamples):
        if density is not None:
            raise ValueError("density must not be given with ColorSamples, which have one of their own")
        rows, weights = samples.colors, samples.density
        check_count("n_generators", n_generators, len(rows), "the number of distinct colors")
    else:
        rows = check_rows("samples", samples)
        weights = check_density(density, len(rows))
        check_count("n_generators", n_generators, len(rows), "the number of samples")
    points = pack(rows, weights, in_order=isinstance(samples, ColorSamples) and samples.in_order)
    fixed = check_locked(locked, n_generators, points.n_dims) - points.center
    conditions = Conditions(settings.stopping, np.random.default_rng(rng), len(fixed), watch=Watch(callback))
    if isinstance(init, str):
        check_choice("init", init, SEEDINGS)
        initial = _search(points, fixed, n_generators, init, METHODS[method], settings, conditions)
    else:
        free = check_generators("init", init, n_generators - len(fixed), points.n_dims) - points.center
        initial = np.concatenate([fixed, free])
    end = _descend(points, initial, METHODS[method], conditions, settings.last_breath)
    labels = assign(points, end.generators)
    masses, _ = cell_moments(points, labels, n_generators)
    return Tessellation(
        generators=end.generators + points.center,
        labels=labels[: points.n_points].copy(),
        masses=masses,
        energy=float(cell_energies(points, end.generators, labels).sum()),
        energies=tuple(end.energies),
        n_iter=len(end.energies) - 1,
        converged=end.converged,
    )


def _search(
    points: Points,
    fixed: NDArray[np.float64],
    n_generators: int,
    init: str,
    method: Method,
    effort: Effort,
    conditions: Conditions,
) -> NDArray[np.float64]:
    """Return the generators, the fixed ones first, at the best end of some searches over fewer points."""
    fewer = points
    for factor in _COARSER:
        if points.n_points >= factor * _POINTS_PER_GENERATOR * n_generators:
            fewer = coarsen(points, factor) if points.in_order else thin(points, factor, conditions.rng)
            break
    ends = []
    for start in range(effort.n_starts):
        # Seeds that draw nothing serve once.
        seeding = SEEDINGS[init if start == 0 else "k-means++"]
        seeds = seeding(fewer, n_generators - len(fixed), conditions.rng)
        initial = np.concatenate([fixed, seeds])
        ends.append(_descend(fewer, initial, method, conditions.until(_SEARCHING), effort.breath))
        if conditions.watch.stopped:
            break
    return min(ends, key=lambda end: end.energies[-1]).generators


def _descend(
    points: Points, generators: NDArray[np.float64], method: Method, conditions: Conditions, breath: float
) -> Iteration:
    if not breath:
        return method(points, generators, conditions)
    return breathe(points, generators, method, conditions, max(1, int(breath * len(generators))))

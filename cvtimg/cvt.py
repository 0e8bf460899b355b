"""Centroidal Voronoi tessellations of weighted samples: the engine that everything else in cvtimg stands on.

A tessellation is a CVT when each generator is the center of mass of its own Voronoi cell. Generators that minimise
the energy, the sum of density times squared distance to the nearest generator, form a CVT.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._checks import check_choice, check_count, check_density, check_generators, check_rows
from cvtimg.methods import METHODS, Stopping
from cvtimg.points import Points, assign, cell_energies, cell_moments, pack
from cvtimg.samples import ColorSamples
from cvtimg.seeding import SEEDINGS

#: How far the iteration goes, by name: see `tessellate` for what each costs.
EFFORTS: dict[str, Stopping] = {
    "fast": Stopping(tolerance=1e-2, max_iterations=4),
    "balanced": Stopping(tolerance=1e-4, max_iterations=300),
    "best": Stopping(tolerance=1e-7, max_iterations=3000),
}


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
        The energy before each move of the generators, and at the end; it never rises.
    n_iter : int
        Moves of the generators.
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
    rng: int | np.random.Generator = 0,
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
        Initial generators. "split" and "maximin" draw nothing.
    effort : {"fast", "balanced", "best"}
        "fast": at most 4 moves. "balanced": until a move lowers the energy by 1e-4 of it or less, typically 10 to
        60 moves. "best": until it lowers it by 1e-7 or less.
    rng : int or numpy.random.Generator
        Seed of what is drawn. The same seed gives the same result, bit by bit, whatever the number of threads.

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
    stopping = EFFORTS[check_choice("effort", effort, EFFORTS)]
    if isinstance(samples, ColorSamples):
        if density is not None:
            raise ValueError("density must not be given with ColorSamples, which have one of their own")
        rows, weights = samples.colors, samples.density
        check_count("n_generators", n_generators, len(rows), "the number of distinct colors")
    else:
        rows = check_rows("samples", samples)
        weights = check_density(density, len(rows))
        check_count("n_generators", n_generators, len(rows), "the number of samples")
    points = pack(rows, weights)
    initial = _initial_generators(points, n_generators, init, np.random.default_rng(rng))
    end = METHODS[method](points, initial, stopping)
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


def _initial_generators(
    points: Points, n_generators: int, init: str | ArrayLike, rng: np.random.Generator
) -> NDArray[np.float64]:
    if isinstance(init, str):
        return SEEDINGS[check_choice("init", init, SEEDINGS)](points, n_generators, rng)
    return check_generators("init", init, n_generators, points.n_dims) - points.center

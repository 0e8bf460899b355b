"""Centroidal Voronoi tessellations of weighted samples.

A tessellation is a CVT when each generator is the center of mass of its own Voronoi cell. Generators that minimize
the energy, the sum of density times squared distance to the nearest generator, form a CVT.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import SAMPLES_OF_FIGURE
from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_density,
    check_generators,
    check_locked,
    check_needs,
    check_non_negative,
    check_rows,
    check_that,
    raise_unsupported,
)
from cvtimg._shared.choices import EffortName, InitName, MethodName
from cvtimg._shared.progress import part
from cvtimg._shared.records import PROVING, Claims, ReadOnly, equals, never_rises, prove
from cvtimg._shared.types import Array, Floats, Indices, Ints
from cvtimg.blocks.rows import Blocks, as_blocks, is_blocked
from cvtimg.engine.methods import Callback, Conditions, Iterate, Iteration, Watch, choose_method
from cvtimg.engine.methods.transfer import weighted_energy
from cvtimg.engine.points import (
    LOSS,
    Frame,
    Points,
    RowMoments,
    assign_rows,
    cell_energies,
    cell_moments,
    float32_suffices,
    pack,
)
from cvtimg.engine.samples import Line, WeightedSamples, line_through, pack_in_order
from cvtimg.engine.search import EFFORTS, SEARCHED, SearchEffort, effort_beyond, search
from cvtimg.engine.seeding import SEEDINGS, TooFewSamplesError
from cvtimg.files.whole import StrPath

#: Fraction by which labels of float32 may raise the energy of colors, which one far away does by more; less takes
#: float64, twice as slow, for thousands of colors in spaces of floats, too.
_LOSS_OF_COLORS = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Tessellation(ReadOnly):
    """Generators and their Voronoi cells.

    Attributes
    ----------
    generators : (K, D) float64 array
        In the units of the samples.
    labels : (M,) int32 array
        Index of the nearest generator of each sample, the lowest on a tie; with a `volume_power`, of the generator
        that the sample was transferred to. For samples in blocks a Dask array, computed when it is needed.
    masses : (K,) float64 array
        Sum of the density over each cell.
    energy : float
        Sum of density times squared distance to the own generator, in float64, whatever the range of the samples.
    weighted_energy : float
        The same, with each cell weighted by its fraction of the mass to the power `volume_power`.
    energies : tuple of float
        Weighted energy before each move of the generators on all samples, and at the end; it never rises.
    n_iter : int
        Number of steps between these energies.
    converged : bool
        Whether the energy had converged when the iteration stopped.

    Notes
    -----
    scikit-learn calls the generators ``cluster_centers_``, the labels ``labels_`` and the energy ``inertia_``.
    """

    generators: Floats
    labels: Ints
    masses: Floats
    energy: float
    weighted_energy: float
    energies: tuple[float, ...]
    n_iter: int
    converged: bool

    def _claims(self) -> Claims:
        yield "masses and generators are as long", len(self.masses) == len(self.generators)
        yield "energies never rise", never_rises(self.energies)
        if isinstance(self.labels, np.ndarray):
            yield "labels are those of generators", (self.labels >= 0) & (self.labels < len(self.generators))

    def __repr__(self) -> str:
        """Tell size, energy and convergence in one line."""
        n_generators, n_dims = self.generators.shape
        ended = "converged" if self.converged else "not converged"
        size = f"{len(self.labels)} samples, {n_generators} generators, D={n_dims}"
        return f"Tessellation({size}, energy={self.energy:.6g}, {ended} after {self.n_iter} steps)"


def tessellate(
    samples: WeightedSamples | Blocks | ArrayLike,
    n_generators: int,
    *,
    density: ArrayLike | None = None,
    method: MethodName | Iterate | None = None,
    init: InitName | ArrayLike = "split",
    effort: EffortName = "balanced",
    volume_power: float = 0,
    locked: ArrayLike | None = None,
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
    checkpoint: StrPath | None = None,
) -> Tessellation:
    """Compute a centroidal Voronoi tessellation.

    Parameters
    ----------
    samples : WeightedSamples or (N, D) array
        Colors of an image with their density, or the rows of a table: any integer or floating point type. Dask and
        zarr arrays, and files from `cvtimg.blocks.open_blocks`, are never loaded as a whole: see Notes.
    n_generators : int
        Number of generators K, at most the number of distinct samples.
    density : (N,) array, optional
        Weights >= 0 of the rows of a table, 1 by default. Weighted samples carry their own.
    method : {"lloyd", "transfer", "macqueen", "probabilistic", "optimal1d"} or Method, optional
        How generators move. By default "transfer" if `volume_power` is not 0; otherwise "optimal1d", the global
        optimum, for samples of one dimension, or on a line, if neither `locked` nor initial generators are given;
        otherwise "lloyd".
    init : {"split", "k-means++", "random"} or (K, D) array
        Initial generators. "split" is deterministic. From an array the iteration starts without a search.
    effort : {"fast", "balanced", "best"}
        All efforts first search over fewer points: means of neighboring colors, or some of the rows of a table. "fast"
        then moves the generators at most 4 times. "balanced" leaves most local minima in the search, and then moves
        until a pass lowers the energy by at most 1e-4 of it. "best" searches longer, and moves until 1e-6: on
        photographs 2 to 10 times the time of "balanced", for an energy a few tenths of a percent lower. Of tables
        "balanced" and "best" cross tessellations with each other, of all rows up to 32,768, or 100 K if that is more,
        and otherwise of some, among which are those that are far away.
    volume_power : float
        Power p >= 0 in the weighted energy, the sum over the cells of (mass of the cell / total mass)^p times the
        energy of the cell. With 0 all cells count the same; with 1 or 2 a heavy cell counts more, so that rare colors
        lose generators to frequent ones. Only the method "transfer" takes values other than 0.
    locked : (L, D) array, optional
        Generators that stay in place: the first L of the K. Those of `init`, if given, come after them.
    rng : int or numpy.random.Generator
        Seed of all random numbers. The same seed gives the same result, bit for bit, with any number of threads.
    callback : callable, optional
        Called before each step with its number and the energy. It stops the computation by returning True; the result
        then has the best generators so far. During the search the energy is that of the fewer points.
    checkpoint : path, optional
        For samples in blocks: a file in which the generators are saved before every pass. If it exists, the
        computation goes on from there, and ends with the same bits as if it had never stopped.

    Returns
    -------
    Tessellation

    Raises
    ------
    ConnectionError
        If the Dask cluster was lost.

    Notes
    -----
    Of samples in blocks, about a million rows are drawn for the search, which is as long as that of "best" if there are
    many more rows. Lloyd's method then descends over all blocks, on the Dask cluster or scheduler that is current.
    `energy` and `masses` are those of all samples. The same blocks give the same result, bit for bit, with any number
    of workers.

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
    allowed = f"be one of {', '.join(SEEDINGS)} or (K, D) generators, such as a callable returns"
    check_that("init", not callable(init), allowed)
    power = check_non_negative("volume_power", volume_power)
    watch = Watch(callback)
    n_generators = n_generators.item() if isinstance(n_generators, np.integer) else n_generators  # of few bits
    asked = _Asked(n_generators, method, init, settings, power, locked, np.random.default_rng(rng), watch)
    if is_blocked(samples):
        return _tessellate_blocks(as_blocks(samples, density), asked, effort, checkpoint)
    check_needs("checkpoint", checkpoint is not None, "samples in blocks", False)
    if isinstance(samples, WeightedSamples):
        check_that("density", density is None, "not be given with weighted samples")
        check_count("n_generators", n_generators, samples.n_samples, "the number of distinct samples")
        if asked.is_free and (line := line_through(samples.rows)) is not None:
            return _tessellate_line(line, samples.density, asked)
        if type(samples) is not WeightedSamples:
            return _tessellate_colors(samples, asked)
        return _tessellate_rows(samples.rows, samples.density, asked, in_order=samples.in_order)
    rows = check_rows("samples", cast("ArrayLike", samples))
    weights = check_density(density, len(rows))
    check_count("n_generators", n_generators, len(rows), "the number of samples")
    if asked.is_free and (line := line_through(rows)) is not None:
        return _tessellate_line(line, weights, asked)
    return _tessellate_rows(rows, weights, asked)


def _tessellate_line(line: Line, weights: Floats, asked: _Asked) -> Tessellation:
    """Tessellate rows on a line by their places along it: as exactly as one column."""
    along = _tessellate_rows(line.places[:, None], weights, asked._replace(locked=None))
    scale = float((line.direction**2).sum())
    return replace(
        along,
        generators=line.origin + line.direction * along.generators,
        energy=scale * along.energy,
        weighted_energy=scale * along.weighted_energy,
        energies=tuple(scale * energy for energy in along.energies),
    )


def _tessellate_colors(samples: WeightedSamples, asked: _Asked) -> Tessellation:
    """Tessellate colors in float32, or as rows where it cannot hold those near each other beside one far away."""
    asked_of_colors = asked._replace(effort=replace(asked.effort, evolution=None))
    points = pack(samples.rows, samples.density, in_order=samples.in_order)
    try:
        end, _, _ = _descended(points, asked_of_colors)
    except TooFewSamplesError:  # that differ in float32
        return _tessellate_rows(samples.rows, samples.density, asked_of_colors, in_order=samples.in_order)
    labels = end.labels_of(points)
    masses, sums = cell_moments(points, labels, asked.n_generators)
    parts = cell_energies(points, end.generators, labels)
    moments = RowMoments(masses, sums, parts / points.frame.scale / points.frame.scale)
    places = points.frame.outward(end.generators)
    result = _result(end, places, labels[: points.n_points], moments, asked.volume_power, points.frame)
    is_short = samples.rows.dtype in (np.uint8, np.uint16)  # whose values and differences float32 holds
    if not (is_short or asked.watch.stopped or float32_suffices(points, float(parts.sum()), _LOSS_OF_COLORS)):
        return _tessellate_rows(samples.rows, samples.density, asked_of_colors, in_order=samples.in_order)
    return proven(result, samples.rows, samples.density, asked.to_nearest)


def _tessellate_rows(rows: Array, weights: Floats, asked: _Asked, *, in_order: bool = False) -> Tessellation:
    """Tessellate (N, D) rows: in float32, and again in float64 where that was too coarse; one column always in that."""
    exact = rows.shape[1] == 1
    while True:
        points, order = pack_in_order(rows, weights, asked.n_generators, in_order=in_order, exact=exact)
        try:
            result = _measured(rows, weights, points, order, asked)
        except TooFewSamplesError:  # that differ in float32
            if exact:
                raise
        else:
            energy = result.energy * points.frame.scale * points.frame.scale
            if exact or asked.watch.stopped or float32_suffices(points, energy):
                return proven(result, rows, weights, asked.to_nearest)
        exact = True


def _descended(points: Points, asked: _Asked) -> tuple[Iteration, Floats, bool]:
    """Move generators from the end of a search, or from given ones; return those locked and if labels are kept too."""
    locked = check_locked(asked.locked, asked.n_generators, points.n_dims)
    fixed, n, power = points.frame.inward(locked), asked.n_generators, asked.volume_power
    told: dict[str, Any] = {"volume_power": power, "n_locked": len(fixed), "has_start": not isinstance(asked.init, str)}
    method = choose_method(asked.method, n_dims=points.n_dims, **told)
    asked.watch.outward = points.frame.energy
    conditions = Conditions(asked.effort.stopping, asked.rng, len(fixed), power, asked.watch)
    if not isinstance(asked.init, str):
        free = check_generators("init", asked.init, n - len(fixed), points.n_dims)
        start = np.concatenate([fixed, points.frame.inward(free)])
    else:
        init, start = check_choice("init", asked.init, SEEDINGS), np.zeros((n, points.n_dims))
        if not method.exact_in_one_dimension:  # of which only the number matters
            with part(0, SEARCHED):
                start = search(points, fixed, n, init, method, conditions, asked.effort)
    with part(SEARCHED, 1):
        return method.iterate(points, start, conditions), locked, bool(power) or method.exact_in_one_dimension


def _measured(rows: Array, weights: Floats, points: Points, order: Indices | None, asked: _Asked) -> Tessellation:
    """Descend with packed rows, and measure the end on the rows themselves, in float64."""
    end, locked, is_labeled = _descended(points, asked)
    frame, n_locked = points.frame, len(locked)
    places = frame.outward(end.generators)
    places[:n_locked] = locked
    if is_labeled:
        labels = np.empty(points.n_points, np.int32)
        labels[slice(None) if order is None else order] = end.labels_of(points)[: points.n_points]
    else:
        labels = assign_rows(rows, places, points, order)
    moments = RowMoments.of(rows, weights, places, labels)
    # A generator that is the mean of its cell but for rounding is made the mean.
    moves = moments.to_means(places, frame, exact=points.exact)
    moves[:n_locked] = 0
    places += moves
    return _result(end, places, labels, moments.about(places, moves), asked.volume_power, frame)


class _Asked(NamedTuple):
    """Arguments of `tessellate` for samples of any kind."""

    n_generators: int
    method: MethodName | Iterate | None
    init: InitName | ArrayLike
    effort: SearchEffort
    volume_power: float
    locked: ArrayLike | None
    rng: np.random.Generator
    watch: Watch

    @property
    def to_nearest(self) -> bool:
        """Whether rows end with their nearest generators, and not where a method moved them to."""
        return not self.volume_power and (self.method is None or self.method in ("lloyd", "macqueen", "probabilistic"))

    @property
    def is_free(self) -> bool:
        """Whether nothing but the number of generators was asked for."""
        locked = self.locked is not None and np.size(self.locked)
        return self.method is None and isinstance(self.init, str) and not (locked or self.volume_power)


def _tessellate_blocks(blocks: Blocks, asked: _Asked, effort: EffortName, checkpoint: StrPath | None) -> Tessellation:
    from cvtimg.engine.block_descent import Checkpoint, descend, label_blocks, sample_rows, survey

    if asked.method not in (None, "lloyd"):  # only sums over cells are known
        raise_unsupported("method", asked.method, "samples in blocks", ["'lloyd'"])
    if asked.volume_power:
        raise_unsupported("volume_power", asked.volume_power, "samples in blocks", ["0"])
    locked = check_locked(asked.locked, asked.n_generators, blocks.n_dims)
    surveyed = survey(blocks, asked.n_generators, asked.rng)
    rows, weights = sample_rows(blocks, surveyed, asked.n_generators)
    options = asked.n_generators, effort, np.asarray(asked.init).tolist(), locked.tolist()
    kept = Checkpoint(checkpoint, surveyed.fingerprint(*options, asked.rng.bit_generator.state))
    state = kept.load()
    if state is None and isinstance(asked.init, str):
        beyond = asked._replace(effort=effort_beyond(asked.effort, int(surveyed.lengths.sum()), len(surveyed.rows)))
        state = _tessellate_rows(rows, weights, beyond).generators, []
    elif state is None:  # from given generators the descent starts at once
        free = check_generators("init", asked.init, asked.n_generators - len(locked), blocks.n_dims)
        state = np.concatenate([locked, free]), []
    asked.watch.outward = float
    conditions = Conditions(asked.effort.stopping, asked.rng, len(locked), watch=asked.watch)
    end, moments = descend(blocks, surveyed.frame, (rows, weights), *state, conditions, kept)
    labels = label_blocks(blocks, surveyed.lengths, end.generators, surveyed.frame)
    return _result(end, end.generators, labels, moments, 0.0, Frame(locked, 1.0))


def _result(
    end: Iteration, places: Floats, labels: Any, moments: RowMoments, volume_power: float, frame: Frame
) -> Tessellation:
    """Return the end of an iteration in a frame, with what was measured at the end."""
    weighted = weighted_energy(moments.masses, moments.energies, volume_power)
    return Tessellation(
        generators=places,
        labels=labels,
        masses=moments.masses,
        energy=float(moments.energies.sum()),
        weighted_energy=weighted,
        # Those before may be of rounded samples.
        energies=(*(max(frame.energy(before), weighted) for before in end.energies[:-1]), weighted),
        n_iter=len(end.energies) - 1,
        converged=end.converged,
    )


def proven(result: Tessellation, rows: Array, density: Floats, nearest: bool) -> Tessellation:
    """Return a tessellation of (N, D) rows, which is checked if that is asked for; labels if they are the nearest."""
    if PROVING:
        prove("Tessellation", _claims(result, rows, density, nearest))
    return result


def _claims(result: Tessellation, rows: Array, density: Floats, nearest: bool) -> Claims:
    labels, generators = result.labels, result.generators
    yield "masses are sums of the density", equals(result.masses, np.bincount(labels, density, len(generators)))
    blocks = [slice(start, start + SAMPLES_OF_FIGURE) for start in range(0, len(rows), SAMPLES_OF_FIGURE)]
    squares = np.concatenate([np.square(rows[block] - generators[labels[block]]).sum(axis=1) for block in blocks])
    rounded = float(np.square(np.finfo(np.float32).eps * np.abs(rows).max()))  # of generators that are found in float32
    energy, rounding = float(density @ squares), rounded * float(density.sum())
    yield "the energy is that of the labels", abs(result.energy - energy) <= LOSS * energy + rounding
    if nearest:
        some = slice(None, None, -(-len(rows) // SAMPLES_OF_FIGURE))
        least = np.full(len(squares[some]), np.inf)
        for generator in generators:
            np.minimum(least, np.square(rows[some] - generator).sum(axis=1), out=least)
        # Distances of float32 have the digits of those from the middle.
        middle = np.square(rows[some] - generators.mean(axis=0)).sum(axis=1)
        yield "rows have their nearest generators", squares[some] <= least + LOSS * (least + middle) + rounded

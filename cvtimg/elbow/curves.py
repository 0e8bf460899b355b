"""Energy curves: how many generators are worth their number.

E(k), the lowest energy of k generators, falls with k. Up to the number of colors that an image really has, each further
generator removes much of the energy; from there on it removes only some of the noise. The curve bends, and the rules
in `cvtimg.elbow.rules` say where.
"""

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_density,
    check_non_negative,
    check_rows,
    raise_unsupported,
)
from cvtimg._shared.choices import EffortName, Row, SpaceName
from cvtimg._shared.notebooks import drawn
from cvtimg._shared.pixels import array_of, white_among
from cvtimg._shared.records import Claims, ReadOnly, never_rises
from cvtimg._shared.types import Floats, ImageLike
from cvtimg.colors.places import to_places
from cvtimg.colors.samples import ColorSamples, color_samples
from cvtimg.elbow.rules import CHORD_ENDS, RULES, TARGETED, Scale, TargetMissedError, explained, judged
from cvtimg.engine.methods import Callback, Conditions, Iteration, Watch, choose_method
from cvtimg.engine.points import Points, float32_suffices, pack
from cvtimg.engine.samples import MAX_ORDERED_DIMS, WeightedSamples, along_curve, line_through
from cvtimg.engine.search import EFFORTS
from cvtimg.engine.tessellation import tessellate

#: Rows of which the gap statistic is, tables of reference, and standard errors by which clusters must be beyond these:
#: with the one of the paper 18 of 480 clouds without clusters were, with three 4; iris and the like are 8 and more.
_GAP_ROWS, _REFERENCES, _ERRORS = 2000, 8, 3


@dataclass(frozen=True, slots=True, eq=False)
class EnergyCurve(ReadOnly):
    """Energies of tessellations with 1 to n_max generators, which never increase.

    Attributes
    ----------
    energies : (n_max,) float64 array
        Sum of density times squared distance to the nearest generator, in squared units of the samples or of the
        color space; with a `volume_power`, the weighted energy of `Tessellation`. The curve ends early, with 0, at the
        number of distinct samples.
    generators : tuple of (k, D) float64 arrays
        The generators with these energies, in the units of the samples or in the color space.
    scale : Scale
        The scale against which the rules measure energies.
    is_continuum : bool
        Whether these are rows of a table that have no elbow: of one cluster, or of a continuum.
    """

    energies: Floats
    generators: tuple[Floats, ...]
    scale: Scale = field(repr=False)
    is_continuum: bool = False

    def _claims(self) -> Claims:
        yield "energies never rise", never_rises(self.energies)
        yield "at most k generators have the k-th energy", [len(of) <= k for k, of in enumerate(self.generators, 1)]

    def __repr__(self) -> str:
        """Tell the range of the curve and its elbow in one line."""
        first, last = self.energies[0], self.energies[-1]
        return f"EnergyCurve(k=1..{self.n_max}, energy {first:.6g}..{last:.6g}, {self.verdict})"

    def _repr_png_(self) -> bytes | None:
        points = np.stack([np.arange(1, self.n_max + 1), self.energies], axis=1)
        return drawn(repr(self), points, is_place=False)

    @property
    def n_max(self) -> int:
        """The largest number of generators."""
        return len(self.energies)

    @property
    def is_clear(self) -> bool:
        """Whether the curve bends enough at its elbow for the number of clusters or colors to be beyond doubt."""
        return not self.is_continuum and judged(self.energies, self.scale)[1]

    @property
    def verdict(self) -> str:
        """What is to be said of the elbow, in a few words."""
        if self.is_continuum:
            return "no elbow: one cluster or a continuum"
        return f"elbow at k={self.elbow()}" + ("" if self.is_clear else ", not clear")

    @property
    def explained(self) -> Floats:
        """(n_max,) fraction of the variance that k generators explain, 1 - E(k) / E(1)."""
        return explained(self.energies)

    @property
    def psnr(self) -> Floats | None:
        """(n_max,) PSNR in dB, infinite where exact; None for tables, other color spaces and weighted energies."""
        return None if self.scale.peak is None else self.scale.psnr(self.energies)

    def elbow(self, rule: str = "chord", target: float | None = None) -> int:
        """Pick the number of generators.

        Parameters
        ----------
        rule : {"chord", "variance", "psnr"}
            "chord": where the curve of log E over log k is farthest below the line between its ends, k = 1 and 32 or
            `n_max`. For a smooth cloud of samples E(k) is proportional to k^(-2/D), a straight line there; the
            distinct colors of an image bend it. Before the logarithm the energy of rounding to 8 bits is added to
            each E (1e-3 of E(1) for tables and other spaces), so that an end with E = 0 does not dominate. Of rows
            without an elbow, `is_continuum`, it is 1. Of images it is always a number; `is_clear` tells what it means.
            "variance" and "psnr": the smallest k that reaches the target.
        target : float, optional
            For "variance" the fraction of the variance to explain, 0.95 by default; for "psnr" dB, 30 by default.

        Returns
        -------
        int
            In 1..n_max; 1 if all samples are equal, and for rows of one cluster or a continuum.

        Raises
        ------
        TargetMissedError
            If no k in 1..n_max reaches the target.

        Examples
        --------
        >>> from cvtimg import energy_curve
        >>> image = np.array([[0, 1, 90, 91, 200, 201]] * 4, np.uint8)
        >>> curve = energy_curve(image, 5)
        >>> curve.energies.round(1).tolist()
        [160539.3, 32406.0, 6.0, 4.0, 2.0]
        >>> curve.elbow(), curve.elbow("variance", 0.75)
        (3, 2)
        """
        judge = RULES[check_choice("rule", rule, RULES)]
        if target is None:
            return 1 if rule == "chord" and self.is_continuum else judge(self.energies, self.scale)
        if rule not in TARGETED:
            raise_unsupported("rule", rule, "a target", TARGETED)
        return judge(self.energies, self.scale, check_non_negative("target", target))

    def elbows(self) -> dict[str, int]:
        """Return the k that each rule picks.

        Rules whose target is missed, that do not apply, or whose package is not installed, are left out.
        """
        picks = {}
        for rule in RULES:
            if rule != "psnr" or self.scale.peak is not None:
                with suppress(TargetMissedError, ImportError):
                    picks[rule] = self.elbow(rule)
        return picks

    def summary(self, rule: str = "chord", target: float | None = None) -> Row:
        """Return the number of generators that a rule picks, and the figures that commands and reports show."""
        k = self.elbow(rule, target)
        decibels = math.inf if self.psnr is None else float(self.psnr[k - 1])
        return {
            "k": k,
            "rule": rule,
            "energy": float(self.energies[k - 1]),
            "explained": float(self.explained[k - 1]),
            "psnr": decibels if math.isfinite(decibels) else None,  # JSON has no infinity
            "elbow": self.elbows(),
            "clear": self.is_clear,
            "verdict": self.verdict,
            "n_max": self.n_max,
            "energies": self.energies.tolist(),
        }


def energy_curve(
    samples: ImageLike | ColorSamples,
    n_max: int = 64,
    *,
    density: ArrayLike | None = None,
    space: SpaceName = "rgb",
    volume_power: float = 0,
    effort: EffortName = "fast",
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
) -> EnergyCurve:
    """Compute the energy of tessellations with 1 to n_max generators, for choosing their number.

    Parameters
    ----------
    samples : image, ColorSamples or (N, D) array
        An image (H, W, C) or a Pillow image, colors with their density, or the rows of a table. An array (H, W) is
        taken for a gray image if it is uint8 or uint16, and for the rows of a table otherwise.
    n_max : int
        Largest number of generators; the curve ends at the number of distinct samples if that is smaller.
    density : (N,) array, optional
        Weights >= 0 of the rows of a table.
    space : {"rgb", "linear", "lab", "oklab"}
        Color space in which distances are measured; see `quantize`.
    volume_power : float
        Weights the cells, as in `tessellate`.
    effort : {"fast", "balanced", "best"}
        "fast" finds each solution from its neighbors: to k = 64, the curve takes the time of two to five calls of
        `tessellate`, and energies can be a percent or two higher than those of such calls. With "balanced" and "best"
        each number is also searched by itself, with that effort, and the better end kept.
    rng : int or numpy.random.Generator
        Seed of all random numbers.
    callback : callable, optional
        As in `tessellate`; the curve ends where it returns True.

    Returns
    -------
    EnergyCurve

    Notes
    -----
    For samples of one dimension every energy is the global minimum, whatever the effort.

    A curve of rows that has no clear bend is compared with that of rows spread evenly over the same box: where two
    clusters save no more than they do there, the rows are one cluster or a continuum. That is the gap statistic of
    R. Tibshirani, G. Walther, T. Hastie, J. R. Statist. Soc. B 63 (2001) 411-423, doi 10.1111/1467-9868.00293.

    Examples
    --------
    >>> from cvtimg import energy_curve
    >>> energy_curve([[0.0, 0.0], [0.0, 2.0], [9.0, 0.0], [9.0, 2.0]], 3).energies.tolist()
    [85.0, 4.0, 2.0]
    """
    n_max = check_count("n_max", n_max, 1 << 16, "the largest number of generators")
    power = check_non_negative("volume_power", volume_power)
    alone = None if check_choice("effort", effort, EFFORTS) == "fast" else EFFORTS[effort]
    generator, watch = np.random.default_rng(rng), Watch(callback)
    weighted, scale, is_table = _weighted(samples, density, space)
    rows, line = weighted.rows, None if power else line_through(weighted.rows)
    rows, squared = (rows, 1.0) if line is None else (line.places[:, None], float((line.direction**2).sum()))
    exact = is_table and rows.shape[1] == 1
    while True:
        points = pack(rows, weighted.density, in_order=weighted.in_order, exact=exact)
        watch.outward = points.frame.energy
        conditions = Conditions(EFFORTS["balanced"].stopping, generator, 0, power, watch)
        most = min(n_max, int(np.count_nonzero(points.density)))
        method = choose_method(n_dims=points.n_dims, volume_power=power)
        if method.exact_in_one_dimension:
            ends = list[Iteration]()
            while len(ends) < most and not (ends and (ends[-1].energies[-1] == 0 or watch.stopped)):
                ends.append(method(points, np.zeros((len(ends) + 1, 1)), conditions))
        else:
            from cvtimg.engine.all_counts import chain

            ends = chain(points, most, method, conditions, alone)
        least = min(end.energies[-1] for end in ends)  # 0 may be of rows that float32 does not tell apart
        if points.exact or not is_table or watch.stopped or float32_suffices(points, least):
            break
        exact = True
    if power:
        scale = Scale(scale.n_values, None)  # weighted energies are not sums over samples
    generators = [points.frame.outward(end.generators) for end in ends]
    curve = EnergyCurve(
        np.array([squared * points.frame.energy(end.energies[-1]) for end in ends]),
        tuple(places if line is None else line.origin + line.direction * places for places in generators),
        scale,
    )
    if is_table and not (power or watch.stopped or curve.is_clear) and curve.n_max > 1:
        inside = 1 < curve.elbow() < min(curve.n_max, CHORD_ENDS)
        return replace(curve, is_continuum=not inside or _is_one_cluster(points, generator))
    return curve


def _is_one_cluster(points: Points, rng: np.random.Generator) -> bool:
    """Tell by the gap statistic whether two clusters save no more energy than of evenly spread rows."""
    share = points.density[: points.n_points] / points.density.sum()
    few = points.n_points <= _GAP_ROWS and np.ptp(share) == 0
    drawn = points.rows() if few else points.rows(rng.choice(len(share), min(len(share), _GAP_ROWS), p=share))
    rows = drawn - drawn.mean(axis=0)
    along = rows @ np.linalg.svd(rows, full_matrices=False)[2].T
    low, high = along.min(axis=0), along.max(axis=0)

    def saved(some: Floats) -> float:
        energy = tessellate(some, 2).energy
        return float(np.log(((some - some.mean(axis=0)) ** 2).sum() / energy)) if energy > 0 else np.inf

    references = np.array([saved(rng.uniform(low, high, along.shape)) for _ in range(_REFERENCES)])
    # The standard error of the mean of references, and of one more.
    error = references.std() * np.sqrt(1 + 1 / _REFERENCES)
    return saved(along) <= references.mean() + _ERRORS * error


def auto_count(samples: ImageLike | ColorSamples, n_max: int = CHORD_ENDS, **options: Any) -> tuple[int, EnergyCurve]:
    """Pick the number of generators by the default rule; also return the `energy_curve` of these arguments.

    Examples
    --------
    >>> from cvtimg.elbow.curves import auto_count
    >>> auto_count(np.array([[3, 3, 90], [200, 90, 3]], np.uint8))[0]
    3
    """
    curve = energy_curve(samples, n_max, **options)
    return curve.elbow(), curve


def _weighted(
    samples: ImageLike | ColorSamples, density: ArrayLike | None, space: SpaceName
) -> tuple[WeightedSamples, Scale, bool]:
    """Return samples of any kind, what their energies are measured against, and whether they are a table."""
    if density is None and (isinstance(samples, ColorSamples) or _is_image(samples)):
        counted = samples if isinstance(samples, ColorSamples) else color_samples(samples)
        n_channels = counted.colors.shape[1]
        plain = space == "rgb" and not counted.alpha
        scale = Scale(float(counted.density.sum() * n_channels), white_among(counted.colors) if plain else None)
        places = to_places(counted.colors, space, counted.alpha)
        return WeightedSamples(places, counted.density, counted.in_order), scale, False
    rows = check_rows("samples", samples)
    weights = check_density(density, len(rows))
    ordered = rows.shape[1] <= MAX_ORDERED_DIMS
    order = along_curve(rows) if ordered else np.arange(len(rows))
    scale = Scale(float(weights.sum() * rows.shape[1]), None)
    return WeightedSamples(rows[order], weights[order], ordered), scale, True


def _is_image(samples: ImageLike | ColorSamples) -> bool:
    array = array_of(samples)
    return array.ndim == 3 or hasattr(samples, "getbands") or (array.dtype.kind == "u" and array.dtype.itemsize <= 2)

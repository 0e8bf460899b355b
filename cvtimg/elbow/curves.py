"""The energy elbow: how many generators are worth their number.

E(k), the least energy of k generators, falls with k. Up to the number of colors that a picture really has each more
generator takes away much of the energy, and from there on only a part of the noise: the curve bends. `elbow_rules`
has the rules that say where.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_count, check_density, check_non_negative, check_rows
from cvtimg.colors.places import has_alpha, to_places
from cvtimg.colors.samples import ColorSamples, color_samples
from cvtimg.colors.spaces import peak
from cvtimg.elbow.rules import CHORD_ENDS, RULES, TARGETED, Scale, explained
from cvtimg.engine.all_counts import chain
from cvtimg.engine.methods import Callback, Conditions, Iteration, Method, Watch, choose_method
from cvtimg.engine.ordering import MAX_ORDERED_DIMS, along_curve
from cvtimg.engine.points import Points, pack
from cvtimg.engine.search import EFFORTS


@dataclass(frozen=True, slots=True, eq=False)
class EnergyCurve:
    """Energies of 1, 2, .. n_max generators, none of them above the one before.

    Attributes
    ----------
    energies : (n_max,) float64 array
        Sum of density times squared distance to the nearest generator, in squared units of the samples, or of the
        color space; with a `volume_power` the weighted energy of `Tessellation`. The curve ends early with 0 where
        there are no more distinct samples.
    generators : tuple of (k, D) float64 arrays
        Those that have this energy, in the units of the samples, or in the color space.
    scale : Scale
        What the rules measure the energies against.
    """

    energies: NDArray[np.float64]
    generators: tuple[NDArray[np.float64], ...]
    scale: Scale = field(repr=False)

    def __post_init__(self) -> None:
        for array in (self.energies, *self.generators):
            array.flags.writeable = False

    @property
    def n_max(self) -> int:
        """The greatest number of generators."""
        return len(self.energies)

    @property
    def explained(self) -> NDArray[np.float64]:
        """(n_max,) share of the variance that k generators explain, 1 - E(k) / E(1)."""
        return explained(self.energies)

    @property
    def psnr(self) -> NDArray[np.float64] | None:
        """(n_max,) PSNR in dB, infinite where exact; None for tables, other color spaces and weighted energies."""
        return None if self.scale.peak is None else self.scale.psnr(self.energies)

    def elbow(self, rule: str = "chord", target: float | None = None) -> int:
        """Pick the number of generators.

        Parameters
        ----------
        rule : {"chord", "chord-linear", "kneedle", "variance", "psnr"}
            "chord": where the curve of log E over log k is farthest below the line between its ends, k = 1 and 32 or
            `n_max`. A smooth cloud of samples has E(k) in proportion to k^(-2/D), a straight line there; the colors
            that a picture is made of bend it. Before the logarithm each E gets what rounding to 8 bits would leave
            (1e-3 of E(1) for tables and other spaces), so that an end where nothing is left does not count for all.
            "chord-linear": the same of E over k, up to `n_max`. "kneedle": of E over k, by the package kneed.
            "variance" and "psnr": the least k that reaches the target, or `n_max` if none does.
        target : float, optional
            For "variance" the share of the variance to explain, 0.95 by default; for "psnr" dB, 30 by default.

        Returns
        -------
        int
            In 1..n_max; 1 where all samples are one color.

        Raises
        ------
        ValueError
            If there is no such rule, or it takes no target, or "psnr" is asked of what has no peak.

        References
        ----------
        V. Satopaa, J. Albrecht, D. Irwin, B. Raghavan, ICDCS Workshops 2011, doi 10.1109/ICDCSW.2011.20 (Kneedle).

        Examples
        --------
        >>> import numpy as np
        >>> from cvtimg import energy_curve
        >>> picture = np.array([[0, 1, 90, 91, 200, 201]] * 4, np.uint8)
        >>> curve = energy_curve(picture, 5)
        >>> curve.energies.round(1).tolist()
        [160539.3, 32406.0, 6.0, 4.0, 2.0]
        >>> curve.elbow(), curve.elbow("variance", 0.75)
        (3, 2)
        """
        judge = RULES[check_choice("rule", rule, RULES)]
        if target is None:
            return judge(self.energies, self.scale)
        if rule not in TARGETED:
            raise ValueError(f"rule={rule!r} takes no target; {' and '.join(TARGETED)} do")
        return judge(self.energies, self.scale, check_non_negative("target", target))

    def elbows(self) -> dict[str, int]:
        """Return the k that each rule picks; "psnr" is left out where there is none."""
        return {rule: self.elbow(rule) for rule in RULES if rule != "psnr" or self.scale.peak is not None}


def energy_curve(
    samples: Any,
    n_max: int = 64,
    *,
    density: ArrayLike | None = None,
    space: str = "rgb",
    volume_power: float = 0,
    effort: str = "fast",
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
) -> EnergyCurve:
    """Compute the energies of 1, 2, .. n_max generators in one pass.

    Parameters
    ----------
    samples : image, ColorSamples or (N, D) array
        An image (H, W, C) or a Pillow image, colors with their density, or the rows of a table. An array (H, W) is
        taken for a grey image if it is of uint8 or uint16, else for the rows of a table.
    n_max : int
        The greatest number; no more than there are distinct samples are looked at.
    density : (N,) array, optional
        Weights >= 0 for the rows of a table.
    space : {"rgb", "linear", "lab", "oklab"}
        Where the colors of an image lie; see `quantize`.
    volume_power : float
        As in `tessellate`: cells count by their volume.
    effort : {"fast", "balanced", "best"}
        "fast" finds each number from one more or one less: all together take about the time of eight calls of
        `tessellate`, and an energy can be a percent or two above that of such a call. With "balanced" and "best"
        each number is searched by itself too, with that effort, and the better end kept.
    rng : int or numpy.random.Generator
        Seed of what is drawn.
    callback : callable, optional
        As in `tessellate`; where it returns True the curve ends.

    Returns
    -------
    EnergyCurve

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here; the message names it.

    Notes
    -----
    For samples of one dimension every energy is the least there is, whatever the effort.

    Examples
    --------
    >>> from cvtimg import energy_curve
    >>> energy_curve([[0.0, 0.0], [0.0, 2.0], [9.0, 0.0], [9.0, 2.0]], 3).energies.tolist()
    [85.0, 4.0, 2.0]
    """
    n_max = check_count("n_max", n_max, 1 << 16, "the largest number of generators")
    power = check_non_negative("volume_power", volume_power)
    alone = None if check_choice("effort", effort, EFFORTS) == "fast" else EFFORTS[effort]
    points, scale = _points(samples, density, space)
    if power:
        scale = Scale(scale.n_values, None)  # weighted energies are not sums over samples
    watch = Watch(callback, points.frame.energy)
    conditions = Conditions(EFFORTS["balanced"].stopping, np.random.default_rng(rng), 0, power, watch)
    n_max = min(n_max, int(np.count_nonzero(points.density)))
    method = choose_method(n_dims=points.n_dims, volume_power=power)
    if method.exact_in_one_dimension:
        ends = _optimal(points, n_max, method, conditions)
    else:
        ends = chain(points, n_max, method, conditions, alone)
    return EnergyCurve(
        np.array([points.frame.energy(end.energies[-1]) for end in ends]),
        tuple(points.frame.outward(end.generators) for end in ends),
        scale,
    )


def auto_count(samples: Any, n_max: int = CHORD_ENDS, **options: Any) -> tuple[int, EnergyCurve]:
    """Pick the number of generators by the default rule, and return the curve that tells why.

    Parameters
    ----------
    samples, n_max, **options
        As in `energy_curve`.

    Returns
    -------
    int, EnergyCurve

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.elbow.curves import auto_count
    >>> auto_count(np.array([[3, 3, 90], [200, 90, 3]], np.uint8))[0]
    3
    """
    curve = energy_curve(samples, n_max, **options)
    return curve.elbow(), curve


def _optimal(points: Points, n_max: int, method: Method, conditions: Conditions) -> list[Iteration]:
    ends: list[Iteration] = []
    while len(ends) < n_max and not (ends and (ends[-1].energies[-1] == 0 or conditions.watch.stopped)):
        ends.append(method(points, np.zeros((len(ends) + 1, 1)), conditions))
    return ends


def _points(samples: Any, density: ArrayLike | None, space: str) -> tuple[Points, Scale]:
    """Pack samples of any kind, and tell what their energies are measured against."""
    if density is None and (isinstance(samples, ColorSamples) or _is_image(samples)):
        counted = samples if isinstance(samples, ColorSamples) else color_samples(samples)
        n_channels = counted.colors.shape[1]
        plain = space == "rgb" and not has_alpha(n_channels)
        scale = Scale(float(counted.density.sum() * n_channels), peak(counted.colors.dtype) if plain else None)
        return pack(to_places(counted.colors, space), counted.density, in_order=counted.in_order), scale
    rows = check_rows("samples", samples)
    weights = check_density(density, len(rows))
    ordered = rows.shape[1] <= MAX_ORDERED_DIMS
    order = along_curve(rows) if ordered else np.arange(len(rows))
    return pack(rows[order], weights[order], in_order=ordered), Scale(float(weights.sum() * rows.shape[1]), None)


def _is_image(samples: Any) -> bool:
    array = np.asarray(samples)
    return array.ndim == 3 or hasattr(samples, "getbands") or array.dtype in (np.uint8, np.uint16)

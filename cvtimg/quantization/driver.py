"""The one way to a quantized image: count its colors, find a palette, map the pixels, wherever they are."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Generic, Literal, Protocol, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import (
    check_alone,
    check_choice,
    check_excluded,
    check_given,
    check_in_range,
    check_needs,
    check_non_negative,
    refuse,
)
from cvtimg._shared.choices import DitherName, EffortName, GoalName, SpaceName
from cvtimg._shared.progress import part
from cvtimg.colors.samples import ColorSamples
from cvtimg.looks.rate import STRENGTH as COMPACT_STRENGTH
from cvtimg.looks.rate import USUAL, CoderName, Rate
from cvtimg.quantization.dithering import STRENGTH
from cvtimg.quantization.looks import MATCHES, MAX_ENTRIES, PRICES
from cvtimg.quantization.palette_search import (
    EngineOptions,
    Palette,
    best_of,
    check_room,
    find_palette,
    fixed_colors,
    ramp_of,
)
from cvtimg.quantization.remapping import MAX_COLORS

#: First number of colors in the search for a target, and the minimum gain in dB from doubling it.
_FIRST_TRIAL = 32
#: Parts of the time until palettes are found, without dithering and with it.
_FOUND = (0.7, 0.2)
#: What is left of a search after each trial, as a guess: how many there will be is not known.
_LEFT = 0.75
_DECIBEL = 2.0
#: Halvings of the range of prices of bits, or of colors; the last saves a few percent of the file.
_HALVINGS = 5


class _HasPsnr(Protocol):
    @property
    def psnr(self) -> float: ...


R_co = TypeVar("R_co", bound=_HasPsnr, covariant=True)
R = TypeVar("R", bound=_HasPsnr)
#: An image, or frames: dataclasses that hold their quality.
S = TypeVar("S", bound=Any)


@dataclass(frozen=True, slots=True)
class QuantizeOptions:
    """Options of `quantize` that are the same for images, frames, files and blocks, by these names."""

    n_colors: int | Literal["auto"] | None = None
    psnr: float | None = None
    palette: ArrayLike | None = None
    locked: ArrayLike | None = None
    color_bits: int | Sequence[int] | None = None
    ramp: bool = False
    space: SpaceName = "rgb"
    dither: DitherName | None = None
    dither_strength: float | None = None
    engine: EngineOptions = field(default_factory=EngineOptions)
    goal: GoalName = "error"
    quality: float | None = None
    price: float = USUAL.price
    coder: CoderName = "deflate"

    def aimed(self) -> QuantizeOptions:
        """Return what the goal and the quality stand for."""
        if check_choice("goal", self.goal, get_args(GoalName)) == "error" and self.quality is None:
            return self
        others = {"n_colors": self.n_colors == "auto", "psnr": self.psnr is not None}
        others |= {"space": self.space not in ("rgb", "oklab"), "ramp": self.ramp}
        for name in (name for name, given in others.items() if given):
            raise ValueError(f"{name}={getattr(self, name)!r} cannot be combined with goal='eyes' or quality")
        if isinstance(self.n_colors, int) and self.n_colors > MAX_ENTRIES:
            refuse("n_colors", self.n_colors, f"at most {MAX_ENTRIES} with goal='eyes' or quality")
        if self.quality is not None:
            check_in_range("quality", self.quality, 0 <= self.quality <= 100, "in 0..100")
            if self.dither not in (None, "compact"):
                raise ValueError(f"dither={self.dither!r} must be 'compact', the default, with quality")
        n_colors = MAX_ENTRIES if self.n_colors is None and self.palette is None else self.n_colors
        return replace(self, n_colors=n_colors, space="oklab", dither=self.dither or "compact", goal="eyes")

    def check(self, **others: object) -> None:
        """Require an aim, and refuse aims and other options that exclude each other."""
        check_needs("ramp", self.ramp, "palette", self.palette is not None)
        no_ramp = {
            "n_colors": self.n_colors,
            "space": self.space != "rgb",
            "dither='compact'": self.dither == "compact",
        }
        check_excluded("ramp", self.ramp, **no_ramp)
        if self.palette is not None:
            if self.n_colors == "auto":
                refuse("n_colors", self.n_colors, "a number with palette")
            found = {"locked": self.locked, "psnr": self.psnr, "color_bits": self.color_bits, **others, **self.engine}
            check_alone("palette", [name for name, value in found.items() if value is not None])
        elif self.psnr is None:
            check_given("n_colors, psnr or palette", self.n_colors)
        else:
            check_non_negative("psnr", self.psnr)
            if self.n_colors == "auto":
                refuse("n_colors", self.n_colors, "a number with psnr")

    @property
    def rate(self) -> Rate:
        """What small files are worth to `dither="compact"`."""
        return Rate(self.price, MATCHES[self.engine.get("effort", "balanced")], self.coder)

    @property
    def strength(self) -> float:
        """Strength of dithering: in full with a given palette, which may need strong mixtures."""
        if self.dither_strength is not None:
            return self.dither_strength
        if self.dither == "compact":
            return COMPACT_STRENGTH
        return STRENGTH if self.palette is None else 1.0


class Source(Protocol[R_co]):
    """Pixels that are counted, and mapped once there is a palette."""

    @property
    def counted(self) -> Sequence[ColorSamples]:
        """The densities that palettes are found for: one for all pixels, or one for each frame."""
        ...

    def mapped(self, palettes: Sequence[Palette], how: QuantizeOptions) -> R_co:
        """Map the pixels to the palettes, one for each of `counted`."""
        ...


class SeenSource(Source[S], Protocol[S]):
    """Pixels whose looks can be measured."""

    def quality(self, result: S) -> float:
        """Return the visual quality of a result."""
        ...


def quantized(source: Source[R], how: QuantizeOptions) -> R:
    """Quantize pixels with a number of colors, a palette, or the fewest colors of a quality."""
    if how.palette is not None or how.psnr is None:
        with part(0, _FOUND[how.dither is not None]):
            palettes = [*map(finder(how), source.counted)]
        return source.mapped(palettes, how)
    results = Search(source, how, lambda result: result.psnr, _DECIBEL).reach(how.psnr, how.n_colors or MAX_COLORS)
    if True not in results:
        best = results[False]
        n_colors = max(len(colors) for colors in palettes_of(best))
        refuse("psnr", how.psnr, f"at most {best.psnr:.2f} dB, which {n_colors} colors reach")
    return results[True]


def finder(how: QuantizeOptions) -> Callable[[ColorSamples], Palette]:
    """Return what finds the palette of samples, or returns the given one."""
    if how.palette is None:
        names = ("n_colors", "space", "locked", "color_bits")
        return partial(find_palette, **{name: getattr(how, name) for name in names}, **how.engine)
    if how.ramp:
        return partial(ramp_of, palette=how.palette)
    if how.n_colors is not None:
        n_colors: Any = how.n_colors
        return partial(best_of, palette=how.palette, n_colors=n_colors, space=how.space)
    colors = np.array(how.palette)
    given = Palette(colors, None, colors.shape[1:] == (4,))
    return lambda samples: given


def for_eyes(source: SeenSource[S], how: QuantizeOptions) -> S:
    """Let bits cost as much as the quality allows, and say what was reached; see `quantize`."""
    result = nearest_quality(source, how)
    if how.quality is not None and result.quality < how.quality:
        n_colors = max(len(colors) for colors in palettes_of(result))
        refuse("quality", how.quality, f"at most {result.quality:.1f}, which {n_colors} colors reach")
    return result


def nearest_quality(source: SeenSource[S], how: QuantizeOptions) -> S:
    """Return the smallest result of a quality, if one is wanted, or else the best."""
    wanted = how.quality
    if wanted is None:
        result = quantized(source, how)
    else:

        def good(result: S) -> bool:
            return source.quality(result) >= wanted

        result, price = toward(source, how, *PRICES, good)
        if price == PRICES[1] and how.palette is None and result.energy:  # images of few colors stay exact
            result = with_fewer_colors(source, replace(how, price=price), result, good)
    return replace(result, quality=source.quality(result))


def toward(
    source: Source[R], how: QuantizeOptions, start: float, end: float, good: Callable[[R], bool]
) -> tuple[R, float]:
    """Return the good result whose price of bits is nearest to `end`, or else the one at `start`; and its price."""
    palettes = [*map(finder(how), source.counted)]
    best = source.mapped(palettes, replace(how, price=start))
    if not good(best):
        return best, start
    last = source.mapped(palettes, replace(how, price=end))
    if good(last):
        return last, end
    for _ in range(_HALVINGS):
        price = math.sqrt(start * end)
        result = source.mapped(palettes, replace(how, price=price))
        if good(result):
            start, best = price, result
        else:
            end = price
    return best, start


def with_fewer_colors(source: Source[R], how: QuantizeOptions, best: R, good: Callable[[R], bool]) -> R:
    """Return a good result with fewer colors than the best so far, or that."""
    few, many = max(fixed_colors(one, how.locked)[2] for one in source.counted), len(palettes_of(best)[0])
    for _ in range(_HALVINGS):
        n_colors = round(math.sqrt(max(few, 1) * many))
        if not few < n_colors < many:
            break
        result = quantized(source, replace(how, n_colors=n_colors))
        if good(result):
            many, best = n_colors, result
        else:
            few = n_colors
    return best


def palettes_of(result: Any) -> list[Any]:
    """Return the palettes of the results of all frames, or of a single one."""
    return [one.palette for one in getattr(result, "results", (result,))]


@dataclass(frozen=True, slots=True)
class Search(Generic[R]):
    """The search for the number of colors at which a figure of the result reaches a target."""

    source: Source[R]
    how: QuantizeOptions
    value: Callable[[R], float]
    #: Approximate growth of the value from n to 2 n colors.
    per_octave: float

    def reach(self, target: float, most: int | Any) -> dict[bool, R]:
        """Return the result with the fewest colors whose value reaches the target, under True."""
        # Under False is the result with one color less; either can be missing.
        # A first pass with low effort shows where to look. Each trial is a search of its own, so that its result is
        # what `quantize` returns for its size: starting from another trial would end at a higher energy.
        least = max(fixed_colors(one, self.how.locked)[2] for one in self.source.counted)
        check_room(most, least)
        n, left = _FIRST_TRIAL, 1.0
        for effort in dict.fromkeys(["fast", self.how.engine.get("effort", "balanced")]):
            results: dict[bool, R] = {}

            def measure(n: int, effort: EffortName = effort, results: dict[bool, R] = results) -> float:
                nonlocal left
                engine = EngineOptions(**{**self.how.engine, "effort": effort})
                with part(1 - left, 1 - _LEFT * left):
                    result = quantized(self.source, replace(self.how, n_colors=n, psnr=None, engine=engine))
                left *= _LEFT
                reached = self.value(result)
                results[reached >= target] = result
                return reached

            n = first_reaching(measure, target, least, most, first=n, per_octave=self.per_octave)
        return results


def first_reaching(
    measure: Callable[[int], float], target: float, least: int, most: int, *, first: int, per_octave: float
) -> int:
    """Return an n in least..most with measure(n) >= target where measure(n - 1) is below it; most + 1 if none is."""
    # `measure` grows with n, more or less, from n to 2 n by about `per_octave`; each trial is expensive.
    below, reaching = least - 1, most + 1
    n = min(max(first, least), most)
    trials: list[tuple[int, float]] = []
    while reaching - below > 1:
        trials.append((n, measure(n)))
        if trials[-1][1] >= target:
            reaching = n
        else:
            below = n
        n = min(max(_next(trials, target, below, reaching, per_octave), below + 1), reaching - 1)
    return reaching


def _next(trials: list[tuple[int, float]], target: float, below: int, reaching: int, per_octave: float) -> int:
    """Follow the line through the last two trials; every sixth time bisect, in case the values are far from a line."""
    (n, value), tried = trials[-1], {trial[0] for trial in trials}
    if not math.isfinite(value) or (len(trials) % 6 == 0 and reaching in tried):
        return round(math.sqrt(max(below, 1) * reaching))
    slope = per_octave
    if len(trials) > 1 and (other := trials[-2])[1] != value and math.isfinite(other[1]):
        slope = max((value - other[1]) / math.log2(n / other[0]), per_octave / 8)
    octaves = min(max((target - value) / slope, -4), 4)
    guess = n * 2**octaves
    return math.ceil(guess) if value < target else math.floor(guess)

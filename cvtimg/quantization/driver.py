"""The one way to a quantized image: count its colors, find a palette, map the pixels, wherever they are."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Generic, Literal, Protocol, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import (
    check_alone,
    check_choice,
    check_count,
    check_excluded,
    check_given,
    check_in_range,
    check_needs,
    check_non_negative,
    check_one_of,
    refuse,
)
from cvtimg._shared.choices import DitherName, EffortName, GoalName, SpaceName
from cvtimg._shared.progress import part
from cvtimg.colors.samples import ColorSamples
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.looks.rate import STRENGTH as COMPACT_STRENGTH
from cvtimg.looks.rate import USUAL, Rate
from cvtimg.quantization.dithering import STRENGTH
from cvtimg.quantization.looks import DEAREST, MATCHES, MAX_ENTRIES, PRICES
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
#: The search for a quality ends this little above it, in points of `visual_quality`, or after so many trials.
_CLOSE, _TRIALS = 0.5, 5
#: Where it begins, in prices of bits, and how quality changes with them and with each doubling of the colors: first
#: guesses, which two trials replace.
_FIRST_PRICE, _POINTS_BY_PRICE, _POINTS_BY_DOUBLING = 0.7, -10.0, 6.0
#: By so much a file grows, roughly, when the number of colors doubles.
_BYTES_A_PIXEL = 0.05


class _HasPsnr(Protocol):
    @property
    def psnr(self) -> float: ...


R_co = TypeVar("R_co", bound=_HasPsnr, covariant=True)
R = TypeVar("R", bound=_HasPsnr)
#: An image, or frames: dataclasses that hold their quality.
S = TypeVar("S", bound=Any)


@dataclass(frozen=True, slots=True)
class QuantizeOptions:
    """What is wanted of images in few colors, whatever holds them.

    Attributes
    ----------
    n_colors, psnr, max_bytes, palette, locked, color_bits, ramp, space, dither, dither_strength, goal, quality
        As in `cvtimg.quantize`.
    per_frame : bool
        Find a palette for each frame or page, not one for all.
    engine : dict
        The options of `tessellate`: method, init, effort, volume_power, rng and callback.
    suffix : str
        The format whose bytes count; `quantize_file` takes that of its target.
    """

    n_colors: int | Literal["auto"] | None = None
    psnr: float | None = None
    max_bytes: int | None = None
    palette: ArrayLike | None = None
    locked: ArrayLike | None = None
    color_bits: int | Sequence[int] | None = None
    ramp: bool = False
    space: SpaceName = "rgb"
    dither: DitherName | None = None
    dither_strength: float | None = None
    goal: GoalName = "error"
    quality: float | tuple[float, float] | None = None
    per_frame: bool = False
    engine: EngineOptions = field(default_factory=EngineOptions)
    suffix: str = ".png"
    price: float = USUAL.price  # that of a bit, which searches set

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
            least, wanted = self.quality_range
            rising = not isinstance(self.quality, Sequence) or 0 <= least <= wanted
            check_in_range("quality", self.quality, rising and 0 <= wanted <= 100, "in 0..100, or two such, rising")
            if self.dither not in (None, "compact"):
                raise ValueError(f"dither={self.dither!r} must be 'compact', the default, with quality")
        n_colors = MAX_ENTRIES if self.n_colors is None and self.palette is None else self.n_colors
        return replace(self, n_colors=n_colors, space="oklab", dither=self.dither or "compact", goal="eyes")

    def check(self, **others: object) -> None:
        """Require an aim, and refuse aims and other options that exclude each other."""
        if self.max_bytes is not None:
            check_one_of(psnr=self.psnr, max_bytes=self.max_bytes, palette=self.palette)
            check_count("max_bytes", self.max_bytes, 1 << 62, "the size of a file")
            return
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
            found["per_frame"] = self.per_frame or None
            check_alone("palette", [name for name, value in found.items() if value is not None])
        elif self.psnr is None:
            check_given("n_colors, psnr or palette", self.n_colors)
        else:
            check_non_negative("psnr", self.psnr)
            if self.n_colors == "auto":
                refuse("n_colors", self.n_colors, "a number with psnr")

    @property
    def quality_range(self) -> tuple[float, float]:
        """The least quality that is accepted, and the one that is wanted."""
        if isinstance(self.quality, Sequence):
            least, wanted = self.quality
            return float(least), float(wanted)
        return -math.inf, float(self.quality or 0)

    @property
    def rate(self) -> Rate:
        """What small files are worth to `dither="compact"`."""
        return Rate(
            self.price, MATCHES[self.engine.get("effort", "balanced")], "lzw" if self.suffix == ".gif" else "deflate"
        )

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


class MeasuredSource(Source[S], Protocol[S]):
    """Pixels in memory, whose looks and bytes can be measured."""

    n_pixels: int

    def quality(self, result: S) -> float:
        """Return the visual quality of a result."""
        ...

    def size(self, result: S) -> int:
        """Return the bytes of its file."""
        ...

    def elbow(self, how: QuantizeOptions) -> tuple[int, EnergyCurve]:
        """Return the number of colors at the elbow of the energies, and their curve."""
        ...


def quantized(source: Any, how: QuantizeOptions) -> Any:
    """Quantize pixels to a number of colors, to a palette, or to the fewest colors that reach an aim."""
    if how.n_colors == "auto":
        at_elbow, curve = source.elbow(how)
        return replace(quantized(source, replace(how, n_colors=at_elbow)), curve=curve)
    if how.max_bytes is not None:
        return _within_bytes(source, replace(how, n_colors=how.n_colors or MAX_ENTRIES), how.max_bytes)
    if how.goal == "eyes":
        return _for_eyes(source, how)
    if how.psnr is not None and how.palette is None:
        return _reaching(source, how, how.psnr)
    with part(0, _FOUND[how.dither is not None]):
        palettes = [*map(finder(how), source.counted)]
    return source.mapped(palettes, how)


def _with(source: Source[R], how: QuantizeOptions, n_colors: int) -> R:
    """Quantize pixels to a number of colors, whatever the aim."""
    found: R = quantized(source, replace(how, n_colors=n_colors, goal="error", psnr=None, max_bytes=None))
    return found


def _reaching(source: Source[R], how: QuantizeOptions, psnr: float) -> R:
    """Quantize pixels to the fewest colors of a quality in dB."""
    results = Search(source, how, lambda result: result.psnr, _DECIBEL).reach(psnr, how.n_colors or MAX_COLORS)
    if True not in results:
        best = results[False]
        n_colors = max(len(colors) for colors in palettes_of(best))
        refuse("psnr", psnr, f"at most {best.psnr:.2f} dB, which {n_colors} colors reach")
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


def _within_bytes(source: MeasuredSource[S], how: QuantizeOptions, max_bytes: int) -> S:
    """Find the most colors whose file is small enough; for eyes the best image that fits."""
    if how.quality is not None:
        result = _nearest_quality(source, how)
        if source.size(result) <= max_bytes:
            return result
    if how.dither == "compact":
        dearest = replace(how, price=DEAREST)
        fitting, _ = _toward(source, dearest, DEAREST, PRICES[0], lambda result: source.size(result) <= max_bytes)
        if source.size(fitting) <= max_bytes:
            return _seen(source, fitting) if how.goal == "eyes" else fitting
        how = dearest
    results = Search(source, how, source.size, _BYTES_A_PIXEL * source.n_pixels).reach(max_bytes + 1, how.n_colors)
    if False not in results:
        fewest = results[True]
        n_colors = max(len(colors) for colors in palettes_of(fewest))
        refuse("max_bytes", max_bytes, f"at least {source.size(fewest)}, for the fewest colors, {n_colors}")
    found = results[False]
    if found.n_distinct > 1 and all(len(colors) == 1 for colors in palettes_of(found)):
        warnings.warn(f"max_bytes={max_bytes} leaves one color of {found.n_distinct}", UserWarning, stacklevel=4)
    return _seen(source, found) if how.goal == "eyes" else found


def _seen(source: MeasuredSource[S], result: S) -> S:
    """Return a result that knows its visual quality."""
    return replace(result, quality=source.quality(result))


def _for_eyes(source: MeasuredSource[S], how: QuantizeOptions) -> S:
    """Let bits cost as much as the quality allows, and say what was reached; see `quantize`."""
    result = _nearest_quality(source, how)
    least, wanted = how.quality_range
    if how.quality is not None and result.quality < wanted:
        colors = f"{max(len(colors) for colors in palettes_of(result))} colors"
        if result.quality < least:
            refuse("quality", how.quality, f"at most {result.quality:.1f} at its lower end, which {colors} reach")
        text = f"quality={wanted:g} is out of reach of {colors}: {result.quality:.1f}"
        warnings.warn(text, UserWarning, stacklevel=4)
    return result


def _nearest_quality(source: MeasuredSource[S], how: QuantizeOptions) -> S:
    """Return the smallest result of a quality, if one is wanted and can be had, or else the best."""
    if how.quality is None:
        return _seen(source, quantized(source, replace(how, goal="error", max_bytes=None)))
    _, wanted = how.quality_range
    palettes = [*map(finder(how), source.counted)]

    def priced(price: float) -> S:
        return _seen(source, source.mapped(palettes, replace(how, price=price)))

    result, price = _just_reaching(priced, wanted, _FIRST_PRICE, PRICES, _POINTS_BY_PRICE)
    if price < PRICES[1] or how.palette is not None or not result.energy:  # images of few colors stay exact
        return result
    few, many = max(fixed_colors(one, how.locked)[2] for one in source.counted), len(palettes_of(result)[0])
    if result.quality <= wanted + _CLOSE or many <= max(few, 1):
        return result

    known = {many: result}

    def reduced(halvings: float) -> S:
        n_colors = min(max(round(many / 2**halvings), few, 1), many)
        if n_colors not in known:
            known[n_colors] = _seen(source, _with(source, replace(how, price=price), n_colors))
        return known[n_colors]

    first = (result.quality - wanted) / _POINTS_BY_DOUBLING
    ends = 0.0, math.log2(many / max(few, 1))
    fewer, _ = _just_reaching(reduced, wanted, min(first, ends[1]), ends, -_POINTS_BY_DOUBLING)
    return fewer if fewer.quality >= wanted else result


def _just_reaching(
    trial: Callable[[float], S], wanted: float, first: float, ends: tuple[float, float], slope: float
) -> tuple[S, float]:
    """Return the result of a quality at the greatest saving, and that saving; the least one where none reaches it."""
    # The quality falls nearly in a line with the saving, from the first to the second of `ends`.
    trials: list[tuple[float, S]] = []
    reaching: tuple[float, S] | None = None
    below: tuple[float, S] | None = None
    saving = first
    while True:
        result = trial(saving)
        trials.append((saving, result))
        if result.quality >= wanted:
            reaching = trials[-1]
        else:
            below = trials[-1]
        close = wanted <= result.quality <= wanted + _CLOSE
        if close or len(trials) == _TRIALS or saving == ends[int(result.quality >= wanted)]:
            break
        if len(trials) > 1 and (before := trials[-2])[0] != saving:
            slope = min((result.quality - before[1].quality) / (saving - before[0]), slope / 8)
        low, high = reaching[0] if reaching else ends[0], below[0] if below else ends[1]
        guess = saving + (wanted + _CLOSE / 2 - result.quality) / slope
        saving = min(max(guess, low), high)
        if reaching and below and not low < saving < high:
            saving = (low + high) / 2
        if len(trials) == _TRIALS - 1 and not reaching:
            saving = ends[0]
    found = reaching or below
    assert found is not None
    return found[1], found[0]


def _toward(
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
                    result = _with(self.source, replace(self.how, engine=engine), n)
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

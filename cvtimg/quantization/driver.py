"""The one way to a quantized image: count its colors, find a palette, map the pixels, wherever they are."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_excluded,
    check_in_range,
    check_needs,
    check_non_negative,
    check_that,
    refuse,
)
from cvtimg._shared.choices import DitherName, GoalName, SpaceName
from cvtimg._shared.messages import warn
from cvtimg._shared.progress import first_few, part
from cvtimg._shared.types import Array
from cvtimg.colors.samples import ColorSamples
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.looks.rate import STRENGTH as COMPACT_STRENGTH
from cvtimg.looks.rate import USUAL, Rate
from cvtimg.looks.similarity import content_quality, visual_quality
from cvtimg.quantization.dithering import STRENGTH
from cvtimg.quantization.looks import MATCHES, MAX_ENTRIES, streaks
from cvtimg.quantization.palette_search import (
    EngineOptions,
    Merged,
    Palette,
    best_of,
    check_room,
    find_palette,
    fixed_colors,
    merged_colors,
    ramp_of,
)
from cvtimg.quantization.remapping import MAX_COLORS
from cvtimg.quantization.targets import climb, toward


class _Aiming(NamedTuple):
    """Where searches begin and end, and first guesses of how figures grow."""

    number: int = 32
    decibels: float = 2.0  # for twice the colors
    bytes_per_pixel: float = 0.05  # likewise, or for half the price of a bit
    # Of most photographs: the visual quality of endlessly many colors at no price, and what is lost to fewer, by a
    # power of the mean squared error of the palette, in levels of 8 bits; and to the price of an index.
    points: float = 93.5
    points_by_error: float = 1.8
    power: float = 0.75
    points_by_price: float = 1.2
    power_of_phrases: float = 0.65  # of the price of a bit of LZW
    trial_matches: int = 4  # enough to tell a quality within half a point
    # Prices of a bit, in squared levels, up to which a quality is lowered before colors are. At qualities of 40 to 70,
    # files at 2.4 take .85 of the bytes of fewer colors at 1.2, and smooth areas show fewer streaks; above that, gentle
    # texture is lost, which the measure does not see. Phrases of LZW make no long streaks: at 4.8, files of qualities
    # below 75 take a tenth to a quarter less than with fewer colors at 1.2.
    price: float = 2.4
    price_of_phrases: float = 4.8
    least_price: float = 0.02
    dearer: float = 4.0  # times the highest price, by which the quality of a number of colors is lowered
    less: float = 0.1  # of the diffusion, at the highest price
    # For files that must be small: streaks look better than few colors.
    all_prices: Sequence[float] = tuple(np.geomspace(16.0, 0.02, 33).tolist())
    # A search for a quality ends with a result that is better by `close`, or after `n_trials`.
    close: float = 0.5
    # Below and above the quality, where the same number of colors is enough, at another price.
    near: float = 1.5
    far: float = 6.0
    n_trials: int = 4  # with one of few matches
    n_more: int = 9  # where none has reached the quality
    n_usual: int = 2  # of all matches, without a target
    # The quality without a target, at which images look the same, or `below_best` less than the best that can be had.
    same: float = 85.0
    below_best: float = 1.0
    worth: float = 1.5  # power of the quality by which a file that is not exact must be smaller
    bands: float = 0.118  # that rounding to 8 bits leaves: .289 sqrt(1.5) / 3


_AIMING = _Aiming()


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantizeOptions:
    """What is wanted of images in few colors, whatever holds them: by name, but for the number of colors.

    Attributes
    ----------
    n_colors, psnr, max_bytes, palette, locked, color_bits, ramp, space, dither, dither_strength, goal, quality
        As in `cvtimg.quantize`.
    engine : dict
        The options of `tessellate`: method, init, effort, volume_power, rng and callback.
    suffix : str
        The format whose bytes count; `quantize_file` takes that of its target.
    """

    n_colors: int | Literal["auto"] | None = field(default=None, kw_only=False)
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
    engine: EngineOptions = field(default_factory=EngineOptions)
    suffix: str = ".png"
    # What searches set: the price of a bit, the matches that are followed, and whether an image that has the colors of
    # the palette alone stays as it is.
    price: float = USUAL.price
    n_matches: int | None = None
    keeps_exact: bool = True

    @property
    def has_aim(self) -> bool:
        """Whether anything tells what is wanted."""
        aims = (self.n_colors, self.psnr, self.max_bytes, self.palette, self.quality)
        return self.goal == "eyes" or any(aim is not None for aim in aims)

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
            check_excluded("max_bytes", True, psnr=self.psnr is not None, palette=self.palette is not None)
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
            excluded = {"locked": self.locked, "psnr": self.psnr, "color_bits": self.color_bits, **others}
            excluded |= self.engine
            given = " or ".join(name for name, value in excluded.items() if value is not None)
            check_that("palette", not given, f"not be given with {given}")
        elif self.psnr is None and self.n_colors is None:
            raise TypeError("n_colors, psnr or palette must be given")
        elif self.psnr is not None:
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
        n_matches = self.n_matches or MATCHES[self.engine.get("effort", "balanced")]
        return Rate(self.price, n_matches, "lzw" if self.suffix == ".gif" else "deflate", self.keeps_exact)

    @property
    def strength(self) -> float:
        """Strength of dithering: in full with a given palette, which may need strong mixtures."""
        if self.dither_strength is not None:
            return self.dither_strength
        if self.dither == "compact":
            return COMPACT_STRENGTH
        return STRENGTH if self.palette is None else 1.0


class Source:
    """Pixels that are counted, and mapped once there is a palette; what follows `mapped` needs them in memory."""

    counted: ColorSamples  # the density of all pixels
    images: Sequence[Array]  # as they were
    n_pixels: int

    def mapped(self, palette: Palette, how: QuantizeOptions) -> Any:
        """Map the pixels to a palette: an image, or frames."""
        raise NotImplementedError

    def elbow(self, how: QuantizeOptions) -> tuple[int, EnergyCurve]:
        """Return the number of colors at the elbow of the energies, and their curve."""
        raise NotImplementedError

    def size(self, result: Any) -> int:
        """Return the bytes of the file of a result."""
        raise NotImplementedError

    def sample(self, small: bool) -> Source:
        """Return fewer pixels of the same looks, a small sample within a point or two, or itself."""
        return self

    @property
    def is_drawn(self) -> bool:
        """Whether colors that are not mixed may have the smallest file."""
        return False

    def exact(self, how: QuantizeOptions) -> Any:
        """Return the image in all its colors, where its file may be small; or None."""
        return None

    def quality(self, result: Any) -> float:
        """Return the quality of the content of a result, the mean of the frames."""
        return self._mean(content_quality, result)

    def visual_quality(self, result: Any) -> float:
        """Return the visual quality of a result, the mean of the frames."""
        return self._mean(visual_quality, result)

    def _mean(self, measure: Callable[[Array, Array], float], result: Any) -> float:
        pairs = zip(self.images, _each(result), strict=True)
        return float(np.mean([measure(image, frame.image) for image, frame in pairs]))


def quantized(source: Any, how: QuantizeOptions) -> Any:
    """Quantize pixels to a number of colors, to a palette, or to the fewest colors that reach an aim."""
    if how.n_colors == "auto":
        at_elbow, curve = source.elbow(how)
        return replace(quantized(source, replace(how, n_colors=at_elbow)), curve=curve)
    if how.max_bytes is not None:
        result = _within_bytes(source, replace(how, n_colors=how.n_colors or MAX_ENTRIES), how.max_bytes)
        return judged(source, result) if how.goal == "eyes" else result
    if how.goal == "eyes":
        return _for_eyes(source, how)
    if how.psnr is not None and how.palette is None:
        below, reaching = _by_number(source, how, lambda result: result.psnr, how.psnr, _AIMING.decibels)
        if reaching is None:
            refuse("psnr", how.psnr, f"at most {below.psnr:.2f} dB, which {len(below.palette)} colors reach")
        return reaching
    with part(0, 0.2 if how.dither else 0.7):
        palette = finder(how)(source.counted)
    return source.mapped(palette, how)


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


def _by_number(
    source: Source, how: QuantizeOptions, figure: Callable[[Any], float], target: float, growth: float
) -> Any:
    """Return the results of neighboring numbers of colors, whose figure is below a target and reaches it."""
    least = fixed_colors(source.counted, how.locked)[2]
    most: Any = how.n_colors or MAX_COLORS
    check_room(most, least)
    plain, first = replace(how, goal="error", psnr=None, max_bytes=None), _AIMING.number
    # A first pass with low effort shows where to look. Each number is searched for by itself: starting from another one
    # would end at a higher energy.
    for effort in first_few(dict.fromkeys(("fast", how.engine.get("effort", "balanced"))), left=0.5):

        def result(n: Any, engine: Any = {**how.engine, "effort": effort}) -> Any:  # noqa: B006
            return quantized(source, replace(plain, n_colors=n, engine=engine))

        numbers = range(least, most + 1)
        ends = climb(numbers, result, figure, target, lambda n: growth * math.log2(n), max(first - least, 0))
        first = next(int(end[0]) for end in ends[::-1] if end)
    return [end and end[1] for end in ends]


def _within_bytes(source: Source, how: QuantizeOptions, max_bytes: int) -> Any:
    """Find the most colors whose file is small enough; for eyes the best image that fits."""
    growth = _AIMING.bytes_per_pixel * source.n_pixels
    if how.quality is not None:
        result = _nearest_quality(source, how)
        if source.size(result) <= max_bytes:
            return result
    if how.dither == "compact":
        palettes, prices = _Palettes(how, source), _AIMING.all_prices
        at_price = partial(palettes.mapped, source, palettes.most)
        fitting, _ = climb(prices, at_price, source.size, max_bytes + 1, lambda price: -growth * math.log2(price), 0)
        if fitting is not None:
            return fitting[1]
        how = replace(how, price=prices[0])
    result, fewest = _by_number(source, how, source.size, max_bytes + 1, growth)
    if result is None:
        least = f"at least {source.size(fewest)}, for the fewest colors, {len(fewest.palette)}"
        refuse("max_bytes", max_bytes, least)
    if result.n_distinct > 1 and len(result.palette) == 1:
        warn(f"max_bytes={max_bytes} leaves one color of {result.n_distinct}")
    return result


def _for_eyes(source: Source, how: QuantizeOptions) -> Any:
    """Let bits cost as much as the quality allows, and say what was reached; see `quantize`."""
    result = _nearest_quality(source, how)
    least, wanted = how.quality_range
    if how.quality is not None and result.energy and (quality := result.content_quality) < wanted:
        colors = f"{len(result.palette)} colors"
        if quality < least:
            refuse("quality", least, f"at most {quality:.1f} at its lower end, which {colors} reach")
        warn(f"quality={wanted:g} is out of reach of {colors}: {quality:.1f}")
    return judged(source, result)


def _nearest_quality(source: Source, how: QuantizeOptions) -> Any:
    """Return the smallest result of a quality, the usual one by default, if it can be had, or else the best."""
    # Animations have a price of their own: noise that the measure sees in a frame is hardly seen in motion.
    if how.dither != "compact" or (how.quality is None and how.rate.coder == "lzw"):
        return _seen(source, quantized(source, replace(how, goal="error", max_bytes=None)))
    palettes, has_aim = _Palettes(how, source), how.quality is not None
    exact = palettes.exact(source)
    if exact is not None and (palettes.most <= 2 or how.quality_range[1] >= 100):
        return exact
    search = _Search(source, how, palettes)
    results = [search.nearest()]
    if source.is_drawn and how.palette is None:
        least = search.least if has_aim else max(search.least, results[0].content_quality)
        results += _unmixed(source, palettes, least, results[0])
    results += [] if exact is None else [exact]
    best = max(result.content_quality for result in results)
    least = min(best, search.least - (0 if has_aim else 2.5 * _AIMING.close))

    def cost(result: Any) -> float:
        # Without a target, what is lost must be saved: the law of pngquant's --skip-if-larger.
        lossy = exact is not None and result is not exact and not has_aim
        return source.size(result) / (max(result.content_quality, 1) / 100) ** (_AIMING.worth if lossy else 0)

    good = [result for result in results if result.content_quality >= least]
    if exact is not None and not has_aim:  # bands and streaks, which the measure hardly sees, are no gain
        good = [result for result in good if result is exact or _banding(source, result) <= _AIMING.bands]
    return good[0] if len(good) == 1 else min(good, key=cost)


def _unmixed(source: Source, palettes: _Palettes, least: float, mixed: Any) -> list[Any]:
    """Return the result of the fewest colors of a quality that are not mixed, if it is likely to be small.

    Text and drawings have smaller files without dithering; gradients show bands, more than where colors are mixed.
    """
    all_colors = palettes.unmixed(source, palettes.most)
    if all_colors.content_quality < least or source.size(all_colors) > 2 * source.size(mixed):
        return []
    numbers, at = palettes.numbers, partial(palettes.unmixed, source)
    number = numbers[bisect_left(numbers, True, key=lambda n: at(n).content_quality >= least)]
    bands = _banding(source, at(number))
    return [at(number)] if bands <= max(_AIMING.bands, _banding(source, mixed)) else []


class _Rung(NamedTuple):
    """A setting that a search may try."""

    n_colors: int
    price: float  # of a bit


class _Search:
    """A search for the result of a quality: by mappings of pieces, or with few matches, then by whole ones.

    What a setting is expected to lose of the quality, by `_Palettes.expected`, is the one coordinate of the search.
    """

    def __init__(self, source: Source, how: QuantizeOptions, palettes: _Palettes) -> None:
        self._source, self._palettes, self._aim = (
            source,
            palettes,
            None if how.quality is None else how.quality_range[1],
        )
        self._sample = source.sample(small=self._aim is None)
        self._tried: dict[_Rung, float] = {}  # qualities of pieces, or with few matches
        self._results: dict[_Rung, Any] = {}
        self._above = 0.0  # by which the whole with all matches was better
        self._best = palettes.rung(0.0)

    @property
    def least(self) -> float:
        """The least quality to reach: the given or the usual one, or what is `below_best` under the best."""
        if self._aim is not None:
            return self._aim
        return min(_AIMING.same, self._tried[self._best] + self._above - _AIMING.below_best)

    def nearest(self) -> Any:
        """Return the smallest result of the quality, or the best."""
        given, close = self._aim is not None, _AIMING.close
        with part(0.1, 0.3):
            rung = self._begun()
        n_left, more = _AIMING.n_trials if given else _AIMING.n_usual, 0.0
        with part(0.3, 1):
            for n in first_few(range(n_left + _AIMING.n_more)):
                quality, wanted = self._whole(rung), self.least + given * close / 2
                reached = [some for some in map(self._whole, self._results) if some >= self.least]
                enough = (bool(reached) or not given or self._best in self._results) and n + 1 >= n_left
                if enough or abs(quality - wanted) <= (close / 2 if given else 2.5 * close):
                    break
                more = 2 * more or close / 2 if n + 2 >= n_left and not reached else 0.0
                number = self._number(wanted + more)
                settings = (self._toward(wanted + more, number), self._toward(wanted + more + close), self._best)
                rung = next((rung for rung in settings if rung not in self._results), rung)
                if rung in self._results:
                    break
        return min(self._results.values(), key=lambda result: _miss(result.content_quality, self.least))

    def _begun(self) -> _Rung:
        """Return the setting to begin with, as mappings with few matches tell."""
        given = self._aim is not None
        if not given:
            self._trial(self._best)
        wanted, rung = self.least + given * _AIMING.close / 2, self._toward(self.least)
        for _ in range(_AIMING.n_usual if not given or self._sample is not self._source else 0):
            missed = 0.0 if rung in self._tried else abs(self._trial(rung) - wanted)
            rung = self._toward(wanted)
            if missed <= 3 * _AIMING.close:
                break
        return rung

    def _number(self, wanted: float) -> int | None:
        """Return the number of colors of a result whose quality is near; None without one."""
        # Figures jump among palettes of other numbers. Dearer bits lower them; cheaper ones hardly raise them, where
        # colors are few.
        misses = {rung: self._whole(rung) - wanted for rung in self._results}
        far = {rung: miss / _AIMING.far if miss > 0 else -miss / _AIMING.near for rung, miss in misses.items()}
        nearest = min(far, key=far.__getitem__)
        return nearest.n_colors if far[nearest] <= 1 else None

    def _toward(self, wanted: float, n_colors: int | None = None) -> _Rung:
        """Return the setting where the qualities that were seen, of a number of colors if so, come to another."""
        seen = {rung: quality + self._above for rung, quality in self._tried.items()}
        seen |= {rung: result.content_quality for rung, result in self._results.items()}
        alike = {rung: quality for rung, quality in seen.items() if n_colors in (None, rung.n_colors)}
        places = {-self._palettes.expected(rung): quality for rung, quality in alike.items()}
        if n_colors is None or len(places) < 2:
            places[0.0] = _AIMING.points
        return self._palettes.rung(-toward(wanted, places), n_colors)

    def _whole(self, rung: _Rung) -> float:
        if rung not in self._results:
            result = _seen(self._source, self._palettes.mapped(self._source, *rung))
            self._results[rung] = result
            if self._tried:
                expected = self._palettes.expected
                near = min(self._tried, key=lambda tried: abs(expected(tried) - expected(rung)))
                lost = (_AIMING.points - self._tried[near]) * expected(rung) / expected(near)
                self._above = result.content_quality - (_AIMING.points - lost)
        return float(self._results[rung].content_quality)

    def _trial(self, rung: _Rung) -> float:
        n_matches = _AIMING.trial_matches if self._aim is None else None
        result = self._palettes.mapped(self._sample, *rung, n_matches=n_matches)
        self._tried[rung] = self._sample.quality(result)
        return self._tried[rung] + self._above


class _Palettes:
    """Palettes of the most colors for a source, and of fewer, and the quality that is expected of them."""

    def __init__(self, how: QuantizeOptions, source: Source) -> None:
        self.most: Any = how.n_colors or len(np.asarray(how.palette))
        self._how, self._counted, self._of_phrases = how, source.counted, how.rate.coder == "lzw"
        # The price up to which qualities are lowered before colors are.
        self._free = _AIMING.price_of_phrases if self._of_phrases else _AIMING.price
        with part(0, 0.1):
            palette = finder(how)(source.counted)
        self._has_all = how.palette is None and palette.tessellation is None
        if self._has_all:
            self.most = len(palette.colors)
        least = self.most if how.palette is not None else fixed_colors(source.counted, how.locked)[2]
        fewer = {max(round(2 ** (n / 8)), least) for n in range(8, 65)}
        #: Numbers of colors that are tried, each a fifth more than the one before.
        self.numbers = sorted({*(n for n in fewer if n < self.most), self.most})
        self._of_number = {self.most: palette}
        self._unmixed: dict[int, Any] = {}

    @cached_property
    def _merged(self) -> Merged:
        fixed = fixed_colors(self._counted, self._how.locked)[1]
        samples = self._counted if self._has_all else None
        return merged_colors(self._of_number[self.most], self.most, fixed, samples)

    def mapped(self, pixels: Source, n_colors: int, price: float, n_matches: int | None = None) -> Any:
        """Map pixels to a number of colors, at a price of bits."""
        strength = self._how.dither_strength
        if strength is None:
            strength = COMPACT_STRENGTH - _AIMING.less * min(price / self._free, 1)
        how = replace(self._how, price=price, dither_strength=strength, n_matches=n_matches, keeps_exact=False)
        return pixels.mapped(self._palette(n_colors), how)

    def unmixed(self, source: Source, n_colors: int) -> Any:
        """Map pixels to the nearest of a number of colors, and see how good that is."""
        if n_colors not in self._unmixed:
            result = source.mapped(self._palette(n_colors), replace(self._how, dither=None))
            self._unmixed[n_colors] = _seen(source, result)
        return self._unmixed[n_colors]

    def exact(self, source: Source) -> Any:
        """Return the image as it is, where the palette has all its colors or its file may be small; or None."""
        if self._has_all:
            result = self.unmixed(source, self.most)
            return None if result.energy else result
        result = source.exact(self._how) if self._how.palette is None else None
        return result and _seen(source, result)

    def _palette(self, n_colors: int) -> Palette:
        """Find fewer colors from those that neighbors become: so quality hardly ever falls where colors are added."""
        if n_colors not in self._of_number:
            engine: Any = self._how.engine
            for start in self._merged.starts[self.most - n_colors :][:1]:
                engine = {**engine, "init": start}
            with part(0, 0.1):
                how = replace(self._how, n_colors=n_colors, engine=engine)
                self._of_number[n_colors] = finder(how)(self._counted)
        return self._of_number[n_colors]

    def _by_error(self, n_colors: int) -> float:
        """Return what is expected to be lost to a number of colors."""
        energy = self._merged.energies[: self.most - n_colors + 1][-1]
        return float(_AIMING.points_by_error * (255**2 * energy / self._merged.n_pixels) ** _AIMING.power)

    def _by_price(self, price: float, n_colors: int) -> float:
        n_bits = math.log2(max(self.most if self._of_phrases else n_colors, 2))
        return _AIMING.points_by_price * n_bits * price ** (_AIMING.power_of_phrases if self._of_phrases else 1)

    def expected(self, rung: _Rung) -> float:
        """Return what is expected to be lost, of the quality of endlessly many colors at no price."""
        return math.hypot(self._by_error(rung.n_colors), self._by_price(rung.price, rung.n_colors))

    def rung(self, lost: float, n_colors: int | None = None) -> _Rung:
        """Return the setting of an expected loss: the fewest colors that lose no more at the highest price."""
        cheap = (n for n in self.numbers if self.expected(_Rung(n, self._free)) <= lost)
        number = n_colors or next(cheap, self.most)
        paid = math.sqrt(max(lost, 0) ** 2 - min(self._by_error(number), max(lost, 0)) ** 2)
        price = (paid / self._by_price(1, number)) ** (1 / (_AIMING.power_of_phrases if self._of_phrases else 1))
        return _Rung(number, min(max(price, _AIMING.least_price), _AIMING.dearer * self._free))


def _seen(source: Source, result: Any) -> Any:
    """Return a result that knows the quality of its content."""
    return replace(result, content_quality=source.quality(result))


def judged(source: Source, result: Any) -> Any:
    """Return a result that knows its qualities."""
    result = _seen(source, result) if result.content_quality is None else result
    return replace(result, quality=source.visual_quality(result))


def _banding(source: Source, result: Any) -> float:
    pairs = zip(source.images, _each(result), strict=True)
    return max(streaks(image, frame.image, has_alpha=source.counted.alpha) for image, frame in pairs)


def _miss(quality: float, least: float) -> tuple[bool, float]:
    """Return the order of qualities: those that reach the least one, then those nearest to it."""
    return quality < least, abs(quality - least)


def _each(result: Any) -> Sequence[Any]:
    """Return the results of all frames, or the single one."""
    return getattr(result, "results", (result,))

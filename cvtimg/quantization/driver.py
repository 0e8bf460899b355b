"""The one way to a quantized image: count its colors, find a palette, map the pixels, wherever they are."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import repeat
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import MAX_COLORS, ROUNDING
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
from cvtimg.looks.rate import USUAL, CoderName, Rate
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
from cvtimg.quantization.targets import climb, toward


class _Aiming(NamedTuple):
    """Where searches begin and end, and first guesses of how figures grow."""

    number: int = 32
    decibels: float = 2.0  # for twice the colors
    bytes_per_pixel: float = 0.05  # likewise, or for half the price of a bit
    # Of most photographs: the visual quality of endlessly many colors at no price, and what is lost to fewer, by a
    # power of the mean squared error of the palette, in levels of 8 bits; to the price of an index; and to less
    # diffusion.
    points: float = 93.5
    points_by_error: float = 1.8
    power: float = 0.75
    points_by_price: float = 1.2
    power_of_phrases: float = 0.65  # of the price of a bit of LZW
    share_by_strength: float = 0.4  # of what is lost, for less diffusion
    strengths: Sequence[float] = tuple(np.linspace(0.4, 0.6, 201).tolist())
    most_unlike: float = 8.0  # times as much, or as little, is lost by other images
    trial_matches: int = 4  # enough to tell a quality within half a point
    # Prices of a bit, in squared levels, between which a quality is sought. At qualities of 40 to 70, files at 2.4 take
    # .85 of the bytes of fewer colors at 1.2, and smooth areas show fewer streaks; above that, gentle texture is lost,
    # which the measure does not see.
    prices: Sequence[float] = tuple(np.geomspace(2.4, 0.02, 237).tolist())
    # Phrases of LZW make no long streaks: at 4.8, files of qualities below 75 take a tenth to a quarter less than with
    # fewer colors at 1.2.
    prices_of_phrases: Sequence[float] = tuple(np.geomspace(4.8, 0.02, 237).tolist())
    # For files that must be small: streaks look better than few colors.
    all_prices: Sequence[float] = tuple(np.geomspace(16.0, 0.02, 33).tolist())
    # A search for a quality ends with a result that is better by at most `close`, and by that more with each mapping
    # after the fourth.
    close: float = 0.5
    # A sample so near to the quality is enough to go on with the whole; so far above it are other numbers of colors
    # tried, that prices then lower.
    near: float = 1.5
    far: float = 6.0  # above the quality are the same colors enough, at another price or diffusion
    dearer: float = 4.0  # times the highest price, by which the quality of a number of colors is lowered
    others: float = 2.5  # times as many colors, or a share of them, are tried after the first number
    n_most: int = 12
    n_usual: int = 2  # without a target
    # The quality without a target, at which images look the same, or `below_best` less than the best that can be had.
    same: float = 85.0
    below_best: float = 1.0
    # From which on the rims of discs and letters, in few colors that are not mixed, are not notched at twice the size.
    clean: float = 92.0
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
    per_frame : bool
        Find a palette for each frame or page, not one for all.
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
    per_frame: bool = False
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
            found = {"locked": self.locked, "psnr": self.psnr, "color_bits": self.color_bits, **others, **self.engine}
            found["per_frame"] = self.per_frame or None
            given = " or ".join(name for name, value in found.items() if value is not None)
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
        coder: CoderName = "lzw" if self.suffix == ".gif" else "deflate"
        n_matches = self.n_matches or MATCHES[coder][self.engine.get("effort", "balanced")]
        return Rate(self.price, n_matches, coder, self.keeps_exact)

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

    counted: Sequence[ColorSamples]  # what palettes are found for: the density of all pixels, or that of each frame
    images: Sequence[Array]  # as they were
    n_pixels: int

    def mapped(self, palettes: Sequence[Palette], how: QuantizeOptions) -> Any:
        """Map the pixels to the palettes, one for each of `counted`: an image, or frames."""
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

    @property
    def seen(self) -> Sequence[ColorSamples]:
        """What palettes are found for where eyes judge them."""
        return self.counted

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
        return float(np.mean([measure(image, one.image) for image, one in pairs]))


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
        below, found = _by_number(source, how, lambda result: result.psnr, how.psnr, _AIMING.decibels)
        if found is None:
            refuse("psnr", how.psnr, f"at most {below.psnr:.2f} dB, which {_most_colors(below)} colors reach")
        return found
    with part(0, 0.2 if how.dither else 0.7):
        palettes = [*map(finder(how), source.counted)]
    return source.mapped(palettes, how)


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
    least = max(fixed_colors(one, how.locked)[2] for one in source.counted)
    wanted: Any = how.n_colors or MAX_COLORS
    most = check_room(wanted, least)
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
    found, fewest = _by_number(source, how, source.size, max_bytes + 1, growth)
    if found is None:
        least = f"at least {source.size(fewest)}, for the fewest colors, {_most_colors(fewest)}"
        refuse("max_bytes", max_bytes, least)
    if found.n_distinct > 1 and _most_colors(found) == 1:
        warn(f"max_bytes={max_bytes} leaves one color of {found.n_distinct}")
    return found


def _for_eyes(source: Source, how: QuantizeOptions) -> Any:
    """Let bits cost as much as the quality allows, and say what was reached; see `quantize`."""
    result = _nearest_quality(source, how)
    least, wanted = how.quality_range
    if how.quality is not None and result.energy and (quality := result.content_quality) < wanted:
        colors = f"{_most_colors(result)} colors"
        if quality < least:
            refuse("quality", least, f"at most {quality:.1f} at its lower end, which {colors} reach")
        warn(f"quality={wanted:g} is out of reach of {colors}: {quality:.1f}")
    return judged(source, result)


def _nearest_quality(source: Source, how: QuantizeOptions) -> Any:
    """Return the smallest result of a quality, the usual one by default, if it can be had, or else the best."""
    # Animations have a price of their own: noise that the measure sees in a frame is hardly seen in motion.
    if how.dither != "compact" or (how.quality is None and how.rate.coder == "lzw"):
        return _seen(source, quantized(source, replace(how, goal="error", max_bytes=None)))
    palettes = _Palettes(how, source)
    exact = palettes.exact(source)
    if exact is not None and (palettes.most <= 2 or how.quality_range[1] >= 100):
        return exact
    is_given, is_drawn = how.quality is not None, source.is_drawn and how.palette is None
    found = [] if exact is None else [exact]
    clean = [] if is_given or not is_drawn else _unmixed(source, palettes, _AIMING.clean)
    if clean:  # mixed colors of less quality make smaller files, in which rims are rough
        return min(clean + found, key=partial(_cost, source, exact))
    search = _Search(source, how, palettes)
    found += [search.nearest()]
    if is_drawn:
        least = search.least() if is_given else max(search.least(), found[-1].content_quality)
        found += _unmixed(source, palettes, least, found[-1])
    best = max(one.content_quality for one in found)
    least = min(best, search.least() - (0 if is_given else 2.5 * _AIMING.close))
    good = [one for one in found if one.content_quality >= least]
    if exact is not None and not is_given:  # bands and streaks, which the measure hardly sees, are no gain
        most = ROUNDING if is_drawn else _AIMING.bands
        good = [one for one in good if one is exact or palettes.banding(source, one) <= most]
    return good[0] if len(good) == 1 else min(good, key=partial(_cost, source, None if is_given else exact))


def _cost(source: Source, exact: Any, result: Any) -> float:
    """Return the bytes of a result; instead of an exact one, what is lost must be saved, as by --skip-if-larger."""
    lossy = exact is not None and result is not exact
    return source.size(result) / (max(result.content_quality, 1) / 100) ** (_AIMING.worth if lossy else 0)


def _unmixed(source: Source, palettes: _Palettes, least: float, mixed: Any = None) -> list[Any]:
    """Return the result of the fewest colors of a quality that are not mixed, if it has hardly more bands, or none.

    Text and drawings have smaller files without dithering; gradients show bands, more than where colors are mixed.
    """
    numbers = sorted({*(round(2 ** (n / 4)) for n in range(4, 33)), palettes.most})
    numbers = numbers[: numbers.index(palettes.most) + 1]
    if palettes.unmixed(source, palettes.most).content_quality < least:
        return []
    at = bisect_left(numbers[:-1], True, key=lambda n: palettes.unmixed(source, n).content_quality >= least)
    fewest = palettes.unmixed(source, numbers[at])
    most = ROUNDING if mixed is None else max(_AIMING.bands, palettes.banding(source, mixed))
    return [fewest] if palettes.banding(source, fewest) <= most else []


class _Setting(NamedTuple):
    """What a search varies."""

    n_colors: int
    price: float  # of a bit
    strength: float  # of diffusion


class _Trial(NamedTuple):
    """What a setting gives: of a sample, with few matches, a quality alone."""

    quality: float
    result: Any = None


class _Search:
    """A search for the setting of a quality: by a sample, where that is much smaller, and by whole mappings."""

    def __init__(self, source: Source, how: QuantizeOptions, palettes: _Palettes) -> None:
        self._source, self._how, self._palettes, self._given = source, how, palettes, how.quality is not None
        self._sample = source.sample(small=not self._given)
        self._trials: dict[_Setting, _Trial] = {}
        self._bias = 0.0  # by which the whole with all matches is better than the sample
        self._strengths = _AIMING.strengths if how.dither_strength is None else [how.strength]
        self._prices = _AIMING.prices_of_phrases if how.rate.coder == "lzw" else _AIMING.prices
        numbers = range(max(fixed_colors(one, how.locked)[2] for one in source.counted), palettes.most)
        usual = _Setting(palettes.most, self._prices[0], self._strengths[len(self._strengths) // 2])
        finely = self._finely(palettes.most)
        # From bad to good: of more and more colors, and of all at lower prices.
        self._settings = [usual._replace(n_colors=number) for number in numbers if how.palette is None]
        self._settings += finely[finely.index(usual) :]

    def nearest(self) -> Any:
        """Return the smallest result of the quality, or the best."""
        with part(0.1, 0.3):
            setting: _Setting | None = self._begun()
        with part(0.3, 1):
            for n in first_few(range(1, 1 + (_AIMING.n_most if self._given else _AIMING.n_usual))):
                if setting is None:
                    break
                self._mapped(setting)
                least, most_below, most_above = self.least(), 2.5 * _AIMING.close, 2.5 * _AIMING.close
                if self._given:
                    most_below, most_above = 0, _AIMING.close * max(1, n - 3)
                if any(-most_below <= self._seen(some) - least <= most_above for some in self._whole):
                    break
                setting = self._following(least + (most_above - most_below) / 2)
            if self._given and max(map(self._seen, self._whole)) < least:
                self._mapped(self._settings[-1])
        misses = {setting: self._seen(setting) - least for setting in self._whole}
        # The one nearest to the quality, of those that reach it if so; without a target, nearly.
        return self._trials[min(misses, key=lambda some: (misses[some] < -most_below, abs(misses[some])))].result

    def least(self) -> float:
        """Return the least quality to reach: the given or the usual one, or what is `below_best` under the best."""
        if self._given:
            return self._how.quality_range[1]
        return min(_AIMING.same, self._seen(self._settings[-1]) - _AIMING.below_best)

    def _begun(self) -> _Setting:
        """Return the setting to begin with, as the sample tells."""
        if not self._given:
            setting = self._settings[-1]
            self._palettes.expect(setting, self._sampled(setting))
            setting = self._at(self._settings, self.least())
            for _ in range(_AIMING.n_usual):
                missed = 0.0 if setting in self._trials else abs(self._sampled(setting) - self.least())
                setting = self._toward(self._settings, self.least())
                if missed <= _AIMING.near:
                    break
            return setting
        wanted = self.least() + _AIMING.close / 2
        first = self._at(self._settings, wanted)
        quality = self._mapped(first) if first == self._settings[-1] else self._sampled(first)
        self._palettes.expect(first, quality)
        if abs(quality - wanted) <= _AIMING.near:
            return first
        setting = self._at(self._settings, wanted)
        if setting.n_colors not in (first.n_colors, self._palettes.most):
            setting = self._at(self._settings, wanted + _AIMING.near)
        least, most = first.n_colors / _AIMING.others, min(first.n_colors * _AIMING.others, self._palettes.most)
        number = int(min(max(setting.n_colors, least), most))
        return setting if number == setting.n_colors else self._settings[0]._replace(n_colors=number)

    def _following(self, wanted: float) -> _Setting | None:
        """Return the setting to try next, if one is left."""
        # Figures jump among palettes of other numbers, so these are to be better than what is wanted. Dearer bits lower
        # that by some points, for fewer bytes than less colors; cheaper ones hardly raise it, where colors are few.
        misses = {setting: self._seen(setting) - wanted for setting in self._whole}
        reaching = [setting for setting, miss in misses.items() if miss >= 0]
        other = self._toward(self._settings, wanted)
        if other.n_colors != self._palettes.most:
            other = self._toward(self._settings, wanted + (_AIMING.near if self._given else -_AIMING.close))
        following = [other]
        if reaching:
            best = min(reaching, key=misses.__getitem__)
            lowered = self._toward(self._finely(best.n_colors), wanted)
            is_near = misses[best] <= _AIMING.far or len(reaching) < len(misses)
            following = [lowered, other] if is_near else [other, lowered]
        return next((setting for setting in following if setting not in self._whole), None)

    def _finely(self, n_colors: int) -> list[_Setting]:
        """Return the settings of a number of colors: high prices, strengths of diffusion, and lower prices."""
        free, *prices = self._prices
        dear = np.geomspace(_AIMING.dearer * free, free, 50)[:-1].tolist() if self._given else []
        settings = [_Setting(n_colors, free, strength) for strength in self._strengths]
        return [
            *(settings[0]._replace(price=price) for price in dear), *settings,
            *(settings[-1]._replace(price=price) for price in prices),
        ]  # fmt: skip

    def _at(self, settings: list[_Setting], quality: float) -> _Setting:
        """Return the first setting of at least this expected quality, or the last one."""
        return settings[min(bisect_left(settings, quality, key=self._palettes.expected), len(settings) - 1)]

    def _toward(self, settings: list[_Setting], wanted: float) -> _Setting:
        """Return the setting where the qualities that were seen, of these settings if so, come to another."""
        seen = {setting: self._seen(setting) for setting in self._trials}
        alike = {setting: seen[setting] for setting in settings if setting in seen}
        places = {self._palettes.expected(setting): quality for setting, quality in (alike or seen).items()}
        at = settings.index(self._at(settings, toward(wanted, places)))
        return settings[at - (at > 0 and seen.get(settings[at], 0) > wanted)]

    @property
    def _whole(self) -> dict[_Setting, _Trial]:
        return {setting: trial for setting, trial in self._trials.items() if trial.result is not None}

    def _seen(self, setting: _Setting) -> float:
        trial = self._trials[setting]
        return trial.quality if trial.result is not None else trial.quality + self._bias

    def _mapped(self, setting: _Setting) -> float:
        """Map the whole, and return its quality."""
        if setting not in self._whole:
            result, expected = self._palettes.mapped(self._source, *setting), self._palettes.expected
            quality = self._source.quality(result)
            if sampled := self._trials.keys() - self._whole.keys():
                near = min(sampled, key=lambda some: abs(expected(some) - expected(setting)))
                self._bias = quality - (self._trials[near].quality + expected(setting) - expected(near))
            self._trials[setting] = _Trial(quality, replace(result, content_quality=quality))
        return self._seen(setting)

    def _sampled(self, setting: _Setting) -> float:
        """Map the sample with few matches, and return its quality; of LZW few paths tell little."""
        if self._sample is self._source or self._how.rate.coder == "lzw":
            return self._mapped(setting)
        result = self._palettes.mapped(self._sample, *setting, n_matches=_AIMING.trial_matches)
        self._trials[setting] = _Trial(self._sample.quality(result))
        return self._seen(setting)


class _Palettes:
    """Palettes of the most colors for a source, and of fewer, and the quality that is expected of them."""

    def __init__(self, how: QuantizeOptions, source: Source) -> None:
        self.most: Any = how.n_colors or len(np.asarray(how.palette))
        self._how, self._counted, self._unlike = how, source.counted, 1.0
        with part(0, 0.1):  # of few colors each stands for what is common, however rough
            found = [*map(finder(how), source.seen if self.most == MAX_ENTRIES else source.counted)]
        self._has_all = how.palette is None and all(one.tessellation is None for one in found)
        if self._has_all:
            self.most = max(len(one.colors) for one in found)
        self._found = {self.most: found}
        self._unmixed: dict[int, Any] = {}
        self._bands: dict[Any, float] = {}

    @cached_property
    def _merged(self) -> list[Merged]:
        fixed = [fixed_colors(samples, self._how.locked)[1] for samples in self._counted]
        found = self._found[self.most] if self._has_all else [*map(finder(self._how), self._counted)]
        return [*map(merged_colors, found, repeat(self.most), fixed, self._counted)]

    def mapped(
        self, pixels: Source, n_colors: int, price: float, strength: float | None = None, n_matches: int | None = None
    ) -> Any:
        """Map pixels to a number of colors, at a price of bits and a strength of diffusion."""
        strength = self._how.strength if strength is None else strength
        how = replace(self._how, price=price, dither_strength=strength, n_matches=n_matches, keeps_exact=False)
        return pixels.mapped(self._of(n_colors), how)

    def unmixed(self, source: Source, n_colors: int) -> Any:
        """Map pixels to the nearest of a number of colors, and see how good that is."""
        if n_colors not in self._unmixed:
            result = source.mapped(self._of(n_colors), replace(self._how, dither=None))
            self._unmixed[n_colors] = _seen(source, result)
        return self._unmixed[n_colors]

    def banding(self, source: Source, result: Any) -> float:
        """Return the streaks of a result, which are measured once."""
        if result not in self._bands:
            pairs = zip(source.images, _each(result), strict=True)
            worst = max(streaks(image, one.image, has_alpha=source.counted[0].alpha) for image, one in pairs)
            self._bands[result] = worst
        return self._bands[result]

    def exact(self, source: Source) -> Any:
        """Return the image as it is, where the palette has all its colors or its file may be small; or None."""
        if self._has_all:
            result = self.unmixed(source, self.most)
            return None if result.energy else result
        result = source.exact(self._how) if self._how.palette is None else None
        return result and _seen(source, result)

    def _of(self, n_colors: int) -> list[Palette]:
        """Return the palettes of a number of colors."""
        if n_colors not in self._found:
            with part(0, 0.1):
                self._found[n_colors] = [*map(self._fewer, self._merged, self._counted, repeat(n_colors))]
        return self._found[n_colors]

    def _fewer(self, merged: Merged, samples: ColorSamples, n_colors: int) -> Palette:
        """Find fewer colors from those that neighbors become: so quality hardly ever falls where colors are added."""
        engine: Any = self._how.engine
        for start in merged.starts[self.most - n_colors :][:1]:
            engine = {**engine, "init": start}
        return finder(replace(self._how, n_colors=n_colors, engine=engine))(samples)

    def expected(self, setting: _Setting) -> float:
        """Return the quality that is expected of a number of colors, at a price of bits and a strength of diffusion."""
        n_merges = self.most - setting.n_colors
        energy, n_pixels = np.sum([(one.energies[: n_merges + 1][-1], one.n_pixels) for one in self._merged], axis=0)
        error = float((255**2 * energy / n_pixels) ** _AIMING.power)
        price = setting.price ** (_AIMING.power_of_phrases if self._how.rate.coder == "lzw" else 1)
        paid = _AIMING.points_by_price * price * math.log2(self.most)
        lost = self._unlike * math.hypot(_AIMING.points_by_error * error, paid)
        return _AIMING.points - lost * (1 + _AIMING.share_by_strength * (COMPACT_STRENGTH - setting.strength))

    def expect(self, setting: _Setting, seen: float) -> None:
        """Expect a loss of the usual times a factor, by which the quality seen would have been expected."""
        usual = (_AIMING.points - self.expected(setting)) / self._unlike
        ratio = (_AIMING.points - seen) / max(usual, 1e-9)
        self._unlike = min(max(ratio, 1 / _AIMING.most_unlike), _AIMING.most_unlike)


def _seen(source: Source, result: Any) -> Any:
    """Return a result that knows the quality of its content."""
    return replace(result, content_quality=source.quality(result))


def judged(source: Source, result: Any) -> Any:
    """Return a result that knows its qualities."""
    result = _seen(source, result) if result.content_quality is None else result
    return replace(result, quality=source.visual_quality(result))


def _each(result: Any) -> Sequence[Any]:
    """Return the results of all frames, or the single one."""
    return getattr(result, "results", (result,))


def _most_colors(result: Any) -> int:
    return max(len(one.palette) for one in _each(result))

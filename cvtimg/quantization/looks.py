"""Pixels for eyes: errors count where they are seen, and indices are chosen by the bytes that they need."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cvtimg._shared.choices import EffortName
from cvtimg._shared.pixels import peak
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Ints
from cvtimg.colors.places import CLEAR, allowed_for, kinds_of
from cvtimg.colors.samples import ColorSamples
from cvtimg.colors.spaces import to_space
from cvtimg.looks.rate import REACH, CoderName, Rate, map_by_rate, visibility

#: Largest palette of a .gif or .png, in which an index is a byte.
MAX_ENTRIES = 256
#: Matches followed from a pixel, by effort: half of the balanced ones make files 1 to 2 % larger, and twice as many
#: take up to a tenth more time for at most .3 % of the bytes.
MATCHES: dict[CoderName, dict[EffortName, int]] = {
    "deflate": {"fast": 16, "balanced": 128, "best": 256},
    "lzw": {"fast": 16, "balanced": 32, "best": 256},
}

#: Greatest variance, in squared levels, of what is around a pixel in smooth areas.
_SMOOTH = 4.0


class Below(NamedTuple):
    """The frame that a frame is drawn over: (H, W) indices, and whether the pixels of both originals are equal."""

    indices: Array
    still: Bools


def map_for_eyes(
    samples: ColorSamples, palette: Array, nearest: Ints, rate: Rate, strength: float, below: Below | None = None
) -> Ints:
    """Return the (H, W) index of the color of each pixel, chosen by visible error and the price of bits.

    Each color has its `nearest` entry (M,). If that has no error in any pixel, it may be taken, see `Rate`. Pixels that
    stand still keep their index; in a GIF others may, too, which costs little.
    """
    if len(palette) > MAX_ENTRIES:
        raise ValueError(f"palette must have at most {MAX_ENTRIES} colors with dither='compact', not {len(palette)}")
    if len(palette) == 1 or (rate.keeps_exact and (palette[nearest] == samples.colors).all()):
        return samples.at_pixels(nearest)
    places, entries = (_seen_places(colors, samples.alpha).astype(np.float32) for colors in (samples.colors, palette))
    kinds, kinds_of_entries = kinds_of(samples.colors, samples.alpha), kinds_of(palette, samples.alpha)
    labels = samples.at_pixels(np.where(kinds == CLEAR, -1, np.arange(len(kinds))))
    canvas, box = samples.inverse[0, 0], _content_box(labels)
    if below is None and labels[box].size < labels.size and (entries[nearest[canvas]] == places[canvas]).all():
        # Canvas in its own color needs no search: it hands no errors on.
        indices = samples.at_pixels(nearest)
        inside = None if samples.inside is None else samples.inside[box]
        content = replace(samples, inverse=np.ascontiguousarray(samples.inverse[box]), inside=inside)
        indices[box] = map_for_eyes(content, palette, nearest, rate, strength)
        return indices
    bits = rate.price * np.log2(len(palette))
    seen = visible(samples, bits)
    wanted, kept = samples.at_pixels(places), None
    if below is not None:
        shown = entries[below.indices]
        wanted[below.still] = shown[below.still]
        # Where few pixels may keep what is below, its index would only be one more to learn.
        cheap = seen * ((wanted - shown) ** 2).sum(axis=2) < bits
        fits = rate.coder == "lzw" and len(palette) < MAX_ENTRIES and not samples.alpha
        kept = shown if fits and 2 * np.count_nonzero(cheap) > cheap.size else None
    indices = map_by_rate(wanted, entries, seen, rate, strength, kept)
    if below is not None:
        indices = np.where(below.still | (indices == len(palette)), below.indices, indices)
    if not samples.alpha:
        return indices.astype(np.int32)
    allowed = allowed_for(kinds_of_entries)[samples.at_pixels(kinds), indices]
    return np.where(allowed, indices, samples.at_pixels(nearest))


def visible(samples: ColorSamples, bits: float = 0.0) -> Floats32:
    """Return how much an error counts in each (H, W) pixel, on the worse of black and white; see `visibility`."""
    grounds = (0, 255) if samples.alpha else (0,)
    levels = [samples.at_pixels(_brightness(samples.colors, samples.alpha, ground)) for ground in grounds]
    seen: Floats32 = np.maximum.reduce([visibility(shades, bits) for shades in levels])
    return seen if samples.inside is None else seen * samples.inside


def _content_box(labels: Ints) -> tuple[slice, slice]:
    """Return the box of the (H, W) labels that differ from the first one, and of what `visibility` sees around them."""
    differs, sides = labels != labels[0, 0], list[slice]()
    for axis in range(2):
        places = np.flatnonzero(differs.any(axis=1 - axis))
        sides.append(slice(max(places[0] - REACH, 0), places[-1] + REACH + 1) if len(places) else slice(0, 1))
    return sides[0], sides[1]


def _seen_places(colors: Array, alpha: bool) -> Floats:
    """Return where colors lie for eyes, in levels of 8 bits: gray in one coordinate, color in three.

    With alpha there is one more: the squared distance is the mean over a black and a white background, on which screens
    compose in sRGB.
    """
    if not alpha:
        places = to_space(colors, "oklab")
        return places * np.array([255, 127.5, 127.5])[: places.shape[1]]  # opponent coordinates are doubled there
    share = colors[:, -1:] / peak(colors.dtype)
    unit = colors[:, :-1] / peak(colors.dtype) * share
    black, white = to_space(unit, "oklab"), to_space(unit + (1 - share), "oklab")
    lightness = [np.sqrt(0.5) * ground[:, :1] for ground in (black, white)]
    return np.concatenate([*lightness, (black[:, 1:] + white[:, 1:]) / 4], axis=1) * 255


def _brightness(colors: Array, alpha: bool, ground: int) -> Floats:
    """Return the brightness of (..., C) colors in levels of 8 bits, in front of a gray level."""
    bands = colors * (255 / peak(colors.dtype))
    seen = bands[..., : colors.shape[-1] - alpha]
    levels = np.einsum("...c,c->...", seen, [0.299, 0.587, 0.114] if seen.shape[-1] == 3 else [1 / seen.shape[-1]])
    if not alpha:
        return levels
    share = bands[..., -1] / 255
    return levels * share + ground * (1 - share)


def streaks(original: Array, image: Array, *, has_alpha: bool) -> float:
    """Return how much smooth areas of an image are banded, in levels of 8 bits, on the worse of black and white.

    Root of the mean square, over pixels around which the original varies little, of the mean error of nine pixels of a
    row, or of a column, less that of those beside it.
    """
    from scipy.ndimage import gaussian_filter, uniform_filter1d  # which take long to import

    images = [some.reshape(*some.shape[:2], -1) for some in (original, image)]
    worst = 0.0
    for ground in (0, 255) if has_alpha else (0,):
        before, after = (_brightness(some, has_alpha and some.shape[2] in (2, 4), ground) for some in images)
        rough = gaussian_filter((before - gaussian_filter(before, 3)) ** 2, 3)
        for axis in (0, 1):
            mean = np.moveaxis(uniform_filter1d(after - before, 9, axis), axis, 1)
            steps = (mean[1:-1] - (mean[2:] + mean[:-2]) / 2)[np.moveaxis(rough, axis, 1)[1:-1] < _SMOOTH]
            worst = max(worst, float(np.sqrt(np.mean(steps**2)))) if steps.size else worst
    return worst

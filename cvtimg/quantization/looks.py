"""Pixels for eyes: errors count where they are seen, and indices are chosen by the bytes that they need."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.choices import EffortName
from cvtimg._shared.pixels import peak
from cvtimg.colors.places import allowed_for, kinds_of, to_places
from cvtimg.colors.samples import ColorSamples
from cvtimg.looks.rate import Rate, map_by_rate, visibility

#: Largest palette of a .gif or .png, in which an index is a byte.
MAX_ENTRIES = 256
#: Matches followed from a pixel, by effort.
MATCHES: dict[EffortName, int] = {"fast": 16, "balanced": 32, "best": 256}


class Below(NamedTuple):
    """The frame that a frame is drawn over: (H, W) indices, and whether the pixels of both originals are equal."""

    indices: NDArray[Any]
    still: NDArray[np.bool_]


def map_for_eyes(
    samples: ColorSamples,
    palette: NDArray[Any],
    nearest: NDArray[np.int32],
    rate: Rate,
    strength: float,
    below: Below | None = None,
) -> NDArray[np.int32]:
    """Return the (H, W) index of the color of each pixel, chosen by visible error and the price of bits.

    Each color has its `nearest` entry (M,). If that has no error in any pixel, it is taken. Pixels that stand still
    keep their index; in a GIF others may, too, which costs little.
    """
    if len(palette) > MAX_ENTRIES:
        raise ValueError(f"palette must have at most {MAX_ENTRIES} colors with dither='compact', not {len(palette)}")
    if len(palette) == 1 or (palette[nearest] == samples.colors).all():
        return samples.at_pixels(nearest)
    places, entries = (_seen_places(colors, samples.alpha).astype(np.float32) for colors in (samples.colors, palette))
    kinds, kinds_of_entries = kinds_of(samples.colors, samples.alpha), kinds_of(palette, samples.alpha)
    seen = visibility(_brightness(samples))
    if samples.inside is not None:
        seen[~samples.inside] = 0
    wanted, kept = samples.at_pixels(places), None
    if below is not None:
        shown = entries[below.indices]
        wanted[below.still] = shown[below.still]
        kept = shown if rate.coder == "lzw" and len(palette) < MAX_ENTRIES and not samples.alpha else None
    indices = map_by_rate(wanted, entries, seen, rate, strength, kept)
    if below is not None:
        indices = np.where(below.still | (indices == len(palette)), below.indices, indices)
    if not samples.alpha:
        return indices.astype(np.int32)
    allowed = allowed_for(kinds_of_entries)[samples.at_pixels(kinds), indices]
    return np.where(allowed, indices, samples.at_pixels(nearest))


def _seen_places(colors: NDArray[Any], alpha: bool) -> NDArray[np.float64]:
    """Return where colors lie for eyes: gray in one coordinate, color in three, and alpha in one more."""
    # Lightness becomes levels like those of 8 bits, and the opponent coordinates, which are doubled there, count once.
    factors = np.array([255, 127.5, 127.5, 255] if colors.shape[1] > 2 else [255, 255])
    places = to_places(colors, "oklab", alpha)
    return places * factors[: places.shape[1]]


def _brightness(samples: ColorSamples) -> NDArray[np.float64]:
    """Return the brightness of the pixels (H, W) in levels of 8 bits, in front of black."""
    colors = samples.colors * (255 / peak(samples.colors.dtype))
    seen = colors[:, : colors.shape[1] - samples.alpha]
    levels = seen @ [0.299, 0.587, 0.114] if seen.shape[1] == 3 else seen.mean(axis=1)
    if samples.alpha:
        levels = levels * (colors[:, -1] / 255)
    return samples.at_pixels(levels)

"""Mapping to a palette by rate: indices that take few bits in files, where the eye does not see the difference.

Each row takes the path of least cost, where cost is the visible squared error plus the bits that the file needs, at a
price. For PNG a path goes through single indices and repetitions of earlier ones, as deflate (RFC 1951) has them; for
GIF through the phrases that LZW (T. A. Welch, Computer 17 (6), 1984, 8-19) has learned from the pixels before. What is
left of the error is diffused, as by R. Floyd and L. Steinberg, Proc. SID 17 (1976) 75-77; for PNG more along the path
than to the next row.
"""

from typing import Literal, NamedTuple, TypeAlias

import numpy as np

import cvtimg.looks._looks as _looks
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Array, Bytes, Floats, Floats32
from cvtimg.looks.similarity import blurred

#: Bands are mapped without the rows above them, so that several threads share the work: they have so many rows at
#: least, and so many times the pixels that matches reach back. With 2, files are 1.1 % larger, with 8 .1 % smaller.
_BAND, _WINDOWS = 64, 4
#: Steps of the kernel for each coordinate of a pixel, by which work is divided among threads.
_WORK = 1000
#: Share of the error that is handed on: with more, grain costs bytes; with less, tones drift.
STRENGTH = 0.6
#: Bits of the codes of lengths from 3, and of distances from 1, that photographs lead to; and of what follows them.
_LENGTH_BITS = np.array([2.5, 3.5, 4, 4.5, 5, 5.5, 6, 6.5, *[8] * 20])
_LENGTH_EXTRA = np.array([0] * 8 + [n for n in range(1, 6) for _ in range(4)])
_DISTANCE_BITS = np.array([*[5.5] * 18, *[4] * 12])
_DISTANCE_EXTRA = np.array([0] * 4 + [n for n in range(1, 14) for _ in range(2)])
#: The bits of each length and distance.
_FROM_3 = np.repeat(_LENGTH_BITS + _LENGTH_EXTRA, 1 << _LENGTH_EXTRA)
_LENGTHS = np.concatenate([np.zeros(3), _FROM_3[: _looks.LONGEST - 3], [8.0]])
_DISTANCES = np.append(0, np.repeat(_DISTANCE_BITS + _DISTANCE_EXTRA, 1 << _DISTANCE_EXTRA))
#: Distances between entries are measured with at most about this many comparisons.
COMPARISONS = 1 << 22
#: A coordinate far from all pixels, and the least visibility, with which it is still dear.
_FAR, _LEAST = 1e15, 1e-12
#: By how much a squared level of variance raises the squared step that is hardly seen in grain: with 4, photographs get
#: 1 % larger, and smooth areas keep a few more of their tones.
_GRAIN = 16.0
#: Pixels that a Gaussian window of `visibility` reaches.
REACH = 20
#: Shortest step between entries.
_LEAST_STEP = 1e-3

#: Ways to code indices: of PNG, and of GIF.
CoderName: TypeAlias = Literal["deflate", "lzw"]


class Rate(NamedTuple):
    """What small files are worth."""

    #: Price of a bit, in squared errors: at 0.1 these are hardly larger than for the nearest entries; 1.2 gives half of
    #: the bytes.
    price: float = 0.4
    #: Most matches that are followed from a pixel, in 1..256: four times as many make files 1 to 4 % smaller, and take
    #: two to three times as long.
    n_matches: int = 32
    #: Whose bits count. With "lzw" half as many paths are followed as there are matches, at most 64.
    coder: CoderName = "deflate"
    #: Whether an image that has the colors of its palette stays as it is, whatever its bits cost.
    keeps_exact: bool = True


#: What keeps photographs as they are seen.
USUAL = Rate()


def visibility(brightness: Array, bits: float = 0.0) -> Floats32:
    """Return how much an error counts in each (H, W) pixel: less where the brightness varies, which hides errors.

    Errors count half where its standard deviation is 3 levels, in a Gaussian window of sigma 3; and more where nothing
    but a slope hides them, as runs of one index in a gradient are seen as streaks.

    The brightness is in levels of 8 bits; `bits` is what an index costs, in squared errors. Where nothing hides a step,
    it must not buy more than one that is hardly seen, of a level; the square of what is seen grows in a line with the
    power of grain (Z.-L. Lu, B. A. Dosher, J. Opt. Soc. Am. A 16 (1999) 764-778, doi:10.1364/JOSAA.16.000764).
    """
    # Squares of less are rounded less. Four blurs of sigma 1.5 are one of 3.
    (height, width), seen = brightness.shape, np.empty(brightness.shape, np.float32)
    planes = [*np.empty((2, height, width + 2 * REACH), np.float32)]

    def begin(rows: slice) -> None:
        levels = np.asarray(brightness[rows], np.float32) - 128
        planes[0][rows] = np.pad(levels, ((0, 0), (REACH, REACH)), "symmetric")
        np.square(planes[0][rows], out=planes[1][rows])

    in_stripes(begin, height, 8.0 * seen.size)
    for _ in range(4):
        planes = blurred(planes)
    mean, square = planes

    def weigh(rows: slice) -> None:
        first = max(rows.start - 1, 0)
        near, own = mean[first : rows.stop + 1], slice(rows.start - first, rows.stop - first)
        # The plane that fits best in a Gaussian window has the slope of the blurred brightness.
        slopes = [np.gradient(near, axis=axis)[own] for axis in range(2) if mean.shape[axis] > 1]
        variance = square[rows] - near[own] * near[own]
        rest = variance - sum(np.float32(9) * slope * slope for slope in slopes)
        variance, rest = (np.maximum(some[:, REACH:-REACH], np.float32(0)) for some in (variance, rest))
        hidden = 1 / (1 + np.sqrt(variance) / np.float32(3))
        seen[rows] = np.maximum(hidden, np.float32(bits) / (1 + np.float32(_GRAIN) * rest))

    in_stripes(weigh, height, 32.0 * seen.size)
    return seen


def map_by_rate(
    places: Floats32,
    entries: Floats32,
    seen: Floats32,
    rate: Rate,
    strength: float = STRENGTH,
    kept: Floats32 | None = None,
) -> Bytes:
    """Return the (H, W) entry of each pixel so that a file needs few bits; the same for any number of threads.

    Pixels and the entries, 2 to 256, are places of up to four coordinates, in units in which a squared distance of 1 is
    hardly seen; `seen` is how much it counts, see `visibility`. `strength` is the share of the error that is handed on.
    `kept` are the places of what a frame is drawn over, with the coder "lzw" and at most 255 colors: K stands for it.
    """
    height, width, _ = places.shape
    targets, weights = _wide(places), np.maximum(seen, np.float32(_LEAST))
    palette = np.concatenate([_wide(entries), np.full((1, 4), _FAR, np.float32)])
    indices, longest = np.empty((height, width), np.uint8), max(usual_step(entries), _LEAST_STEP)
    side = max(float(np.sqrt(np.median(_squared_steps(entries)))), _LEAST_STEP)  # a few lonely entries do not change it
    if rate.coder == "lzw":
        below = None if kept is None else _wide(kept)
        n_paths = min(max(rate.n_matches // 2, 1), _looks.MOST_PATHS)
        _looks.map_phrases(targets, weights, palette, below, n_paths, rate.price, side, strength, longest, indices)
        return indices
    shift = next(shift for shift in (3, 2, 1, 0) if len(entries) <= 1 << (8 >> shift))
    lengths, distances = ((rate.price * bits).astype(np.float32) for bits in (_LENGTHS, _DISTANCES))
    literal = rate.price * np.log2(len(entries))

    def kernel(rows: slice) -> None:
        _looks.map_band(
            targets[rows], weights[rows], palette, lengths, distances, shift, rate.n_matches,
            rate.price, literal, side, strength, longest, indices[rows],
        )  # fmt: skip

    rows = max(_BAND, _WINDOWS * (_looks.FARTHEST << shift) // width)
    in_stripes(kernel, height, _WORK * targets.size, rows)
    return indices


def _wide(places: Floats32) -> Floats32:
    """Return places with four coordinates, the last of them 0."""
    return np.pad(places, [(0, 0)] * (places.ndim - 1) + [(0, 4 - places.shape[-1])])


def usual_step(palette: Floats32) -> float:
    """Return the root of the mean squared distance from an entry to the nearest other one."""
    # Longer errors come mostly from colors that the palette cannot mix. They would add up and end as spots of far
    # colors.
    return float(np.sqrt(_squared_steps(palette).mean()))


def _squared_steps(palette: Floats32) -> Floats:
    """Return the squared distance from entries to the nearest other one; a lonely one has 0."""
    some = np.arange(0, len(palette), max(1, len(palette) ** 2 // COMPARISONS))
    squares = ((palette[some][:, None] - palette) ** 2).sum(axis=2, dtype=np.float64)
    squares[np.arange(len(some)), some] = np.inf if len(palette) > 1 else 0
    return np.asarray(squares.min(axis=1))

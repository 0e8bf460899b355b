"""Borders between neighboring regions, and how strongly they part them.

The strength of a border is measured at the cracks between the pixels on its two sides: a disc around a crack is
halved along the border, and the histograms of the halves are compared, channel by channel, for discs of several radii.

D. Martin, C. Fowlkes, J. Malik, IEEE Trans. Pattern Analysis and Machine Intelligence 26 (2004) 530-549, doi
10.1109/TPAMI.2004.1273918: half discs. Measuring at the borders of small regions alone is what makes it quick.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts
from cvtimg.labels.borders import Borders
from cvtimg.segmentation import _segments
from cvtimg.segmentation._segments import HIDDEN, N_LEVELS, REACH
from cvtimg.segmentation.hierarchy.channels import Channels

#: Radii of the discs, and what each counts for.
RADII = (2, 3, 5, 10)
RADIUS_WEIGHTS = (1 / 3, 1 / 3, 1 / 3, 1 / 6)
#: What lightness, the two other channels and textons count for.
_COLOR_WEIGHTS, _TEXTON_WEIGHT = (1.0, 1.2, 1.2), 0.3
_N_ANGLES = 16
#: How far along a border its direction is looked for, in pixels.
_STRAIGHT = 5.0
#: Levels are smoothed by a Gaussian of this many bins.
_SMOOTHING = 0.1 * N_LEVELS


def border_strengths(borders: Borders, channels: Channels) -> NDArray[np.float64]:
    """(B,) mean strength of each border, about 0 to 1.5."""
    if not len(borders.pairs):
        return np.zeros(0)
    angles = _angles(borders)
    turns = (borders.is_flat * _N_ANGLES + angles).astype(np.int32)
    distances = _half_disc_distances(channels, borders.places, turns)
    n_colors = distances.shape[1] - 1
    weights = np.outer([*_COLOR_WEIGHTS[:n_colors], _TEXTON_WEIGHT], RADIUS_WEIGHTS)
    strengths = np.einsum("pcr,cr->p", distances, weights)
    means: NDArray[np.float64] = np.add.reduceat(strengths, borders.starts[:-1]) / borders.lengths
    return means


def _angles(borders: Borders) -> NDArray[np.int32]:
    """(P,) number of the direction in which the border runs at each crack; a crack alone runs along itself."""
    angles = np.empty(len(borders.places), np.int32)
    middles = 2 * borders.places + np.stack([borders.is_flat, ~borders.is_flat], axis=1)

    def orient(first: int, last: int) -> None:
        _segments.orient(middles, borders.starts, first, last, _STRAIGHT, _N_ANGLES, angles)

    in_parts(orient, len(borders.pairs), work=float(np.square(borders.lengths, dtype=np.float64).sum()))
    alone = np.where(borders.is_flat, 0, _N_ANGLES // 2)
    return np.where(angles < 0, alone, angles).astype(np.int32)


def _half_disc_distances(
    channels: Channels, places: NDArray[np.int32], turns: NDArray[np.int32]
) -> NDArray[np.float32]:
    """(P, C, R) distances of the halves of discs around cracks."""
    margin = RADII[-1]
    shown = np.where(channels.inside[..., None], channels.bins, np.uint8(HIDDEN))
    padded = np.pad(shown, ((margin, margin), (margin, margin), (0, 0)), constant_values=HIDDEN)
    width, n_channels = padded.shape[1:]
    down, right, counts = _discs()
    steps = (down * width + right).astype(np.int32)
    flat = ((places[:, 0] + margin) * width + places[:, 1] + margin).astype(np.int32)
    smoothing = _taps().astype(np.float32)
    distances = np.empty((len(flat), n_channels, len(RADII)), np.float32)

    def measure(first: int, last: int) -> None:
        _segments.half_disc_distances(
            padded.reshape(-1, n_channels), flat, turns, steps, counts, smoothing, first, last, distances
        )

    in_parts(measure, len(flat), work=3000.0 * len(flat))
    return distances


@cache
def _discs() -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
    """Rows and columns (T, 2, S), from the pixel before a crack, of the halves of discs, and (T, R) their sizes.

    Upright cracks come first, then flat ones, each in all directions. Pixels on the line between the halves belong
    to neither; inner ones come first.
    """
    reach = np.arange(-RADII[-1], RADII[-1] + 2)
    rows, columns = (grid.ravel() for grid in np.meshgrid(reach, reach, indexing="ij"))
    halves, counts = [], []
    for is_flat in (False, True):
        down, right = rows - 0.5 * is_flat, columns - 0.5 * (not is_flat)
        distances = np.hypot(down, right)
        for angle in np.pi / _N_ANGLES * np.arange(_N_ANGLES):
            across = down * np.cos(angle) - right * np.sin(angle)
            for side in (-1, 1):
                half = np.flatnonzero((distances <= RADII[-1]) & (side * across > 1e-6))
                half = half[np.argsort(distances[half], kind="stable")]
                halves.append(half)
            counts.append(np.searchsorted(distances[half], RADII, side="right"))
    table = np.zeros((len(halves), max(map(len, halves))), np.intp)
    for line, half in zip(table, halves, strict=True):
        line[: len(half)] = half
    sides = table.reshape(len(counts), 2, -1)
    return rows[sides], columns[sides], np.array(counts, np.int32)


def _taps() -> NDArray[np.float64]:
    taps = np.exp(-0.5 * (np.arange(-REACH, REACH + 1) / _SMOOTHING) ** 2)
    normed: NDArray[np.float64] = taps / taps.sum()
    return normed


def smoothing_matrix() -> NDArray[np.float64]:
    """(N_LEVELS, N_LEVELS) share of each level that smoothing gives to each other; rows have sum 1."""
    levels = np.arange(N_LEVELS)
    far = levels[:, None] - levels
    shares = np.where(abs(far) <= REACH, _taps()[np.clip(far + REACH, 0, 2 * REACH)], 0)
    normed: NDArray[np.float64] = shares / shares.sum(axis=1, keepdims=True)
    return normed

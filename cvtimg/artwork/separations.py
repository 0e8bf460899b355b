"""Colors taken apart into the ink of several pens."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.artwork.tones import Floats32, as_coverage, linear_light
from cvtimg.colors.samples import color_samples
from cvtimg.colors.spaces import from_space, to_space
from cvtimg.quantization.palette_search import find_palette

#: Pens of process colors: what each name draws.
PROCESS_COLORS = {"cyan": (0, 255, 255), "magenta": (255, 0, 255), "yellow": (255, 255, 0), "black": (0, 0, 0)}
#: Levels of each channel that palettes are mixed for, and sweeps of the search for a mixture.
_LEVELS, _SWEEPS = 48, 60
_BYTE = np.dtype(np.uint8)


def process_coverages(image: Any, white_cutoff: float, max_ink: float) -> list[Floats32]:
    """Compute the coverage of cyan, magenta, yellow and black, in this order, for tones scaled by `max_ink`.

    Black takes all that the three have in common. Ink c and black k leave 1 - c - k + q c k of the light of a channel:
    q is 1 for dots that fall on each other by chance (Demichel), and 0 for dots that never do. Dots here keep apart as
    far as there is room, which black takes: q is k, which drawings bear out.
    """
    light, opacity = _three_channels(image)
    light = 1 - np.float32(max_ink) * (1 - light)
    lightest = light.max(axis=2)
    black = 1 - lightest
    share = np.maximum(1 - black * black, np.float32(1e-6))
    inks = [(lightest - light[:, :, channel]) / share for channel in range(3)]
    return [as_coverage(ink, opacity, white_cutoff * max_ink) for ink in (*inks, black)]


def palette_coverages(image: Any, n_pens: int, white_cutoff: float) -> tuple[list[Floats32], NDArray[np.uint8]]:
    """Find pens for an image, and the coverage of each where their dots lie side by side on white paper.

    The pens are the palette of the image, white being one color more, which the paper has.
    """
    light, opacity = _three_channels(image)
    seen = light if opacity is None else 1 - opacity[:, :, np.newaxis] * (1 - light)
    encoded = from_space(seen.reshape(-1, 3).astype(np.float64), "linear", np.dtype(np.float32))
    steps = np.rint(encoded * (_LEVELS - 1)).astype(np.int64)
    keys = (steps[:, 0] * _LEVELS + steps[:, 1]) * _LEVELS + steps[:, 2]
    distinct, of_pixel = np.unique(keys, return_inverse=True)
    levels = np.stack([distinct // _LEVELS**2, distinct // _LEVELS % _LEVELS, distinct % _LEVELS], axis=1)
    colors = np.rint(levels * (255 / (_LEVELS - 1))).astype(np.uint8)
    white = np.full((1, 3), 255, np.uint8)
    palette = find_palette(color_samples(colors[of_pixel][np.newaxis]), n_pens + 1, locked=white).colors
    pens = palette[(palette < 255).any(axis=1)][:n_pens]
    if not len(pens):
        pens = np.zeros((1, 3), np.uint8)
    shares = _mixtures(to_space(colors, "linear"), to_space(pens, "linear"))
    inks = [shares[of_pixel, pen].reshape(light.shape[:2]).astype(np.float32) for pen in range(len(pens))]
    return [as_coverage(ink, None, white_cutoff) for ink in inks], np.ascontiguousarray(pens[:, :3])


def _three_channels(image: Any) -> tuple[Floats32, Floats32 | None]:
    light, opacity = linear_light(image)
    return np.repeat(light, 3, axis=2) if light.shape[2] == 1 else light, opacity


def _mixtures(light: NDArray[np.float64], pens: NDArray[np.float64]) -> NDArray[np.float64]:
    """Find the shares of pens, >= 0 and at most 1 together, whose mixture with white is nearest, by coordinates."""
    removed = 1 - pens  # by each pen from the light of the paper
    shares = np.zeros((len(light), len(pens)))
    rest = 1 - light  # to remove
    free = np.ones(len(light))
    for _ in range(_SWEEPS):
        for pen, step in enumerate(removed):
            best = shares[:, pen] + (rest @ step) / max(float(step @ step), 1e-9)
            share = np.clip(best, 0, shares[:, pen] + free)
            change = share - shares[:, pen]
            shares[:, pen] = share
            free -= change
            rest -= change[:, np.newaxis] * step
    return shares

"""The script of the sample images that damages pictures, and pictures to damage, for the tests of restoration."""

from pathlib import Path

import damage
import numpy as np

from cvtimg._shared.types import Array, Bytes, Floats, Indices

SCRIPT = Path(damage.__file__)


def as_bytes(image: Array) -> Bytes:
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def two_phases(side: int = 96) -> Floats:
    """(H, W, 1) a ring and a bar, 1, on a background, 0."""
    down, right = np.mgrid[:side, :side] / side
    far = np.hypot(down - 0.42, right - 0.4)
    ring = (far < 0.27) & (far > 0.11)
    bar = (abs(down - 0.75) < 0.12) & (abs(right - 0.65) < 0.2)
    return (ring | bar).astype(np.float64)[:, :, None]


def card(side: int = 96) -> tuple[Floats, Indices]:
    """(H, W, 3) flat shapes in three colors on a fourth, and (H, W) which is where."""
    down, right = np.mgrid[:side, :side] / side
    which = np.zeros((side, side), np.intp)
    which[np.hypot(down - 0.33, right - 0.3) < 0.22] = 1
    which[(abs(down - 0.78) < 0.15) & (abs(right - 0.3) < 0.2)] = 2
    which[(down > 0.12) & (down < 0.85) & (abs(right - 0.75) < (down - 0.12) / 4)] = 3
    colors = np.array([[0.9, 0.85, 0.7], [0.2, 0.3, 0.75], [0.8, 0.2, 0.2], [0.15, 0.55, 0.3]])
    return colors[which], which


def psnr(one: Array, other: Array) -> float:
    """In dB, where white is 1."""
    return float(-10 * np.log10(np.mean((np.asarray(one, np.float64) - other) ** 2)))

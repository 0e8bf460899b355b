"""Averages by a Gaussian, for noisy images.

With a kernel w of sum 1, averaging the squared distance to a generator gives the same cells as averaging the image,
because w * |u - z|^2 = |w * u - z|^2 + a term without z.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from cvtimg._shared.types import Bools, Floats32

#: A Gaussian is truncated at this many standard deviations.
TRUNCATE = 4.0


def noise_gain(deviation: float) -> float:
    """Return the part of the variance of white noise that averages have: the sum of the squared weights."""
    line = np.zeros(2 * int(TRUNCATE * deviation) + 5)
    line[len(line) // 2] = 1
    weights = gaussian_filter(line, deviation, mode="constant", truncate=TRUNCATE)
    return float(weights @ weights) ** 2


def averaged(values: Floats32, deviation: float, inside: Bools | None = None) -> Floats32:
    """(H, W, D) averages of (H, W, D) values over the pixels `inside`, (H, W); 0 elsewhere."""
    # Deviations are in pixels. Pixels beyond the border of the image are outside too.
    within = np.ones(values.shape[:2], bool) if inside is None else inside

    def filtered(image: Floats32) -> Floats32:
        return np.asarray(gaussian_filter(image, deviation, mode="constant", truncate=TRUNCATE, axes=(0, 1)))

    mass = filtered(within[..., None].astype(np.float32))
    sums = filtered(np.where(within[..., None], values, np.float32(0)))
    return np.divide(sums, mass, out=np.zeros_like(sums), where=within[..., None])

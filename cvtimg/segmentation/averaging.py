"""Averaging: noisy or irregular pictures are segmented by what a pixel and those about it have in common.

With a kernel w of sum 1, averaging the squared distance to a generator gives the same cells as averaging the picture,
because w * |u - z|^2 = |w * u - z|^2 + a term without z: this is "before". With "after" it is the segmented picture
that is averaged: each pixel is replaced by its generator, that picture is averaged, each pixel goes to the generator
nearest to its average, and the generators are renewed from the original pixels, until the labels rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice
from cvtimg.engine.points import assign, pack

WHEN = ("before", "after")
KERNELS = ("gaussian", "box")
#: A Gaussian is cut off at so many standard deviations.
TRUNCATE = 4.0
#: Labels rest when no more than this share of the pixels changes.
_AT_REST = 1e-3
_MAX_ROUNDS = 50


@dataclass(frozen=True, slots=True)
class Averaging:
    """How to average.

    Attributes
    ----------
    when : {"before", "after"}
        Average the picture and then segment it, or segment it and then average the segments.
    kernel : {"gaussian", "box"}
        What the weights of near pixels are.
    radius : float
        In pixels, > 0: the standard deviation of the Gaussian; or how far the square box reaches from its center,
        a whole number.
    """

    when: str = "before"
    kernel: str = "gaussian"
    radius: float = 2.0

    def __post_init__(self) -> None:
        check_choice("when", self.when, WHEN)
        check_choice("kernel", self.kernel, KERNELS)
        if not 0 < self.radius <= 1000:
            raise ValueError(f"radius={self.radius} must be > 0 and at most 1000 pixels")
        if self.kernel == "box" and self.radius != int(self.radius):
            raise ValueError(f"radius={self.radius} of a box must be a whole number of pixels")

    @property
    def noise_gain(self) -> float:
        """What is left of the variance of white noise: the sum of the squared weights."""
        reach = int(TRUNCATE * self.radius) + 2
        peak = np.zeros((2 * reach + 1, 1, 1), np.float32)
        peak[reach] = 1
        line = _filtered(peak, self)[:, 0, 0].astype(np.float64)
        return float((line / line.sum()) @ (line / line.sum())) ** 2


def as_averaging(averaging: str | Averaging | None) -> Averaging | None:
    """Return an `Averaging` for its name, "before" or "after", or as it is."""
    return Averaging(check_choice("averaging", averaging, WHEN)) if isinstance(averaging, str) else averaging


def averaged(
    values: NDArray[np.float32], averaging: Averaging, inside: NDArray[np.bool_] | None = None
) -> NDArray[np.float32]:
    """(H, W, D) averages of (H, W, D) values over the pixels that are `inside` (H, W); elsewhere 0.

    What lies beyond the border of the picture is outside too.
    """
    within = np.ones(values.shape[:2], bool) if inside is None else inside
    mass = _filtered(within[..., None].astype(np.float32), averaging)
    sums = _filtered(np.where(within[..., None], values, np.float32(0)), averaging)
    result: NDArray[np.float32] = np.divide(sums, mass, out=np.zeros_like(sums), where=within[..., None])
    return result


def _filtered(values: NDArray[np.float32], averaging: Averaging) -> NDArray[np.float32]:
    from scipy.ndimage import gaussian_filter, uniform_filter

    if averaging.kernel == "gaussian":
        result: NDArray[np.float32] = gaussian_filter(
            values, averaging.radius, mode="constant", truncate=TRUNCATE, axes=(0, 1)
        )
    else:
        result = uniform_filter(values, 2 * int(averaging.radius) + 1, mode="constant", axes=(0, 1))
    return result


def average_segments(
    values: NDArray[np.float32], labels: NDArray[np.int32], n_segments: int, averaging: Averaging
) -> NDArray[np.int32]:
    """Average segments and assign pixels anew, in turns, until the labels rest or come back to what they were.

    Parameters
    ----------
    values : (H, W, D) float32 array
        The original pixels.
    labels : (H, W) int32 array
        Where to start: 1..n_segments, and 0 outside of the mask.
    n_segments : int
        K. A segment that loses its last pixel does not come back.
    averaging : Averaging
        The kernel and its radius.

    Returns
    -------
    (H, W) int32 array
    """
    inside = labels > 0
    rows = values[inside]
    seen: set[bytes] = set()
    own, before = labels[inside] - 1, None
    while len(seen) < _MAX_ROUNDS and own.tobytes() not in seen:
        if before is not None and np.count_nonzero(own != before) <= _AT_REST * len(own):
            break
        seen.add(own.tobytes())
        masses = np.bincount(own, minlength=n_segments)
        means = np.stack([np.bincount(own, column, n_segments) for column in rows.T.astype(np.float64)], axis=1)
        present = np.flatnonzero(masses)
        means[present] = means[present] / masses[present, None]
        picture = np.zeros(values.shape, np.float32)
        picture[inside] = means[own]
        points = pack(averaged(picture, averaging, inside)[inside], np.ones(len(rows)))
        nearest = assign(points, points.frame.inward(means[present]))[: len(rows)]
        before, own = own, present[nearest].astype(np.int32)
    end = np.zeros_like(labels)
    end[inside] = own + 1
    return end

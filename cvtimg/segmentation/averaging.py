"""Averaging, for noisy or irregular images.

With a kernel w of sum 1, averaging the squared distance to a generator gives the same cells as averaging the image,
because w * |u - z|^2 = |w * u - z|^2 + a term without z: this is "before". With "after", the segmented image is
averaged: each pixel is replaced by its generator, this image is averaged, each pixel moves to the generator nearest to
its average, and the generators are updated from the original pixels, until the labels settle.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_in_range
from cvtimg._shared.progress import tell
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg.engine.points import assign, pack

WHEN = ("before", "after")
KERNELS = ("gaussian", "box")
#: A Gaussian is truncated at this many standard deviations.
TRUNCATE = 4.0
#: Labels have settled when at most this share of the pixels changes.
_AT_REST = 1e-3
_MAX_ROUNDS = 50
_LARGEST_RADIUS = 1000


@dataclass(frozen=True, slots=True)
class Averaging:
    """How to average.

    Attributes
    ----------
    when : {"before", "after"}
        Average the image and then segment it, or segment it and then average the segments.
    kernel : {"gaussian", "box"}
        Weights of near pixels.
    radius : float
        In pixels, > 0 and at most 1000: the standard deviation of the Gaussian; or the reach of the square box from
        its center, a whole number.
    """

    when: str = "before"
    kernel: str = "gaussian"
    radius: float = 2.0

    def __post_init__(self) -> None:
        check_choice("when", self.when, WHEN)
        check_choice("kernel", self.kernel, KERNELS)
        check_in_range(
            "radius", self.radius, 0 < self.radius <= _LARGEST_RADIUS, f"> 0 and <= {_LARGEST_RADIUS} pixels"
        )
        whole = self.kernel != "box" or self.radius == int(self.radius)
        check_in_range("radius", self.radius, whole, "a whole number of pixels for kernel='box'")

    @property
    def noise_gain(self) -> float:
        """Part of the variance of white noise that remains: the sum of the squared weights."""
        reach = int(TRUNCATE * self.radius) + 2
        peak = np.zeros((2 * reach + 1, 1, 1), np.float32)
        peak[reach] = 1
        line = _filtered(peak, self)[:, 0, 0].astype(np.float64)
        return float((line / line.sum()) @ (line / line.sum())) ** 2


def averaged(
    values: NDArray[np.float32], averaging: Averaging, inside: NDArray[np.bool_] | None = None
) -> NDArray[np.float32]:
    """(H, W, D) averages of (H, W, D) values over the pixels `inside`, (H, W); 0 elsewhere."""
    # Pixels beyond the border of the image are outside too.
    within = np.ones(values.shape[:2], bool) if inside is None else inside
    mass = _filtered(within[..., None].astype(np.float32), averaging)
    sums = _filtered(np.where(within[..., None], values, np.float32(0)), averaging)
    return np.divide(sums, mass, out=np.zeros_like(sums), where=within[..., None])


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
    """Average segments and reassign pixels in turn, until the labels settle or repeat."""
    # Values, (H, W, D), are the original pixels. Labels, (H, W), are in 1..n_segments, and 0 outside the mask; a
    # segment that loses its last pixel does not come back.
    inside = labels > 0
    rows = values[inside]
    seen: set[bytes] = set()
    changed: list[float] = []
    own, before = labels[inside] - 1, None
    while len(seen) < _MAX_ROUNDS and own.tobytes() not in seen:
        if before is not None:
            changed.append(np.count_nonzero(own != before) / len(own))
            if changed[-1] <= _AT_REST:
                break
            tell(log(max(changed) / changed[-1]) / log(max(changed) / _AT_REST))
        seen.add(own.tobytes())
        masses = np.bincount(own, minlength=n_segments)
        means = per_mass(sum_by_label(own, rows, n_segments), masses)
        present = np.flatnonzero(masses)
        drawn = np.zeros(values.shape, np.float32)
        drawn[inside] = means[own]
        points = pack(averaged(drawn, averaging, inside)[inside], np.ones(len(rows)))
        nearest = assign(points, points.frame.inward(means[present]))[: len(rows)]
        before, own = own, present[nearest].astype(np.int32)
    end = np.zeros_like(labels)
    end[inside] = own + 1
    return end

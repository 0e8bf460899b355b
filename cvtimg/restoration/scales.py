"""An image at half its size, where noise is half as strong, and what that tells of the image itself.

Small patches leave noise of low frequencies, which shows as blotches in flat areas. At half the size the same patches
reach twice as far and remove it. Detail is not there, so only low frequencies are taken, and only where both sizes
agree up to some noise.

G. Facciolo, N. Pierazzo, J.-M. Morel, SIAM J. Imaging Sciences 10 (2017) 1603-1626, doi 10.1137/17M1111826, for
putting scales together; the weight is our own.
"""

from __future__ import annotations

import numpy as np

from cvtimg.restoration.filters import Noisy
from cvtimg.restoration.patches import REACH, with_border
from cvtimg.restoration.versions import Floats

#: Blur, in pixels of the half size, of what is taken from there, and of the first estimate of an image.
_LOW, FIRST_BLUR = 1.0, 0.7
#: Side of the windows in which the sizes are compared, and the squared difference at which half is taken, as a share of
#: the variance of the noise.
_AROUND, _HALF = 7, 0.03


def halved(noisy: Noisy) -> Noisy:
    """Halve the size of a noisy image; blurred, it is the first estimate of itself."""
    from scipy.ndimage import gaussian_filter

    inner = slice(REACH, -REACH)
    precision = noisy.precision[inner, inner, None]
    weight = 4 * _half(precision)
    total = 4 * _half(precision * noisy.values[inner, inner])
    values = np.divide(total, weight, out=_half(noisy.estimate[inner, inner]), where=weight > 0)
    estimate = gaussian_filter(values, (FIRST_BLUR, FIRST_BLUR, 0))
    return Noisy(with_border(values), with_border(estimate), with_border(weight)[:, :, 0])


def with_low_frequencies(estimate: Floats, coarse: Floats, variance: float) -> Floats:
    """(H, W, C) estimate, with low frequencies from an estimate of half the size where they agree."""
    # `variance` is that of the noise that the image had.
    from scipy.ndimage import gaussian_filter, uniform_filter, zoom

    height, width = estimate.shape[:2]
    apart = coarse - _half(estimate)
    strength = uniform_filter(np.square(apart).mean(axis=2), _AROUND) / np.float32(_HALF * variance)
    apart = gaussian_filter(apart, (_LOW, _LOW, 0)) / (1 + strength[:, :, None] ** 2)
    added: Floats = zoom(apart, (2, 2, 1), order=1, grid_mode=True, mode="nearest")
    return estimate + added[:height, :width]


def _half(image: Floats) -> Floats:
    """(ceil(H / 2), ceil(W / 2), C) means of 2 x 2 pixels; an odd last row or column counts twice."""
    height, width = image.shape[:2]
    even = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) * np.float32(0.25)

"""How close an image is to another."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def psnr(mse: float | NDArray[Any], white: float) -> Any:
    """Return the peak signal-to-noise ratio in dB of a mean squared error, infinite where that is 0.

    Parameters
    ----------
    mse : float or array
        Mean squared error per sample, in squared units of the image.
    white : float
        The peak: the value of white in these units, as `peak` gives it.

    Examples
    --------
    >>> round(float(psnr(6.5025, 255)), 6)
    40.0
    """
    with np.errstate(divide="ignore"):
        return 10 * np.log10(white**2 / np.asarray(mse, dtype=np.float64))

"""How close an image is to another."""

from __future__ import annotations

from typing import Any

import numpy as np

from cvtimg._shared.pixels import white_among
from cvtimg._shared.types import Array


def psnr(mse: float | Array, white: float) -> Any:
    """Return the peak signal-to-noise ratio in dB of a mean squared error, infinite where that is 0."""
    with np.errstate(divide="ignore"):
        return 10 * np.log10(white**2 / np.asarray(mse, dtype=np.float64))


class Fidelity:
    """Figures of results that have an `energy` over `n_values` samples, and a `palette` of the type of the image."""

    __slots__ = ()

    @property
    def mse(self: Any) -> float:
        """Mean squared error per sample, alpha not counted, as in skimage.metrics.mean_squared_error."""
        return float(self.energy / self.n_values)

    @property
    def psnr(self: Any) -> float:
        """Peak signal-to-noise ratio in dB, infinite if exact.

        The peak is the white of the type; for floating point it is 1, or the range of a palette that leaves 0..1.
        """
        return float(psnr(self.mse, white_among(self.palette)))

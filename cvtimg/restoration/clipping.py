"""What clipping takes away from noisy values near the ends of an integer type, and how to put it back."""

from __future__ import annotations

import numpy as np

from cvtimg.restoration.versions import Floats

#: Points of the table from which the loss is read, over this many standard deviations beyond each end.
_N_POINTS, _BEYOND = 2048, 8.0


def mean_loss(true: Floats, sigma: float, white: float, ends: tuple[bool, bool] = (True, True)) -> Floats:
    """Return what clipping to 0..white adds to the mean of noisy values; the noise is Gaussian.

    Parameters
    ----------
    true : array
        Values without noise.
    sigma : float
        Standard deviation of the noise, > 0.
    white : float
    ends : tuple of bool
        Whether values are clipped at 0, and at white.
    """
    from scipy.special import ndtr

    # Far from an end nothing is lost; the table holds what is lost at the lower one.
    grid = np.linspace(0, _BEYOND, _N_POINTS)
    lost = np.exp(-(grid**2) / 2) / np.sqrt(2 * np.pi) - grid * ndtr(-grid)
    inside = np.clip(true, 0, white)
    loss = np.zeros(true.shape, np.float32)
    if ends[0]:
        loss += sigma * np.interp(inside / sigma, grid, lost, right=0)
    if ends[1]:
        loss -= sigma * np.interp((white - inside) / sigma, grid, lost, right=0)
    return loss


def clipped_ends(values: Floats, true: Floats, sigma: float, white: float) -> tuple[bool, bool]:
    """Tell whether values pile up at 0 and at `white` as Gaussian noise that is clipped there would."""
    from scipy.special import ndtr

    def piles_up(end: float) -> bool:
        expected = ndtr(-np.abs(np.clip(true, 0, white) - end) / sigma).sum()
        return bool(np.count_nonzero(values == end) >= expected / 2)

    return piles_up(0.0), piles_up(white)

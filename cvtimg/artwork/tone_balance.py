"""Dots of one size brought into balance with the tones: where ink is lacking the density grows.

A centroidal Voronoi tessellation has dots in proportion to the root of its density only where the density hardly
changes from one dot to the next. Light details beside dark areas get too few, as the dark pulls dots over.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine.methods import Stopping
from cvtimg.placement import DESCENTS, PixelMoments, Terms
from cvtimg.placement.pictures import WhereMassIs, picture_moments

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

#: How often the density is corrected, and moves after each correction.
_ROUNDS, _MOVES = 4, 4
#: The density grows as this power of the ink of a cell, in units of the mean, and at most by this factor.
_POWER, _LARGEST = 2.0, 4.0
#: Corrections are smoothed over this part of the distance between dots: the error of a single dot is noise.
_SMOOTHED = 0.5


def balance_tones(amount: Floats32, points: Floats) -> Floats:
    """Move dots until each stands for about the same amount, everywhere but for the noise of single dots.

    Parameters
    ----------
    amount : (H, W) float32 array
        Dots that each pixel asks for, in any unit.
    points : (N, 2) array
        A centroidal Voronoi tessellation of the density `amount` squared, or nearly.
    """
    amounts = picture_moments(amount, len(points))
    density = amount * amount
    for _ in range(_ROUNDS):
        density *= corrections(amounts, points)
        moments = picture_moments(density, len(points))
        terms = Terms(Stopping(0.0, _MOVES), project=WhereMassIs(moments))
        points = DESCENTS["l-bfgs"](moments, points, terms).generators
    return points


def corrections(amounts: PixelMoments, points: Floats) -> Floats32:
    """Compute the factors of a density, above 1 where points are too few for their amount, for each pixel."""
    from scipy.ndimage import gaussian_filter

    n_points = len(points)
    factors = np.clip((amounts(points).masses * (n_points / amounts.mass)) ** _POWER, 1 / _LARGEST, _LARGEST)
    width = _SMOOTHED * np.sqrt(np.count_nonzero(amounts.density) / n_points) / amounts.scale
    smooth: Floats32 = gaussian_filter(_of_pixels(factors, amounts, points), width, mode="nearest")
    return smooth


def _of_pixels(values: Floats, moments: PixelMoments, points: Floats) -> Floats32:
    """Give each pixel of the picture, before it was enlarged, the mean value of the cells that it lies in."""
    fine = values.astype(np.float32)[moments.labels(points)]
    factor = round(moments.scale)
    height, width = fine.shape
    means: Floats32 = fine.reshape(height // factor, factor, width // factor, factor).mean(axis=(1, 3))
    return means

"""Dots of several pens that keep apart from each other, each pen with the tones of its own ink.

Dots move to the centers of their cells among those of their own pen, and part of the way to the centers of their cells
among all dots, so that dots of different pens do not fall on each other.

M. Jiang, Y. Zhou, R. Wang, R. Southern, J. J. Zhang, Blue noise sampling using an SPH-based method, ACM Trans. Graphics
34 (2015), doi 10.1145/2816795.2818102; L.-Y. Wei, Multi-class blue noise sampling, ACM Trans. Graphics 29 (2010), doi
10.1145/1778765.1778816.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cvtimg.artwork.tone_balance import corrections
from cvtimg.placement.pictures import WhereMassIs, picture_moments

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

#: Moves, after how many the tones are corrected, and how far dots go to the centers of their cells among all dots.
_MOVES, _CORRECTED, _TO_ALL = 20, 4, 0.5


def keep_apart(amounts: Sequence[Floats32], points: Sequence[Floats]) -> list[Floats]:
    """Move dots of several pens apart.

    Parameters
    ----------
    amounts : sequence of (H, W) float32 arrays
        Dots that each pixel asks for of each pen, in any unit.
    points : sequence of (N, 2) arrays
        The dots of each pen, placed without regard to the others.
    """
    placed = list(points)
    used = [pen for pen, own in enumerate(placed) if len(own)]
    if len(used) < 2:
        return placed
    # Dots of all pens in an area are as many as the sum of what they ask for, each in units of one dot.
    wanted = {pen: amounts[pen] * (len(placed[pen]) / amounts[pen].sum(dtype=np.float64)) for pen in used}
    together = np.stack(list(wanted.values())).sum(axis=0, dtype=np.float32)
    of_all = picture_moments(together * together, sum(len(placed[pen]) for pen in used))
    of_amount = {pen: picture_moments(amounts[pen], len(placed[pen])) for pen in used}
    densities = {pen: amounts[pen] * amounts[pen] for pen in used}
    own = {pen: picture_moments(densities[pen], len(placed[pen])) for pen in used}
    into_ink = {pen: WhereMassIs(of_amount[pen]) for pen in used}
    size = np.array(together.shape[::-1])
    ends = np.cumsum([len(placed[pen]) for pen in used])[:-1]
    for move in range(1, _MOVES + 1):
        centers = np.split(of_all(np.concatenate([placed[pen] for pen in used])).centroids, ends)
        for pen, center in zip(used, centers, strict=True):
            if move % _CORRECTED == 0 and move < _MOVES:
                densities[pen] *= corrections(of_amount[pen], placed[pen])
                own[pen] = picture_moments(densities[pen], len(placed[pen]))
            among_own = own[pen](placed[pen]).centroids
            moved = np.clip(among_own + _TO_ALL * (center - placed[pen]), 0, size)
            placed[pen] = into_ink[pen](moved, placed[pen])
    return placed

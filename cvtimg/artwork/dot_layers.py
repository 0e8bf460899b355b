"""The dots of one pen or of several: where they lie and how large they are, for the ink that each pixel asks for.

Dots of one size are brought into balance with the tones: where ink is lacking the density grows, as a centroidal
Voronoi tessellation has dots in proportion to the root of its density only where that hardly changes from one dot to
the next. Dots of several pens move to the centers of their cells among those of their own pen, and part of the way to
those among all dots, so that they do not fall on each other.

M. Jiang, Y. Zhou, R. Wang, R. Southern, J. J. Zhang, Blue noise sampling using an SPH-based method, ACM Trans. Graphics
34 (2015), doi 10.1145/2816795.2818102; L.-Y. Wei, Multi-class blue noise sampling, ACM Trans. Graphics 29 (2010), doi
10.1145/1778765.1778816.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.progress import each, part
from cvtimg.engine.methods import Stopping
from cvtimg.placement import DESCENTS, PixelMoments, Terms, place_in_picture
from cvtimg.placement.pictures import WhereMassIs, picture_moments

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

DOTS = ("equal", "sized")
#: How often the density is corrected, and moves after each correction.
_ROUNDS, _MOVES = 4, 4
#: The density grows as this power of the ink of a cell, in units of the mean, and at most by this factor.
_POWER, _LARGEST = 2.0, 4.0
#: Corrections are smoothed over this part of the distance between dots: the error of a single dot is noise.
_SMOOTHED = 0.5
#: Moves, after how many the tones are corrected, and how far dots go to the centers of their cells among all dots.
_PEN_MOVES, _CORRECTED, _TO_ALL = 20, 4, 0.5
#: Moves of dots to the centers of the ink of their cells at the end.
_LAST_MOVES = {"equal": 1, "sized": 2}
#: Parts of the time: until dots are balanced, until those of pens are placed, until all but the last moves are made.
_PLACED, _OF_PENS, _SPREAD = 0.3, 0.5, 0.9
#: Steps of the tones that sizes of dots are told by, and logarithms of the powers by which they may grow.
_TONES, _POWERS = 1024, (-10.0, 10.0)


def balance_tones(amount: Floats32, points: Floats) -> Floats:
    """Move (N, 2) dots until each stands for about the same amount, everywhere but for the noise of single dots.

    They are a tessellation, or nearly, of the square of the (H, W) dots that each pixel asks for, in any unit.
    """
    amounts = picture_moments(amount, len(points))
    density = amount * amount
    for _ in each(range(_ROUNDS)):
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
    return gaussian_filter(_of_pixels(factors, amounts, points), width, mode="nearest")


def _of_pixels(values: Floats, moments: PixelMoments, points: Floats) -> Floats32:
    """Give each pixel of the picture, before it was enlarged, the mean value of the cells that it lies in."""
    fine = values.astype(np.float32)[moments.labels(points)]
    factor = round(moments.scale)
    height, width = fine.shape
    return fine.reshape(height // factor, factor, width // factor, factor).mean(axis=(1, 3))


def keep_apart(amounts: Sequence[Floats32], points: Sequence[Floats]) -> list[Floats]:
    """Move apart the dots of several pens, placed without regard to each other.

    Amounts are the (H, W) dots that each pixel asks for of each pen, in any unit.
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
    for move in each(range(1, _PEN_MOVES + 1)):
        centers = np.split(of_all(np.concatenate([placed[pen] for pen in used])).centroids, ends)
        for pen, center in zip(used, centers, strict=True):
            if move % _CORRECTED == 0 and move < _PEN_MOVES:
                densities[pen] *= corrections(of_amount[pen], placed[pen])
                own[pen] = picture_moments(densities[pen], len(placed[pen]))
            among_own = own[pen](placed[pen]).centroids
            moved = np.clip(among_own + _TO_ALL * (center - placed[pen]), 0, size)
            placed[pen] = into_ink[pen](moved, placed[pen])
    return placed


@dataclass(frozen=True, slots=True, eq=False)
class DotLayer:
    """Dots of one pen; arrays are as in `Stipples`."""

    points: Floats
    radii: Floats
    masses: Floats
    energy: float


def place_dots(ink: Floats32, n_dots: int, dots: str, radius_range: tuple[float, float] | None) -> DotLayer:
    """Place dots whose areas add up to the ink, the (H, W) area of disks that each pixel asks for.

    Dots are "equal", of one size where the density tells; or "sized", each as large as its mass, with radii in a range
    if one is given.
    """
    amount = _amount(ink, n_dots, radius_range)
    with part(0, _SPREAD):
        points = _spread_dots(amount, n_dots, balanced=dots != "sized" or radius_range is not None)
    with part(_SPREAD, 1):
        return _finished(ink, points, dots, radius_range, _LAST_MOVES[dots])


def place_pens(
    inks: Sequence[Floats32], counts: Sequence[int], dots: str, radius_range: tuple[float, float] | None
) -> list[DotLayer]:
    """Place the dots of several pens, each with the tones of its own ink, and apart from those of the others."""
    amounts = [_amount(ink, count, radius_range) for ink, count in zip(inks, counts, strict=True)]
    with part(0, _OF_PENS):
        placed = [_spread_dots(*pen, balanced=True) for pen in each(list(zip(amounts, counts, strict=True)))]
    with part(_OF_PENS, 1):
        apart = keep_apart(amounts, placed)
    return [_finished(ink, points, dots, radius_range, 0) for ink, points in zip(inks, apart, strict=True)]


def _amount(ink: Floats32, n_dots: int, radius_range: tuple[float, float] | None) -> Floats32:
    """Return how many dots each pixel asks for, in any unit; dots of one size must be as many as the ink."""
    if n_dots == 0 or radius_range is None:
        return ink
    return ink / _disk_areas(ink, n_dots, radius_range)


def _spread_dots(amount: Floats32, n_dots: int, *, balanced: bool) -> Floats:
    if n_dots == 0:
        return np.empty((0, 2))
    # In a tessellation of density rho there are rho^(1/2) dots in an area.
    with part(0, _PLACED if balanced else 1):
        points = place_in_picture(amount * amount, n_dots, effort="fast").points
    if not balanced:
        return points
    with part(_PLACED, 1):
        return balance_tones(amount, points)


def _finished(
    ink: Floats32, points: Floats, dots: str, radius_range: tuple[float, float] | None, n_moves: int
) -> DotLayer:
    """Make the last moves of dots, and find their sizes."""
    n_dots = len(points)
    if n_dots == 0:
        return DotLayer(points, np.empty(0), np.empty(0), 0.0)
    moments = picture_moments(ink, n_dots)
    # The density of dots is steeper than the ink, and pulls dots within their cells to its dark side.
    for _ in range(n_moves):
        points = moments(points).centroids
    points = WhereMassIs(moments)(points, points)
    found = moments(points)
    masses = found.masses
    radii = np.full(n_dots, np.sqrt(moments.mass / n_dots / np.pi))
    if dots == "sized":
        radii = np.sqrt(masses / np.pi)
        if radius_range is not None:
            radii = np.clip(radii, *radius_range)
    return DotLayer(points, radii, masses, found.energy)


def _disk_areas(ink: Floats32, n_dots: int, radius_range: tuple[float, float]) -> Floats32:
    """Choose how large the dots of each tone are, from the least radius to the greatest, so that n dots give the ink.

    The radius grows as a power of the ink from one to the other; the power is what makes the number right. Where even
    the least or the greatest for all tones does not, the tones will be off.
    """
    least, greatest = radius_range
    darkest = float(ink.max())
    counts, edges = np.histogram(ink, _TONES, (0, darkest))
    tones = (edges[1:] + edges[:-1]) / 2

    def areas(tone: Floats, exponent: float) -> Floats:
        return np.pi * (least + (greatest - least) * (tone / darkest) ** exponent) ** 2

    def excess(power: float) -> float:
        return float((counts * tones / areas(tones, np.exp(power))).sum()) - n_dots

    from scipy.optimize import bisect

    low, high = _POWERS
    power = low if excess(low) > 0 else high if excess(high) < 0 else float(bisect(excess, low, high, xtol=1e-9))
    table = areas(np.linspace(0, darkest, _TONES), np.exp(power)).astype(np.float32)
    return table[np.rint(ink * np.float32((_TONES - 1) / darkest)).astype(np.intp)]

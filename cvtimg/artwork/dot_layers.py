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
from cvtimg.artwork.tones import TABLE_SIZE
from cvtimg.engine.methods import Stopping
from cvtimg.placement import DESCENTS, PixelMoments, Terms, place_generators
from cvtimg.placement.pictures import WhereMassIs, picture_moments

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

DOTS = ("equal", "sized")
#: Moves of dots to the centers of the ink of their cells at the end.
_LAST_MOVES = {"equal": 1, "sized": 2}


@dataclass(frozen=True, slots=True)
class Balance:
    """How dots are brought into balance with the tones, and those of several pens away from each other."""

    rounds: int = 4  # corrections of the density
    moves: int = 4  # after each correction
    largest: float = 4.0  # factor of the density in a correction
    smoothed: float = 0.5  # distances between dots that it is smoothed over: the error of a single dot is noise
    pen_moves: int = 20  # of several pens
    to_all: float = 0.5  # part of the way to the centers of cells among all dots that these go


BALANCE = Balance()


def balance_tones(amount: Floats32, points: Floats) -> Floats:
    """Move (N, 2) dots until each stands for about the same amount, everywhere but for the noise of single dots.

    They are a tessellation, or nearly, of the square of the (H, W) dots that each pixel asks for, in any unit.
    """
    amounts = picture_moments(amount, len(points))
    density = amount * amount
    for _ in each(range(BALANCE.rounds)):
        density *= corrections(amounts, points)
        moments = picture_moments(density, len(points))
        terms = Terms(Stopping(0.0, BALANCE.moves), project=WhereMassIs(moments))
        points = DESCENTS["l-bfgs"](moments, points, terms).generators
    return points


def corrections(amounts: PixelMoments, points: Floats) -> Floats32:
    """Compute the factors of a density, above 1 where points are too few for their amount, for each pixel."""
    from scipy.ndimage import gaussian_filter

    n_points = len(points)
    # There are rho^(1/2) dots in an area where the density is rho.
    lacking = (amounts(points).masses * (n_points / amounts.mass)) ** 2
    factors = np.clip(lacking, 1 / BALANCE.largest, BALANCE.largest)
    width = BALANCE.smoothed * np.sqrt(np.count_nonzero(amounts.density) / n_points) / amounts.scale
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
    if sum(len(own) > 0 for own in placed) < 2:
        return placed
    # Dots of all pens in an area are as many as the sum of what they ask for, each in units of one dot.
    counts = [len(own) for own in placed]
    together = np.zeros_like(amounts[0])
    for amount, count in zip(amounts, counts, strict=True):
        if count:
            together += amount * np.float32(count / amount.sum(dtype=np.float64))
    of_all = picture_moments(together * together, sum(counts))
    pens = {pen: _Pen(amounts[pen], count) for pen, count in enumerate(counts) if count}
    size = np.array(together.shape[::-1])
    for move in each(range(1, BALANCE.pen_moves + 1)):
        centers = np.split(of_all(np.concatenate(placed)).centroids, np.cumsum(counts)[:-1])
        for pen, own in pens.items():
            if move % BALANCE.moves == 0 and move < BALANCE.pen_moves:
                own.correct(placed[pen])
            among_own = own.moments(placed[pen]).centroids
            moved = np.clip(among_own + BALANCE.to_all * (centers[pen] - placed[pen]), 0, size)
            placed[pen] = own.into_ink(moved, placed[pen])
    return placed


class _Pen:
    """The density that the dots of one of several pens follow."""

    def __init__(self, amount: Floats32, n_dots: int) -> None:
        self._amount, self._density, self._n_dots = picture_moments(amount, n_dots), amount * amount, n_dots
        self.into_ink = WhereMassIs(self._amount)
        self.moments = picture_moments(self._density, n_dots)

    def correct(self, points: Floats) -> None:
        self._density *= corrections(self._amount, points)
        self.moments = picture_moments(self._density, self._n_dots)


@dataclass(frozen=True, slots=True, eq=False)
class DotLayer:
    """Dots of one pen; arrays are as in `Stipples`."""

    points: Floats
    radii: Floats
    masses: Floats
    energy: float


def place_dots(ink: Floats32, n_dots: int, dots: str, radius_range: tuple[float, float] | None) -> DotLayer:
    """Place dots whose areas add up to the ink, the (H, W) area of disks that each pixel asks for."""
    amount = _amount(ink, n_dots, radius_range)
    points = _spread_dots(amount, n_dots, balanced=dots != "sized" or radius_range is not None)
    return _finished(ink, points, dots, radius_range, _LAST_MOVES[dots])


def place_pens(
    inks: Sequence[Floats32], counts: Sequence[int], dots: str, radius_range: tuple[float, float] | None
) -> list[DotLayer]:
    """Place the dots of several pens, each with the tones of its own ink, and apart from those of the others."""
    amounts = [_amount(ink, count, radius_range) for ink, count in zip(inks, counts, strict=True)]
    with part(0, 1 / 2):
        placed = [_spread_dots(*pen, balanced=True) for pen in each(list(zip(amounts, counts, strict=True)))]
    with part(1 / 2, 1):
        apart = keep_apart(amounts, placed)
    return [_finished(ink, points, dots, radius_range, 0) for ink, points in zip(inks, apart, strict=True)]


def _spread_dots(amount: Floats32, n_dots: int, *, balanced: bool) -> Floats:
    if n_dots == 0:
        return np.empty((0, 2))
    # In a tessellation of density rho there are rho^(1/2) dots in an area.
    with part(0, 1 / 2):
        points = place_generators(None, n_dots, density=amount * amount, effort="fast").points
    with part(1 / 2, 1):
        return balance_tones(amount, points) if balanced else points


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
        radii = np.clip(np.sqrt(masses / np.pi), *(radius_range or (0, np.inf)))
    return DotLayer(points, radii, masses, found.energy)


def _amount(ink: Floats32, n_dots: int, radius_range: tuple[float, float] | None) -> Floats32:
    """Return how many dots each pixel asks for, in any unit; dots of one size must be as many as the ink.

    In a range of radii, that of a dot grows as the power of the ink that lets n dots give the ink. Where even the least
    or the greatest for all tones does not, the tones will be off.
    """
    from scipy.optimize import bisect

    if n_dots == 0 or radius_range is None:
        return ink
    least, greatest = radius_range
    darkest = float(ink.max())
    counts, edges = np.histogram(ink, TABLE_SIZE, (0, darkest))
    tones = (edges[1:] + edges[:-1]) / 2

    def areas(bent: float) -> Floats:
        # As a power of the ink: its zeroth makes all dots large, and its last all small.
        power = bent / (1 - bent) if bent < 1 else np.inf
        return np.pi * (least + (greatest - least) * (tones / darkest) ** power) ** 2

    def excess(bent: float) -> float:
        return float((counts * tones / areas(bent)).sum()) - n_dots

    bent = 0.0 if excess(0) > 0 else 1.0 if excess(1) < 0 else float(bisect(excess, 0, 1))
    return (
        ink / areas(bent).astype(np.float32)[np.minimum(ink * (TABLE_SIZE / darkest), TABLE_SIZE - 1).astype(np.intp)]
    )

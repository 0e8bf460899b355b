"""The dots of one pen or of several: where they lie and how large they are, for the ink that each pixel asks for.

Dots of one size are brought into balance with the tones: where ink is lacking the density grows, as a centroidal
Voronoi tessellation has dots in proportion to the root of its density only where that hardly changes from one dot to
the next. Dots of several pens move to the centers of their cells among those of their own pen, and part of the way to
those among all dots, so that they do not fall on each other.

M. Jiang, Y. Zhou, R. Wang, R. Southern, J. J. Zhang, Blue noise sampling using an SPH-based method, ACM Trans. Graphics
34 (2015), doi 10.1145/2816795.2818102; L.-Y. Wei, Multi-class blue noise sampling, ACM Trans. Graphics 29 (2010), doi
10.1145/1778765.1778816.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from cvtimg._shared.progress import each, part
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Floats, Floats32
from cvtimg.artwork.tones import TABLE_SIZE
from cvtimg.engine.methods import Stopping
from cvtimg.placement import DESCENTS, PixelMoments, Terms, place_generators
from cvtimg.placement.descent import each_with_cell
from cvtimg.placement.pictures import WhereMassIs, picture_moments

DOTS = ("equal", "sized")
#: Moves of dots to the centers of the ink of their cells at the end.
_LAST_MOVES = {"equal": 1, "sized": 2}
#: Corrections of the density, and moves after each.
_ROUNDS = 4
#: Part of the way to the centers of their cells among all dots that dots of several pens go: with more, they keep
#: farther from those of other pens, and less evenly from those of their own.
_TO_ALL = 0.5


@dataclass(frozen=True, slots=True)
class Dots:
    """What kind of dots there are to be: fields are as the arguments of `cvtimg.stipple`."""

    dots: str = "equal"
    radius_range: tuple[float, float] | None = None
    bleed: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class DotLayer:
    """Dots of one pen; arrays are as in `Stipples`."""

    points: Floats
    radii: Floats
    masses: Floats
    energy: float


class _Pen:
    """One of several pens: the ink of its dots, the (H, W) area of disks that each pixel asks for, which is not 0."""

    def __init__(self, ink: Floats32, n_dots: int, how: Dots) -> None:
        self.ink, self.n_dots, self.how = ink, n_dots, how
        self.amount = _amount(ink, n_dots, how.radius_range)
        self.amounts = picture_moments(self.amount, n_dots)
        self.radius = float(np.sqrt(ink.sum(dtype=np.float64) / n_dots / np.pi))  # if all have the same
        self.size = np.array(ink.shape[::-1], np.float64)
        self.into_ink = WhereMassIs(self.amounts, 0.0 if how.bleed else self.radius)
        n_pixels = np.count_nonzero(self.amounts.density) / self.amounts.scale**2
        self.reach = float(np.sqrt(n_pixels / n_dots)) / 2  # of the cell of a dot
        # In a tessellation of density rho there are rho^(1/2) dots in an area.
        self.density = self.amount * self.amount

    def correct(self, points: Floats) -> PixelMoments:
        """Let the density grow where dots are too few, and return its moments."""
        lacking = (self.amounts(points).masses * (self.n_dots / self.amounts.mass)) ** 2
        # Of each pixel before it was enlarged; smoothed, as the error of a single dot is noise.
        values, factor, (height, width) = lacking.astype(np.float32), round(self.amounts.scale), self.density.shape
        labels = self.amounts.labels(points).reshape(height, factor, width, factor)
        means = in_stripes(lambda rows: values[labels[rows]].mean(axis=(1, 3)), height, 16.0 * labels.size)
        self.density *= gaussian_filter(np.concatenate(means), self.reach, mode="nearest")
        return picture_moments(self.density, self.n_dots)

    def spread(self, *, balanced: bool) -> Floats:
        """Place the (N, 2) dots; balanced ones stand for about equal amounts, but for the noise of single ones."""
        with part(0, 1 / 2):
            points = place_generators(None, self.n_dots, density=self.density, effort="fast").points
        with part(1 / 2, 1):
            terms = Terms(Stopping.after(_ROUNDS), project=self.into_ink)
            for _ in each(range(_ROUNDS if balanced else 0)):
                points = DESCENTS["l-bfgs"](self.correct(points), points, terms).generators
        return points

    def finished(self, points: Floats, n_moves: int) -> DotLayer:
        """Make the last moves of dots, and find their sizes; each has a cell and, unless it may bleed, is whole."""
        moments = self.amounts if self.amount is self.ink else picture_moments(self.ink, self.n_dots)
        # The density of dots is steeper than the ink, and pulls dots within their cells to its dark side.
        for _ in range(n_moves):
            points = moments(points).centroids
        points, moments_of_dots = each_with_cell(moments, self.into_ink(points, points), self.into_ink)
        radii = np.full(self.n_dots, self.radius)
        if self.how.dots == "sized":
            radii = np.clip(np.sqrt(moments_of_dots.masses / np.pi), *(self.how.radius_range or (0, np.inf)))
        if not self.how.bleed:
            radii = np.minimum(radii, self.size.min() / 2)
            points = np.clip(points, radii[:, np.newaxis], self.size - radii[:, np.newaxis])
        return DotLayer(points, radii, moments_of_dots.masses, moments_of_dots.energy)


def place_pens(inks: Sequence[Floats32], counts: Sequence[int], how: Dots) -> list[DotLayer]:
    """Place dots of one pen or several, whose areas add up to the ink, and apart from those of the other pens.

    An ink is the (H, W) area of disks that each pixel asks for.
    """
    layers = [DotLayer(np.empty((0, 2)), np.empty(0), np.empty(0), 0.0)] * len(counts)
    pens = {number: _Pen(inks[number], count, how) for number, count in enumerate(counts) if count}
    is_alone = len(pens) < 2
    balanced = not is_alone or how.dots != "sized" or how.radius_range is not None
    with part(0, 1 if is_alone else 1 / 2):
        placed = [pen.spread(balanced=balanced) for pen in each([*pens.values()])]
    with part(1 / 2, 1):
        placed = placed if is_alone else _kept_apart([*pens.values()], placed)
    for (number, pen), points in zip(pens.items(), placed, strict=True):
        layers[number] = pen.finished(points, _LAST_MOVES[how.dots] if is_alone else 0)
    return layers


def _kept_apart(pens: Sequence[_Pen], placed: list[Floats]) -> list[Floats]:
    """Move apart the dots of several pens, placed without regard to each other."""
    # Dots of all pens in an area are as many as the sum of what they ask for, each in units of one dot.
    together = np.zeros_like(pens[0].amount)
    for pen in pens:
        together += pen.amount * np.float32(pen.n_dots / pen.amount.sum(dtype=np.float64))
        pen.density = pen.amount * pen.amount
    counts = [pen.n_dots for pen in pens]
    of_all = picture_moments(together * together, sum(counts))
    moments = [picture_moments(pen.density, pen.n_dots) for pen in pens]
    n_moves = _ROUNDS * (_ROUNDS + 1)
    for move in each(range(1, n_moves + 1)):
        centers = np.split(of_all(np.concatenate(placed)).centroids, np.cumsum(counts)[:-1])
        for number, pen in enumerate(pens):
            points = placed[number]
            if move % _ROUNDS == 0 and move < n_moves:
                moments[number] = pen.correct(points)
            among_own = moments[number](points).centroids
            placed[number] = pen.into_ink(among_own + _TO_ALL * (centers[number] - points), points)
    return placed


def _amount(ink: Floats32, n_dots: int, radius_range: tuple[float, float] | None) -> Floats32:
    """Return how many dots each pixel asks for, in any unit; dots of one size must be as many as the ink.

    In a range of radii, that of a dot grows as the power of the ink that lets n dots give the ink. Where even the least
    or the greatest for all tones does not, the tones will be off.
    """
    if radius_range is None:
        return ink
    from scipy.optimize import brentq

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

    bent = 0.0 if excess(0) > 0 else 1.0 if excess(1) < 0 else brentq(excess, 0, 1)
    tone = np.minimum(ink * (TABLE_SIZE / darkest), TABLE_SIZE - 1).astype(np.intp)
    return ink / areas(bent).astype(np.float32)[tone]

"""The dots of one pen: where they lie and how large they are, for the ink that each pixel asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.artwork.equal_masses import share_equally
from cvtimg.artwork.pens import keep_apart
from cvtimg.artwork.tone_balance import balance_tones
from cvtimg.placement import place_in_picture
from cvtimg.placement.pictures import WhereMassIs, picture_moments

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

DOTS = ("equal", "equal-mass", "sized")
#: Moves of dots to the centers of the ink of their cells at the end; and where those of other pens are in the way.
_LAST_MOVES = {"equal": 1, "equal-mass": 5, "sized": 2}
_LAST_MOVES_APART = {"equal": 0, "equal-mass": 1, "sized": 0}
#: Steps of the tones that sizes of dots are told by, and of the search for how they grow.
_TONES, _HALVINGS = 1024, 40


@dataclass(frozen=True, slots=True, eq=False)
class DotLayer:
    """Dots of one pen.

    Attributes
    ----------
    points : (N, 2) float64 array
    radii, masses, weights : (N,) float64 arrays
        As in `Stipples`.
    energy : float
    """

    points: Floats
    radii: Floats
    masses: Floats
    weights: Floats
    energy: float


def place_dots(ink: Floats32, n_dots: int, dots: str, radius_range: tuple[float, float] | None) -> DotLayer:
    """Place dots whose areas add up to the ink everywhere.

    Parameters
    ----------
    ink : (H, W) float32 array
        Area of disks that each pixel asks for.
    n_dots : int
        Number of dots.
    dots : {"equal", "equal-mass", "sized"}
        Dots of one size where the density tells; of one size and cells of one mass; or each as large as its mass.
    radius_range : (float, float) or None
        Least and greatest radius, for "sized".
    """
    points = _spread_dots(
        _amount(ink, n_dots, radius_range), n_dots, balanced=dots != "sized" or radius_range is not None
    )
    return _finished(ink, points, dots, radius_range, _LAST_MOVES[dots])


def place_pens(
    inks: Sequence[Floats32], counts: Sequence[int], dots: str, radius_range: tuple[float, float] | None
) -> list[DotLayer]:
    """Place the dots of several pens, each with the tones of its own ink, and apart from those of the others."""
    amounts = [_amount(ink, count, radius_range) for ink, count in zip(inks, counts, strict=True)]
    placed = [_spread_dots(amount, count, balanced=True) for amount, count in zip(amounts, counts, strict=True)]
    apart = keep_apart(amounts, placed)
    moves = _LAST_MOVES_APART[dots]
    return [_finished(ink, points, dots, radius_range, moves) for ink, points in zip(inks, apart, strict=True)]


def _amount(ink: Floats32, n_dots: int, radius_range: tuple[float, float] | None) -> Floats32:
    """Return how many dots each pixel asks for, in any unit; dots of one size must be as many as the ink."""
    if n_dots == 0 or radius_range is None:
        return ink
    return ink / _disk_areas(ink, n_dots, radius_range)


def _spread_dots(amount: Floats32, n_dots: int, *, balanced: bool) -> Floats:
    if n_dots == 0:
        return np.empty((0, 2))
    # In a tessellation of density rho there are rho^(1/2) dots in an area.
    points = place_in_picture(amount * amount, n_dots, effort="fast").points
    return balance_tones(amount, points) if balanced else points


def _finished(
    ink: Floats32, points: Floats, dots: str, radius_range: tuple[float, float] | None, n_moves: int
) -> DotLayer:
    """Make the last moves of dots, and find their sizes."""
    n_dots = len(points)
    if n_dots == 0:
        return DotLayer(points, np.empty(0), np.empty(0), np.empty(0), 0.0)
    moments, weights = picture_moments(ink, n_dots), np.zeros(n_dots)
    if dots == "equal-mass":
        points, weights = share_equally(moments, points, n_moves)
    else:
        # The density of dots is steeper than the ink, and pulls dots within their cells to its dark side.
        for _ in range(n_moves):
            points = moments(points).centroids
    points = WhereMassIs(moments)(points, points)
    found = moments(points, weights)
    masses = found.masses
    radii = np.full(n_dots, np.sqrt(moments.mass / n_dots / np.pi))
    if dots == "sized":
        radii = np.sqrt(masses / np.pi)
        if radius_range is not None:
            radii = np.clip(radii, *radius_range)
    return DotLayer(points, radii, masses, weights, found.energy)


def share_dots(dots: DotLayer, inks: Sequence[Floats32], order: NDArray[np.intp]) -> list[DotLayer]:
    """Give the dots of one tessellation to several pens, so that each pen has its ink everywhere.

    The dots are walked along a tour, and each goes to the pen that is most in arrears: what a pen has had too much or
    too little is carried on to the next dot, which is near. Dots of all pens together keep their distances.
    """
    if len(dots.points) == 0:
        return [dots] * len(inks)
    found = [
        picture_moments(ink, len(dots.points))(dots.points).masses if ink.any() else np.zeros(len(dots.points))
        for ink in inks
    ]
    wanted = np.stack(found, axis=1)[order]
    pens = np.empty(len(order), np.intp)
    arrears = np.zeros(len(inks))
    for step, (dot, mass) in enumerate(zip(order, wanted, strict=True)):
        arrears += mass
        pens[dot] = pen = int(arrears.argmax())
        arrears[pen] -= wanted[step].sum()
    parts = [np.flatnonzero(pens == pen) for pen in range(len(inks))]
    energies = [dots.energy, *([0.0] * (len(inks) - 1))]
    return [
        DotLayer(dots.points[own], dots.radii[own], dots.masses[own], dots.weights[own], energy)
        for own, energy in zip(parts, energies, strict=True)
    ]


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

    low, high = -10.0, 10.0  # logarithms of the power
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        n_needed = float((counts * tones / areas(tones, np.exp(middle))).sum())
        low, high = (middle, high) if n_needed < n_dots else (low, middle)
    table = areas(np.linspace(0, darkest, _TONES), np.exp(middle)).astype(np.float32)
    chosen: Floats32 = table[np.rint(ink * np.float32((_TONES - 1) / darkest)).astype(np.intp)]
    return chosen

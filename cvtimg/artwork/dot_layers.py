"""The dots of one pen: where they lie and how large they are, for the ink that each pixel asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.artwork.equal_masses import share_equally
from cvtimg.artwork.tone_balance import balance_tones
from cvtimg.placement import place_in_picture
from cvtimg.placement.pictures import picture_moments

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

DOTS = ("equal", "equal-mass", "sized")
#: Moves of dots to the centers of the ink of their cells at the end.
_TO_INK = {"equal": 1, "sized": 2}
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
    total = float(ink.sum(dtype=np.float64))
    if n_dots == 0 or total == 0:
        return DotLayer(np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0), 0.0)
    # In a tessellation of density rho there are rho^(1/2) dots in an area. Dots of one size must be as many as the ink.
    amount = ink if radius_range is None else ink / _disk_areas(ink, n_dots, radius_range)
    points, weights = place_in_picture(amount * amount, n_dots, effort="fast").points, np.zeros(n_dots)
    moments = picture_moments(ink, n_dots)
    if dots != "sized" or radius_range is not None:
        points = balance_tones(amount, points)
    if dots == "equal-mass":
        points, weights = share_equally(moments, points)
    else:
        # The density of dots is steeper than the ink, and pulls dots within their cells to its dark side.
        for _ in range(_TO_INK[dots]):
            points = moments(points).centroids
    points = into_ink(points, ink)
    found = moments(points, weights)
    masses = found.masses
    radii = np.full(n_dots, np.sqrt(total / n_dots / np.pi))
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


def into_ink(points: Floats, ink: Floats32) -> Floats:
    """Move points that lie on paper to the nearest pixel that asks for ink.

    The center of mass of a cell may lie outside of what it is the center of, as for a ring.
    """
    height, width = ink.shape
    size = np.array([width, height])
    points = np.clip(points, 0, np.nextafter(size, 0))
    x, y = points.astype(np.intp).T
    lost, reach = np.flatnonzero(ink[y, x] == 0), 1
    while len(lost):
        steps = np.arange(-reach, reach + 1)
        found = np.zeros(len(lost), np.bool_)
        for number, dot in enumerate(lost):
            columns = steps + int(points[dot, 0])
            rows = steps + int(points[dot, 1])
            columns, rows = columns[(columns >= 0) & (columns < width)], rows[(rows >= 0) & (rows < height)]
            inked = np.argwhere(ink[np.ix_(rows, columns)])
            if len(inked):
                pixels = np.stack([columns[inked[:, 1]], rows[inked[:, 0]]], axis=1)
                places = np.clip(points[dot], pixels + 0.25, pixels + 0.75)
                points[dot] = places[((places - points[dot]) ** 2).sum(axis=1).argmin()]
                found[number] = True
        lost, reach = lost[~found], 2 * reach
    return points

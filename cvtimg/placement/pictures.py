"""Placement in an image: from a start along a curve, over coarser levels, to the image itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_count, check_fewer, check_picture_density, check_places
from cvtimg._shared.choices import EffortName
from cvtimg._shared.iteration import Callback, Stopping, Watch
from cvtimg._shared.progress import part
from cvtimg.placement import _placement
from cvtimg.placement.densities import Points
from cvtimg.placement.descent import DESCENTS, Descent, Projection, Terms
from cvtimg.placement.moments import PixelMoments
from cvtimg.placement.polygons import NearestPixel, PictureRegion
from cvtimg.placement.result import Placement

#: A picture is enlarged where generators have few pixels: by the first factor with so many for each.
_ENLARGEMENTS = ((1, 20.0), (2, 4.0), (4, 0.0))
#: A coarser level is worth its time from so many generators on.
_WORTH_A_LEVEL = 1000
#: Part of the time that coarser levels take together.
_COARSE = 0.3
#: Children of a generator: offsets from it, as parts of the distance to its nearest neighbor.
_CHILDREN = np.array([[-2, -1], [1, -2], [2, 1], [-1, 2]]) / 6


@dataclass(frozen=True, slots=True)
class PlacementEffort:
    """How long to descend."""

    coarse: tuple[Stopping, Stopping]  # when to stop at coarser levels of a picture
    in_picture: Stopping  # when to stop in the picture itself
    elsewhere: Stopping  # when to stop in other regions
    samples: int  # for each generator, where cells are not integrated exactly
    most_samples: int  # of all generators
    n_starts: int = 1  # in other regions, of which the best is kept


#: The registry: names for `effort`.
EFFORTS = {
    "fast": PlacementEffort(
        (Stopping(1e-3, 12), Stopping(1e-3, 12)), Stopping(1e-3, 8), Stopping(1e-3, 15), 100, 1 << 17
    ),
    "balanced": PlacementEffort(
        (Stopping(1e-5, 40), Stopping(1e-4, 20)), Stopping(9e-5, 36), Stopping(1e-6, 100), 400, 1 << 19
    ),
    "best": PlacementEffort(
        (Stopping(1e-5, 40), Stopping(1e-5, 40)), Stopping(1e-6, 400), Stopping(1e-10, 1000), 1000, 1 << 21, n_starts=8
    ),
}

#: Fixed generators are apart by more than this part of the diagonal of their region.
_APART = 1e-9
#: More generators than this need more memory than a machine has.
MOST_GENERATORS = 1 << 28


def place_in_picture(
    density: ArrayLike,
    n_generators: int,
    *,
    fixed: ArrayLike | None = None,
    method: str = "l-bfgs",
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
    callback: Callback | None = None,
) -> Placement:
    """Place generators in an image, each at the center of mass of its own Voronoi cell.

    Parameters
    ----------
    density : (H, W) array
        Mass of each pixel, finite, >= 0 and not all 0. Where it is 0 no generator is placed.
    n_generators : int
        Number of generators K, with the fixed ones.
    fixed : (L, 2) array, optional
        Generators (x, y) that stay in place: the first L of the K.
    method : {"l-bfgs", "over-relaxed", "lloyd"}
        How generators move.
    effort : {"fast", "balanced", "best"}
        How long: energies of "balanced" end about 0.2 percent over those of "best" in a tenth of the time.
    rng : int or numpy.random.Generator
        Seed of the start. The same seed gives the same bits, whatever the number of threads.
    callback : callable, optional
        Called before each move with its number and the energy, which is that of a coarser level at first; it stops by
        returning True.

    Returns
    -------
    Placement
        Points (x, y) in pixels; those that are not fixed in about the order of a Hilbert curve.

    See Also
    --------
    cvtimg.place_generators, cvtimg.stipple, pixel_moments, pixel_labels

    Notes
    -----
    With density rho there are about rho^(1/2) generators in an area.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.placement import place_in_picture
    >>> placement = place_in_picture(np.ones((4, 8)), 2)
    >>> np.sort(placement.points, axis=0).round(1).tolist()
    [[2.0, 2.0], [6.0, 2.0]]
    """
    mass = check_picture_density("density", density)
    check_count("n_generators", n_generators, MOST_GENERATORS, "what memory holds")
    still = np.empty((0, 2)) if fixed is None else check_places("fixed", fixed, 2)
    check_fewer("fixed", len(still), n_generators)
    check_apart("fixed", still, np.array([[0, 0], mass.shape[::-1]]))
    check_choice("method", method, DESCENTS)
    moments, settings = picture_moments(mass, n_generators), EFFORTS[check_choice("effort", effort, EFFORTS)]
    random = np.random.default_rng(rng)
    end = place_by_levels(moments, n_generators, still, method, settings, random, Watch(callback))
    return Placement.of(end, PictureRegion(np.ones(mass.shape, bool)))


def check_apart(name: str, points: Points, bounds: NDArray[Any]) -> None:
    """Refuse points (L, D) that nearly coincide: the cells of all but one of them would be slivers, or empty."""
    from scipy.spatial import cKDTree

    if len(points) < 2:
        return
    gaps, near = cKDTree(points).query(points, 2)
    least = _APART * float(np.linalg.norm(bounds[1] - bounds[0]))
    if gaps[:, 1].min() < least:
        one, other = sorted(near[gaps[:, 1].argmin()].tolist())
        place = points[other].tolist()
        raise ValueError(f"{name} must be at least {least:.3g} apart: number {other}, {place}, lies on number {one}")


def picture_moments(density: NDArray[np.float32], n_generators: int) -> PixelMoments:
    """Prepare the moments over an image, enlarged as `n_generators` ask for it, in its own pixels."""
    n_pixels = int(np.count_nonzero(density))
    factor = next(factor for factor, pixels in _ENLARGEMENTS if n_pixels >= pixels * n_generators)
    return PixelMoments(enlarge(density, factor), factor)


def enlarge(density: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Enlarge an image by bilinear interpolation, of which masses of pixels are left, and 0 where it is 0."""
    if factor == 1:
        return density
    large = density
    for axis in (0, 1):
        n = density.shape[axis]
        at = np.clip((np.arange(n * factor) + 0.5) / factor - 0.5, 0, n - 1)
        low = np.minimum(at.astype(np.intp), max(n - 2, 0))
        part = (at - low).astype(np.float32)[:, None] if axis == 0 else (at - low).astype(np.float32)
        large = large.take(low, axis) * (1 - part) + large.take(np.minimum(low + 1, n - 1), axis) * part
    large *= np.float32(factor**-2)
    large.reshape(len(density), factor, -1, factor).swapaxes(1, 2)[density == 0] = 0
    return large


def place_by_levels(
    moments: PixelMoments,
    n_generators: int,
    fixed: Points,
    method: str,
    effort: PlacementEffort,
    rng: np.random.Generator,
    watch: Watch,
) -> Descent:
    """Place generators, the first of them fixed, and the others in about the order of a Hilbert curve."""

    def descend(cells: PixelMoments, free: Points, stopping: Stopping, project: Projection | None = None) -> Descent:
        movable = np.arange(len(fixed) + len(free)) >= len(fixed) if len(fixed) else None
        terms = Terms(stopping, movable, project, watch=watch)
        return DESCENTS[method](cells, np.concatenate([fixed, free]), terms)

    def start(cells: PixelMoments, n_free: int, coarser: tuple[Stopping, ...]) -> Points:
        if not coarser or n_free < _WORTH_A_LEVEL:
            return along_hilbert_curve(cells.density, n_free, rng) / cells.scale
        coarse = cells.halved()
        with part(0, _COARSE):
            first = start(coarse, -(-n_free // 4), coarser[:-1])
        with part(_COARSE, 1):
            end = descend(coarse, first, coarser[-1])
        height, width = cells.density.shape
        split = split_generators(end.generators[len(fixed) :], n_free)
        return np.clip(split, 0, np.array([width, height]) / cells.scale)

    project = WhereMassIs(moments)
    with part(0, _COARSE):
        free = start(moments, n_generators - len(fixed), effort.coarse)
    with part(_COARSE, 1):
        return descend(moments, project(free, free), effort.in_picture, project)


class WhereMassIs:
    """The projection of points to pixels with mass: a cell may have its center of mass in a gap."""

    def __init__(self, moments: PixelMoments) -> None:
        self._mass = moments.density > 0
        self._scale = moments.scale
        self._everywhere = bool(self._mass.all())
        self._nearest: NearestPixel | None = None  # made when it is needed first

    def __call__(self, there: Points, before: Points) -> Points:
        """Move points without mass below them to the nearest pixel that has some."""
        if self._everywhere:
            return there
        height, width = self._mass.shape
        places = there * self._scale
        x, y = np.clip(places, 0, [width - 1, height - 1]).astype(np.intp).T
        white = np.flatnonzero(~self._mass.ravel()[y * width + x])
        if not len(white):
            return there
        if self._nearest is None:
            self._nearest = NearestPixel(self._mass)
        moved = there.copy()
        moved[white] = self._nearest(places[white]) / self._scale
        return moved


def along_hilbert_curve(density: NDArray[np.float32], n_generators: int, rng: np.random.Generator) -> Points:
    """Draw (K, 2) places, in pixels, in the order of a Hilbert curve; each in one of K parts of equal rho^(1/2).

    In the plane a centroidal Voronoi tessellation of many generators has about rho^(1/2) of them in an area (Gersho's
    conjecture). A start by rho itself would leave light parts to few, and a uniform one cells without mass.
    """
    weights = np.sqrt(density)
    places = np.empty((n_generators, 2))
    total = weights.sum(dtype=np.float64)
    found = _placement.place_along_curve(weights, total / n_generators, places)
    places[found:] = places[found - 1]  # but for rounding, all are found
    return places + rng.random(places.shape)


def split_generators(generators: Points, n_generators: int) -> Points:
    """Split each of (K, 2) generators into four that stand around it; leave out the last ones over `n_generators`."""
    from scipy.spatial import cKDTree

    gaps = cKDTree(generators).query(generators, 2)[0][:, 1]
    children = generators[:, None] + gaps[:, None, None] * _CHILDREN
    return children.reshape(-1, 2)[:n_generators]

"""Placement in an image: from a start along a curve, over coarser levels, to the image itself."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cvtimg._shared.iteration import Stopping, Watch
from cvtimg._shared.progress import part
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Array, Floats32, Points
from cvtimg.engine.samples import along_curve
from cvtimg.placement.descent import Descend, Descent, Projection, Terms
from cvtimg.placement.moments import PixelMoments
from cvtimg.placement.polygons import NearestPixel

#: Factors by which pictures are enlarged, and pixels for each generator from which on: the first that fits is taken.
_ENLARGEMENTS = ((1, 20.0), (2, 4.0), (4, 0.0))
#: Generators from which on a coarser level is worth its time.
_WORTH_A_LEVEL = 1000
#: Steps of a kernel that moving a point to its frame takes, and points of a part: few calls, as each takes the GIL.
_STEPS, _ROWS = 400.0, 1 << 14
#: Pixels for each generator that are enough to start from.
_PIXELS_TO_START = 256


@dataclass(frozen=True, slots=True)
class PlacementEffort:
    """How long to descend."""

    coarse: tuple[Stopping, Stopping]  # when to stop at coarser levels of a picture
    in_picture: Stopping  # when to stop in the picture itself
    elsewhere: Stopping  # when to stop in other regions
    samples: int  # for each generator, where cells are not integrated exactly
    most_samples: int  # of all generators, in multiples of what is enough for a sum over a region
    n_starts: int = 1  # in other regions, of which the best is kept


#: A start for finer levels, and what "fast" ends with where it is no picture.
_ROUGH, _FINE = Stopping(1e-3, 12), Stopping(1e-5, 40)
#: The registry: names for `effort`.
EFFORTS = {
    "fast": PlacementEffort((_ROUGH, _ROUGH), Stopping(1e-3, 8), _ROUGH, 100, 1),
    "balanced": PlacementEffort((_FINE, Stopping(1e-4, 20)), Stopping(9e-5, 36), Stopping(1e-6, 100), 400, 4),
    "best": PlacementEffort((_FINE, _FINE), Stopping(1e-6, 400), Stopping(1e-10, 1000), 1000, 16, 8),
}

#: Part of the diagonal of their region that fixed generators are apart at least: nearer ones lie on each other.
_APART = 1e-9


def check_apart(name: str, points: Points, bounds: Array) -> None:
    """Refuse points (L, D) that nearly coincide: the cells of all but one of them would be slivers, or empty."""
    from scipy.spatial import cKDTree

    if len(points) < 2:
        return
    gaps, near = cKDTree(points).query(points, 2)
    least = _APART * float(np.linalg.norm(bounds[1] - bounds[0]))
    if gaps[:, 1].min() < least:
        first, other = sorted(near[gaps[:, 1].argmin()].tolist())
        place = points[other].tolist()
        raise ValueError(f"{name} must be at least {least:.3g} apart: number {other}, {place}, lies on number {first}")


def picture_moments(density: Floats32, n_generators: int) -> PixelMoments:
    """Prepare the moments over an image, enlarged as `n_generators` ask for it, in its own pixels."""
    n_pixels = int(np.count_nonzero(density))
    factor = next(factor for factor, pixels in _ENLARGEMENTS if n_pixels >= pixels * n_generators)
    return PixelMoments(enlarge(density, factor), factor)


def enlarge(density: Floats32, factor: int) -> Floats32:
    """Enlarge an image by bilinear interpolation, of which masses of pixels are left, and 0 where it is 0."""
    from scipy.ndimage import zoom

    if factor == 1:
        return density
    large: Floats32 = zoom(density, factor, order=1, mode="nearest", grid_mode=True)
    blocks = large.reshape(density.shape[0], factor, density.shape[1], factor)
    blocks *= np.where(density > 0, np.float32(factor**-2), 0)[:, np.newaxis, :, np.newaxis]
    return large


def place_by_levels(
    moments: PixelMoments,
    n_generators: int,
    fixed: Points,
    method: Descend,
    effort: PlacementEffort,
    rng: np.random.Generator,
    watch: Watch,
) -> Descent:
    """Place generators, the first of them fixed, and the others in about the order of a curve."""

    def descend(cells: PixelMoments, free: Points, stopping: Stopping, project: Projection) -> Descent:
        movable = np.arange(len(fixed) + len(free)) >= len(fixed) if len(fixed) else None
        terms = Terms(stopping, movable, project, watch=watch)
        return method(cells, np.concatenate([fixed, free]), terms)

    def start(cells: PixelMoments, n_free: int, coarser: tuple[Stopping, ...]) -> Points:
        if not coarser or n_free < _WORTH_A_LEVEL:
            while cells.density.size > _PIXELS_TO_START * n_free:
                cells = cells.halved()
            return draw_along_curve(cells.density, n_free, rng) / cells.scale
        coarse = cells.halved()
        with part(0, 1 / 4):  # it has a quarter of the pixels
            first = start(coarse, -(-n_free // 4), coarser[:-1])
        with part(1 / 4, 1):
            end = descend(coarse, first, coarser[-1], project.into_frame)
        from scipy.spatial import cKDTree

        # Each is split into four that stand around it; the last ones may be too many.
        first = end.generators[len(fixed) :]
        gaps = cKDTree(first).query(first, 2)[0][:, 1]
        offsets = np.array([[-2, -1], [1, -2], [2, 1], [-1, 2]]) / 6  # as parts of the distance to the nearest neighbor
        split = (first[:, None] + gaps[:, None, None] * offsets).reshape(-1, 2)[:n_free]
        return project.into_frame(split, split)

    project = WhereMassIs(moments)
    with part(0, 1 / 4):
        free = start(moments, n_generators - len(fixed), effort.coarse)
    with part(1 / 4, 1):
        return descend(moments, project(free, free), effort.in_picture, project)


class WhereMassIs:
    """The projection of points to pixels with mass: a cell may have its center of mass in a gap.

    Points stay in the frame of the image, as far from its sides as the margin: a step of a descent may lead anywhere.
    Where all mass is in the margin, they leave it all the same.
    """

    def __init__(self, moments: PixelMoments, margin: float = 0.0) -> None:
        self._mass = moments.density > 0
        self._scale = moments.scale
        height, width = self._mass.shape
        size = np.array([width, height]) / moments.scale
        self._low = np.minimum(margin, size / 2)
        self._high = size - self._low
        # Pixels in the frame: the first column and row, and the last ones.
        first = np.floor(self._low * moments.scale).astype(np.intp)
        self._ends = first, np.maximum(np.array([width, height]) - 1 - first, first)
        (left, top), (right, bottom) = self._ends
        framed = self._mass[top : bottom + 1, left : right + 1]
        self._everywhere = bool(framed.all())
        if framed.any() and not self._everywhere:
            self._mass = np.pad(framed, ((top, height - 1 - bottom), (left, width - 1 - right)))

    def __call__(self, there: Points, before: Points) -> Points:
        """Move points without mass below them to the nearest pixel that has some."""

        def move(rows: slice) -> Points:
            moved = self.into_frame(there[rows], before)
            if self._everywhere:
                return moved
            places = moved * self._scale
            x, y = np.clip(places, *self._ends).astype(np.intp).T
            white = np.flatnonzero(~self._mass.take(y * self._mass.shape[1] + x))
            if not len(white):
                return moved
            moved[white] = self._nearest(places[white]) / self._scale
            return self.into_frame(moved, before)

        return np.concatenate(in_stripes(move, len(there), _STEPS * len(there), _ROWS))

    @cached_property
    def _nearest(self) -> NearestPixel:
        return NearestPixel.of(self._mass)

    def into_frame(self, there: Points, before: Points) -> Points:
        """Move points to the frame."""
        return np.clip(there, self._low, self._high)


def draw_along_curve(density: Floats32, n_generators: int, rng: np.random.Generator) -> Points:
    """Draw (K, 2) places, in pixels, in the order of a Morton curve; each in one of K parts of equal rho^(1/2).

    In the plane a centroidal Voronoi tessellation of many generators has about rho^(1/2) of them in an area (Gersho's
    conjecture). A start by rho itself would leave light parts to few, and a uniform one cells without mass.
    """
    pixels = np.stack(np.unravel_index(np.arange(density.size), density.shape)[::-1], axis=1)
    pixels = pixels[along_curve(pixels)]
    weights = np.cumsum(np.sqrt(density[pixels[:, 1], pixels[:, 0]], dtype=np.float64))
    chosen = np.searchsorted(weights, (np.arange(n_generators) + 0.5) / n_generators * weights[-1])
    return pixels[chosen] + rng.random((n_generators, 2))

"""Tilings of a picture by its points: Voronoi cells and Delaunay triangles, and the descent of their error.

The error of a mosaic is the integral over each tile of the squared distance between the image and the mean color of
the tile. Its gradient lives on the borders: moving a border gives the pixels that it passes over to the other tile. A
descent moves points only a little at a time; so a cell in a flat part of the image, where it is hardly missed, is now
and then relocated to where a cell is worth dividing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np

import cvtimg.artwork._artwork as _artwork
from cvtimg._shared.progress import part, tell
from cvtimg._shared.sums import sum_by_label
from cvtimg._shared.threads import in_stripes, of_each
from cvtimg._shared.types import Floats, Floats32, Indices, Ints
from cvtimg.placement import pixel_labels, place_generators

#: Bands of rows, each with sums of its own. They are fixed, so that no bit depends on threads.
_PARTS = 16
#: Steps of kernels for a pixel, and of algebra for a cell, by which threads share them out.
_STEPS_OF_PIXEL, _STEPS_OF_CELL = 32.0, 2e4
#: The part of the error that a slope explains which a step explains, too, in a cell of uniform width.
_STEP_OF_SLOPE = 0.75


@dataclass(frozen=True, slots=True)
class Descent:
    """How points descend the error, and are relocated meanwhile."""

    momentum: float = 0.8  # how much of the last steps counts in the direction of the next
    memory: float = 0.95  # and in its length
    step: float = 0.25  # length of a first step, in sides of a tile,
    later: float = 0.1  # and where a smaller image came first, as they do
    coarsest: float = 8.0  # while tiles have this side there, in pixels
    every: int = 8  # steps between relocations, for cells that are moved need steps to settle
    at_most: float = 0.05  # of the cells at a time: estimates hold only while few neighbors change


DESCENT = Descent()


@dataclass(frozen=True, slots=True, eq=False)
class Painted:
    """An (H, W, C) image painted with the mean color of each tile."""

    labels: Ints  # (H, W) tile of each pixel
    colors: Floats  # (K, C) mean of each tile; that of the whole image for one without pixels
    areas: Floats  # (K,) pixels of each tile
    errors: Floats  # (K,) squared error of each tile, summed over pixels and bands

    @property
    def energy(self) -> float:
        """The squared error of the mosaic."""
        return float(self.errors.sum())


def paint(image: Floats32, labels: Ints, n_tiles: int) -> Painted:
    """Measure the tiles of an (H, W, C) image."""
    n_bands = image.shape[2]
    sums = by_rows(partial(_artwork.add_colors, image, labels), labels.shape, (n_tiles, n_bands + 2))
    areas, colors = sums[:, -1], sums[:, :n_bands]
    empty = areas == 0
    means = np.where(empty[:, np.newaxis], colors.sum(axis=0) / areas.sum(), colors / np.maximum(areas, 1)[:, None])
    errors = np.maximum(sums[:, n_bands] - (colors * means).sum(axis=1), 0)
    return Painted(labels, means, areas, np.where(empty, 0, errors))


def by_rows(add: Callable[[int, int, Floats], None], shape: tuple[int, ...], sums_shape: tuple[int, ...]) -> Floats:
    """Let parts of the rows add to sums of their own, and add these up in order."""
    height, width = shape
    sums = np.empty((_PARTS, *sums_shape))
    bounds = [height * number // _PARTS for number in range(_PARTS + 1)]

    def add_part(number: int) -> None:
        sums[number] = 0
        add(bounds[number], bounds[number + 1], sums[number])

    of_each(add_part, _PARTS, _STEPS_OF_PIXEL * height * width)
    return np.concatenate(in_stripes(lambda rows: sums[:, rows].sum(axis=0), sums_shape[0], 4.0 * sums.size, 1024))


def relocate(image: Floats32, points: Floats, painted: Painted) -> tuple[Floats, Indices]:
    """Divide the cells that gain most by it, with (K, 2) points whose cells are missed least.

    Return the points, and the indices of those that moved.
    """
    costs, (gains, middles, offsets) = removal_costs(painted), division_gains(image, painted)
    n_most = max(1, int(DESCENT.at_most * len(points)))
    removed, divided = np.argsort(costs, kind="stable")[:n_most], np.argsort(-gains, kind="stable")[:n_most]
    worth = (costs[removed] < gains[divided]) & ~np.isin(removed, divided)
    removed, divided = removed[worth], divided[worth]
    points = points.copy()
    points[removed] = middles[divided] + offsets[divided]
    points[divided] = middles[divided] - offsets[divided]
    return points, np.concatenate([removed, divided])


def removal_costs(painted: Painted) -> Floats:
    """(K,) estimate of how much the error grows if a cell is shared among its neighbors by the lengths of borders."""
    add = partial(_artwork.add_borders, painted.labels, painted.colors)
    squares, lengths = by_rows(add, painted.labels.shape, (len(painted.areas), 2)).T
    return painted.areas * squares / np.maximum(lengths, 1)


def division_gains(image: Floats32, painted: Painted) -> tuple[Floats, Floats, Floats]:
    """Estimate what the error falls by if a cell is divided across the direction in which colors change most.

    Return the gains (K,), the centers (K, 2) of cells, and the offsets (K, 2) from there to the centers of both halves.
    """
    areas = np.maximum(painted.areas, 1)
    add = partial(_artwork.add_moments, image, painted.labels)
    sums = by_rows(add, painted.labels.shape, (len(areas), 2 * image.shape[2] + 6)).reshape(len(areas), -1, 2)
    middles = sums[:, 0] / areas[:, np.newaxis]
    means = np.concatenate([middles, painted.colors], axis=1)

    def divided(cells: slice) -> tuple[Floats, Floats]:
        n, middle = areas[cells, np.newaxis], middles[cells]
        about = sums[cells, 1:] - (n * means[cells])[:, :, np.newaxis] * middle[:, np.newaxis]
        # A pixel is a square: about its center it has 1/12 of its area, and no cell is flat.
        moments, slopes = about[:, :2] + n[:, :, np.newaxis] / 12 * np.eye(2), about[:, 2:]
        # Of all directions d, the slope along d explains most where |slopes d|^2 / (d moments d) is greatest.
        roots = np.linalg.cholesky(moments)
        whitened = np.linalg.solve(roots, slopes.transpose(0, 2, 1))
        values, vectors = np.linalg.eigh(whitened @ whitened.transpose(0, 2, 1))
        directions = np.linalg.solve(roots.transpose(0, 2, 1), vectors[:, :, -1:])[:, :, 0]
        # The halves of a uniform cell have their centers at half the root of three times its standard deviation.
        lengths = np.sqrt(3) / 2 / (np.sqrt(n) * np.square(directions).sum(axis=1, keepdims=True))
        return _STEP_OF_SLOPE * values[:, -1], directions * lengths

    gains, offsets = zip(*in_stripes(divided, len(areas), _STEPS_OF_CELL * len(areas), 128), strict=True)
    return np.concatenate(gains), middles, np.concatenate(offsets)


def detail_density(bands: Floats32, n_tiles: int, uniform: float) -> Floats32:
    """Compute the squared gradient of an (H, W, C) image, in units of its mean, with a share that is uniform.

    It is smoothed over a quarter of the size of tiles, and above 0.
    """
    from scipy.ndimage import gaussian_filter

    def detail(band: int) -> Floats32:
        smooth = gaussian_filter(bands[:, :, band], 1.0, mode="nearest")
        slopes = [np.gradient(smooth, axis=axis) for axis in (0, 1) if smooth.shape[axis] > 1]
        return np.sum(np.square(slopes), axis=0, initial=0, dtype=np.float32)

    density = np.sum(of_each(detail, bands.shape[2], 100.0 * bands.size), axis=0)
    mean = float(density.mean(dtype=np.float64))
    if mean > 0:
        density /= np.float32(mean)
    width = 0.25 * np.sqrt(density.size / n_tiles)
    smooth = gaussian_filter(density, width, mode="nearest")
    return np.maximum(smooth, 0) + np.float32(uniform)


def place_corners(density: Floats32, n_triangles: int) -> Floats:
    """Place points whose Delaunay triangulation has `n_triangles` triangles, which fill the picture.

    The corners of the picture and some points of its sides are among them: of V points, B of them on the sides,
    2 V - 2 - B triangles come.
    """
    height, width = density.shape
    side = 2 / 3**0.25 * np.sqrt(height * width / n_triangles)  # of equilateral ones
    n_border = int(np.clip(round(2 * (height + width) / side), 4, n_triangles + 2))
    n_border += (n_border - n_triangles) % 2
    n_inner = (n_triangles + 2 - n_border) // 2
    border = _border_points(density, n_border - 4)
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float64)
    inner = place_generators(None, n_inner, density=density, effort="fast").points if n_inner else np.empty((0, 2))
    return np.concatenate([corners, border, inner])


def _border_points(density: Floats32, n_points: int) -> Floats:
    """Place points around the picture, between its corners, by the root of the density there."""
    height, width = density.shape
    rim = np.concatenate([density[0], density[:, -1], density[-1, ::-1], density[::-1, 0]])
    sums = np.append(0, np.cumsum(np.sqrt(rim, dtype=np.float64)))
    at = np.interp((np.arange(n_points) + 0.5) / max(n_points, 1) * sums[-1], sums, np.arange(len(rim) + 1))
    ends = np.cumsum([0, width, height, width, height])
    which = np.minimum(np.searchsorted(ends, at, side="right") - 1, 3)
    # One that falls on a corner goes half a pixel along.
    along = np.clip(at - ends[which], 0.25, np.diff(ends)[which] - 0.25)
    corners = [0, width, width, 0, 0], [0, 0, height, height, 0]
    return np.stack([np.interp(ends[which] + along, ends, sides) for sides in corners], axis=1)


class VoronoiTiling:
    """Voronoi cells: a tile for each point."""

    def __init__(self, shape: tuple[int, int], n_points: int) -> None:
        self._shape, self.n_tiles = shape, n_points

    def labels(self, points: Floats) -> Ints:
        """Label pixels by the point that is nearest to their center."""
        return pixel_labels(self._shape, points)

    def gradient(self, image: Floats32, points: Floats, painted: Painted) -> Floats:
        """Differentiate along the borders of cells."""
        add = partial(_artwork.add_border_gradient, image, painted.labels, points, painted.colors)
        return by_rows(add, self._shape, points.shape)

    def spacing(self, painted: Painted, n_points: int) -> Floats:
        """Tell the side of each cell if it were a square."""
        return np.sqrt(painted.areas)

    def keep_inside(self, points: Floats) -> Floats:
        """Keep points in the picture."""
        return np.clip(points, 0, self._shape[::-1])


class DelaunayTiling:
    """Delaunay triangles of points that have the corners of the picture among them.

    Points that begin on a side of the picture stay on it, so that triangles always fill the picture.
    """

    def __init__(self, shape: tuple[int, int], points: Floats) -> None:
        self._shape = shape
        self._size = np.array(shape[::-1], np.float64)
        self._low, self._high = points == 0, points == self._size
        self.triangles: Ints = np.empty((0, 3), np.int32)

    @property
    def n_tiles(self) -> int:
        """Number of triangles of the last labels."""
        return len(self.triangles)

    def labels(self, points: Floats) -> Ints:
        """Triangulate the points anew, and label pixels by the triangle that their center is in."""
        labels, self._mesh = find_triangles(points, self._shape)
        self.triangles = np.ascontiguousarray(self._mesh.simplices, np.int32)
        return labels

    def gradient(self, image: Floats32, points: Floats, painted: Painted) -> Floats:
        """Differentiate along the edges of triangles."""
        # Each inner edge once: its ends, and the triangles to its right and left, with y down. All turn from x to y.
        beside = self._mesh.neighbors
        triangle, corner = np.nonzero(beside > np.arange(len(beside))[:, np.newaxis])
        a, b = (self.triangles[triangle, (corner + turn) % 3] for turn in (1, 2))
        edges = np.ascontiguousarray(np.stack([a, b, triangle, beside[triangle, corner]], axis=1), np.int32)
        gradient = np.zeros_like(points)
        _artwork.add_edge_gradient(image, points, edges, painted.colors, gradient)
        return gradient

    def spacing(self, painted: Painted, n_points: int) -> Floats:
        """Tell the side of a square of the mean area of the triangles around each point."""
        corners = self.triangles.ravel()
        areas = sum_by_label(corners, np.repeat(painted.areas, 3), n_points)
        return np.sqrt(areas / np.maximum(np.bincount(corners, minlength=n_points), 1))

    def keep_inside(self, points: Floats) -> Floats:
        """Keep points of the sides on them, and others in the picture."""
        inside = np.clip(points, 1e-3, self._size - 1e-3)
        return np.where(self._low, 0, np.where(self._high, self._size, inside))


def find_triangles(points: Floats, shape: tuple[int, ...], scale: float | Floats = 1.0) -> tuple[Ints, Any]:
    """Triangulate points, and find the triangle of the center of each pixel in a picture of a shape and scale."""
    from scipy.spatial import Delaunay

    mesh, labels = Delaunay(points), np.zeros(shape, np.int32)  # some pixel may be in none by rounding
    corners = np.sort(mesh.simplices, axis=1)  # so that an edge has the same bits from either side
    x, y = np.moveaxis((points * scale)[corners], 2, 0)

    def fill(rows: slice) -> None:
        triangle, row = ranges(*(np.clip(end(y, axis=1), rows.start, rows.stop) for end in (np.min, np.max)))
        ends = np.full((2, len(row)), [[np.inf], [-np.inf]])
        for edge in ((0, 1), (0, 2), (1, 2)):
            (x1, y1), (x2, y2) = ((x[triangle, corner], y[triangle, corner]) for corner in edge)
            crosses = (y1 <= row + 0.5) != (y2 <= row + 0.5)
            at = x1 + (row + 0.5 - y1) / np.where(crosses, y2 - y1, 1) * (x2 - x1)
            ends[0] = np.minimum(ends[0], at, where=crosses, out=ends[0])
            ends[1] = np.maximum(ends[1], at, where=crosses, out=ends[1])
        span, column = ranges(*np.clip(ends, 0, shape[1]))
        labels[row[span], column] = triangle[span]

    in_stripes(fill, shape[0], 64.0 * labels.size)
    return labels, mesh


def ranges(low: Floats, high: Floats) -> tuple[Indices, Indices]:
    """List the pixels whose middles lie between the ends of intervals: the interval and the pixel of each."""
    first, stop = (np.ceil(end - 0.5).astype(np.intp) for end in (low, high))
    counts = np.maximum(stop - first, 0)
    interval = np.repeat(np.arange(len(counts)), counts)
    return interval, np.arange(len(interval)) + (first - np.cumsum(counts) + counts)[interval]


#: Tiles that follow from points.
Tiling: TypeAlias = VoronoiTiling | DelaunayTiling


def descend_cells(
    image: Floats32, points: Floats, n_steps: int, on_step: Callable[[int, float], None]
) -> tuple[Tiling, Floats, list[float]]:
    """Move the points of cells, first on the image of half the size: they move as well there, in a quarter of the time.

    Return the cells, the best places, and the error before each step on the whole image.
    """
    height, width = image.shape[:2]
    tiling, first = VoronoiTiling((height, width), len(points)), DESCENT.step
    if height * width >= len(points) * (2 * DESCENT.coarsest) ** 2:
        even = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
        small = even.reshape(even.shape[0] // 2, 2, even.shape[1] // 2, 2, -1).mean(axis=(1, 3))
        with part(0, 0.2):
            _, points, _ = descend_cells(small, points / 2, n_steps, lambda step, energy: None)
        points, first = tiling.keep_inside(2 * points), DESCENT.later
    with part(0.2, 1):
        return tiling, *descend_error(tiling, image, points, n_steps, on_step, first)


def descend_error(
    tiling: Tiling,
    image: Floats32,
    points: Floats,
    n_steps: int,
    on_step: Callable[[int, float], None],
    first: float = DESCENT.step,
) -> tuple[Floats, list[float]]:
    """Move points so that the error of the mosaic falls; return the best places and the error before each step.

    Each point steps by a share of the size of its tiles, in the direction of its smoothed gradient; steps shrink to
    nothing (Adam, of one scale for both coordinates). A step may raise the error: the places with the least are kept.

    References
    ----------
    D. P. Kingma, J. Ba, Adam: A method for stochastic optimization, ICLR 2015, arXiv:1412.6980.
    """
    direction, scale = np.zeros_like(points), np.zeros((len(points), 1))
    best, least, energies = points, np.inf, []
    how = DESCENT
    for step in range(n_steps + 1):
        painted = paint(image, tiling.labels(points), tiling.n_tiles)
        energies.append(painted.energy)
        on_step(step, painted.energy)
        tell(step / n_steps)
        if painted.energy < least:
            best, least = points, painted.energy
        if step == n_steps or painted.energy == 0:
            break
        # Several triangles share each corner, so that none can move by itself.
        if isinstance(tiling, VoronoiTiling) and step and step % how.every == 0:
            points, moved = relocate(image, points, painted)
            direction[moved] = scale[moved] = 0
            if len(moved):
                points = tiling.keep_inside(points)
                continue
        gradient = tiling.gradient(image, points, painted)
        direction = how.momentum * direction + (1 - how.momentum) * gradient
        scale = how.memory * scale + (1 - how.memory) * (gradient**2).sum(axis=1, keepdims=True)
        mean = direction / (1 - how.momentum ** (step + 1))
        spread = np.sqrt(scale / (1 - how.memory ** (step + 1)))
        length = first * (1 - step / n_steps) * tiling.spacing(painted, len(points))[:, np.newaxis]
        steps = length * np.divide(mean, spread, out=np.zeros_like(mean), where=spread > 0)
        points = tiling.keep_inside(points - steps)
    return best, energies

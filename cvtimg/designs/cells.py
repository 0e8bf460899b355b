"""Voronoi cells of points in the unit cube or on the unit torus: exactly in one to three dimensions, else by samples.

Walls are made by mirror images, and the torus by copies.
"""

import itertools
import math
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

import cvtimg.designs._designs as _designs
from cvtimg._shared.checks import check_rows, check_within
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg._shared.threads import in_parts
from cvtimg._shared.types import Array, Floats, Floats32
from cvtimg.engine.points import Points, assign, cell_moments, energy, pack
from cvtimg.engine.samples import WeightedSamples
from cvtimg.placement.moments import CellSums, Moments, SampleMoments
from cvtimg.placement.regions import Box

#: Dimensions up to which cells are computed exactly.
MOST_EXACT_DIMS = 3


def exact_cells(points: Floats, periodic: bool) -> CellSums:
    """Compute the cells of (n, d) points in the unit cube, d <= 3, or on the torus; no two may be equal."""
    if points.shape[1] == 1:
        return _intervals(points[:, 0], periodic)
    n_points, n_dims = points.shape
    width = 2.6 * n_points ** (-1 / n_dims)  # from walls, within which points have images at first: enough for most
    while True:
        cells = _cells(points, periodic, width)
        # A corner of a cell within the cube feels images up to its distance from the point; on the torus twice that.
        needed = float(cells.reaches.max()) * (2 if periodic else 1)
        if needed <= width or width >= 2:
            return cells
        width = min(2.0, 1.1 * needed)


def _intervals(points: Floats, periodic: bool) -> CellSums:
    order = np.argsort(points)
    levels = points[order]
    before = np.append(levels[-1] - 1, levels[:-1]) if periodic else np.append(-levels[0], levels[:-1])
    after = np.append(levels[1:], levels[0] + 1) if periodic else np.append(levels[1:], 2 - levels[-1])
    down, up = np.empty((2, len(points)))
    down[order], up[order] = (levels - before) / 2, (after - levels) / 2
    seconds = (down**3 + up**3) / 3
    return CellSums(down + up, ((up**2 - down**2) / 2)[:, None], seconds[:, None, None], np.maximum(down, up))


def _cells(points: Floats, periodic: bool, width: float) -> CellSums:
    from scipy.spatial import Voronoi

    n_points, n_dims = points.shape
    diagram = Voronoi(np.concatenate([points, *_images(points, periodic, width)]))
    # Faces are divided into triangles, which with the point are the simplices of its cell.
    faces = [
        (pair, first, *corners)
        for pair, (first, *others) in zip(diagram.ridge_points.tolist(), diagram.ridge_vertices, strict=True)
        if min(pair) < n_points and min(first, *others) >= 0
        for corners in (itertools.pairwise(others) if n_dims == 3 else [others])
    ]
    pairs = np.array([face[0] for face in faces])
    corners = diagram.vertices[np.array([face[1:] for face in faces])]
    volumes, firsts, reaches = np.zeros(n_points), np.zeros((n_points, n_dims)), np.zeros(n_points)
    seconds = np.zeros((n_points, n_dims, n_dims))
    for cells in pairs.T:
        cell = cells[cells < n_points]
        legs = corners[cells < n_points] - points[cell][:, None]
        parts, sums = np.abs(np.linalg.det(legs)) / math.factorial(n_dims), legs.sum(axis=1)
        outer = np.einsum("tvi,tvj->tij", legs, legs) + sums[:, :, None] * sums[:, None]
        volumes += sum_by_label(cell, parts, n_points)
        firsts += sum_by_label(cell, sums, n_points, parts) / (n_dims + 1)
        shares = sum_by_label(cell, outer.reshape(-1, n_dims**2), n_points, parts)
        seconds += shares.reshape(seconds.shape) / ((n_dims + 1) * (n_dims + 2))
        np.maximum.at(reaches, cell, np.linalg.norm(legs, axis=2).max(axis=1))
    return CellSums(volumes, firsts, seconds, reaches)


def _images(points: Floats, periodic: bool, width: float) -> list[Floats]:
    """Return copies beyond the walls, or mirror images in each wall, of the points at most so far from them."""
    n_dims, images = points.shape[1], []
    if periodic:
        copies = [points + np.array(step) for step in itertools.product((-1, 0, 1), repeat=n_dims) if any(step)]
        return [image[((image > -width) & (image < 1 + width)).all(axis=1)] for image in copies]
    for dim, wall in itertools.product(range(n_dims), (0.0, 1.0)):
        mirrored = points[np.abs(points[:, dim] - wall) < width].copy()
        mirrored[:, dim] = 2 * wall - mirrored[:, dim]
        images.append(mirrored)
    return images


def sobol_samples(n_samples: int, n_dims: int, rng: int | np.random.Generator) -> Floats32:
    """(m, d) scrambled Sobol points in the unit cube, m the power of two from `n_samples` on."""
    from scipy.stats.qmc import Sobol

    generator = np.random.default_rng(rng)
    return Sobol(n_dims, rng=generator).random_base2((n_samples - 1).bit_length()).astype(np.float32)


def nearest_distances(points: Floats, periodic: bool) -> Floats:
    """(n,) distance from each of (n, d) points, n >= 2, to the nearest other one, in the unit cube or on the torus."""
    box = Box([0] * points.shape[1], [1] * points.shape[1], periodic)
    return np.asarray(box.nearest(points, points, 2)[0][:, 1])


class Cube(SampleMoments):
    """Moments of the cells of points in the unit cube or torus, or a part of it.

    Parameters
    ----------
    samples : (m, d) float32 array
        Where points may lie.
    weights : (m,) array, optional
        Density of the samples.
    periodic : bool
        Whether opposite walls meet.
    exact : bool
        Whether moments are integrals over cells, and not sums over samples.
    """

    def __init__(
        self, samples: Floats32, weights: Floats | None = None, periodic: bool = False, exact: bool = False
    ) -> None:
        loads = np.full(len(samples), 1 / len(samples)) if weights is None else weights / weights.sum()
        region = Box([0] * samples.shape[1], [1] * samples.shape[1], periodic)
        super().__init__(WeightedSamples(samples, loads, in_order=False), 2, region)
        self.samples, self.weights, self.periodic, self.exact = samples, weights, periodic, exact

    @cached_property
    def _packed(self) -> Points:
        return pack(self.samples, self._weights)

    def __call__(self, generators: Floats, /) -> Moments:
        """Compute the moments of the cells of (n, d) points, which need not be inside of the torus's unit cell."""
        if self.exact:
            return exact_cells(generators % 1.0 if self.periodic else generators, self.periodic).moments(generators)
        if self.periodic:
            return super().__call__(generators)
        places, frame = self._packed.frame.inward(generators), self._packed.frame
        labels = assign(self._packed, places)
        masses, firsts = cell_moments(self._packed, labels, len(places))
        total = energy(self._packed, places, labels, masses, firsts)
        moves = per_mass(firsts - masses[:, None] * places, masses)
        return Moments(masses, frame.outward(places + moves), frame.energy(total))

    def labels(self, generators: Floats) -> Array:
        """Find the point nearest to each sample (m,): with so few of them, all are compared faster than by a tree."""
        if not self.periodic:
            return assign(self._packed, self._packed.frame.inward(generators))[: len(self.samples)]
        labels = np.empty(len(self.samples), np.int32)
        columns = np.ascontiguousarray((generators % 1.0).T, np.float32)

        def assign_part(start: int, stop: int) -> None:
            _designs.assign_on_torus(self.samples[start:stop], columns, labels[start:stop])

        in_parts(assign_part, len(labels), work=self.samples.size * len(generators) / 8)
        return labels


def check_unit_points(name: str, points: ArrayLike) -> Floats:
    """Return `points` as an (n, d) float64 array in the unit cube."""
    array = check_rows(name, points).astype(np.float64)
    check_within(name, array, 0, 1, ", the unit cube")
    return array

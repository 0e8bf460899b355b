"""Voronoi cells of points in the unit cube or on the unit torus, exactly, in one to three dimensions.

A Delaunay simplex is cut into orthoschemes: simplices whose corners are a vertex, the middle of an edge from it, in
three dimensions the circumcenter of a face, and the circumcenter of the simplex. Summed with their signs, those of a
vertex are its Voronoi cell. Walls are made by mirror images, and the torus by copies.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]

#: Dimensions up to which cells are computed exactly.
MOST_EXACT_DIMS = 3
#: Images nearer to a wall than this times the mean spacing are enough for most points.
_HALO = 2.6
#: Simplices flatter than this are left out: points on a grid have some of volume 0.
_FLAT = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Moments of Voronoi cells.

    Attributes
    ----------
    volumes : (n,) float64 array
        They sum to 1.
    firsts : (n, d) float64 array
        Integral of x - z over the cell of z.
    seconds : (n, d, d) float64 array
        Integral of (x - z)(x - z)^T.
    reaches : (n,) float64 array
        Greatest distance from z to a point of its cell.
    """

    volumes: _Floats
    firsts: _Floats
    seconds: _Floats
    reaches: _Floats

    @property
    def energy(self) -> float:
        """Integral of the squared distance to the nearest point."""
        return float(np.einsum("ndd->", self.seconds))


def exact_cells(points: _Floats, periodic: bool) -> Cells:
    """Compute the cells of (n, d) points in the unit cube, d <= 3, or on the torus; no two may be equal."""
    if points.shape[1] == 1:
        return _intervals(points[:, 0], periodic)
    n_points, n_dims = points.shape
    width = _HALO * n_points ** (-1 / n_dims)
    while True:
        cells = _cells(points, periodic, width)
        # A corner of a cell within the cube feels images up to its distance from the point; on the torus twice that.
        needed = float(cells.reaches.max()) * (2 if periodic else 1)
        if needed <= width or width >= 2:
            return cells
        width = min(2.0, 1.1 * needed)


def _intervals(points: _Floats, periodic: bool) -> Cells:
    order = np.argsort(points)
    levels = points[order]
    before = np.append(levels[-1] - 1, levels[:-1]) if periodic else np.append(-levels[0], levels[:-1])
    after = np.append(levels[1:], levels[0] + 1) if periodic else np.append(levels[1:], 2 - levels[-1])
    down, up = np.empty((2, len(points)))
    down[order], up[order] = (levels - before) / 2, (after - levels) / 2
    seconds = (down**3 + up**3) / 3
    return Cells(down + up, ((up**2 - down**2) / 2)[:, None], seconds[:, None, None], np.maximum(down, up))


def _cells(points: _Floats, periodic: bool, width: float) -> Cells:
    from scipy.spatial import Delaunay

    n_points = len(points)
    places = np.concatenate([points, *_images(points, periodic, width)])
    simplices = Delaunay(places, qhull_options="Qbb Qc Qz Q12").simplices
    simplices = simplices[(simplices < n_points).any(axis=1)]
    corners = places[simplices]
    edges = corners[:, 1:] - corners[:, :1]
    lengths = np.linalg.norm(edges, axis=2)
    solid = np.abs(np.linalg.det(edges)) > _FLAT * lengths.prod(axis=1)
    simplices, corners, edges, lengths = simplices[solid], corners[solid], edges[solid], lengths[solid]
    to_center = np.linalg.solve(2 * edges, (lengths**2)[..., None])[..., 0]
    centers = corners[:, 0] + to_center
    reaches = np.zeros(n_points)
    for corner in simplices.T:
        own = corner < n_points
        np.maximum.at(reaches, corner[own], np.linalg.norm(to_center[own], axis=1))
    volumes, firsts, seconds = _sum_orthoschemes(simplices, corners, centers, n_points)
    return Cells(volumes, firsts, seconds, reaches)


def _images(points: _Floats, periodic: bool, width: float) -> list[_Floats]:
    """Return copies beyond the walls, or mirror images in each wall, of the points at most so far from them."""
    n_dims = points.shape[1]
    images = []
    if periodic:
        for step in itertools.product((-1, 0, 1), repeat=n_dims):
            if any(step):
                copies = points + np.array(step)
                images.append(copies[((copies > -width) & (copies < 1 + width)).all(axis=1)])
        return images
    for dim in range(n_dims):
        for wall in (0.0, 1.0):
            mirrored = points[np.abs(points[:, dim] - wall) < width].copy()
            mirrored[:, dim] = 2 * wall - mirrored[:, dim]
            images.append(mirrored)
    return images


def _sum_orthoschemes(
    simplices: NDArray[np.int32], corners: _Floats, centers: _Floats, n_points: int
) -> tuple[_Floats, _Floats, _Floats]:
    n_dims = corners.shape[2]
    volumes, firsts = np.zeros(n_points), np.zeros((n_points, n_dims))
    seconds = np.zeros((n_points, n_dims, n_dims))
    for flag in itertools.permutations(range(n_dims + 1)):
        own = simplices[:, flag[0]] < n_points
        vertices = simplices[own, flag[0]]
        steps = corners[own][:, list(flag[1:])] - corners[own, flag[0]][:, None]
        legs = [steps[:, 0] / 2]
        if n_dims == 3:
            legs.append(_face_center(steps[:, 0], steps[:, 1]))
        scheme = np.stack([*legs, centers[own] - corners[own, flag[0]]], axis=1)
        parts = np.sign(np.linalg.det(steps)) * np.linalg.det(scheme) / math.factorial(n_dims)
        sums = scheme.sum(axis=1)
        volumes += np.bincount(vertices, parts, n_points)
        outer = np.einsum("tvi,tvj->tij", scheme, scheme) + sums[:, :, None] * sums[:, None]
        for i in range(n_dims):
            firsts[:, i] += np.bincount(vertices, parts * sums[:, i], n_points) / (n_dims + 1)
            for j in range(n_dims):
                shares = np.bincount(vertices, parts * outer[:, i, j], n_points)
                seconds[:, i, j] += shares / ((n_dims + 1) * (n_dims + 2))
    return volumes, firsts, seconds


def _face_center(one: _Floats, other: _Floats) -> _Floats:
    """Circumcenters of triangles with a corner at the origin and two others given."""
    normals = np.cross(one, other)
    ones, others = (one**2).sum(axis=1, keepdims=True), (other**2).sum(axis=1, keepdims=True)
    centers: _Floats = np.cross(normals, one) * others + np.cross(other, normals) * ones
    centers /= 2 * (normals**2).sum(axis=1, keepdims=True)
    return centers

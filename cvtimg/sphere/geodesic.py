"""Grids of 10 t + 2 points with twelve pentagons, t = h^2 + h k + k^2: lattices of triangles on an icosahedron.

D. Caspar, A. Klug, Cold Spring Harbor Symposia on Quantitative Biology 27 (1962) 1-24, doi 10.1101/sqb.1962.027.001.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from cvtimg._shared.types import Floats, Indices, Points
from cvtimg.sphere.starts import icosahedron
from cvtimg.sphere.triangulation import unit

#: Points are the same if they are so near, and are moved so far towards the middle of a face to be in one triangle.
_SAME, _INWARD = 1e-7, 1e-9


def twist(n: int) -> tuple[int, int] | None:
    """Return h >= k >= 0 for a number of points, 10 (h^2 + h k + k^2) + 2, or None."""
    t, rest = divmod(n - 2, 10)
    if t < 1 or rest:
        return None
    k = np.arange(int((t / 3) ** 0.5) + 1)
    h = np.rint((np.sqrt(4 * t - 3 * k * k) - k) / 2).astype(int)
    solutions = np.flatnonzero(h * h + h * k + k * k == t)
    return (int(h[solutions[0]]), int(k[solutions[0]])) if len(solutions) else None


def nearest_twelve(n: int) -> int:
    """Return the number of points nearest to n with which twelve cells are pentagons and all others hexagons."""
    step = 0
    while True:
        for near in (n - step, n + step):
            if twist(near):
                return near
        step += 1


class Lattice:
    """A lattice of triangles on the faces of an icosahedron; one side of a face is h steps and k steps to the left."""

    def __init__(self, h: int, k: int) -> None:
        self.t = h * h + h * k + k * k
        i, j = np.meshgrid(np.arange(-k, h + 1), np.arange(h + k + 1))
        along, left = (h + k) * i + k * j, h * j - k * i
        shares = np.stack([self.t - along - left, along, left], axis=-1)
        #: How much (B, 3) each place of a face has of its corners, times t.
        self.shares = shares[(shares >= 0).all(axis=-1)]

    @cached_property
    def numbers(self) -> Indices:
        """The number of the point at each place of all faces (20, B)."""
        flat = self._on_faces(None, None)
        _, numbers = np.unique(np.rint(flat / _SAME), axis=0, return_inverse=True)
        return numbers.reshape(20, -1)

    def points(self, coarse: Lattice | None = None, moved: Points | None = None) -> Points:
        """Return the points (n, 3): projected from the faces, or moved as those of a coarser lattice with k = 0 are."""
        _, first = np.unique(self.numbers, return_index=True)
        return unit(self._on_faces(coarse, moved)[first])

    def _on_faces(self, coarse: Lattice | None, moved: Points | None) -> Points:
        """Return places (20 B, 3)."""
        shares = self.shares / self.t
        if coarse is None or moved is None:
            mesh = icosahedron()
            return np.concatenate([shares @ mesh.points[face] for face in mesh.triangles])
        corners, weights = coarse._around(shares)
        nodes = moved[coarse.numbers]
        return np.concatenate([np.einsum("bc,bcx->bx", weights, face[corners]) for face in nodes])

    def _around(self, shares: Floats) -> tuple[Indices, Floats]:
        """Return the places (B, 3) of this lattice, k = 0, at the corners around others, and their weights (B, 3)."""
        n_steps = int(self.t**0.5 + 0.5)
        steps = (shares + _INWARD * (1 / 3 - shares)) * n_steps
        lower = np.floor(steps).astype(int)
        weights = steps - lower
        points_up = lower.sum(axis=1) == n_steps - 1
        weights[~points_up] = 1 - weights[~points_up]
        corners = lower[:, None] + np.where(points_up[:, None, None], np.eye(3, dtype=int), 1 - np.eye(3, dtype=int))
        place = np.empty((n_steps + 1, n_steps + 1), np.intp)
        face_shares = self.shares // n_steps
        place[face_shares[:, 1], face_shares[:, 2]] = np.arange(len(face_shares))
        return place[corners[..., 1], corners[..., 2]], weights

"""Points to start from: lattices on an icosahedron, draws by density, and the midpoints of coarser grids."""

from __future__ import annotations

from functools import cached_property
from itertools import count

import numpy as np

from cvtimg._shared.budgets import ENOUGH_SAMPLES
from cvtimg._shared.types import Floats, Indices, Ints, Points, Triangles
from cvtimg.engine.samples import along_curve
from cvtimg.sphere.densities import SphereDensity, fibonacci
from cvtimg.sphere.triangulation import LEAST_DISTANCE, SphereTriangulation, unit

#: Places that draws choose from, for each point: with more, draws follow the density more closely.
_CANDIDATES = 64


def icosahedron() -> SphereTriangulation:
    """Return the triangulation of the 12 corners of an icosahedron."""
    golden = (1 + 5**0.5) / 2
    corners = [
        corner
        for side in (-1.0, 1.0)
        for long in (-golden, golden)
        for corner in ((0.0, side, long), (side, long, 0.0), (long, 0.0, side))
    ]
    return SphereTriangulation(unit(np.array(corners)))


def bisected(mesh: SphereTriangulation) -> SphereTriangulation:
    """Add the midpoints of all edges and divide triangles by four: n points become 4 n - 6."""
    n, edges, twins = len(mesh.points), mesh.triangles.ravel(), mesh.twins.ravel()
    number = np.arange(len(twins), dtype=np.int32)
    first = np.flatnonzero(number < twins)
    number[first] = n + np.arange(len(first), dtype=np.int32)
    number[twins[first]] = number[first]
    ends = np.roll(mesh.triangles, -1, axis=1).ravel()
    middles = unit(mesh.points[edges[first]] + mesh.points[ends[first]])
    a, b, c = mesh.triangles.T
    ab, bc, ca = number.reshape(-1, 3).T
    triangles = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    # The first half of edge k is edge k of part k, the second one that of the next part; 9 to 11 are in the middle.
    part, k = 12 * (twins // 3), twins % 3
    of_ab, of_bc, of_ca = (part + 3 * ((k + 1) % 3) + k).reshape(-1, 3).T
    to_ab, to_bc, to_ca = (part + 4 * k).reshape(-1, 3).T
    middle = 12 * np.arange(len(mesh.triangles), dtype=np.int32)
    sides = [of_ab, middle + 11, to_ca, to_ab, of_bc, middle + 9, middle + 10, to_bc, of_ca]
    beside = np.stack([*sides, middle + 5, middle + 6, middle + 1], axis=1).reshape(-1, 3)
    return SphereTriangulation(np.concatenate([mesh.points, middles]), triangles, beside)


def in_order(mesh: SphereTriangulation) -> SphereTriangulation:
    """Give points numbers along a curve, so that neighbors are near in memory."""
    order = along_curve(mesh.points)
    number = np.empty(len(order), np.int32)
    number[order] = np.arange(len(order), dtype=np.int32)
    triangles = number[mesh.triangles]
    by_least = np.argsort(triangles.min(axis=1), kind="stable")
    place = np.empty(len(triangles), np.int32)
    place[by_least] = np.arange(len(triangles), dtype=np.int32)
    twins = _renumbered(mesh.twins[by_least], place)
    return SphereTriangulation(mesh.points[order], triangles[by_least], twins)


def without(mesh: SphereTriangulation, n_surplus: int, rng: np.random.Generator) -> SphereTriangulation:
    """Leave out some points, far from each other; a neighbor takes the triangles of each, and edges flip."""
    points, direction = mesh.points, rng.normal(size=3)
    triangles, twins = mesh.triangles.copy(), mesh.twins.ravel().copy()
    corners, stays, is_left = triangles.ravel(), np.ones(len(points), bool), np.ones(len(triangles), bool)
    farness = points @ direction
    for _ in range(n_surplus):
        point = int(farness.argmax())
        around = np.flatnonzero(corners == point)
        corner = int(around[0])
        stays[point], corners[around] = False, corners[corner + (1, -1, -2)[corner % 3]]
        edge = corner - (corner % 3 == 1)  # to that neighbor, or from it
        for side in (edge, twins[edge]):  # whose triangle is left out: its other two edges become one
            first, second = twins[3 * (side // 3) + (side % 3 + np.array([1, 2])) % 3]
            twins[first], twins[second], is_left[side // 3] = second, first, False
        farness = np.minimum(farness, -(points @ points[point]))
    number, place = (np.cumsum(some, dtype=np.int32) - 1 for some in (stays, is_left))
    beside = _renumbered(twins.reshape(-1, 3)[is_left], place)
    merged = SphereTriangulation(points[stays], number[triangles[is_left]], beside)
    merged.replace(merged.points)
    return merged


def _renumbered(twins: Triangles, place: Ints) -> Triangles:
    """Return half-edges where triangles are at other places (T,)."""
    return 3 * place[twins // 3] + twins % 3


def drawn(density: SphereDensity, n: int, rng: np.random.Generator) -> Points:
    """Draw N points in strata along a curve, as many in each as the generators of a tessellation: density^(1/2)."""
    places = fibonacci(max(_CANDIDATES * n, ENOUGH_SAMPLES))
    places = places[along_curve(places)]
    weights = np.cumsum(np.sqrt(density(places)))
    wanted = (np.arange(n) + rng.random(n)) * (weights[-1] / n)
    chosen = np.unique(np.minimum(np.searchsorted(weights, wanted), len(places) - 1))
    if len(chosen) < n:  # where strata are smaller than the spaces between places
        others = np.setdiff1d(np.arange(len(places)), chosen)
        chances = density(places[others]) ** 0.5
        more = rng.choice(others, n - len(chosen), replace=False, p=chances / chances.sum())
        chosen = np.union1d(chosen, more)
    return places[chosen]


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
    return next(near for step in count() for near in (n - step, n + step) if twist(near))


class Lattice:
    """A lattice of triangles on the faces of an icosahedron; one side of a face is h steps and k steps to the left.

    D. Caspar, A. Klug, Cold Spring Harbor Symposia on Quantitative Biology 27 (1962) 1-24,
    doi 10.1101/sqb.1962.027.001.
    """

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
        _, numbers = np.unique(np.rint(flat / LEAST_DISTANCE), axis=0, return_inverse=True)
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
        steps = (shares + 1e-9 * (1 / 3 - shares)) * n_steps  # not on a side, so that each is in one triangle
        lower = np.floor(steps).astype(int)
        weights = steps - lower
        points_up = lower.sum(axis=1) == n_steps - 1
        weights[~points_up] = 1 - weights[~points_up]
        corners = lower[:, None] + np.where(points_up[:, None, None], np.eye(3, dtype=int), 1 - np.eye(3, dtype=int))
        place = np.empty((n_steps + 1, n_steps + 1), np.intp)
        face_shares = self.shares // n_steps
        place[face_shares[:, 1], face_shares[:, 2]] = np.arange(len(face_shares))
        return place[corners[..., 1], corners[..., 2]], weights

"""Points to start from: an icosahedron, draws by density, and the midpoints of coarser grids."""

from __future__ import annotations

import numpy as np

from cvtimg._shared.types import Points
from cvtimg.engine.samples import along_curve
from cvtimg.sphere.densities import SphereDensity, fibonacci
from cvtimg.sphere.triangulation import SphereTriangulation, unit

#: Places that draws choose from, for each point, and at least.
_CANDIDATES, _FEWEST = 64, 1 << 17


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
    return SphereTriangulation(np.concatenate([mesh.points, middles]), triangles)


def in_order(mesh: SphereTriangulation) -> SphereTriangulation:
    """Give points numbers along a curve, so that neighbors are near in memory."""
    order = along_curve(mesh.points)
    number = np.empty(len(order), np.int32)
    number[order] = np.arange(len(order), dtype=np.int32)
    triangles = number[mesh.triangles]
    by_least = np.argsort(triangles.min(axis=1), kind="stable")
    return SphereTriangulation(mesh.points[order], triangles[by_least])


def without(points: Points, n_surplus: int, rng: np.random.Generator) -> Points:
    """Leave out some points, far from each other."""
    direction = rng.normal(size=3)
    left_out: list[int] = []
    farness = points @ direction
    for _ in range(n_surplus):
        left_out.append(int(farness.argmax()))
        farness = np.minimum(farness, -(points @ points[left_out[-1]]))
    return np.delete(points, left_out, axis=0)


def drawn(density: SphereDensity, n: int, rng: np.random.Generator) -> Points:
    """Draw N points in strata along a curve, as many in each as the generators of a tessellation: density^(1/2)."""
    places = fibonacci(max(_CANDIDATES * n, _FEWEST))
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

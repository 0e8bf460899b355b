"""Triangles, how good they are, and the half-edges between them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_places, check_shape, check_triangles
from cvtimg._shared.types import Array, Floats, Indices, Ints, Ints64, Points, Triangles

#: Flips at most for each triangle: in a metric that varies, or on curved surfaces, two edges might take turns for ever.
MOST_FLIPS = 20


class HalfEdges:
    """Triangles; half-edge 3 t + k leads from corner k of triangle t to the next one.

    Attributes
    ----------
    points : (N, 2) or (N, 3) float64 array
    triangles : (T, 3) int32 array
        Indices of points, counterclockwise.
    twins : (T, 3) int32 array
        For each half-edge that which leads back, or -1 on a boundary.
    """

    def __init__(self, points: Points, triangles: Triangles, twins: Triangles | None = None) -> None:
        self.points = np.ascontiguousarray(points)
        self.triangles = np.ascontiguousarray(triangles, np.int32)
        self.twins = find_twins(self.triangles, len(points)) if twins is None else twins

    @property
    def is_closed(self) -> bool:
        """Whether there is no boundary."""
        return bool((self.twins >= 0).all())

    @property
    def euler_characteristic(self) -> int:
        """Vertices minus edges plus triangles: 2 for a sphere, 0 for a torus."""
        n_edges = (self.triangles.size + np.count_nonzero(self.twins < 0)) // 2
        return int(len(self.points) - n_edges + len(self.triangles))

    @property
    def edges(self) -> Triangles:
        """The two ends (3 T, 2) of each half-edge."""
        return edges_around(self.triangles)


def half_edges_out(first: Triangles, twins: Triangles, degrees: Triangles) -> Triangles:
    """List the half-edges (N, M) out of each vertex of a closed surface, counterclockwise from the first; then -1."""
    current = first.copy()
    ring = np.full((len(degrees), int(degrees.max())), -1, np.int32)
    for j in range(ring.shape[1]):
        some = np.flatnonzero(degrees > j)
        ring[some, j] = current[some]
        current[some] = turn_left(current[some], twins)
    return ring


def turn_left(half_edges: Triangles, twins: Triangles) -> Triangles:
    """Return the next half-edges out of the same vertices, counterclockwise; -1 at a boundary."""
    return twins.ravel()[np.where(half_edges % 3 == 0, half_edges + 2, half_edges - 1)]


def edge_keys(edges: NDArray[np.integer], n: int) -> Ints64:
    """One number for both directions of each of (E, 2) edges between n points."""
    a, b = edges.T.astype(np.int64)
    return np.minimum(a, b) * n + np.maximum(a, b)


def find_twins(triangles: NDArray[np.integer], n: int) -> Triangles:
    """Return the half-edge (T, 3) that leads back along each one; -1 for none, or where an edge has more than two."""
    edges = edges_around(triangles)
    keys = edge_keys(edges, n)
    order = np.argsort(keys)
    same = np.diff(keys[order]) == 0
    alone = same & ~np.append(False, same[:-1]) & ~np.append(same[1:], False)
    pairs = np.stack([order[:-1], order[1:]], axis=1)[alone]
    pairs = pairs[edges[pairs[:, 0], 0] == edges[pairs[:, 1], 1]]
    twins = np.full(len(edges), -1, np.int32)
    twins[pairs] = pairs[:, ::-1]
    return twins.reshape(-1, 3)


class EdgeTable:
    """Finds edges, given as (E, 2) of n points, by their ends, in either direction."""

    def __init__(self, edges: NDArray[np.integer], n: int) -> None:
        self._n = n
        keys = edge_keys(edges, n)
        order = np.argsort(keys, kind="stable")
        # The last key is none's: what is wanted after all others ends there.
        self._keys = np.append(keys[order], np.iinfo(np.int64).max)
        self._order = np.append(order, -1)

    def find(self, pairs: NDArray[np.integer]) -> Indices:
        """Return which edge (P,) has each of (P, 2) pairs of ends, the first of equal ones; -1 for none."""
        wanted = edge_keys(pairs, self._n)
        at = np.searchsorted(self._keys, wanted)
        return np.where(self._keys[at] == wanted, self._order[at], -1)


def edges_around(triangles: NDArray[np.integer]) -> Array:
    """Return the three edges (3 T, 2) of each triangle, as it goes around."""
    return triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)


def unique_edges(edges: NDArray[np.integer]) -> tuple[Array, Indices, Indices]:
    """Return edges (E, 2) once and from the lower end (U, 2), which of these each is (E,), and how many are (U,)."""
    n = int(edges.max(initial=0)) + 1
    keys, which, counts = np.unique(edge_keys(edges, n), return_inverse=True, return_counts=True)
    return np.stack([keys // n, keys % n], axis=1).astype(edges.dtype), which, counts


def joined_points(points: Points, apart: float) -> Indices:
    """Return the point (N,) that each is when those nearer than `apart` to one before them are that one."""
    from scipy.spatial import KDTree

    _, first, place = np.unique(points, axis=0, return_index=True, return_inverse=True)
    joined = first[place.ravel()]
    if apart > 0:
        pairs = np.sort(first[KDTree(points[first]).query_pairs(apart, output_type="ndarray")], axis=1)
        which = np.arange(len(points))
        for a, b in pairs[np.lexsort(pairs.T[::-1])].tolist():
            if which[a] == a and which[b] == b:
                which[b] = a
        joined = which[joined]
    return joined


def boundary_edges(triangles: Triangles) -> Triangles:
    """Return the (B, 2) edges that only one triangle has, as it goes around."""
    edges = edges_around(triangles)
    _, which, counts = unique_edges(edges)
    return edges[counts[which] == 1]


def connected_parts(links: tuple[Array, Array], n: int) -> tuple[int, Ints]:
    """Return how many parts links, by their ends (E,) and (E,), make of n things, and the part (n,) of each."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    matrix = coo_array((np.ones(len(links[0]), np.int8), links), (n, n))
    return connected_components(matrix, directed=False)


@dataclass(frozen=True, slots=True, eq=False)
class TriangleMeasures:
    """Measures of each of T triangles.

    Attributes
    ----------
    areas : (T,) float64 array
    least_angles, largest_angles : (T,) float64 arrays
        In degrees.
    circumradii : (T,) float64 array
    qualities : (T,) float64 array
        2 r / R, from 0 for triangles without area to 1 for equilateral ones.
    """

    areas: Floats
    least_angles: Floats
    largest_angles: Floats
    circumradii: Floats
    qualities: Floats

    @property
    def angles(self) -> Floats:
        """All angles (3 T,) in degrees: the least of each triangle, the middle ones, and the largest."""
        middle = 180 - self.least_angles - self.largest_angles
        return np.concatenate([self.least_angles, middle, self.largest_angles])


def measure_triangles(points: ArrayLike, triangles: ArrayLike) -> TriangleMeasures:
    """Measure each triangle.

    Parameters
    ----------
    points : (N, 2) or (N, 3) array
    triangles : (T, 3) integer array
        Indices of points, in either direction.

    Returns
    -------
    TriangleMeasures

    Examples
    --------
    >>> from cvtimg.meshes import measure_triangles
    >>> measures = measure_triangles([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]])
    >>> measures.areas.tolist(), measures.least_angles.round(9).tolist()
    ([0.5], [45.0])
    """
    places = check_places("points", points)
    check_shape("points", places.shape, places.shape[1] in (2, 3), "(N, 2) or (N, 3), a place in each row")
    corners = check_triangles("triangles", triangles, len(places))
    a, b, c = (places[corners[:, k]] for k in range(3))
    sides = np.sort(np.linalg.norm([c - b, a - c, b - a], axis=2), axis=0)
    u, v, is_flat = b - a, c - a, places.shape[1] == 2
    areas = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] if is_flat else np.linalg.norm(np.cross(u, v), axis=1)) / 2
    short, middle, long = sides
    with np.errstate(divide="ignore", invalid="ignore"):
        circumradii = np.where(areas > 0, short * middle * long / (4 * areas), np.inf)
        inradii = 2 * areas / (short + middle + long)
        qualities = np.where(areas > 0, 2 * inradii / circumradii, 0.0)
    # Tangents are exact for narrow angles, and for wide ones, too.
    least = np.degrees(np.arctan2(4 * areas, middle**2 + long**2 - short**2))
    largest = np.degrees(np.arctan2(4 * areas, short**2 + middle**2 - long**2))
    return TriangleMeasures(areas, least, largest, circumradii, qualities)

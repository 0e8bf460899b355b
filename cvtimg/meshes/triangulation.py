"""A triangulation whose borders stay: made once, and from then on only vertices move and edges flip."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.extras import needs
from cvtimg.meshes import _triangles
from cvtimg.meshes.sliding import Tracks

Points = NDArray[np.float64]
Triangles = NDArray[np.int32]

#: Flips at most, for each triangle: in a metric that varies, flips might never end.
_MOST_FLIPS = 20
#: How vertices move.
FREE, FIXED, SLIDES = 0, 1, 2


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """Points and edges that a triangulation must have.

    Attributes
    ----------
    points : (B, 2) float64 array
    edges : (E, 2) int32 array
        Indices of points.
    sides : (E, 2) int32 array
        Labels on both sides of each edge from a to b: where the cross product of b - a and the step to it is positive,
        and where it is negative. Labels <= 0 are outside.
    tracks : Tracks or None
        Along which some of the points may slide.
    """

    points: Points
    edges: Triangles
    sides: Triangles
    tracks: Tracks | None = None


class Triangulation:
    """Vertices, triangles and their neighbors; `points` change in place.

    Attributes
    ----------
    points : (N, 2) float64 array
    fixed : (N,) uint8 array
        `FREE`, `FIXED` or `SLIDES`.
    tracks : Tracks or None
        Of the vertices that slide.
    triangles : (T, 3) int32 array
        Counter-clockwise where y points up.
    tags : (T,) int32 array
        Label of the side of the border that each triangle is on; flips do not change it.
    twins, borders : (T, 3) arrays
        Of the edge opposite to each corner: the same edge of the next triangle as 3 t + k, or -1; whether it stays.
    corners : (N,) int32 array
        One corner 3 t + k at each vertex.
    """

    def __init__(self, points: Points, fixed: NDArray[np.bool_], triangles: Triangles, edges: Triangles) -> None:
        self.points = np.ascontiguousarray(points)
        self.fixed = fixed.astype(np.uint8)
        self.tracks: Tracks | None = None
        self.triangles = np.ascontiguousarray(triangles, np.int32)
        self.tags = np.ones(len(triangles), np.int32)
        self._join(edges)

    @classmethod
    def constrained(cls, borders: Borders, inner: Points) -> Triangulation:
        """Triangulate borders and inner points; keep what is inside, and tag it by the sides of the borders."""
        points = np.concatenate([borders.points, inner])
        fixed = np.arange(len(points)) < len(borders.points)
        triangles = delaunay(points, borders.edges)
        # In the order of the inner points, which is along a curve: neighbors are near in memory.
        triangles = triangles[np.argsort(triangles.max(axis=1))]
        mesh = cls(points, fixed, triangles, borders.edges)
        if borders.tracks is not None:
            mesh.tracks = borders.tracks
            mesh.fixed[mesh.tracks.vertices] = SLIDES
        mesh._tag(borders)
        inside = mesh.tags > 0
        if not inside.all():
            mesh._keep(inside, borders.edges)
        return mesh

    def has_edges(self, edges: Triangles) -> NDArray[np.bool_]:
        """Tell which of (E, 2) edges are there."""
        return np.isin(_keys(edges, len(self.points)), _keys(self._all_edges(), len(self.points)))

    def flip(self, metric: Points | None) -> int:
        """Flip edges until the triangulation is Delaunay, but for its borders; return how many."""
        n_edges = self.triangles.size
        stack, waiting = np.empty(n_edges, np.int32), np.empty(n_edges, np.uint8)
        most = _MOST_FLIPS * len(self.triangles)
        return _triangles.flip(self.points, metric, *self._topology(), most, stack, waiting)

    def moments(self, metric: Points) -> tuple[float, Points, Points]:
        """Compute the energy of the cells, mass times metric (N, 3), and that times the steps to centroids (N, 2)."""
        inertia, pull = np.empty((len(self.points), 3)), np.empty((len(self.points), 2))
        energy = _triangles.sum_cells(self.points, metric, *self._topology(), inertia, pull)
        return energy, inertia, pull

    def move(self, steps: Points) -> Points:
        """Move vertices by (N, 2) steps, or by parts of them where a triangle would turn over; return what was done."""
        done = steps.copy()
        self._move(self.fixed, done)
        return done

    def _move(self, fixed: NDArray[np.uint8], steps: Points) -> None:
        least, is_late = np.empty(len(self.triangles)), np.empty(len(fixed), np.uint8)
        _triangles.move(self.points, fixed, steps, *self._topology(), least, is_late)

    def even(self, metric: Points, share: float = 1.0) -> None:
        """Move vertices so that the edges at each, above all the worst, get nearer to the mean length in a metric.

        They make a share of the best steps. Those on borders slide along them, as far as their tracks lead.
        """
        mean = _triangles.mean_square(self.points, metric, self.triangles, self.twins)
        steps = np.zeros_like(self.points)
        tracks = self.tracks
        if tracks is not None:
            tangents = steps[tracks.vertices] = tracks.tangents()
        _triangles.even(self.points, metric, self.fixed, steps, mean, share, *self._topology())
        if tracks is None:
            return
        moved = tracks.moved((steps[tracks.vertices] * tangents).sum(axis=1))
        steps[tracks.vertices] = moved.points() - self.points[tracks.vertices]
        self._move(np.maximum(self.fixed, FIXED), steps)
        stayed = (steps[tracks.vertices] == 0).all(axis=1)
        self.tracks = replace(moved, along=np.where(stayed, tracks.along, moved.along))

    def smooth(self, metric: Points, power: int) -> None:
        """Move vertices so that the triangles around each, above all the worst, get more equilateral in its metric."""
        _triangles.smooth(self.points, metric, self.fixed, power, *self._topology())

    def locate(self, places: Points, near: Triangles) -> tuple[Triangles, Points]:
        """Walk to the triangles of (M, 2) places from vertices nearby; return them and barycentric coordinates."""
        found = (self.corners[near] // 3).astype(np.int32)
        shares = np.empty((len(places), 3))
        _triangles.locate(self.points, self.triangles, self.twins, np.ascontiguousarray(places), found, shares)
        return found, shares

    def state(self) -> tuple[NDArray[Any], ...]:
        """Return a copy of all that moves and flips change."""
        return tuple(array.copy() for array in (self.points, *self._topology()))

    def restore(self, state: tuple[NDArray[Any], ...]) -> None:
        """Go back to what `state` returned."""
        self.points, self.triangles, self.twins, self.borders, self.corners = state

    def border_edges(self) -> Triangles:
        """Return the (E, 2) edges that stay, each once."""
        own = np.flatnonzero(self.borders.ravel() & (self.twins.ravel() < np.arange(self.twins.size)))
        return self._all_edges()[own]

    def _topology(self) -> tuple[Triangles, Triangles, NDArray[np.uint8], Triangles]:
        return self.triangles, self.twins, self.borders, self.corners

    def _all_edges(self) -> Triangles:
        """(3 T, 2) ends of the edge opposite to each corner, as its triangle goes around."""
        return np.stack([self.triangles[:, [1, 2, 0]].ravel(), self.triangles[:, [2, 0, 1]].ravel()], axis=1)

    def _join(self, edges: Triangles) -> None:
        """Find the twin of each edge, and mark those that stay."""
        n, n_corners = len(self.points), self.triangles.size
        self.twins = np.empty((len(self.triangles), 3), np.int32)
        _triangles.join(self.triangles, self.twins, np.empty(n, np.int32), np.empty(n_corners, np.int32))
        stays = self.twins.ravel() < 0
        on_border = np.zeros(n, bool)
        on_border[edges] = True
        all_edges = self._all_edges()
        maybe = np.flatnonzero(on_border[all_edges].all(axis=1))
        stays[maybe] |= np.isin(_keys(all_edges[maybe], n), _keys(edges, n))
        self.borders = stays.astype(np.uint8).reshape(-1, 3)
        self.corners = np.full(n, -1, np.int32)
        self.corners[self.triangles.ravel()] = np.arange(n_corners)

    def _tag(self, borders: Borders) -> None:
        """Give the triangles between borders the label of most of the border around them; 0 if there is none."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        n, n_triangles = len(self.points), len(self.triangles)
        free = np.flatnonzero((self.borders.ravel() == 0) & (self.twins.ravel() >= 0))
        links = coo_array(
            (np.ones(len(free), np.int8), (free // 3, self.twins.ravel()[free] // 3)), (n_triangles, n_triangles)
        )
        n_parts, part = connected_components(links, directed=False)
        forth, back = borders.edges.astype(np.int64), borders.edges[:, ::-1].astype(np.int64)
        keys = np.concatenate([forth, back]) @ np.array([n, 1])
        labels = np.concatenate([borders.sides[:, 0], borders.sides[:, 1]])
        order = np.argsort(keys)
        own = self._all_edges().astype(np.int64) @ np.array([n, 1])
        at = order[np.minimum(np.searchsorted(keys, own, sorter=order), len(keys) - 1)]
        known = keys[at] == own
        lengths = np.linalg.norm(np.subtract(*self.points[self._all_edges()[known].T]), axis=1)
        seen, index = np.unique(labels, return_inverse=True)
        votes = coo_array((lengths, (np.repeat(part, 3)[known], index[at[known]])), (n_parts, len(seen))).tocsr()
        best = np.asarray(votes.argmax(axis=1)).ravel()
        most = np.asarray(votes.max(axis=1).todense()).ravel() > 0
        self.tags = np.where(most, np.maximum(seen[best], 0), 0).astype(np.int32)[part]

    def _keep(self, kept: NDArray[np.bool_], edges: Triangles) -> None:
        """Leave out triangles, and vertices that have none then."""
        used = np.zeros(len(self.points), bool)
        used[self.triangles[kept]] = True
        number = np.cumsum(used, dtype=np.int32) - 1
        tags = self.tags[kept]
        if self.tracks is not None:
            self.tracks = self.tracks.kept(used[self.tracks.vertices], number)
        self.points, self.fixed = np.ascontiguousarray(self.points[used]), self.fixed[used]
        self.triangles = number[self.triangles[kept]]
        self._join(number[edges[used[edges].all(axis=1)]])
        self.tags = tags


def delaunay(points: Points, edges: Triangles | None = None) -> Triangles:
    """Compute the (constrained) Delaunay triangulation of the convex hull of (N, 2) points: (T, 3) indices."""
    try:
        import pythoncdt as cdt
    except ImportError as error:
        raise ImportError(f"meshes need {needs('PythonCDT', 'mesh')}") from error
    found: Any = cdt.Triangulation(cdt.VertexInsertionOrder.AUTO, cdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0)
    found.insert_vertices(np.ascontiguousarray(points, np.float64))
    if edges is not None and len(edges):
        found.insert_edges(np.ascontiguousarray(edges, np.uint32))
    found.erase_super_triangle()
    table = found.triangles_array()
    return np.ascontiguousarray(table[table.dtype.names[0]], np.int32)


def _keys(edges: Triangles, n: int) -> NDArray[np.int64]:
    """One number for both directions of each of (E, 2) edges."""
    ends = edges.astype(np.int64)
    keys: NDArray[np.int64] = np.minimum(*ends.T) * n + np.maximum(*ends.T)
    return keys

"""Tetrahedra between a lattice and a surface: the body-centered cubic lattice, warped to the surface and cut by it.

F. Labelle, J. R. Shewchuk, Isosurface stuffing: fast tetrahedral meshes with good dihedral angles, ACM Transactions on
Graphics 26 (2007) 57, doi 10.1145/1276377.1276448.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.halfedges import edge_keys
from cvtimg.meshes.measures import boundary_faces

Points = NDArray[np.float64]
Cells = NDArray[np.int64]
#: From (N, 3) points to values (N,), < 0 inside.
Level = Callable[[Points], NDArray[np.float64]]

#: A vertex is moved to a place where the surface cuts one of its edges, if that is nearer than this part of the edge.
_NEAR_LONG, _NEAR_SHORT = 0.24999, 0.41189
#: The lattice is not in line with voxels, so that the number of its points inside grows gradually with finer spacing.
_OFFSET = np.array([0.118, 0.382, 0.236])
#: Vertices of tetrahedra with a smaller dihedral angle, in degrees, move in so many rounds by this part of the spacing.
_NARROW, _NUDGES, _NUDGE = 15.0, 8, 0.05
#: What is filled in is so deep, by the spacing.
_FILLED = 0.5
#: Pairs of corners of a tetrahedron, and for each the other two.
_PAIRS = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
_OTHERS = _PAIRS[::-1]


def stuff(level: Level, low: Points, high: Points, spacing: float) -> tuple[Points, Cells]:
    """Fill where a level is below 0, in a box from `low` to `high`, with tetrahedra of a lattice of a spacing.

    The spacing is the length of the longer edges. The surface is a manifold: where it would meet itself along an edge,
    a point of the lattice is filled in.
    """
    points, cells = lattice(low, high, spacing)
    values = level(points)
    while True:
        found, made, origin = _filled(points, cells, values, spacing)
        # More is filled in each round, so that there is a last one.
        pinched = _pinched(made, len(found))
        if not len(pinched):
            return found, made
        values[origin[pinched]] = -_FILLED * spacing


def _filled(
    points: Points, cells: Cells, values: NDArray[np.float64], spacing: float
) -> tuple[Points, Cells, NDArray[np.intp]]:
    """Fill where values (N,) at points of a lattice are below 0; also return the point at, or beyond, each vertex."""
    kept = (values[cells] < 0).any(axis=1)
    lattice_points, cells = np.unique(cells[kept], return_inverse=True)
    points, values, cells = points[lattice_points], values[lattice_points], cells.reshape(-1, 4)
    edges = np.unique(np.sort(cells[:, _PAIRS].reshape(-1, 2), axis=1), axis=0)
    points, values = _warped(points, values, edges, spacing)
    cut = (values[edges] < 0).any(axis=1) & (values[edges] > 0).any(axis=1)
    a, b = edges[cut].T
    share = values[a] / (values[a] - values[b])
    all_points = np.concatenate([points, points[a] + share[:, None] * (points[b] - points[a])])
    keys = a * len(points) + b
    order = np.argsort(keys)

    def cuts(p: NDArray[np.int64], q: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the vertex on each edge p q where it is cut, or q if that is on the surface."""
        wanted = np.minimum(p, q) * len(points) + np.maximum(p, q)
        at = np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)
        return np.where(values[q] == 0, q, len(points) + order[at])

    made = _cut(cells, values, cuts)
    used, made = np.unique(made, return_inverse=True)
    origin = lattice_points[np.append(np.arange(len(points)), np.where(values[a] > 0, a, b))[used]]
    all_points = all_points[used]
    return all_points, _oriented(all_points, made.reshape(-1, 4)), origin


def _pinched(cells: Cells, n: int) -> NDArray[np.intp]:
    """Return the vertices, of n, of edges at which more than two triangles of the surface meet."""
    edges = boundary_faces(cells)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, which, counts = np.unique(edge_keys(edges, n), return_inverse=True, return_counts=True)
    return np.unique(edges[counts[which] > 2])


def widened(points: Points, cells: Cells, spacing: float) -> Points:
    """Move vertices of tetrahedra with small dihedral angles so that these grow, by little."""
    points = points.copy()
    steps = np.stack(np.meshgrid(*[[-1.0, 0, 1]] * 3), axis=-1).reshape(-1, 3) * _NUDGE * spacing
    for _ in range(_NUDGES):
        narrow = np.flatnonzero(dihedral_angles(points, cells).min(axis=1) < _NARROW)
        if not len(narrow):
            break
        moving = np.unique(cells[narrow])
        near = cells[np.isin(cells, moving).any(axis=1)]
        for vertex in moving.tolist():
            star = near[(near == vertex).any(axis=1)]
            places = np.where((star == vertex)[None, :, :, None], points[vertex] + steps[:, None, None], points[star])
            sound = (_volumes(places) > 0).all(axis=1)
            least = np.where(sound, _dihedral_angles(places).min(axis=(1, 2)), 0)
            if least[len(steps) // 2] < _NARROW:
                points[vertex] += steps[least.argmax()]
    return points


def lattice(low: Points, high: Points, spacing: float) -> tuple[Points, Cells]:
    """Return the points of a body-centered cubic lattice over a box, and its tetrahedra.

    The Voronoi cells of this lattice are all alike and their generators are their centers of mass; no centroidal
    Voronoi tessellation of space is known to have less energy.
    """
    shape = np.ceil((high - low) / spacing).astype(np.int64) + 4
    grid = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    corners = low + (grid - 1 - _OFFSET) * spacing
    points = np.concatenate([corners, corners + spacing / 2])
    steps = np.array([shape[1] * shape[2], shape[2], 1])
    n = len(grid)
    cells = []
    for axis in range(3):
        inner = ((grid < shape - 1).all(axis=1) & (grid[:, axis] > 0)).nonzero()[0]
        others = steps[[(axis + 1) % 3, (axis + 2) % 3]]
        ring = [inner, inner + others[0], inner + others[0] + others[1], inner + others[1]]
        for k in range(4):
            cells.append(np.stack([n + inner - steps[axis], n + inner, ring[k], ring[(k + 1) % 4]], axis=1))
    return points, np.concatenate(cells)


def _warped(
    points: Points, values: NDArray[np.float64], edges: Cells, spacing: float
) -> tuple[Points, NDArray[np.float64]]:
    """Move vertices to the surface where it is near to them."""
    a, b = edges.T
    crossing = values[a] * values[b] < 0
    a, b = a[crossing], b[crossing]
    share = values[a] / (values[a] - values[b])
    is_long = np.linalg.norm(points[a] - points[b], axis=1) > 0.93 * spacing
    near = np.where(is_long, _NEAR_LONG, _NEAR_SHORT)
    ends, others = np.concatenate([a, b]), np.concatenate([b, a])
    shares, near = np.concatenate([share, 1 - share]), np.tile(near, 2)
    close = np.flatnonzero(shares < near)
    lengths = np.linalg.norm(points[ends[close]] - points[others[close]], axis=1) * shares[close]
    order = np.lexsort((lengths, ends[close]))
    close = close[order]
    moved, first = np.unique(ends[close], return_index=True)
    chosen = close[first]
    points, values = points.copy(), values.copy()
    points[moved] += shares[chosen, None] * (points[others[chosen]] - points[moved])
    values[moved] = 0
    return points, values


def _cut(
    cells: Cells, values: NDArray[np.float64], cuts: Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.int64]]
) -> Cells:
    """Keep of each tetrahedron what is inside, as tetrahedra that fit those beside.

    Corners are sorted by values: where a quadrangle is divided, the diagonal starts from its deepest corner, so that it
    is the same on both sides and nearly always the shorter one.
    """
    order = np.lexsort((cells, values[cells]), axis=1)
    cells = np.take_along_axis(cells, order, axis=1)
    n_inside, n_outside = (values[cells] < 0).sum(axis=1), (values[cells] > 0).sum(axis=1)
    made = [cells[(n_outside == 0) & (n_inside > 0)]]
    one = cells[(n_inside == 1) & (n_outside > 0)]
    a = one[:, 0]
    made.append(np.stack([a, *(cuts(a, one[:, k]) for k in (1, 2, 3))], axis=1))
    two = cells[(n_inside == 2) & (n_outside > 0)]
    a, b = two[:, 0], two[:, 1]
    a1, a2, b1, b2 = cuts(a, two[:, 2]), cuts(a, two[:, 3]), cuts(b, two[:, 2]), cuts(b, two[:, 3])
    # The wedge a a1 a2, b b1 b2: all diagonals from a; where corners are on the surface, parts of it are flat.
    made += [np.stack([a, b, b1, b2], axis=1), *_prism_cap(a, a1, a2, b1, b2)]
    three = cells[(n_inside == 3) & (n_outside > 0)]
    a, b, c, p = three.T
    a1, b1, c1 = cuts(a, p), cuts(b, p), cuts(c, p)
    # The frustum a b c, a1 b1 c1: diagonals a b1, a c1 and b c1.
    made += [np.stack(parts, axis=1) for parts in ((a, b, c, c1), (a, b, b1, c1), (a, a1, b1, c1))]
    found = np.concatenate(made)
    rows = np.sort(found, axis=1)
    return found[(np.diff(rows, axis=1) > 0).all(axis=1)]


def _prism_cap(
    a: NDArray[np.int64], a1: NDArray[np.int64], a2: NDArray[np.int64], b1: NDArray[np.int64], b2: NDArray[np.int64]
) -> list[Cells]:
    """Divide the pyramid from a over the quadrangle a1 a2 b2 b1 on the surface."""
    first = np.minimum(a1, b2) < np.minimum(a2, b1)
    one = np.where(first[:, None], np.stack([a, a1, b1, b2], axis=1), np.stack([a, a1, b1, a2], axis=1))
    two = np.where(first[:, None], np.stack([a, a1, b2, a2], axis=1), np.stack([a, b1, b2, a2], axis=1))
    return [one, two]


def _oriented(points: Points, cells: Cells) -> Cells:
    """Turn all tetrahedra so that their volumes are positive."""
    turned = volumes(points, cells) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    return cells


def volumes(points: Points, cells: NDArray[np.integer[Any]]) -> NDArray[np.float64]:
    """Return the volumes (T,), > 0 if the corners 1, 2 and 3 turn counter-clockwise."""
    return _volumes(points[cells])


def _volumes(corners: Points) -> NDArray[np.float64]:
    a, b, c, d = (corners[..., k, :] for k in range(4))
    return (np.cross(b - a, c - a) * (d - a)).sum(axis=-1) / 6


def qualities(points: Points, cells: NDArray[np.integer[Any]]) -> NDArray[np.float64]:
    """Return three times the radius of the ball in each tetrahedron (T,) by that of the one around it."""
    a, b, c, d = (points[cells[:, k]] for k in range(4))
    u, v, w = b - a, c - a, d - a
    uv, vw, wu = np.cross(u, v), np.cross(v, w), np.cross(w, u)
    faces = sum(np.linalg.norm(side, axis=1) for side in (uv, vw, wu, uv + vw + wu))
    squares = [(side**2).sum(axis=1)[:, None] for side in (u, v, w)]
    around = np.linalg.norm(squares[0] * vw + squares[1] * wu + squares[2] * uv, axis=1)
    six = (uv * w).sum(axis=1)
    # r = six / faces and R = around / (2 six).
    return np.asarray(6 * six**2 / np.maximum(faces * around, 1e-300))


def dihedral_angles(points: Points, cells: NDArray[np.integer[Any]]) -> Points:
    """Return the six dihedral angles (..., 6) of tetrahedra, in degrees."""
    return _dihedral_angles(points[cells])


def _dihedral_angles(corners: Points) -> Points:
    a, b = corners[..., _PAIRS[:, 0], :], corners[..., _PAIRS[:, 1], :]
    c, d = corners[..., _OTHERS[:, 0], :], corners[..., _OTHERS[:, 1], :]
    axis = b - a
    u, v = np.cross(axis, c - a), np.cross(axis, d - a)
    sine = np.linalg.norm(np.cross(u, v), axis=-1)
    return np.degrees(np.arctan2(sine, (u * v).sum(axis=-1)))

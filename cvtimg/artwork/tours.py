"""Short tours through points, so that a pen plotter travels little between its marks."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_rows, check_shape
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Floats, Indices, Ints
from cvtimg.artwork._artwork import improve, join

#: Neighbors among which better connections are looked for.
_N_NEAR = 8
#: Points of the longest part that a move may turn. Longer ones gain next to nothing and take most of the time.
_REACH = 25_000
#: Steps of a kernel that a search for neighbors takes, and searches of a part.
_STEPS, _ROWS = 2e4, 1024


def find_tour(points: ArrayLike) -> Indices:
    """Order (N, 2) points along a short open path; return the (N,) permutation of them.

    The path begins at its end that is nearer to (0, 0).

    Notes
    -----
    The shortest connections first, as long as they leave paths (greedy), then 2-opt and Or-opt among the 8 nearest
    neighbors of each point, and then among all that are nearer than its steps are long, until nothing is gained. So no
    steps of the path cross.

    References
    ----------
    J. L. Bentley, Fast algorithms for geometric traveling salesman problems, ORSA Journal on Computing 4 (1992)
    387-411, doi 10.1287/ijoc.4.4.387.

    Examples
    --------
    >>> find_tour([[0, 0], [9, 0], [3, 0], [5, 0]]).tolist()
    [0, 2, 3, 1]
    """
    from scipy.spatial import cKDTree

    places = check_rows("points", points).astype(np.float64)
    check_shape("points", places.shape, places.shape[1] == 2, "(N, 2)")
    tour, distances, near = _greedy_path(places)
    n_points, n_near = near.shape
    sizes, near, spans = np.full(n_points, n_near), near.ravel(), n_near * np.arange(n_points)[:, None] + [0, n_near]
    where, settled = np.empty_like(tour), np.zeros(n_points, np.uint8)
    where[tour] = np.arange(n_points, dtype=np.int32)
    _shorten(places, near, spans, tour, where, settled, _REACH)
    tree, reaches, n_moves, grown = cKDTree(places), distances.max(axis=1, initial=0), 1, np.arange(n_points)
    while n_moves or len(grown):
        # Where two steps cross, an end of one is nearer to an end of the other than to its own: without a gain among
        # the points that are nearer than steps are long, no steps cross.
        steps = np.hypot(*np.diff(places[tour], axis=0).T)
        longest = np.maximum(np.append(steps, 0), np.append(0, steps))  # of those to and from each point of the path
        grown = np.flatnonzero((longest[where] > reaches) & (sizes < n_points - 1))
        sizes[grown] = np.minimum(2 * sizes[grown], n_points - 1)
        for n_near in np.unique(sizes[grown]).tolist():
            some = grown[sizes[grown] == n_near]
            distances, others = _nearest(tree, some, n_near)
            reaches[some] = distances[:, -1]
            spans[some] = len(near) + n_near * np.arange(len(some))[:, None] + [0, n_near]
            near = np.append(near, others)
        settled[grown if len(grown) else slice(None)] = 0  # at last none must be anywhere
        n_moves = _shorten(places, near, spans, tour, where, settled, n_points)
    first, last = np.hypot(*places[tour[[0, -1]]].T)
    return tour[:: 1 if first <= last else -1].astype(np.intp)


def _shorten(*path: Any) -> int:
    """Shorten a tour in place until nothing is gained; return in how many moves."""
    return sum(iter(partial(improve, *path), 0))


def _greedy_path(points: Floats) -> tuple[Ints, Floats, Ints]:
    """Join the ends of paths, the nearest first, until one is left; return it and the neighbors of each point."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import depth_first_order
    from scipy.spatial import cKDTree

    n_points = len(points)
    links = np.full((n_points, 2), -1, np.int32)
    parents = np.arange(n_points, dtype=np.int32)
    near: tuple[Floats, Ints] = np.empty((n_points, 0)), np.empty((n_points, 0), np.int32)
    n_paths = n_points
    while n_paths > 1:
        ends = np.flatnonzero(links[:, 1] < 0).astype(np.int32)
        tree = cKDTree(points[ends], balanced_tree=False)
        distances, others = _nearest(tree, np.arange(len(ends)), min(_N_NEAR, len(ends) - 1))
        if n_paths == n_points:
            near = distances, others
        # Each end has at most one other of its own path, so that some pair can always be joined.
        pairs = np.stack([np.repeat(ends, others.shape[1]), ends[others.ravel()]], axis=1)
        n_paths -= join(pairs[np.argsort(distances, axis=None, kind="stable")], links, parents)
    point, side = np.nonzero(links >= 0)
    steps = csr_array((np.ones(len(point)), (point, links[point, side])), shape=(n_points, n_points))
    return depth_first_order(steps, np.flatnonzero(links[:, 1] < 0)[0], return_predecessors=False), *near


def _nearest(tree: Any, some: Indices, n_near: int) -> tuple[Floats, Ints]:
    """Find the nearest others of some points of a tree, and their distances; points may coincide."""

    def find(rows: slice) -> tuple[Floats, Ints]:
        distances, neighbors = tree.query(tree.data[some[rows]], n_near + 1)
        # A point is found itself, and not always first where others lie on it, or even not at all.
        others = neighbors != some[rows, np.newaxis]
        others[others.all(axis=1), -1] = False
        return distances[others].reshape(-1, n_near), neighbors[others].reshape(-1, n_near).astype(np.int32)

    distances, others = zip(*in_stripes(find, len(some), _STEPS * len(some), _ROWS), strict=True)
    return np.concatenate(distances), np.concatenate(others)

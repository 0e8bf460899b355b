"""Short tours through points, so that a pen plotter travels little between its marks."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_rows, check_shape
from cvtimg._shared.threads import n_threads
from cvtimg._shared.types import Floats, Indices, Ints
from cvtimg.artwork._artwork import improve, join

#: Neighbors among which better connections are looked for.
_N_NEAR = 8
#: Points of the longest part that a move may turn. Longer ones gain next to nothing and take most of the time.
_REACH = 25_000


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
    tour, near = _greedy_path(places)
    _shorten(places, near.ravel(), np.arange(len(tour) + 1) * near.shape[1], tour, _REACH)
    tree, everyone = cKDTree(places), np.arange(len(tour))
    changed = everyone
    while len(changed):
        before = _beside(tour)
        n_moves = _shorten(places, *_within_steps(tree, tour, changed), tour, len(tour))
        # Where steps have changed, more may be gained; at last none must be anywhere.
        is_last = len(changed) == len(tour) and not n_moves
        moved = np.flatnonzero((_beside(tour) != before).any(axis=1))
        changed = moved if n_moves or is_last else everyone
    first, last = (np.hypot(*places[end]) for end in tour[[0, -1]])
    return tour[:: 1 if first <= last else -1].astype(np.intp)


def _shorten(points: Floats, near: Ints, starts: Indices, tour: Ints, reach: int) -> int:
    """Shorten a tour in place until nothing is gained; return in how many moves."""
    where, settled, n_moves = np.empty_like(tour), np.zeros(len(tour), np.uint8), 0
    where[tour] = np.arange(len(tour), dtype=np.int32)
    while more := improve(points, near, starts, tour, where, settled, reach):
        n_moves += more
    return n_moves


def _beside(tour: Ints) -> Ints:
    """(N, 2) points before and after each in a tour, the lesser first; -1 beyond its ends."""
    beside = np.empty((len(tour), 2), np.int32)
    beside[tour] = np.stack([np.append(-1, tour[:-1]), np.append(tour[1:], -1)], axis=1)
    return np.sort(beside, axis=1)


def _within_steps(tree: Any, tour: Ints, among: Indices) -> tuple[Ints, Indices]:
    """Find the points nearer to some than those before and after them in a tour, and where those of each begin.

    Where two steps cross, an end of one is nearer to an end of the other than to its own: without a gain among these
    points, no steps cross.
    """
    points, longest = np.asarray(tree.data), np.zeros(len(tour))
    steps = np.hypot(*np.diff(points[tour], axis=0).T)
    longest[tour] = np.maximum(np.append(steps, 0), np.append(0, steps))
    moving = among[longest[among] > 0]
    near = tree.query_ball_point(points[moving], longest[moving], workers=n_threads())
    starts = np.repeat(moving, [len(others) for others in near])
    others = np.concatenate([*near, []]).astype(np.int32)
    distances = np.hypot(*(points[others] - points[starts]).T)
    order = np.lexsort((distances, starts))
    order = order[(distances < longest[starts])[order] & (others != starts)[order]]
    return others[order], np.searchsorted(starts[order], np.arange(len(tour) + 1))


def _greedy_path(points: Floats) -> tuple[Ints, Ints]:
    """Join the ends of paths, the nearest first, until one is left; return it and the neighbors of each point."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import depth_first_order

    n_points = len(points)
    links = np.full((n_points, 2), -1, np.int32)
    parents = np.arange(n_points, dtype=np.int32)
    near = np.empty((n_points, 0), np.int32)
    n_paths = n_points
    while n_paths > 1:
        ends = np.flatnonzero(links[:, 1] < 0).astype(np.int32)
        distances, others = _nearest(points[ends])
        if n_paths == n_points:
            near = others
        # Each end has at most one other of its own path, so that some pair can always be joined.
        pairs = np.stack([np.repeat(ends, others.shape[1]), ends[others.ravel()]], axis=1)
        n_paths -= join(pairs[np.argsort(distances, axis=None, kind="stable")], links, parents)
    point, side = np.nonzero(links >= 0)
    steps = csr_array((np.ones(len(point)), (point, links[point, side])), shape=(n_points, n_points))
    return depth_first_order(steps, np.flatnonzero(links[:, 1] < 0)[0], return_predecessors=False), near


def _nearest(points: Floats) -> tuple[Floats, Ints]:
    """Find the nearest others of each point, and their distances; points may coincide."""
    from scipy.spatial import cKDTree

    n_points = len(points)
    n_near = min(_N_NEAR, n_points - 1)
    distances, neighbors = cKDTree(points, balanced_tree=False).query(points, n_near + 1, workers=n_threads())
    # A point is found itself, and not always first where others lie on it, or even not at all.
    itself = neighbors == np.arange(n_points)[:, np.newaxis]
    itself[~itself.any(axis=1), -1] = True
    return distances[~itself].reshape(n_points, n_near), neighbors[~itself].reshape(n_points, n_near).astype(np.int32)

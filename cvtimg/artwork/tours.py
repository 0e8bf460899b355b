"""Short tours through points, so that a pen plotter travels little between its marks."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_rows, check_shape
from cvtimg._shared.threads import n_threads
from cvtimg.artwork._artwork import improve, join, walk

#: Neighbors among which better connections are looked for.
_N_NEAR = 8
#: Points of the longest part that a move may turn. Longer ones gain next to nothing and take most of the time.
_REACH = 25_000
#: Steps of a path that are longer than this, in their median, are few.
_SHORT = 3.0
#: Steps that cross are longer by more than this part than those in their place, but for rounding.
_ROUNDING = 1e-9


def find_tour(points: ArrayLike) -> NDArray[np.intp]:
    """Order (N, 2) points along a short open path; return the (N,) permutation of them.

    The path begins at its end that is nearer to (0, 0).

    Notes
    -----
    The shortest connections first, as long as they leave paths (greedy), then 2-opt and Or-opt among the 8 nearest
    neighbors of each point, until nothing is gained.

    References
    ----------
    J. L. Bentley, Fast algorithms for geometric traveling salesman problems, ORSA Journal on Computing 4 (1992)
    387-411, doi 10.1287/ijoc.4.4.387.

    Examples
    --------
    >>> find_tour([[0, 0], [9, 0], [3, 0], [5, 0]]).tolist()
    [0, 2, 3, 1]
    """
    places = check_rows("points", points).astype(np.float64)
    check_shape("points", places.shape, places.shape[1] == 2, "(N, 2)")
    tour, near = _greedy_path(places)
    where = np.empty_like(tour)
    where[tour] = np.arange(len(tour), dtype=np.int32)
    settled = np.zeros(len(tour), np.uint8)
    while improve(places, near, tour, where, settled, _REACH):
        pass
    first, last = (np.hypot(*places[end]) for end in tour[[0, -1]])
    return tour[:: 1 if first <= last else -1].astype(np.intp)


def uncrossed(points: NDArray[np.float64], tour: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return a tour through (N, 2) points, its ends the same, that is shorter where it crossed itself, and does not."""
    tour = tour.copy()
    while len(crossed := _crossings(points[tour])):
        has_moved = np.zeros(len(tour), np.bool_)
        for first, last in crossed:  # turning what lies between takes a crossing out
            if not (has_moved[first] or has_moved[last]):
                tour[first + 1 : last + 1] = tour[first + 1 : last + 1][::-1]
                has_moved[first : last + 1] = True
    return tour


def _greedy_path(points: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Join the ends of paths, the nearest first, until one is left; return it and the neighbors of each point."""
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
        # Numbers of pairs take the last bits of lengths: both in one are sorted several times as fast.
        places = np.uint64((1 << distances.size.bit_length()) - 1)
        keys = np.sort(distances.ravel().view(np.uint64) & ~places | np.arange(distances.size, dtype=np.uint64))
        n_paths -= join(pairs[(keys & places).astype(np.intp)], links, parents)
    tour = np.empty(n_points, np.int32)
    walk(links, int(np.flatnonzero(links[:, 1] < 0)[0]), tour)
    return tour, near


def _crossings(path: NDArray[np.float64]) -> NDArray[np.intp]:
    """Find the pairs of steps (C, 2) of a path (N, 2) that cross, by the first step, the shorter gaps first."""
    from scipy.spatial import cKDTree

    if len(path) < 4:
        return np.empty((0, 2), np.intp)
    starts, steps = path[:-1], np.diff(path, axis=0)
    lengths, middles = np.hypot(*steps.T), starts + steps / 2
    usual = _SHORT * float(np.median(lengths))
    tree, long = cKDTree(middles), np.flatnonzero(lengths > usual)
    near = tree.query_ball_point(middles[long], (lengths[long] + usual) / 2)
    of_long = np.repeat(long, [len(others) for others in near])
    beside = np.concatenate([*near, []]).astype(np.intp)
    both_long = np.stack(np.meshgrid(long, long), axis=-1).reshape(-1, 2)
    short = tree.query_pairs(usual, output_type="ndarray")
    pairs = np.sort(np.concatenate([short, np.column_stack([of_long, beside]), both_long]), axis=1)
    first, last = pairs[pairs[:, 1] > pairs[:, 0] + 1].T

    def side(of: NDArray[np.intp], points: NDArray[np.float64]) -> NDArray[np.float64]:
        away = points - starts[of]
        return np.sign(steps[of, 0] * away[:, 1] - steps[of, 1] * away[:, 0])

    apart = side(first, path[last]) * side(first, path[last + 1]) < 0
    apart &= side(last, path[first]) * side(last, path[first + 1]) < 0
    first, last = first[apart], last[apart]
    turned = np.hypot(*(path[last] - path[first]).T) + np.hypot(*(path[last + 1] - path[first + 1]).T)
    shorter = turned < (1 - _ROUNDING) * (lengths[first] + lengths[last])  # else steps lie on each other
    order = np.argsort((last - first)[shorter], kind="stable")
    return np.column_stack([first, last])[shorter][order]


def _nearest(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Find the nearest others of each point, and their distances; points may coincide."""
    from scipy.spatial import cKDTree

    n_points = len(points)
    n_near = min(_N_NEAR, n_points - 1)
    distances, found = cKDTree(points, balanced_tree=False).query(points, n_near + 1, workers=n_threads())
    # A point is found itself, and not always first where others lie on it, or even not at all.
    itself = found == np.arange(n_points)[:, np.newaxis]
    itself[~itself.any(axis=1), -1] = True
    return distances[~itself].reshape(n_points, n_near), found[~itself].reshape(n_points, n_near).astype(np.int32)

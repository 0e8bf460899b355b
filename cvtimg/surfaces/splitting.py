"""Splitting of long edges, so that triangles follow a surface and its density."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cvtimg.surfaces.halves import find_twins

Points = NDArray[np.float64]
Triangles = NDArray[np.int32]

#: Rounds at most; each halves the longest edges.
_ROUNDS = 24


def split_long_edges(
    points: Points,
    triangles: Triangles,
    limits: Callable[[Points], NDArray[np.float64]],
    on_surface: Callable[[Points], Points],
) -> tuple[Points, Triangles]:
    """Halve edges until none is longer than allowed.

    Parameters
    ----------
    points, triangles
        The surface.
    limits : callable
        From (N, 3) points to the (N,) lengths that edges there may have.
    on_surface : callable
        Moves the middles of edges to the surface.

    Returns
    -------
    points, triangles
    """
    allowed = limits(points)
    triangles = np.ascontiguousarray(triangles)
    for _ in range(_ROUNDS):
        halves = np.arange(triangles.size, dtype=np.int32)
        edge = np.maximum(halves, find_twins(triangles, len(points)).ravel())  # one of the two half-edges for both
        own = np.flatnonzero(edge == halves)
        a, b = triangles.ravel()[own], triangles[:, [1, 2, 0]].ravel()[own]
        is_long = np.linalg.norm(points[a] - points[b], axis=1) > (allowed[a] + allowed[b]) / 2
        if not is_long.any():
            break
        middles = on_surface((points[a[is_long]] + points[b[is_long]]) / 2)
        number = np.full(triangles.size, -1, np.int32)
        number[own[is_long]] = np.arange(len(points), len(points) + len(middles), dtype=np.int32)
        triangles = _split(triangles, number[edge].reshape(-1, 3))
        points = np.concatenate([points, middles])
        allowed = np.concatenate([allowed, limits(middles)])
    return points, triangles


def _split(triangles: Triangles, middles: Triangles) -> Triangles:
    """Divide triangles at the middles of their sides 0-1, 1-2 and 2-0, where these are >= 0."""
    n_split = (middles >= 0).sum(axis=1)
    # Turn each so that side 0-1 is split and, of two, 1-2 as well; of one or two there is one such turn.
    first = np.where(n_split == 2, (np.argmin(middles, axis=1) + 1) % 3, np.argmax(middles, axis=1))
    turns = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, turns, axis=1).T
    ab, bc, ca = np.take_along_axis(middles, turns, axis=1).T
    patterns = (
        [(a, b, c)],
        [(a, ab, c), (ab, b, c)],
        [(ab, b, bc), (a, ab, bc), (a, bc, c)],
        [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    )
    parts = [
        np.stack([corner[n_split == count] for corner in part], axis=1)
        for count, pattern in enumerate(patterns)
        for part in pattern
    ]
    return np.ascontiguousarray(np.concatenate(parts), np.int32)

"""Where inner vertices start: as many as are wanted, as dense as sizes ask for, and none too near to a border."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_in_range
from cvtimg.meshes.fields import Field, lengths_of
from cvtimg.meshes.triangulation import Borders, PlaneTriangulation

Points = NDArray[np.float64]

#: No vertex starts nearer to one on a border than this part of the edge length there; less where there is no room.
_NEAR = 0.6
_LESS = 0.8
#: Rounds of drawing more, and how many more than seem to be needed.
_ROUNDS, _MORE = 16, 1.03


def place_inside(borders: Borders, field: Field, n: int, rng: np.random.Generator) -> Points:
    """Draw (n, 2) points inside of borders, in order along a curve."""
    from scipy.spatial import cKDTree

    if n <= 0:
        return np.empty((0, 2))
    frame = PlaneTriangulation.constrained(borders, np.empty((0, 2)))
    used = np.unique(frame.triangles).astype(np.int32)
    tree = cKDTree(frame.points[used])
    reach = _reach(frame)[used]
    wanted, part = float(n), _NEAR
    for _ in range(_ROUNDS):
        points = field.seeds(round(wanted), rng)
        near = tree.query(points)[1]
        metric = field.metric(points)
        size = (metric[:, 0] * metric[:, 2] - metric[:, 1] ** 2) ** -0.25
        room = np.maximum(1, reach[near] / size) if field.isotropic else 1.0
        far = lengths_of(metric, points - frame.points[used[near]]) > part * room
        points, near = points[far], near[far]
        _, shares = frame.locate(points, used[near])
        points = points[shares.min(axis=1) > 1e-9]
        if len(points) >= n:
            return points[((np.arange(n) + 0.5) * len(points) / n).astype(np.intp)]
        if wanted > 4 * n:
            part *= _LESS
        wanted = min(wanted * _MORE * n / max(len(points), 1), 8.0 * n) + 1
    check_in_range("n", n, False, f"less by {n - len(points)}: the border leaves no room")
    return points


def _reach(frame: PlaneTriangulation) -> NDArray[np.float64]:
    """Find the longest border edge (N,) at each vertex, by a factor that lets inner vertices stand near its middle."""
    edges = frame.border_edges()
    lengths = np.linalg.norm(np.subtract(*frame.points[edges.T]), axis=1)
    reach = np.zeros(len(frame.points))
    for end in (0, 1):
        np.maximum.at(reach, edges[:, end], 0.8 * lengths)
    return reach

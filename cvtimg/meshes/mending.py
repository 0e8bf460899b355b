"""Small angles at borders: edges there are split and vertices added, as in Delaunay refinement, and others taken away.

J. Ruppert, A Delaunay refinement algorithm for quality 2-dimensional mesh generation, Journal of Algorithms 18 (1995)
548-585, doi 10.1006/jagm.1995.1021.
"""

import numpy as np

from cvtimg._shared.progress import each
from cvtimg._shared.types import Bools, Floats, Indices, Ints, Points
from cvtimg.halfedges import EdgeTable, measure_triangles
from cvtimg.meshes.fields import Field
from cvtimg.meshes.relaxation import relax
from cvtimg.meshes.triangulation import FREE, Borders, PlaneTriangulation

#: Degrees below which angles are mended: with more, meshes need more vertices than there are.
_SMALL = 30.0
#: Degrees of corners of borders beside which no edge is split, for that never ends: with more, others stay narrow.
_TIP = 15.0


def mend(
    mesh: PlaneTriangulation, field: Field, grade: float, rounds: int, *, shortest: float, keep_number: bool
) -> PlaneTriangulation:
    """Return a mesh with fewer small angles, and, if asked, as many vertices.

    New vertices on borders are in the middle of edges longer than twice the shortest, so that areas stay, and those
    inside are farther than that from others.
    Sizes grow by `grade` from there. It ends after some rounds, or when six have gained nothing.
    """
    best, least, since = mesh, _badness(mesh), 0
    for _ in each(range(rounds)):
        ends = mesh.border_edges()
        # Vertices inside that divide the angles of one triangle, which is better without them.
        n_around = np.bincount(mesh.triangles.ravel(), minlength=len(mesh.points))
        dropped = (mesh.fixed == FREE) & (n_around == 3) & mesh.has_angles_below(_SMALL)
        split, added, radii = _refined(mesh, ends, shortest, dropped)
        a, b = mesh.points[ends[split]].transpose(1, 0, 2)
        places = np.concatenate([(a + b) / 2, added])
        sizes = np.concatenate([np.linalg.norm(b - a, axis=1) / 2, radii])
        if not len(places) + dropped.sum() or since == 6:
            break
        free = (mesh.fixed == FREE) & ~dropped
        n_inner = int((mesh.fixed == FREE).sum()) - len(places)
        inner = _as_many(mesh, field, free, n_inner, places, 0.7 * sizes) if keep_number else mesh.points[free]
        if inner is None:
            break
        mesh = PlaneTriangulation.constrained(_with_middles(mesh, split), np.concatenate([inner, added]))
        field = field.lowered(places, sizes, grade)
        relax(mesh, field, most=6, tolerance=0.0)
        for _ in range(10):
            mesh.smooth()
            mesh.flip(None)
        badness, since = _badness(mesh), since + 1
        if badness < least:
            best, least, since = mesh, badness, 0
    return best


def _badness(mesh: PlaneTriangulation) -> float:
    """Sum the degrees by which least angles are too small."""
    angles = measure_triangles(mesh.points, mesh.triangles).least_angles
    return float(np.maximum(_SMALL - angles, 0).sum())


def _refined(mesh: PlaneTriangulation, ends: Ints, shortest: float, dropped: Bools) -> tuple[Bools, Points, Floats]:
    """Find the border edges (E,) to split, and points (A, 2) to add, which are centers of circles with radii (A,).

    They are the circumcenters of bad triangles; where one is in the circle over a border edge, or beyond it, that is
    split instead.
    """
    from scipy.spatial import cKDTree

    a, b = mesh.points[ends].transpose(1, 0, 2)
    middles, halves = (a + b) / 2, np.linalg.norm(b - a, axis=1) / 2
    bad, centers, radii, tips = _bad(mesh)
    may_split = (halves > shortest) & ~np.isin(ends, tips).any(axis=1)
    near = cKDTree(middles).query_ball_point(centers, halves.max())
    triangles, shares = mesh.locate(centers, mesh.triangles[bad, 0])
    way_out = EdgeTable(ends, len(mesh.points)).find(mesh.edges[3 * triangles + (shares.argmin(axis=1) + 1) % 3])
    split, added = np.zeros(len(ends), bool), np.zeros(len(bad), bool)
    taken = dropped.copy()
    for k, triangle in enumerate(mesh.triangles[bad]):
        if taken[triangle].any():
            continue
        hit = np.array(near[k], np.intp)
        hit = hit[np.linalg.norm(middles[hit] - centers[k], axis=1) < halves[hit]]
        if shares[k].min() <= 0 and not len(hit):
            hit = way_out[k : k + 1]
        added[k] = not len(hit) and radii[k] > shortest
        hit = hit[may_split[hit]]
        split[hit] = True
        if added[k] or len(hit):
            taken[triangle] = taken[ends[hit]] = True
            taken[mesh.triangles[triangles[k]]] |= added[k]
    return split, centers[added], radii[added]


def _bad(mesh: PlaneTriangulation) -> tuple[Indices, Points, Floats, Ints]:
    """Find triangles with small angles, the worst first, and their circumcircles, and narrow corners of borders."""
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    sides = np.linalg.norm([b - a, c - b, a - c], axis=2).T
    shortest, each = sides.argmin(axis=1), np.arange(len(sides))
    is_corner = (mesh.borders[each, shortest - 1] > 0) & (mesh.borders[each, shortest - 2] > 0)
    angles = measure_triangles(mesh.points, mesh.triangles).least_angles
    tips = mesh.triangles[each, shortest - 1][is_corner & (angles < _TIP)]
    bad = np.flatnonzero((angles < _SMALL) & ~is_corner)
    bad = bad[np.argsort(angles[bad], kind="stable")]
    (bx, by), (cx, cy) = (b[bad] - a[bad]).T, (c[bad] - a[bad]).T
    bb, cc = bx * bx + by * by, cx * cx + cy * cy
    steps = np.stack([cy * bb - by * cc, bx * cc - cx * bb], axis=1) / (2 * (bx * cy - by * cx))[:, None]
    return bad, a[bad] + steps, np.linalg.norm(steps, axis=1), tips


def _as_many(
    mesh: PlaneTriangulation, field: Field, free: Bools, n: int, places: Points, near: Floats
) -> Points | None:
    """Return n vertices inside: of the free ones (N,), some go, or more stand in the largest triangles.

    Those nearer to new places than `near` (M,) go first. None if fewer are apart.
    """
    from scipy.spatial import cKDTree

    n_less, worth = int(free.sum()) - n, field.metric(mesh.points)[:, 0]
    if n_less <= 0:
        areas = measure_triangles(mesh.points, mesh.triangles).areas * worth[mesh.triangles].mean(axis=1)
        largest = np.argsort(-areas, kind="stable")[:-n_less] if n_less else np.empty(0, np.intp)
        return np.concatenate([mesh.points[free], mesh.points[mesh.triangles[largest]].mean(axis=1)])
    start, end = mesh.edges.T
    lengths = np.linalg.norm(mesh.points[start] - mesh.points[end], axis=1) * np.sqrt(worth[start])
    shortest = np.full(len(free), np.inf)
    np.minimum.at(shortest, start, lengths)
    gaps, new = cKDTree(places).query(mesh.points)
    shortest[gaps < near[new]] = 0
    # No two of them are neighbors: each has shorter edges than all around.
    rank = np.full(len(free), len(free))
    rank[np.argsort(np.where(free, shortest, np.inf), kind="stable")] = np.arange(len(free))
    least = np.full(len(free), len(free))
    np.minimum.at(least, start, rank[end])
    apart = np.flatnonzero(free & (rank < least))
    if len(apart) < n_less:
        return None
    free = free.copy()
    free[apart[np.argsort(rank[apart])[:n_less]]] = False
    return mesh.points[free]


def _with_middles(mesh: PlaneTriangulation, split: Bools) -> Borders:
    """Return the borders of a mesh, with some edges (E,) in two halves."""
    edges = mesh.half_edges_on_borders()
    kept = mesh.fixed != FREE
    number = np.cumsum(kept, dtype=np.int32) - 1
    a, b = number[mesh.edges[edges]].T
    beyond = mesh.twins.ravel()[edges]
    sides = np.stack([mesh.tags[edges // 3], np.where(beyond < 0, 0, mesh.tags[beyond // 3])], axis=1).astype(np.int32)
    points = np.concatenate([mesh.points[kept], mesh.points[mesh.edges[edges[split]]].mean(axis=1)])
    middle = np.arange(kept.sum(), len(points), dtype=np.int32)
    halves = [[a[~split], b[~split]], [a[split], middle], [middle, b[split]]]
    corners = np.append(mesh.corners[kept], np.zeros(len(middle), bool))
    edges_of_both = np.concatenate(halves, axis=1).T
    return Borders(points, edges_of_both, np.concatenate([sides[~split], sides[split], sides[split]]), corners)

"""What points on surfaces keep: creases and boundaries as curves, the corners between these, and points on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.budgets import ROWS_AT_ONCE
from cvtimg._shared.extras import shapely
from cvtimg._shared.sums import sum_by_label
from cvtimg._shared.types import Bools, Floats, Indices, Ints, Points, Triangles
from cvtimg.halfedges import EdgeTable, connected_parts
from cvtimg.surfaces.triangulation import SurfaceTriangulation, number_edges, unit


@dataclass(frozen=True, slots=True)
class Seen:
    """Which features are large enough to be seen, by the distances of points."""

    shortest: float = 3.0  # creases that are shorter in all are left out
    broad: float = 0.9  # part of the angle at which the surfaces on both sides of a crease meet, a distance far
    grain: float = 1 / 8  # faces this near to each other that look one way are one there: 1/4 rounds creases off
    coarse: float = 1 / 3  # grains of this size tell where there is only noise:
    flat: float = 0.6  # where halves of the surface around, however cut, meet at less than this part of the angle
    sure: float = 3.0  # they meet at more by this multiple of the error that noise makes: chance is as far in 1 of 740
    corner: float = 40.0  # a curve has a corner where it turns by the angle of creases or, if that is less, by this
    reach: float = 0.5  # over this part of the distance as well: the steps of a scan do not
    most_loss: float = 0.05  # curves get points until twice as many make them longer by less than this


_SEEN = Seen()


def find_features(mesh: SurfaceTriangulation, angle: float, sizes: Floats, n_faces: int) -> Bools:
    """Tell which half-edges (3 T,) are of features: boundaries, edges of three faces, and creases.

    Creases are where faces meet at more than `angle` degrees from flat, and the surfaces on both sides, as far as a
    distance (N,) of points, nearly do, or by more where there is noise, of its own on each of `n_faces` that triangles
    are parts of. Those that are not longer in all than a few distances are too small to be seen.
    """
    edge = number_edges(mesh.triangles, len(mesh.points))
    is_other = np.bincount(edge)[edge] != 2
    beyond = np.maximum(mesh.twins.ravel(), 0)
    normals = mesh.face_normals()
    cosines = np.einsum("ij,ij->i", normals.repeat(3, axis=0), normals[beyond // 3])
    creased = ~is_other & (cosines < np.cos(np.radians(angle)) - 1e-12)
    first = edge == np.arange(len(edge))
    broad = _is_broad(mesh, first & (creased | is_other), creased & first, sizes, angle, n_faces)
    creased &= broad[edge]
    # Connected creases are long beside the distances of points.
    a, b = mesh.edges[creased].T
    _, group = connected_parts((a, b), len(mesh.points))
    parts = mesh.edge_lengths()[creased] / (sizes[a] + sizes[b])  # half of it, on both sides
    lengths = sum_by_label(group[a], parts, int(group.max()) + 1)
    return np.asarray(is_other | (creased & (lengths > _SEEN.shortest)[group[mesh.edges[:, 0]]]))


def extra_points(mesh: SurfaceTriangulation, sizes: Floats) -> float:
    """Return how many points more there are than whole cells: those on a boundary have half of one."""
    edge = number_edges(mesh.triangles, len(mesh.points))
    a, b = mesh.edges.T
    lengths = mesh.edge_lengths() * 2 / (sizes[a] + sizes[b])
    return float((lengths * (1 / np.bincount(edge)[edge] - 1 / 2)).sum())


def _is_broad(
    mesh: SurfaceTriangulation, features: Bools, creased: Bools, sizes: Floats, angle: float, n_faces: int
) -> Bools:
    """Tell which half-edges (3 T,), of those creased, are creases of the surfaces around, not of single faces or noise.

    Between junctions, a crease is one if it is along half of its length, but not if it is short and has a free end.
    """
    halves = np.flatnonzero(creased)
    broad = np.zeros(len(creased), bool)
    if not len(halves):
        return broad
    normals = mesh.face_normals()
    halves = halves[~_is_flat(mesh, halves // 3, sizes, _SEEN.flat * angle)]
    ends, twins = mesh.edges[halves], mesh.twins.ravel()
    inner = np.flatnonzero(~features & (twins >= 0) & (twins < np.arange(len(twins))))
    sheet = connected_parts((inner // 3, twins[inner] // 3), len(normals))[1]
    centers, areas = mesh.points[mesh.triangles].mean(axis=1), mesh.areas()
    face, grains = areas.sum() / n_faces, _Grains.of(mesh, _SEEN.grain * sizes[mesh.triangles].mean(axis=1), sheet)
    middles, lengths, apart = mesh.points[ends].mean(axis=1), mesh.edge_lengths()[halves], sizes[ends].mean(axis=1)
    sides: list[NDArray[np.integer]] = [halves // 3, twins[halves] // 3]
    outward = unit(grains.vectors)
    # Faces around are on the side of that face at the crease to which the way from its middle leads.
    way = np.subtract(*(unit(centers[side] - middles) for side in sides))
    # Sums of normals, of those in the same sheet, and of areas of these: noise is how these normals differ.
    sums = [2 * areas[side, None] * np.column_stack([normals[side]] * 2 + [np.ones(len(side))]) for side in sides]
    for block, of, grain in grains.near(middles, apart):
        is_first = np.einsum("ij,ij->i", grains.centers[grain] - middles[of], way[of]) > 0
        for side, chosen, total in zip(sides, (is_first, ~is_first), sums, strict=True):
            # Faces of another sheet, turned away, are left out.
            chosen &= np.einsum("ij,ij->i", outward[grain], normals[side[of]]) > 0
            chosen &= grain != grains.of_face[side[of]]
            near, crease = grain[chosen], of[chosen]
            rows = np.column_stack([grains.vectors[near]] * 2 + [grains.areas[near]])
            rows[:, 3:] *= (grains.sheet[near] == sheet[side[crease]])[:, None]
            total[block] += sum_by_label(crease - block.start, rows, len(total[block]))
    turn = np.arccos(np.clip(np.einsum("ij,ij->i", *(unit(total[:, :3]) for total in sums)), -1, 1))
    variance = np.zeros(len(halves))
    for total in sums:
        spread = -np.log(np.clip(np.linalg.norm(total[:, 3:6], axis=1) / total[:, 6], 1e-9, 1))
        variance += spread / np.maximum(total[:, 6] / (2 * face), 1)
    passes = turn > np.radians(_SEEN.broad * angle) + _SEEN.sure * np.sqrt(variance)
    lengths /= apart
    table, n_ends = EdgeTable(ends, len(mesh.points)), np.bincount(mesh.edges[features].ravel())
    for chain in _chains(ends):
        each = table.find(np.stack([chain[:-1], chain[1:]], axis=1))
        is_spur = (n_ends[chain[0]] == 1) != (n_ends[chain[-1]] == 1) and lengths[each].sum() < _SEEN.shortest
        broad[halves[each]] = not is_spur and lengths[each] @ passes[each] >= lengths[each].sum() / 2
    return broad


@dataclass(frozen=True, slots=True, eq=False)
class _Grains:
    """Faces that are near to each other, taken together: sums of few grains stand for those of many faces."""

    of_face: Indices  # (T,)
    centers: Points  # (G, 3)
    vectors: Points  # (G, 3): sums of normals by area
    areas: Floats  # (G,): twice of all faces
    sheet: Ints  # (G,)

    @classmethod
    def of(cls, mesh: SurfaceTriangulation, apart: Floats, sheet: Ints | None) -> _Grains:
        """Join faces in boxes about `apart` (T,) wide: those that face along one axis and are of one sheet (T,).

        If no sheets are given, those that are connected, however noisy.
        """
        a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
        centers, weighted, level = (a + b + c) / 3, np.cross(b - a, c - a), np.floor(np.log2(apart))
        boxes = np.array([*np.floor(centers.T / 2**level), level]).astype(np.int64)
        boxes -= boxes.min(axis=1, keepdims=True)
        box = np.unique(np.ravel_multi_index(boxes, boxes.max(axis=1) + 1), return_inverse=True)[1].ravel()
        if sheet is None:
            sides = np.flatnonzero(mesh.twins.ravel() >= 0)
            links = sides // 3, mesh.twins.ravel()[sides] // 3
            same = box[links[0]] == box[links[1]]
            sheet = connected_parts((links[0][same], links[1][same]), len(centers))[1]
            keys = sheet
        else:
            axis = np.abs(weighted).argmax(axis=1)
            direction = 2 * axis + (weighted[np.arange(len(axis)), axis] < 0)
            keys = (box * (int(sheet.max()) + 1) + sheet) * 6 + direction
        _, first, of_face = np.unique(keys, return_index=True, return_inverse=True)
        areas = np.linalg.norm(weighted, axis=1, keepdims=True)
        rows = np.concatenate([areas, areas * centers, weighted], axis=1)
        total = sum_by_label(of_face, rows, len(first))
        return cls(of_face, total[:, 1:4] / total[:, :1], total[:, 4:], total[:, 0], sheet[first])

    def near(self, places: Points, reach: Floats) -> Iterator[tuple[slice, Indices, Indices]]:
        """Find the grains nearer to places (M, 3) than `reach` (M,): blocks of places, and pairs of both."""
        from scipy.spatial import KDTree

        tree = KDTree(self.centers)
        # There are up to 1000 grains around each.
        for first in range(0, len(places), ROWS_AT_ONCE // 1024):
            block = slice(first, first + ROWS_AT_ONCE // 1024)
            lists = tree.query_ball_point(places[block], reach[block], return_sorted=False)
            of = first + np.arange(len(lists)).repeat([len(each) for each in lists])
            yield block, of, np.concatenate(lists).astype(np.intp)


def _is_flat(mesh: SurfaceTriangulation, faces: Indices, sizes: Floats, angle: float) -> Bools:
    """Tell which faces (F,) have no crease around, whatever noise: halves of the surface there meet at a less angle."""
    apart = sizes[mesh.triangles].mean(axis=1)
    grains = _Grains.of(mesh, _SEEN.coarse * apart, None)
    here, which = np.unique(grains.of_face[faces], return_inverse=True)
    outward, reach = unit(grains.vectors)[here], np.zeros(len(grains.centers))
    np.maximum.at(reach, grains.of_face, apart)
    least = np.ones(len(here))
    for block, of, grain in grains.near(grains.centers[here], reach[here]):
        at, n, vectors = of - block.start, len(least[block]), grains.vectors[grain]
        is_away, areas = np.einsum("ij,ij->i", outward[of], vectors) <= 0, np.linalg.norm(vectors, axis=1)
        away, all_of_it = (np.bincount(at, weights, n) for weights in (is_away * areas, areas))
        normal = unit(sum_by_label(at, vectors, n))
        x = unit(np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)]))
        way = grains.centers[grain] - grains.centers[here][of]
        along = [np.einsum("ij,ij->i", way, axis[at]) for axis in (x, np.cross(normal, x))]
        for turn in np.arange(8) * np.pi / 8:
            first = along[0] * np.cos(turn) + along[1] * np.sin(turn) > 0
            halves = [unit(sum_by_label(at[chosen], vectors[chosen], n)) for chosen in (first, ~first)]
            least[block] = np.minimum(least[block], np.einsum("ij,ij->i", *halves))
        least[block][away > 0.1 * all_of_it] = -1  # where the surface folds back
    return np.asarray((least > np.cos(np.radians(angle)))[which.ravel()])


def place_on_curves(mesh: SurfaceTriangulation, features: Bools, sizes: Floats, angle: float) -> tuple[Indices, Points]:
    """Choose the vertices (M,) that stay on features, and the places (M, 3) they go to, `sizes` (N,) apart."""
    edge = number_edges(mesh.triangles, len(mesh.points))
    ends = mesh.edges[features & (edge == np.arange(len(edge)))]
    kept: dict[int, Points] = {}
    for chain in _chains(ends):
        for curve in _divided(mesh.points, chain, sizes, min(angle, _SEEN.corner)):
            inner, places = _spaced(mesh.points[curve], sizes[curve])
            kept.update(zip(curve[[0, -1]].tolist(), mesh.points[curve[[0, -1]]], strict=True))
            kept.update(zip(curve[inner].tolist(), places, strict=True))
    return np.array([*kept], np.intp), np.array([*kept.values()]).reshape(-1, 3)


def _chains(ends: Triangles) -> list[Indices]:
    """Join edges (E, 2) to chains of vertices between those with other than two; a closed one ends at its start."""
    steps = shapely.linestrings(np.stack([ends, ends], axis=-1).astype(np.float64))
    lines = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(steps))) if len(ends) else []
    return [shapely.get_coordinates(line)[:, 0].astype(np.intp) for line in lines]


def _divided(points: Points, chain: Indices, sizes: Floats, angle: float) -> list[Indices]:
    """Divide a chain of vertices at its corners, where it turns by more than an angle."""
    places, is_closed = points[chain], chain[0] == chain[-1]
    along = _lengths(places)
    reach = np.minimum(_SEEN.reach * sizes[chain], along[-1] / 4)
    sharp = np.ones(len(chain), bool)
    period = along[-1] if is_closed else None
    for step in (reach, 1e-3 * np.diff(along).min()):
        before, after = (
            np.stack([np.interp(along + way, along, x, period=period) for x in places.T], axis=1)
            for way in (-step, step)
        )
        sharp &= np.einsum("ij,ij->i", unit(places - before), unit(after - places)) < np.cos(np.radians(angle))
    corners = np.flatnonzero(sharp[:-1] if is_closed else np.r_[True, sharp[1:-1], True])
    if is_closed and len(corners):
        chain = np.concatenate([chain[corners[0] : -1], chain[: corners[0] + 1]])
        corners = np.append(corners - corners[0], len(chain) - 1)
    elif is_closed:
        corners = np.array([0, len(chain) - 1])
    return [chain[i : j + 1] for i, j in pairwise(corners)]


def _spaced(places: Points, sizes: Floats) -> tuple[Indices, Points]:
    """Choose inner vertices of a curve (M, 3), and the places that divide it by the distances of points.

    In one dimension this is a centroidal Voronoi tessellation, whose ends stay.
    """
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    along = np.concatenate([[0], np.cumsum(steps * 2 / (sizes[1:] + sizes[:-1]))])

    def divided(n: int) -> Points:
        return np.stack([np.interp(np.linspace(0, along[-1], n + 1), along, x) for x in places.T], axis=1)

    is_closed, most = (places[0] == places[-1]).all(), len(places) - 1
    n = min(max(round(along[-1]), 3 if is_closed else 1), most)
    while 2 * n <= most and _lengths(divided(n))[-1] < (1 - _SEEN.most_loss) * _lengths(divided(2 * n))[-1]:
        n *= 2
    inner = np.arange(1, n)
    nearest = np.rint(np.interp(inner * along[-1] / n, along, np.arange(most + 1))).astype(np.intp)
    # Each has a vertex of its own.
    distinct = np.maximum.accumulate(np.maximum(nearest, inner) - inner) + inner
    return np.minimum(distinct, most - n + inner), divided(n)[1:-1]


def _lengths(places: Points) -> Floats:
    """Return how far (M,) each of places (M, 3) is from the first, along straight lines from one to the next."""
    return np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])

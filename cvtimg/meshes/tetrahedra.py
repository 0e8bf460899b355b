"""Tetrahedra between a lattice and a surface: the body-centered cubic lattice, warped to the surface and cut by it.

F. Labelle, J. R. Shewchuk, Isosurface stuffing: fast tetrahedral meshes with good dihedral angles, ACM Transactions on
Graphics 26 (2007) 57, doi 10.1145/1276377.1276448.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that
from cvtimg._shared.types import Array, Bools, Floats, Indices, Ints64, Points
from cvtimg.halfedges import edge_keys, edges_around, unique_edges

Cells = Ints64

#: A vertex is moved to a place where the surface cuts one of its edges, if that is nearer than this part of the edge.
_NEAR_LONG, _NEAR_SHORT = 0.24999, 0.41189
#: Pairs of corners of a tetrahedron; in reverse, those of the other two.
_PAIRS = np.array([*combinations(range(4), 2)])
#: Degrees of dihedral angles below which vertices move: with more, more do, and surfaces lose their shape.
_NARROW = 15.0


class VoxelLevels:
    """Smoothed signed distances to the surfaces of labels of voxels, < 0 inside: a place has the label of the least."""

    def __init__(self, voxels: NDArray[np.integer], reach: float) -> None:
        from scipy import ndimage

        self.tags, numbers = np.unique(np.append(voxels, 0), return_inverse=True)
        numbers = numbers[:-1].reshape(voxels.shape)
        self.wanted = np.bincount(numbers.ravel(), minlength=len(self.tags)).astype(float)[1:]
        # Distances are known in the box of each label, and as far around it as edges reach.
        # They are smoothed by a Gaussian of one voxel, which ends at four.
        self._margin = int(np.ceil(4 + reach)) + 1
        padded = np.pad(numbers, self._margin)
        whole = tuple(slice(0, size) for size in voxels.shape)
        self._corners, self._fields = [], []
        for number, box in enumerate([whole, *ndimage.find_objects(numbers)]):
            inside = padded[tuple(slice(side.start, side.stop + 2 * self._margin) for side in box)] == number
            distances = ndimage.distance_transform_edt(~inside), ndimage.distance_transform_edt(inside)
            distance = np.where(inside, 0.5 - distances[1], distances[0] - 0.5)
            self._fields.append(ndimage.gaussian_filter(distance, 1))
            self._corners.append(np.array([side.start for side in box]) - self._margin + 0.5)
            thick = bool((self._fields[-1] < 0).any())
            check_that(f"label {self.tags[number]} of labels", thick, "have parts at least three voxels thick")
        inner = np.argwhere(numbers > 0)
        self.low, self.high = inner.min(axis=0)[::-1] - 1.0, inner.max(axis=0)[::-1] + 2.0

    def nearest(self, points: Points) -> Indices:
        """Return the label at each of (N, 3) points; 0 is outside."""
        labels, least = np.zeros(len(points), np.intp), self._at(0, points)
        for number in range(1, len(self.tags)):
            corner = self._corners[number][::-1]
            far = corner + self._fields[number].shape[::-1] - 1
            some = np.flatnonzero(((points >= corner) & (points <= far)).all(axis=1))
            values = self._at(number, points[some])
            less = values < least[some]
            labels[some[less]], least[some[less]] = number, values[less]
        return labels

    def distances(self, points: Points, labels: Indices) -> Floats:
        """Return the distance of each of (N, 3) points to its label (N,)."""
        values = np.empty(len(points))
        for number in np.unique(labels).tolist():
            some = labels == number
            values[some] = self._at(number, points[some])
        return values

    def _at(self, number: int, points: Points) -> Floats:
        from scipy.ndimage import map_coordinates

        at = (points[:, ::-1] - self._corners[number]).T
        return map_coordinates(self._fields[number], at, order=1, mode="nearest")


@dataclass(frozen=True, slots=True, eq=False)
class Filling:
    """Tetrahedra with labels."""

    points: Points
    cells: Cells
    labels: Indices  # (T,), from 1


def stuff(levels: VoxelLevels, low: Points, high: Points, spacing: float) -> Filling:
    """Fill the labels from 1 in a box from `low` to `high` with tetrahedra of a lattice of a spacing.

    The spacing is the length of the longer edges. Neighbors share the triangles between them, and the surface of each
    label is a manifold: where it would meet itself along an edge, points of the lattice stay where they are.
    """
    lattice = _Lattice(levels, low, high, spacing)
    while True:
        filling, made = _filled(lattice)
        # Where no point of the lattice moves, labels are derived neighborhoods of their points, which are manifolds.
        at = made[pinched(filling.cells, filling.labels, len(filling.points))]
        at = at[at < len(lattice.points)]
        if not lattice.is_free[at].any():
            return filling
        lattice.is_free[at] = False


class _Lattice:
    """A lattice, the label of each of its points, and where surfaces cut its edges."""

    def __init__(self, levels: VoxelLevels, low: Points, high: Points, spacing: float) -> None:
        points, cells = lattice(low, high, spacing)
        labels = levels.nearest(points)
        self.n_labels = int(labels.max()) + 1
        used, cells = np.unique(cells[(labels[cells] > 0).any(axis=1)], return_inverse=True)
        self.points, self.labels, self.cells = points[used], labels[used], cells.reshape(-1, 4)
        edges = unique_edges(self.cells[:, _PAIRS].reshape(-1, 2))[0]
        self.edges = edges[self.labels[edges[:, 0]] != self.labels[edges[:, 1]]]
        ends, others = self.edges.ravel(), self.labels[self.edges[:, ::-1]].ravel()
        self._keys, first, which = np.unique(ends * self.n_labels + others, return_index=True, return_inverse=True)
        ends, others = ends[first], others[first]
        # Points near to more than two labels stay, so that what is between them has room.
        self.is_free = np.bincount(ends, minlength=len(used)) < 2
        self.is_outer = self.labels == 0
        self.is_outer[ends[others == 0]] = True
        places = self.points[ends]
        apart = levels.distances(places, others) - levels.distances(places, self.labels[ends])
        self._depths = np.maximum(apart / 2, 1e-9 * spacing)
        depths = self._depths[which].reshape(-1, 2)
        self.shares = depths[:, 0] / depths.sum(axis=1)
        self.lengths = np.linalg.norm(points[used[self.edges[:, 0]]] - points[used[self.edges[:, 1]]], axis=1)
        self.near = np.where(self.lengths > 0.93 * spacing, _NEAR_LONG, _NEAR_SHORT)

    def depths(self, points: Cells, others: Indices) -> Floats:
        """Return how deep points are in their labels, seen from other labels, which neighbors of theirs have."""
        return self._depths[np.searchsorted(self._keys, points * self.n_labels + others)]

    def warped(self) -> tuple[Points, Bools]:
        """Move points that are near to a surface to it; also tell which."""
        while True:
            points, on = self._moved()
            # Tetrahedra all of whose corners move are flat: they are left out, or their corners stay.
            flat = self.cells[on[self.cells].all(axis=1) & ~self.is_outer[self.cells].all(axis=1)]
            if not len(flat):
                return points, on
            self.is_free[flat] = False

    def _moved(self) -> tuple[Points, Bools]:
        ends, others = self.edges.T.ravel(), self.edges[:, ::-1].T.ravel()
        shares, near = np.concatenate([self.shares, 1 - self.shares]), np.tile(self.near, 2)
        close = np.flatnonzero((shares < near) & self.is_free[ends])
        close = close[np.lexsort((np.tile(self.lengths, 2)[close] * shares[close], ends[close]))]
        moved, first = np.unique(ends[close], return_index=True)
        chosen = close[first]
        points, on = self.points.copy(), np.zeros(len(self.points), bool)
        points[moved] += shares[chosen, None] * (points[others[chosen]] - points[moved])
        on[moved] = True
        return points, on


def _filled(grid: _Lattice) -> tuple[Filling, Indices]:
    """Fill the labels of a lattice; also return the number of each vertex: those of the lattice come first."""
    points, on = grid.warped()
    n = len(points)
    is_cut = ~on[grid.edges].any(axis=1)
    a, b = grid.edges[is_cut].T
    keys, near = a * n + b, grid.near[is_cut]
    shares = np.clip(grid.shares[is_cut], near, 1 - near)
    on_edges = grid.points[a] + shares[:, None] * (grid.points[b] - grid.points[a])

    def cuts(p: Indices, q: Indices) -> Indices:
        """Return the vertex on each edge p q where it is cut, or q if that is on the surface."""
        at = np.minimum(np.searchsorted(keys, np.minimum(p, q) * n + np.maximum(p, q)), len(keys) - 1)
        return np.where(on[q], q, n + at)

    labels, moved = grid.labels[grid.cells], on[grid.cells]
    least = np.where(moved, grid.n_labels, labels).min(axis=1)
    most = np.where(moved, -1, labels).max(axis=1)
    is_whole = (least == most) & (least > 0)
    is_two = (least < most) & (moved | (labels == least[:, None]) | (labels == most[:, None])).all(axis=1)
    parts = [(grid.cells[is_whole], least[is_whole])]
    for side, beyond in ((least, most), (most, least)):
        chosen = is_two & (side > 0)
        cells, inner = grid.cells[chosen], labels[chosen] == side[chosen, None]
        others = np.where(inner, beyond[chosen, None], side[chosen, None])
        known = ~moved[chosen]
        values = np.zeros(cells.shape)
        values[known] = grid.depths(cells[known], others[known]) * np.where(inner, -1, 1)[known]
        parts.append(_cut(cells, values, side[chosen], cuts))
    several = grid.cells[(least < most) & ~is_two]
    parts_of_several, inner_points = _starred(grid, several, cuts, np.concatenate([points, on_edges]))
    parts += parts_of_several
    made, labels = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    used, made = np.unique(made, return_inverse=True)
    places = np.concatenate([points, on_edges, inner_points])[used]
    cells = made.reshape(-1, 4)
    turned = volumes(places, cells) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    return Filling(places, cells, labels), used


def _starred(
    grid: _Lattice, cells: Cells, cuts: Callable[[Indices, Indices], Indices], points: Points
) -> tuple[list[tuple[Cells, Indices]], Points]:
    """Divide tetrahedra with three or four labels, from a point inside; return also these points.

    Triangles between three labels have such a point, too, so that it is the same for the tetrahedra on both sides.
    """
    faces = cells[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3)
    labels = grid.labels[faces]
    owner = np.arange(len(cells)).repeat(4)
    same = labels == np.roll(labels, -1, axis=1)
    triple = ~same.any(axis=1)
    corners, which = np.unique(np.sort(faces[triple], axis=1), axis=0, return_inverse=True)
    ring = [cuts(corners[:, k], corners[:, (k + 1) % 3]) for k in range(3)]
    middles = points[np.stack(ring, axis=1)].mean(axis=1)
    tips = len(points) + len(middles) + owner
    made = [(np.column_stack([faces, tips])[same.all(axis=1)], labels[same.all(axis=1), 0])]
    a, middle = faces[triple], len(points) + which.reshape(-1)
    for k in range(3):
        for other in ((k + 1) % 3, (k + 2) % 3):
            parts = (a[:, k], cuts(a[:, k], a[:, other]), middle, tips[triple])
            made.append((np.stack(parts, axis=1), labels[triple, k]))
    # The corner a has a label of its own; the diagonal starts from the deeper one of b and c, as in `_cut`.
    two = np.flatnonzero(same.sum(axis=1) == 1)
    alone = (same[two].argmax(axis=1) + 2) % 3
    turned = (alone[:, None] + np.arange(3)) % 3
    alone, b, c = np.take_along_axis(faces[two], turned, axis=1).T
    of_a, of_b = labels[two, turned[:, 0]], labels[two, turned[:, 1]]
    depth_b, depth_c = grid.depths(b, of_a), grid.depths(c, of_a)
    swapped = (depth_c > depth_b) | ((depth_c == depth_b) & (c < b))
    b, c = np.where(swapped, c, b), np.where(swapped, b, c)
    ab, ac = cuts(alone, b), cuts(alone, c)
    for label, face in ((of_a, (alone, ab, ac)), (of_b, (b, c, ac)), (of_b, (b, ac, ab))):
        made.append((np.stack([*face, tips[two]], axis=1), label))
    # A point inside is in the middle of those of its triangles.
    sums = np.zeros((len(cells), 3))
    np.add.at(sums, owner[triple], middles[middle - len(points)])
    centers = sums / np.bincount(owner[triple], minlength=len(cells))[:, None]
    kept = [(part[label > 0], label[label > 0]) for part, label in made]
    return kept, np.concatenate([middles, centers])


def pinched(cells: NDArray[np.integer], labels: Indices, n: int) -> Indices:
    """Return the vertices, of n, of edges at which more than two triangles of the surface of one label meet."""
    faces, labels_of_faces, beyond = label_faces(cells, labels)
    # The surface of all is one as well, as that of label 0.
    of = np.concatenate([labels_of_faces, beyond[beyond == 0]]).repeat(3)
    edges = edges_around(np.concatenate([faces, faces[beyond == 0]]))
    keys = edge_keys(edges, n) * (int(labels.max(initial=0)) + 1) + of
    _, which, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return np.unique(edges[counts[which] > 2])


def widened(points: Points, cells: Cells, spacing: float) -> Points:
    """Move vertices of tetrahedra with small dihedral angles so that these grow, by little."""
    points = points.copy()
    directions = np.stack(np.meshgrid(*[[-1.0, 0, 1]] * 3), axis=-1).reshape(-1, 3)
    for k in range(16):
        steps = directions * spacing * 0.05 / (1 + k % 2)
        narrow = _least_angles(points[cells]) < _NARROW
        if not narrow.any():
            break
        moving = np.unique(cells[narrow])
        near = cells[np.isin(cells, moving).any(axis=1)]
        order = np.argsort(near, axis=None, kind="stable")
        ends = np.searchsorted(near.ravel()[order], np.stack([moving, moving + 1], axis=1))
        for vertex, (first, last) in zip(moving.tolist(), ends.tolist(), strict=True):
            star = near[order[first:last] // 4]
            if _least_angles(points[star]).min() < _NARROW:
                corners = (star == vertex)[None, :, :, None]
                places = np.where(corners, points[vertex] + steps[:, None, None], points[star])
                points[vertex] += steps[_least_angles(places).min(axis=1).argmax()]
    return points


def moved(points: Points, cells: Cells, moves: Points) -> Points:
    """Move points (N, 3) as far as no dihedral angle gets small, or smaller than it is: by 1/16 at least, or not."""
    is_moving = (moves != 0).any(axis=1)
    cells = cells[is_moving[cells].any(axis=1)]
    allowed, part = np.minimum(_least_angles(points[cells]), _NARROW), np.ones((len(points), 1))
    while (bad := _least_angles((points + part * moves)[cells]) < allowed).any():
        near = cells[bad]
        part[near] = np.where(part[near] > 1 / 16, part[near] / 2, 0)
    return points + part * moves


def lattice(low: Points, high: Points, spacing: float) -> tuple[Points, Cells]:
    """Return the points of a body-centered cubic lattice over a box, and its tetrahedra.

    The Voronoi cells of this lattice are all alike and their generators are their centers of mass; no centroidal
    Voronoi tessellation of space is known to have less energy.
    """
    shape = np.ceil((high - low) / spacing).astype(np.int64) + 4
    grid = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    # Not in line with voxels, so that the number of points inside grows gradually with finer spacing.
    corners = low + (grid - 1 - np.array([0.118, 0.382, 0.236])) * spacing
    points = np.concatenate([corners, corners + spacing / 2])
    steps = np.array([shape[1] * shape[2], shape[2], 1])
    cells = []
    for axis in range(3):
        inner = ((grid < shape - 1).all(axis=1) & (grid[:, axis] > 0)).nonzero()[0]
        side, other = steps[[(axis + 1) % 3, (axis + 2) % 3]]
        ring = np.stack([inner, inner + side, inner + side + other, inner + other], axis=1)
        for k in range(4):
            middles = len(grid) + inner
            cells.append(np.stack([middles - steps[axis], middles, ring[:, k], ring[:, (k + 1) % 4]], axis=1))
    return points, np.concatenate(cells)


def _cut(
    cells: Cells, values: Floats, labels: Indices, cuts: Callable[[Indices, Indices], Indices]
) -> tuple[Cells, Indices]:
    """Keep of each tetrahedron what is inside, values (T, 4) < 0, as tetrahedra that fit those beside; with labels.

    Corners are sorted by values: where a quadrangle is divided, the diagonal starts from its deepest corner, so that it
    is the same on both sides and nearly always the shorter one.
    """
    cells = np.take_along_axis(cells, np.lexsort((cells, values), axis=1), axis=1)
    n_inside = (values < 0).sum(axis=1)
    single = cells[n_inside == 1]
    a = single[:, 0]
    made = [np.stack([a, *(cuts(a, single[:, k]) for k in (1, 2, 3))], axis=1)]
    two = cells[n_inside == 2]
    a, b = two[:, 0], two[:, 1]
    a1, a2, b1, b2 = cuts(a, two[:, 2]), cuts(a, two[:, 3]), cuts(b, two[:, 2]), cuts(b, two[:, 3])
    # The wedge a a1 a2, b b1 b2: all diagonals from a; where corners are on the surface, parts of it are flat.
    first = np.minimum(a1, b2) < np.minimum(a2, b1)
    caps = (a, a1, b1, np.where(first, b2, a2)), (a, np.where(first, a1, b1), b2, a2)
    made += [np.stack(parts, axis=1) for parts in ((a, b, b1, b2), *caps)]
    three = cells[n_inside == 3]
    a, b, c, p = three.T
    a1, b1, c1 = cuts(a, p), cuts(b, p), cuts(c, p)
    # The frustum a b c, a1 b1 c1: diagonals a b1, a c1 and b c1.
    made += [np.stack(parts, axis=1) for parts in ((a, b, c, c1), (a, b, b1, c1), (a, a1, b1, c1))]
    pieces = np.concatenate(made)
    labels = np.concatenate([labels[n_inside == 1], *[labels[n_inside == 2]] * 3, *[labels[n_inside == 3]] * 3])
    proper = (np.diff(np.sort(pieces, axis=1), axis=1) > 0).all(axis=1)
    return pieces[proper], labels[proper]


def volumes(points: Points, cells: NDArray[np.integer]) -> Floats:
    """Return the volumes (T,), > 0 if the corners 1, 2 and 3 turn counter-clockwise."""
    return _cosines(points[cells])[1] / 6


def normals(corners: Points) -> Points:
    """Return the normals (..., 3) of triangles (..., 3, 3), twice as long as their areas are large."""
    return np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])


def qualities(points: Points, cells: NDArray[np.integer]) -> Floats:
    """Return three times the radius of the ball in each tetrahedron (T,) by that of the one around it."""
    u, v, w = np.moveaxis(points[cells[:, 1:]] - points[cells[:, :1]], 1, 0)
    sides = np.cross(u, v), np.cross(v, w), np.cross(w, u)
    faces = sum(np.linalg.norm(side, axis=1) for side in (*sides, sum(sides)))
    squares = ((w * w).sum(axis=1), (u * u).sum(axis=1), (v * v).sum(axis=1))
    around = np.linalg.norm(sum(square[:, None] * side for square, side in zip(squares, sides, strict=True)), axis=1)
    # r = six / faces and R = around / (2 six).
    return np.asarray(6 * (sides[0] * w).sum(axis=1) ** 2 / np.maximum(faces * around, 1e-300))


def dihedral_angles(points: Points, cells: NDArray[np.integer]) -> Points:
    """Return the six dihedral angles (..., 6) of tetrahedra, in degrees."""
    return np.degrees(np.arccos(_cosines(points[cells])[0]))


def _least_angles(corners: Points) -> Floats:
    """Return the least dihedral angle of tetrahedra (..., 4, 3), in degrees, or 0 where they are turned over."""
    cosines, volumes = _cosines(corners)
    return np.where(volumes > 0, np.degrees(np.arccos(cosines.max(axis=-1))), 0)


def _cosines(corners: Points) -> tuple[Points, Floats]:
    """Return the cosines (..., 6) of dihedral angles, by the normals of the faces, and six times the volumes (...)."""
    u, v, w = (corners[..., k, :] - corners[..., 0, :] for k in (1, 2, 3))
    normals = [np.cross(v, w), np.cross(w, u), np.cross(u, v)]
    volumes = np.einsum("...i,...i", normals[2], w)
    normals.insert(0, -(normals[0] + normals[1] + normals[2]))
    lengths = [np.maximum(np.sqrt(np.einsum("...i,...i", normal, normal)), 1e-300) for normal in normals]
    pairs = _PAIRS[::-1].tolist()
    products = [np.einsum("...i,...i", normals[i], normals[j]) / (lengths[i] * lengths[j]) for i, j in pairs]
    cosines = -np.stack(products, axis=-1)
    return np.clip(cosines, -1, 1), volumes


def label_faces(tetrahedra: NDArray[np.integer], labels: NDArray[np.integer]) -> tuple[Array, Ints64, Ints64]:
    """Return the faces (S, 3) around each label, counter-clockwise seen from outside, that label, and the one beyond.

    Labels (T,) are above 0, which is beyond the faces that only one tetrahedron has. Faces between two come twice.
    """
    faces = tetrahedra[:, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]].reshape(-1, 3)
    a, b, c = np.sort(faces, axis=1).astype(np.int64).T
    n = int(c.max(initial=0)) + 1
    pairs = np.unique(a * n + b, return_inverse=True)[1]  # three numbers in one would be too large
    which = np.unique(pairs * n + c, return_inverse=True)[1]
    label = labels.astype(np.int64).repeat(4)
    beyond = np.bincount(which, label).astype(np.int64)[which] - label
    around = label != beyond
    return faces[around], label[around], beyond[around]

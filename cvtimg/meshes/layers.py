"""Boundary layers: rows of vertices parallel to the border, and the triangles between them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_count, check_positive, check_shape, check_that
from cvtimg._shared.extras import optional
from cvtimg.meshes.fields import PER_AREA, Field
from cvtimg.meshes.outlines import cross, divided
from cvtimg.meshes.result import Mesh
from cvtimg.meshes.triangulation import Borders

Points = NDArray[np.float64]
Values = NDArray[np.float64]

#: More rows are a mistake.
_MOST = 1000
#: Layers take up to this part of the way to the next border.
_SHARE = 0.3
#: Where rows converge, at corners or on curves, edges of the last one are no shorter than this part of those on the
#: border; while vertices are moved apart along it, than the second one.
_SHORTEST, _SHORT = 0.2, 0.45
#: Where the border turns outwards by more, in degrees, rows go around in a fan, with steps of these angles.
_FAN, _WIDEST, _NARROWEST = 100.0, 50.0, 12.0
#: The border has a corner where it turns by more, in degrees.
_CORNER = 15.0
#: The thickness changes by no more than this for each unit of length along the border.
_SLOPE = 0.5
#: Rounds of making layers thinner where their cells are not convex, and by which factor.
_ROUNDS, _THINNER = 60, 0.7


@dataclass(frozen=True, slots=True)
class Heights:
    """How many layers there are, the height of the first, and by how much the next ones are higher."""

    number: int
    first: float
    growth: float

    @classmethod
    def checked(cls, layers: Any) -> Heights:
        """Check what the user gave."""
        values = np.asarray(layers)
        check_shape("layers", values.shape, values.shape == (3,), "(3,): number, first height, growth")
        number = layers[0]
        check_that(f"layers has the number {number!r}, which", number == int(number), "be whole")
        check_count("the number of layers", int(number), _MOST, "what makes sense")
        return cls(
            int(number),
            check_positive("the first height of layers", layers[1]),
            check_positive("the growth of layers", layers[2]),
        )

    @property
    def sums(self) -> Values:
        """The heights of the rows (L + 1,) above the border, from 0."""
        return self.first * np.append(0, np.cumsum(self.growth ** np.arange(self.number)))

    def more(self, borders: Borders, field: Field) -> float:
        """About how many vertices a mesh has more than without layers."""
        a, b = borders.points[borders.edges].transpose(1, 0, 2)
        metric = field.metric((a + b) / 2)
        covered = self.sums[-1] * float((np.linalg.norm(b - a, axis=1) * np.sqrt(metric[:, 0] * metric[:, 2])).sum())
        return self.number * len(borders.edges) - PER_AREA * covered


@dataclass(frozen=True, slots=True, eq=False)
class Layers:
    """Columns of vertices, each over one on the border; over a tip there is a fan of them."""

    rows: Points  # (L + 1, C, 2): the first is the border
    base: NDArray[np.intp]  # (C,): the vertex on the border below each column
    after: NDArray[np.intp]  # (C,): the next column, with the region on the left
    part: Values  # (C,): by how much layers are thinner than wanted

    @classmethod
    def of(cls, borders: Borders, heights: Heights) -> Layers:
        """Grow layers on borders around a region.

        Raises
        ------
        ValueError
            If borders touch, or if there is no room for any layer.
        """
        edges = np.where(borders.sides[:, :1] > 0, borders.edges, borders.edges[:, ::-1])
        n = int(edges.max()) + 1
        for k in (0, 1):
            counts = np.bincount(edges[:, k], minlength=n)
            at = borders.points[np.flatnonzero(counts != 1)[:1]].ravel().tolist()
            check_that(f"borders at {at}", bool((counts == 1).all()), "not touch where there are layers")
        thickness = float(heights.sums[-1])
        ways, base, after = _directions(borders.points[:n], edges[np.argsort(edges[:, 0]), 1], thickness)
        ring = _Ring.of(borders.points[base], after)
        part = ring.room(ways, thickness)
        for _ in range(_ROUNDS):
            part = ring.gradual(part, thickness)
            bad = ring.folded(ring.points + (part * thickness)[:, None] * ways)
            if not bad.any():
                break
            part = np.where(bad, _THINNER * part, part)
        at = ring.points[bad][:1].ravel().tolist()
        check_that(f"layers at {at}", not bad.any(), "be fewer or thinner: there is no room for them")
        return cls(ring.points + (heights.sums[:, None] * part)[:, :, None] * ways, base, after, part)

    @property
    def thin(self) -> float:
        """The part of the border where layers are thinner than wanted."""
        lengths = np.linalg.norm(self.rows[0][self.after] - self.rows[0], axis=1)
        return float(lengths[self.part < 1 - 1e-9].sum() / lengths.sum())

    @property
    def number(self) -> int:
        """The number of vertices outside of the last row."""
        return int(self.base.max()) + 1 + (len(self.rows) - 2) * len(self.base)

    def inner(self, borders: Borders, field: Field, grade: float) -> tuple[Borders, Field]:
        """Return the borders of what is left inside: the last row, and points on no border; and a field that fits."""
        shapely = optional("shapely", "mesh")

        alone = borders.points[int(self.base.max()) + 1 :]
        edges = np.stack([np.arange(len(self.after)), self.after], axis=1).astype(np.int32)
        ends = self.rows[-1][edges]
        cells = np.concatenate([self.rows[0][edges], ends[:, ::-1]], axis=1)
        covered = shapely.STRtree(shapely.polygons(cells)).query(shapely.points(alone), predicate="intersects")[0]
        check_that(
            f"fixed has {alone[covered[:1]].ravel().tolist()} and", not len(covered), "be farther inside than layers"
        )
        sides = np.tile(np.array([borders.sides.max(), 0], np.int32), (len(edges), 1))
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        points = np.concatenate([self.rows[-1], alone])
        return Borders(points, edges, sides), field.lowered(ends.mean(axis=1), lengths, grade)

    def around(self, mesh: Mesh) -> Mesh:
        """Add the layers to the mesh of what is left inside, whose first vertices are the last row."""
        n_rows, n_columns, _ = self.rows.shape
        n = int(self.base.max()) + 1
        first = np.empty((n, 2))
        first[self.base] = self.rows[0]
        points = np.concatenate([first, *self.rows[1:-1], mesh.points])
        index = np.concatenate([self.base[None], n + np.arange((n_rows - 1) * n_columns).reshape(-1, n_columns)])
        a, b, c, d = index[:-1], index[:-1, self.after], index[1:, self.after], index[1:]
        shorter = np.linalg.norm(points[c] - points[a], axis=-1) < np.linalg.norm(points[d] - points[b], axis=-1)
        shorter |= a == b
        one, two = np.where(shorter, [a, b, c], [a, b, d]), np.where(shorter, [a, c, d], [b, c, d])
        cells = np.concatenate([one, two], axis=2).reshape(3, -1).T
        number = np.repeat(np.arange(1, n_rows, dtype=np.int32), 2 * n_columns)
        real = cells[:, 0] != cells[:, 1]  # at the tip of a fan, one of two triangles is none
        cells, number = cells[real], number[real]
        edges = np.stack([self.base, self.base[self.after]], axis=1)
        below = np.full(len(points), -1, np.int32)
        below[index] = self.base
        return replace(
            mesh,
            points=points,
            triangles=np.concatenate([cells, mesh.triangles + self.number]).astype(np.int32),
            tags=np.concatenate([np.full(len(cells), mesh.tags[0]), mesh.tags]),
            edges=edges[edges[:, 0] != edges[:, 1]].astype(np.int32),
            layers=np.concatenate([number, np.zeros(len(mesh.triangles), np.int32)]),
            below=below,
        )


def _directions(
    points: Points, after: NDArray[np.integer[Any]], thickness: float
) -> tuple[Points, NDArray[np.intp], NDArray[np.intp]]:
    """Find how columns (C, 2) go for a height of 1, the vertex below each, and the next column.

    Where the border turns inwards, neighbors make room; around tips there are several columns.
    """
    ring = _Ring.of(points, after.astype(np.intp))
    come, go = ring.ahead[ring.before], ring.ahead
    turn = np.arctan2(cross(come, go), (come * go).sum(axis=1))
    is_tip, is_corner = turn < -np.radians(_FAN), np.abs(turn) > np.radians(_CORNER)
    # At half the turn, and so far that both sides keep their distance.
    ways = _turned(_left(come), turn / 2) / np.maximum(np.cos(turn / 2), 1e-3)[:, None]
    shift = np.zeros(len(points))
    for neighbor, lengths, along in ((ring.before, ring.lengths[ring.before], go), (ring.after, ring.lengths, -come)):
        # Vertices beside a corner move along the border as it does, the less the farther they are.
        own = np.where(is_corner & ~is_tip, (ways * along).sum(axis=1), 0)
        for side in (1, -1):
            reach = np.maximum(side * own, 0)
            for _ in range(len(reach)):
                farther = np.maximum(reach, reach[neighbor] - (1 - _SHORT) / thickness * lengths)
                farther[is_corner] = reach[is_corner]
                if (farther == reach).all():
                    break
                reach = farther
            shift += side * np.where(is_corner, 0, reach) * (1 if along is go else -1)
    ways -= shift[:, None] * _left(_turned(_left(come), turn / 2))
    lengths = (ring.lengths + ring.lengths[ring.before]) / 2
    widest, narrowest = np.radians(_WIDEST), np.radians(_NARROWEST)
    wanted = np.clip(lengths / thickness, narrowest, widest)
    steps = np.where(is_tip, np.ceil(-turn / wanted), 0).astype(np.intp)
    base, number = divided(steps + 1)
    fan = _turned(_left(come)[base], turn[base] * number / np.maximum(steps[base], 1))
    ways = np.where(is_tip[base, None], fan, ways[base])
    starts = np.cumsum(steps + 1) - (steps + 1)
    next_one = np.where(number == steps[base], starts[after[base]], np.arange(len(base)) + 1)
    return ways, base, next_one


@dataclass(frozen=True, slots=True, eq=False)
class _Ring:
    """Vertices around a region, which is on their left; some may be at one place."""

    points: Points  # (B, 2)
    after: NDArray[np.intp]  # (B,): the next vertex of each
    before: NDArray[np.intp]  # (B,)
    lengths: Values  # (B,): of the way to the next one
    ahead: Points  # (B, 2): directions of these ways

    @classmethod
    def of(cls, points: Points, after: NDArray[np.intp]) -> _Ring:
        before = np.empty_like(after)
        before[after] = np.arange(len(after))
        steps = points[after] - points
        lengths = np.linalg.norm(steps, axis=1)
        return cls(points, after, before, lengths, steps / np.maximum(lengths, 1e-300)[:, None])

    def room(self, ways: Points, thickness: float) -> Values:
        """Find for which part (B,) of a thickness there is room until the next border."""
        shapely = optional("shapely", "mesh")

        edges = np.flatnonzero(self.lengths > 0)
        a, b = self.points[edges], self.points[self.after[edges]]
        ends = self.points + ways * (thickness / _SHARE)
        tree = shapely.STRtree(shapely.linestrings(np.stack([a, b], axis=1)))
        ray, edge = tree.query(shapely.linestrings(np.stack([self.points, ends], axis=1)), predicate="intersects")
        start = self.points[ray]
        apart = (a[edge] != start).any(axis=1) & (b[edge] != start).any(axis=1)
        ray, edge, start = ray[apart], edge[apart], start[apart]
        across = cross(ends[ray] - start, b[edge] - a[edge])
        at = cross(a[edge] - start, b[edge] - a[edge]) / np.where(across == 0, np.inf, across)
        part = np.ones(len(ways))
        np.minimum.at(part, ray, np.clip(at, 0, 1))
        return part

    def gradual(self, part: Values, thickness: float) -> Values:
        """Make parts (B,) of the thickness smaller, so that it changes gradually along the border."""
        steps = _SLOPE * self.lengths / thickness
        for _ in range(len(part)):
            lower = np.minimum(part, np.minimum(part[self.after] + steps, part[self.before] + steps[self.before]))
            if (lower == part).all():
                break
            part = lower
        return part

    def folded(self, last: Points) -> NDArray[np.bool_]:
        """Find vertices (B,) where cells up to the last row are not convex or too short, or that row meets another."""
        shapely = optional("shapely", "mesh")

        a, b, c, d = self.points, self.points[self.after], last[self.after], last
        real = self.lengths > 0
        bad = (cross(c - b, d - c) <= 0) | (cross(d - c, a - d) <= 0)
        bad |= real & ((cross(b - a, c - b) <= 0) | (cross(a - d, b - a) <= 0))
        bad |= ((c - d) * self.ahead).sum(axis=1) < _SHORTEST * self.lengths
        tree = shapely.STRtree(shapely.linestrings(np.stack([d, c], axis=1)))
        one, other = tree.query(shapely.linestrings(np.stack([d, c], axis=1)), predicate="intersects")
        apart = (one != other) & (self.after[one] != other) & (self.after[other] != one)
        bad[one[apart]] = True
        edge, other = tree.query(shapely.linestrings(np.stack([a, b], axis=1)[real]), predicate="intersects")
        bad[np.flatnonzero(real)[edge]] = bad[other] = True
        return bad | bad[self.before]


def _left(steps: Points) -> Points:
    return np.stack([-steps[:, 1], steps[:, 0]], axis=1)


def _turned(steps: Points, angles: Values) -> Points:
    """Turn steps (B, 2) to the left by angles (B,)."""
    return np.cos(angles)[:, None] * steps + np.sin(angles)[:, None] * _left(steps)

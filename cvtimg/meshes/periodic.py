"""Periodic sides: lines of an outline that are copies of others, and pairs of vertices on both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_that
from cvtimg._shared.extras import optional
from cvtimg.meshes.fields import Field
from cvtimg.meshes.outlines import Outline
from cvtimg.meshes.triangulation import Borders

Points = NDArray[np.float64]
Values = NDArray[np.float64]
Index = NDArray[np.intp]

#: Along which axes regions may be periodic.
PERIODS = ("x", "y", "xy")
#: Lines as near to each other, by the diameter of all, are copies.
_NEAR = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Vertices that are those on other sides, moved along an axis."""

    vertices: NDArray[np.int32]  # (Q, 2): each copy, and what it is a copy of
    axes: Index  # (Q,)
    shifts: Values  # (Q,)

    def align(self, points: Points) -> None:
        """Move copies to where they belong, in place."""
        for axis in (0, 1):
            one, other = self.vertices[self.axes == axis].T
            points[one, 1 - axis] = points[other, 1 - axis]
            points[one, axis] = points[other, axis] + self.shifts[self.axes == axis]


@dataclass(frozen=True, slots=True, eq=False)
class _Twin:
    """A line that is a copy of another."""

    copy: int
    line: int
    is_back: bool  # Whether the copy runs the other way
    axis: int
    shift: float  # Of the copy, along the axis


@dataclass(frozen=True, slots=True, eq=False)
class Twins:
    """Lines that are copies of others."""

    all: tuple[_Twin, ...]

    @classmethod
    def of(cls, outline: Outline, periodic: str) -> tuple[Outline, Twins]:
        """Find the twins among lines; return the outline with copies that are exact.

        Raises
        ------
        ValueError
            If sides are no copies; the message names a line that has none.
        """
        check_choice("periodic", periodic, PERIODS)
        near = _NEAR * outline.diameter
        nodes, lines = outline.nodes.copy(), [line.copy() for line in outline.lines]
        outer = np.flatnonzero((outline.sides.min(axis=1) <= 0) & ~outline.is_closed)
        found: list[_Twin] = []
        for axis in ["xy".index(name) for name in periodic]:
            twins = _twins_along(axis, lines, outer, near)
            _check_complete(axis, lines, outer, twins, outline.bounds, near)
            for twin in twins:
                exact = lines[twin.line][::-1].copy() if twin.is_back else lines[twin.line].copy()
                exact[:, axis] += twin.shift
                lines[twin.copy] = exact
                nodes[outline.ends[twin.copy]] = exact[[0, -1]]
            for line, ends in zip(lines, outline.ends, strict=True):
                line[[0, -1]] = nodes[ends]
            found += twins
        return replace(outline, lines=tuple(lines), nodes=nodes), cls(tuple(found))

    def lowered(self, borders: Borders, field: Field, grade: float) -> Field:
        """Return a field that follows the edges on both sides."""
        assert borders.of_line is not None
        ends = borders.points[borders.edges]
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        for twin in self.all:
            for line, sign in ((twin.copy, -1), (twin.line, 1)):
                own = borders.of_line == line
                middles = ends[own].mean(axis=1)
                middles[:, twin.axis] += sign * twin.shift
                field = field.lowered(middles, lengths[own], grade)
        return field

    def paired(self, borders: Borders) -> tuple[Borders, Pairs]:
        """Give both sides the vertices of the one that has more; they do not slide."""
        assert borders.of_line is not None
        points, n = borders.points, len(borders.points)
        chains = [borders.edges[borders.of_line == line] for line in range(int(borders.of_line.max()) + 1)]
        chains = [np.append(chain[:, 0], chain[-1:, 1]) for chain in chains]
        pairs, is_left = [], np.ones(n, bool)
        for twin in self.all:
            turn = slice(None, None, -1 if twin.is_back else 1)
            sides, sign = [twin.copy, twin.line], -1
            if len(chains[twin.copy]) < len(chains[twin.line]):
                sides, sign = [twin.line, twin.copy], 1
            one, other = sides
            new = np.arange(len(points), len(points) + len(chains[one]) - 2, dtype=np.int32)
            inner = points[chains[one][turn][1:-1]]
            inner[:, twin.axis] += sign * twin.shift
            is_left[chains[other][1:-1]] = False
            points, is_left = np.concatenate([points, inner]), np.append(is_left, np.ones(len(new), bool))
            chains[other] = np.concatenate([chains[other][:1], new, chains[other][-1:]])
            both = np.stack([chains[twin.copy][turn], chains[twin.line]], axis=1)
            pairs.append(np.column_stack([np.full(len(both), twin.axis), both, np.full(len(both), twin.shift)]))
        table = np.concatenate(pairs)
        table = table[np.unique(table[:, :3], axis=0, return_index=True)[1]]  # lines share their ends
        number = np.cumsum(is_left, dtype=np.int32) - 1
        edges = np.concatenate([np.stack([chain[:-1], chain[1:]], axis=1) for chain in chains])
        of_line = np.repeat(np.arange(len(chains)), [len(chain) - 1 for chain in chains])
        sides_of_line = np.zeros((len(chains), 2), np.int32)
        sides_of_line[borders.of_line] = borders.sides
        corners = np.append(borders.corners, np.zeros(len(points) - n, bool))
        vertices = number[table[:, 1:3].astype(np.intp)]
        tracks = borders.tracks
        if tracks is not None:
            slides = is_left[tracks.vertices] & ~np.isin(number[tracks.vertices], vertices)
            tracks = tracks.kept(slides, number)
        whole = Borders(points[is_left], number[edges], sides_of_line[of_line], corners[is_left], of_line, tracks)
        return whole, Pairs(vertices, table[:, 0].astype(np.intp), table[:, 3])


def _twins_along(axis: int, lines: list[Points], outer: Index, near: float) -> list[_Twin]:
    """Find copies of lines, as far away as any are."""
    shapely = optional("shapely", "mesh")

    ends = np.array([lines[k][[0, -1]] for k in outer]).reshape(-1, 2, 2)
    found: list[_Twin] = []
    for is_back in (True, False):
        steps = (ends[:, ::-1] if is_back else ends)[:, None] - ends[None]
        fits = (np.abs(steps[..., 1 - axis]) <= near).all(axis=2) & (np.abs(np.ptp(steps[..., axis], axis=2)) <= near)
        for one, other in np.argwhere(fits & (steps[..., 0, axis] > near)).tolist():
            shift = float(steps[one, other, 0, axis])
            found.append(_Twin(int(outer[one]), int(outer[other]), is_back, axis, shift))
    twins: list[_Twin] = []
    for twin in sorted(found, key=lambda each: -each.shift):
        if twins and twin.shift < twins[0].shift - near:
            break
        moved = lines[twin.line] + twin.shift * np.eye(2)[axis]
        if shapely.hausdorff_distance(shapely.LineString(moved), shapely.LineString(lines[twin.copy])) <= near:
            twins.append(replace(twin, shift=twins[0].shift if twins else twin.shift))
    return twins


def _check_complete(
    axis: int, lines: list[Points], outer: Index, twins: list[_Twin], bounds: Points, near: float
) -> None:
    """Refuse sides along the bounds without a copy."""
    name, words = "xy"[axis], (("left", "right"), ("top", "bottom"))[axis]
    known = {line for twin in twins for line in (twin.copy, twin.line)}
    for k in outer.tolist():
        on_bound = (np.abs(lines[k][:, axis, None] - bounds[:, axis]) <= near).all(axis=0).any()
        if on_bound and k not in known:
            ends = f"{lines[k][0].tolist()} to {lines[k][-1].tolist()}"
            check_that(f"periodic={name!r} but the border from {ends}", False, "have a copy on the other side")
    check_that(f"periodic={name!r}", bool(twins), f"be for borders on the {words[0]} and {words[1]} that are copies")

"""Periodic sides: lines of an outline that are copies of others, and pairs of vertices on both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_that
from cvtimg._shared.extras import optional

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
class Twins:
    """Lines that are copies of others."""

    lines: Index  # (P, 2): the numbers of each copy, and of the line that it is a copy of
    back: NDArray[np.bool_]  # (P,): copies that run the other way
    axes: Index  # (P,)
    shifts: Values  # (P,)

    @classmethod
    def of(
        cls, lines: tuple[Points, ...], sides: NDArray[np.integer[Any]], bounds: Points, periodic: str
    ) -> tuple[tuple[Points, ...], Twins]:
        """Find the twins among lines, with labels (M, 2) on both sides; return the lines with copies that are exact.

        Raises
        ------
        ValueError
            If sides are no copies; the message names a line that has none.
        """
        check_choice("periodic", periodic, PERIODS)
        near = _NEAR * float(np.hypot(*(bounds[1] - bounds[0])))
        is_open = np.array([(line[0] != line[-1]).any() for line in lines])
        outer = np.flatnonzero((sides.min(axis=1) <= 0) & is_open)
        exact = list(lines)
        found: list[tuple[int, int, bool, int, float]] = []
        for axis in ["xy".index(name) for name in periodic]:
            twins = _twins_along(axis, exact, outer, near)
            _check_complete(axis, exact, outer, twins, bounds, near)
            for one, other, back, shift in twins:
                copy = exact[other][::-1].copy() if back else exact[other].copy()
                copy[:, axis] += shift
                moved = {tuple(exact[one][at]): copy[at] for at in (0, -1)}
                exact[one] = copy
                exact = [_with_ends(line, moved) for line in exact]
                found.append((one, other, back, axis, shift))
        copies, lines_of, backs, axes, shifts = (np.array(column) for column in zip(*found, strict=True))
        return tuple(exact), cls(np.stack([copies, lines_of], axis=1), backs, axes, shifts)

    def same_numbers(self, n_edges: Index) -> Index:
        """Give lines as many edges as their copies have."""
        n_edges = n_edges.copy()
        for _ in (0, 1):  # along both axes
            n_edges[self.lines] = n_edges[self.lines].max(axis=1, keepdims=True)
        return n_edges

    def pairs(self, chain: NDArray[np.int32], of_chain: Index) -> Pairs:
        """Pair the vertices of all lines, one line after the other."""
        parts = []
        for (one, other), back in zip(self.lines, self.back, strict=True):
            copies = chain[of_chain == one]
            parts.append(np.stack([copies[::-1] if back else copies, chain[of_chain == other]], axis=1))
        counts = [len(part) for part in parts]
        both, axes, shifts = np.concatenate(parts), np.repeat(self.axes, counts), np.repeat(self.shifts, counts)
        first = np.unique(np.column_stack([axes, both]), axis=0, return_index=True)[1]  # lines share their ends
        return Pairs(both[first], axes[first], shifts[first])

    def both(self, of_edge: Index, middles: Points, sizes: Values) -> tuple[Points, Values]:
        """Return places (E, 2) on lines, and sizes there, with those where the copies are."""
        places, values = [middles], [sizes]
        for (one, other), axis, shift in zip(self.lines, self.axes, self.shifts, strict=True):
            for line, sign in ((one, -1), (other, 1)):
                moved = middles[of_edge == line].copy()
                moved[:, axis] += sign * shift
                places.append(moved)
                values.append(sizes[of_edge == line])
        return np.concatenate(places), np.concatenate(values)


def _twins_along(axis: int, lines: list[Points], outer: Index, near: float) -> list[tuple[int, int, bool, float]]:
    """Find copies of lines, the lines, whether they run back, and how far copies are: as far as any are."""
    shapely = optional("shapely", "mesh")

    ends = np.array([lines[k][[0, -1]] for k in outer]).reshape(-1, 2, 2)
    found: list[tuple[int, int, bool, float]] = []
    for back in (True, False):
        steps = (ends[:, ::-1] if back else ends)[:, None] - ends[None]
        fits = (np.abs(steps[..., 1 - axis]) <= near).all(axis=2) & (np.abs(np.ptp(steps[..., axis], axis=2)) <= near)
        for one, other in np.argwhere(fits & (steps[..., 0, axis] > near)).tolist():
            found.append((int(outer[one]), int(outer[other]), back, float(steps[one, other, 0, axis])))
    twins: list[tuple[int, int, bool, float]] = []
    for one, other, back, shift in sorted(found, key=lambda each: -each[3]):
        if twins and shift < twins[0][3] - near:
            break
        moved = lines[other] + shift * np.eye(2)[axis]
        if shapely.hausdorff_distance(shapely.LineString(moved), shapely.LineString(lines[one])) <= near:
            twins.append((one, other, back, twins[0][3] if twins else shift))
    return twins


def _check_complete(
    axis: int, lines: list[Points], outer: Index, twins: list[tuple[int, int, bool, float]], bounds: Points, near: float
) -> None:
    """Refuse sides along the bounds without a copy."""
    name, words = "xy"[axis], (("left", "right"), ("top", "bottom"))[axis]
    known = {line for pair in twins for line in pair[:2]}
    for k in outer.tolist():
        on_bound = (np.abs(lines[k][:, axis, None] - bounds[:, axis]) <= near).all(axis=0).any()
        if on_bound and k not in known:
            ends = f"{lines[k][0].tolist()} to {lines[k][-1].tolist()}"
            check_that(f"periodic={name!r} but the border from {ends}", False, "have a copy on the other side")
    check_that(f"periodic={name!r}", bool(twins), f"be for borders on the {words[0]} and {words[1]} that are copies")


def _with_ends(line: Points, moved: dict[tuple[float, ...], Points]) -> Points:
    """Return a line with ends where they were moved to."""
    places = [moved.get(tuple(line[at])) for at in (0, -1)]
    if all(place is None for place in places):
        return line
    line = line.copy()
    for at, place in zip((0, -1), places, strict=True):
        if place is not None:
            line[at] = place
    return line

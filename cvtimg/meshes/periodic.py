"""Periodic sides: lines that are copies get the same vertices before a mesh is made, and these are paired after that.

Sides become chords between vertices that stay. Where the mesher divides one, its copy is divided there, too.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cvtimg._shared.checks import check_choice, check_that
from cvtimg._shared.extras import shapely
from cvtimg._shared.types import Indices, Ints, Points
from cvtimg.meshes.outlines import ON_LINE, Outline, with_points
from cvtimg.meshes.planning import ROUNDS
from cvtimg.meshes.quadratic import QuadraticTriangles
from cvtimg.meshes.result import Mesh
from cvtimg.meshes.triangulation import Borders


@dataclass(frozen=True, slots=True, eq=False)
class _Twin:
    """A line that is a copy of another."""

    copy: int
    line: int
    is_back: bool  # Whether the copy runs the other way
    step: Points  # (2,), to the copy

    def copied(self, places: Points) -> Points:
        """Return places along the line on its copy, in the direction of that."""
        return (places[::-1] if self.is_back else places) + self.step


def periodic_mesh(
    outline: Outline, periodic: str, plan: Callable[[Outline], Borders], make: Callable[[Outline], Mesh]
) -> tuple[Mesh, Outline]:
    """Make a mesh whose vertices on sides that are copies are so, too; also return the outline, with exact copies.

    Raises
    ------
    ValueError
        If sides are no copies; the message names a line that has none.
    """
    check_choice("periodic", periodic, ("x", "y", "xy"))
    exact, twins = _outline_with_twins(outline, periodic)
    sides, chains = _with_chords(exact, twins, plan(exact))
    steps, near = np.unique([twin.step for twin in twins], axis=0), ON_LINE * outline.diameter
    for _ in range(ROUNDS):  # until no side is divided but its copy
        mesh = make(sides)
        pairs = _pairs(mesh.points, steps, near)
        alone = _alone(mesh, chains, pairs, near)
        if not len(alone):
            return replace(mesh, points=_aligned(mesh.points, pairs), pairs=pairs), exact
        sides, _ = with_points(sides, alone)
    raise ValueError(f"periodic={periodic!r} must be for sides that no other border comes so near to")


def with_paired_middles(six: QuadraticTriangles, mesh: Mesh) -> QuadraticTriangles:
    """Pair the vertices of a mesh, and the nodes on edges between them, too."""
    assert mesh.pairs is not None
    steps = np.unique(mesh.points[mesh.pairs[:, 0]] - mesh.points[mesh.pairs[:, 1]], axis=0)
    middles = mesh.points[mesh.edges].mean(axis=1)
    near = 10 * ON_LINE * float(np.linalg.norm(np.ptp(middles, axis=0)))
    pairs = np.concatenate([mesh.pairs, six.edges[_pairs(middles, steps, near), 2]])
    return replace(six, nodes=_aligned(six.nodes, pairs), pairs=pairs)


def _outline_with_twins(outline: Outline, periodic: str) -> tuple[Outline, list[_Twin]]:
    """Find the twins among lines; return the outline with copies that are exact."""
    near = ON_LINE * outline.diameter
    nodes, lines = outline.nodes.copy(), [line.copy() for line in outline.lines]
    outer = np.flatnonzero((outline.sides.min(axis=1) <= 0) & ~outline.is_closed)
    found: list[_Twin] = []
    for axis in ["xy".index(name) for name in periodic]:
        twins = _twins_along(axis, lines, outer, near)
        _check_complete(axis, lines, outer, twins, outline.bounds, near)
        for twin in twins:
            lines[twin.copy] = twin.copied(lines[twin.line])
            nodes[outline.ends[twin.copy]] = lines[twin.copy][[0, -1]]
        for line, ends in zip(lines, outline.ends, strict=True):
            line[[0, -1]] = nodes[ends]
        found += twins
    return replace(outline, lines=tuple(lines), nodes=nodes), found


def _twins_along(axis: int, lines: list[Points], outer: Indices, near: float) -> list[_Twin]:
    """Find copies of lines, as far away as any are."""
    ends = np.array([lines[k][[0, -1]] for k in outer]).reshape(-1, 2, 2)
    found: list[_Twin] = []
    for is_back in (True, False):
        steps = (ends[:, ::-1] if is_back else ends)[:, None] - ends[None]
        fits = (np.abs(steps[..., 1 - axis]) <= near).all(axis=2) & (np.abs(np.ptp(steps[..., axis], axis=2)) <= near)
        for one, other in np.argwhere(fits & (steps[..., 0, axis] > near)).tolist():
            step = steps[one, other, 0] * np.eye(2)[axis]
            found.append(_Twin(int(outer[one]), int(outer[other]), is_back, step))
    longest = max((twin.step for twin in found), key=np.sum, default=np.zeros(2))
    found = [replace(twin, step=longest) for twin in found if np.abs(twin.step - longest).max() <= near]
    strings = [shapely.LineString(line) for line in lines]
    return [
        twin
        for twin in found
        if shapely.hausdorff_distance(shapely.LineString(twin.copied(lines[twin.line])), strings[twin.copy]) <= near
    ]


def _check_complete(
    axis: int, lines: list[Points], outer: Indices, twins: list[_Twin], bounds: Points, near: float
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


def _with_chords(outline: Outline, twins: list[_Twin], borders: Borders) -> tuple[Outline, list[tuple[Points, Points]]]:
    """Divide twins by the vertices of the one that has more, into chords; also return these places on both."""
    lines, source, chains = list(outline.lines), np.arange(len(outline.lines)), []
    for twin in twins:
        copy, line = (borders.points[borders.chain(k)] for k in (twin.copy, twin.line))
        places = line if len(line) >= len(copy) else (copy[::-1] if twin.is_back else copy) - twin.step
        places[[0, -1]] = outline.lines[twin.line][[0, -1]]
        chains.append((twin.copied(places), places))
        for k, chain in zip((twin.copy, twin.line), chains[-1], strict=True):
            lines[k] = chain[:2]
            lines += [chain[j : j + 2] for j in range(1, len(chain) - 1)]
            source = np.append(source, np.full(len(chain) - 2, k))
    return outline.cut(lines, source, np.concatenate([chain for both in chains for chain in both])), chains


def _pairs(points: Points, steps: Points, near: float) -> Ints:
    """Find the points (P, 2) that are others moved by a step."""
    from scipy.spatial import cKDTree

    tree, found = cKDTree(points), []
    for step in steps[::-1]:
        gaps, others = tree.query(points - step)
        found.append(np.stack([np.arange(len(points)), others], axis=1)[gaps <= near])
    return np.concatenate(found).astype(np.int32)


def _alone(mesh: Mesh, chains: list[tuple[Points, Points]], pairs: Ints, near: float) -> Points:
    """Return the places of vertices on sides that are in no pair, and of the copies that they need."""
    found, places = [np.empty((0, 2))], shapely.points(mesh.points[mesh.boundary])
    for both in chains:
        for column, chain in enumerate(both):
            on_side = mesh.boundary[shapely.distance(shapely.LineString(chain), places) <= near]
            alone = mesh.points[np.setdiff1d(on_side, pairs[:, column])]
            step = both[1 - column].min(axis=0) - chain.min(axis=0)
            found += [alone, alone + step]
    return np.concatenate(found)


def _aligned(points: Points, pairs: Ints) -> Points:
    points, steps = points.copy(), points[pairs[:, 0]] - points[pairs[:, 1]]
    for axis in (0, 1):
        along = np.abs(steps[:, axis]) > np.abs(steps[:, 1 - axis])
        one, other = pairs[along].T
        points[one] = points[other] + steps[along][:1] * np.eye(2)[axis]
    return points

"""Polygons keep their areas: vertices move off curves by as much as makes up for what edges cut off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.meshes.outlines import Outline, StraightParts, cross
from cvtimg.meshes.triangulation import PlaneTriangulation

Points = NDArray[np.float64]
Values = NDArray[np.float64]

#: What an edge cuts off, by its squared length: less than the first of these is nothing, more than the second no curve.
_NOTHING, _MOST = 1e-9, 1.0
#: Rounds of Newton's method: each leaves about the square of what was missing.
_ROUNDS = 6


def keep_areas(outline: Outline, mesh: PlaneTriangulation) -> None:
    """Move vertices along their normals by the area that edges cut off on both sides, so that polygons lose none.

    Corners stay, and so do vertices on straight sides, unless one edge cuts off the turn from a side to the next.
    """
    chords = _chords(outline, mesh)
    edges, cut = chords.edges, chords.cut_off(mesh.points)
    is_cut = np.abs(cut) > _NOTHING * chords.squares(mesh.points)
    into, out = np.zeros((2, len(mesh.points)), np.intp)
    into[edges[:, 1]] = out[edges[:, 0]] = np.arange(len(edges))
    free = chords.may_move & is_cut[into] & is_cut[out]
    alone = edges[is_cut & ~free[edges].any(axis=1)]
    free[alone] = chords.may_move[alone]
    moved, n_free = np.flatnonzero(free), free[edges].sum(axis=1)
    before, after = edges[into[moved], 0], edges[out[moved], 1]
    steps = np.zeros_like(mesh.points)
    steps[moved] = chords.feet[moved] - mesh.points[moved]
    for _ in range(_ROUNDS if len(moved) else 0):
        mesh.move(steps, free)
        shares = np.where(n_free > 0, chords.cut_off(mesh.points) / np.maximum(n_free, 1), 0)
        along = mesh.points[after] - mesh.points[before]
        widths = 2 * (shares[into[moved]] + shares[out[moved]]) / (along**2).sum(axis=1)
        steps[moved] = widths[:, None] * np.stack([along[:, 1], -along[:, 0]], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class _Chords:
    """Edges on borders, and the lines beside them."""

    edges: NDArray[np.int32]  # (E, 2), in the direction of their lines
    beside: Values  # (E,): area that the line sweeps over around the middle, from one foot to the other; NaN if unknown
    feet: Points  # (N, 2): the points of lines nearest to vertices on borders
    middle: Points  # (2,)
    may_move: NDArray[np.bool_]  # (N,): vertices on borders, but for corners

    def squares(self, points: Points) -> Values:
        """Return the squared lengths (E,) of edges."""
        return ((points[self.edges[:, 1]] - points[self.edges[:, 0]]) ** 2).sum(axis=1)

    def cut_off(self, points: Points) -> Values:
        """Return the areas (E,) between edges and lines, from foot to foot; 0 where that is unknown."""
        a, b = self.edges.T
        places, to_feet = points - self.middle, cross(self.feet - self.middle, points - self.middle)
        cut = self.beside + (to_feet[b] - to_feet[a] - cross(places[a], places[b])) / 2
        return np.where(np.abs(cut) < _MOST * self.squares(points), cut, 0)


def _chords(outline: Outline, mesh: PlaneTriangulation) -> _Chords:
    """Find the lines that edges are on: those that their ends, if they are no corners, are nearest to."""
    parts, middle = StraightParts.of(outline.lines), outline.bounds.mean(axis=0)
    places, of_line = parts.places - middle, parts.of_line
    starts, stops = (np.searchsorted(of_line, np.arange(len(outline.lines)), side) for side in ("left", "right"))
    stops -= 1
    # What was swept over, around the middle, until each point.
    inner = np.diff(of_line) == 0
    until = np.append(0, np.cumsum(inner * cross(places[:-1], places[1:]) / 2))
    half_edges = mesh.half_edges_on_borders()
    edges = mesh.edges[half_edges]
    on_border = np.unique(edges)
    moving = on_border[~mesh.corners[on_border]]
    may_move = np.zeros(len(mesh.points), bool)
    may_move[moving] = True
    part, share = parts.nearest(mesh.points[moving])
    start, step = places[part], places[part + 1] - places[part]
    feet, (at, swept), line = mesh.points - middle, np.zeros((2, len(mesh.points))), np.zeros(len(mesh.points), np.intp)
    feet[moving], at[moving], line[moving] = start + share[:, None] * step, part + share, of_line[part]
    swept[moving] = until[part] + cross(start, feet[moving]) / 2
    # An edge goes in the direction of its line, and has the left side of that to the left.
    own = np.where(may_move[edges[:, 0]], line[edges[:, 0]], line[edges[:, 1]])
    back = mesh.tags[half_edges // 3] != outline.sides[own, 0]
    edges[back] = edges[back, ::-1]
    moves, ends = may_move[edges], np.stack([starts[own], stops[own]], axis=1)
    swept, at = np.where(moves, swept[edges], until[ends]), np.where(moves, at[edges], ends)
    around = (until[stops] - until[starts])[own]
    beside = swept[:, 1] - swept[:, 0] + np.where(at[:, 1] < at[:, 0], around, 0)
    known = moves.any(axis=1) & (~moves.all(axis=1) | (line[edges[:, 0]] == line[edges[:, 1]]))
    return _Chords(edges, np.where(known, beside, np.nan), feet + middle, middle, may_move)

"""Segments and polygons keep their areas: vertices on borders move by as much as makes up for what edges cut off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.budgets import GIVEN, ROUNDING
from cvtimg._shared.types import Floats, Indices, Ints, Points

#: Part of what other vertices move by which ends of lines do, corners and junctions: with more, these lose their shape.
_ENDS = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Areas:
    """The areas that polygons and their holes, or the connected pieces of segments, should have."""

    pieces: Indices  # (M, 2): numbers of the pieces on both sides of each line, as `Outline.sides`; 0 outside
    wanted: Floats  # (P,): their areas; the first is not used

    @classmethod
    def of(cls, lines: list[Points], pieces: Indices) -> Areas:
        """Measure what lines enclose."""
        number = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
        points = np.concatenate(lines)
        inner = number[1:] == number[:-1]
        edges = np.stack([np.flatnonzero(inner), np.flatnonzero(inner) + 1], axis=1)
        wanted = _enclosed(points, edges, pieces[number[:-1][inner]], int(pieces.max()) + 1)
        return cls(pieces, wanted)

    def of_parts(self, own: Indices) -> Areas:
        """Return the areas of lines that were cut: each part is of line `own`."""
        return replace(self, pieces=self.pieces[own])

    def kept(self, points: Points, edges: Ints, of_line: Indices, ends: Indices, still: Indices) -> Points:
        """Move vertices (N, 2) of edges (E, 2) on lines (E,) so that pieces have their areas, by the least squares.

        Ends of lines, which are corners or junctions, hardly move; those that are still stay.
        """
        from scipy.sparse import coo_array, eye_array
        from scipy.sparse.linalg import spsolve

        both, n_pieces, n = self.pieces[of_line], len(self.wanted), len(points)
        freedom = np.ones(n)
        freedom[ends] = _ENDS
        freedom[still] = 0
        rows = np.concatenate([both.T.ravel()] * 4)
        columns = np.concatenate([np.tile(2 * edges[:, end] + axis, 2) for end in (0, 1) for axis in (0, 1)])
        signs = np.tile(np.repeat([0.5, -0.5], len(edges)), 4)
        inside = rows > 0
        points = points.copy()
        for round_ in range(20):  # each corrects what the bends of the last one left
            missing = self.wanted - _enclosed(points, edges, both, n_pieces)
            if round_ and (np.abs(missing) <= GIVEN * self.wanted)[1:].all():
                break
            a, b = points[edges[:, 0]], points[edges[:, 1]]
            lengths = np.linalg.norm(b - a, axis=1)
            slopes = np.concatenate([np.tile(slope, 2) for slope in (b[:, 1], -b[:, 0], -a[:, 1], a[:, 0])]) * signs
            of_moves = coo_array((slopes[inside], (rows[inside] - 1, columns[inside])), shape=(n_pieces - 1, 2 * n))
            of_moves = of_moves.tocsr()
            # A move along the normal sweeps over half of both edges, and what an edge cuts off a curve grows with the
            # cube of its length: so vertices move as far as the square says.
            weights = np.repeat(freedom * np.bincount(edges.ravel(), np.repeat(lengths, 2), n), 2)
            weighted = of_moves.multiply(weights).tocsr()
            normal = (weighted @ of_moves.T).tocsc()
            if not normal.diagonal().any():  # no vertex may move
                break
            # Where all areas are kept if all but one are, the equations are regular with a little more on the diagonal.
            scale = ROUNDING * float(normal.diagonal().max())
            needed = np.atleast_1d(spsolve(normal + scale * eye_array(n_pieces - 1, format="csc"), missing[1:]))
            moves = (weighted.T @ needed).reshape(-1, 2)
            shortest = np.full(n, np.inf)
            for end in (0, 1):
                np.minimum.at(shortest, edges[:, end], lengths)
            # By more than a quarter of their shorter edge, edges may cross.
            far = np.linalg.norm(moves, axis=1)
            points += moves * np.minimum(1, shortest / 4 / np.maximum(far, 1e-300))[:, None]
        return points


def _enclosed(points: Points, edges: NDArray[np.integer], both: Indices, n_pieces: int) -> Floats:
    """Areas (P,) that edges enclose, with the pieces (E, 2) on both of their sides."""
    a, b = (points[ends] - points.mean(axis=0) for ends in edges.T)  # far from 0, products would lose digits
    swept = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    areas = np.bincount(both[:, 0], swept, n_pieces) - np.bincount(both[:, 1], swept, n_pieces)
    return areas.astype(np.float64, copy=False)

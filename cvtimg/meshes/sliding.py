"""How vertices slide along the lines of an outline."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

#: A vertex slides from its first place by no more than this part of the distance to the next vertex.
_FARTHEST = 0.6


def places_at(at: NDArray[np.float64], lengths: NDArray[np.float64], places: Points) -> Points:
    """Return the places (..., 2) at lengths along a line over (P, 2) places, with the lengths (P,) until there."""
    return np.stack([np.interp(at, lengths, places[:, axis]) for axis in (0, 1)], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Lines, and the vertices that slide along them."""

    vertices: NDArray[np.int32]  # (S,)
    along: NDArray[np.float64]  # (S,): where they are: the length along all lines, one after the other
    reach: Points  # (S, 2): the least and the greatest value that `along` may have
    # (P, 2): points of the lines, and the lengths until there.
    places: Points
    lengths: NDArray[np.float64]
    periods: NDArray[np.float64]  # (S,): lengths of closed lines, which go on at their start; 0 for vertices of others
    starts: NDArray[np.float64]  # (S,): where the line of each vertex starts

    @classmethod
    def of(
        cls,
        vertices: NDArray[np.int32],
        along: NDArray[np.float64],
        gaps: NDArray[np.float64],
        line: tuple[Points, NDArray[np.float64]],
        starts: NDArray[np.float64],
        periods: NDArray[np.float64],
    ) -> Tracks:
        """Let vertices slide by a part of the gaps (S,) to their neighbors."""
        reach = along[:, None] + _FARTHEST * gaps[:, None] * np.array([-1.0, 1.0])
        return cls(vertices, along, reach, *line, periods, starts)

    def tangents(self) -> Points:
        """Return the directions (S, 2) of the lines where the vertices are."""
        at = np.searchsorted(self.lengths, self._on_line(self.along), side="right")
        at = np.clip(at, 1, len(self.lengths) - 1)
        steps = self.places[at] - self.places[at - 1]
        return steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-300)

    def moved(self, by: NDArray[np.float64]) -> Tracks:
        """Return the tracks with vertices moved by lengths (S,), as far as they may."""
        return replace(self, along=np.clip(self.along + by, *self.reach.T))

    def kept(self, kept: NDArray[np.bool_], number: NDArray[np.int32] | None = None) -> Tracks:
        """Return the tracks of some of the vertices (S,), with new numbers (N,) of all vertices."""
        vertices = self.vertices[kept]
        return replace(
            self,
            vertices=vertices if number is None else number[vertices],
            along=self.along[kept],
            reach=self.reach[kept],
            periods=self.periods[kept],
            starts=self.starts[kept],
        )

    def points(self) -> Points:
        """Return where the vertices are, (S, 2)."""
        return places_at(self._on_line(self.along), self.lengths, self.places)

    def _on_line(self, along: NDArray[np.float64]) -> NDArray[np.float64]:
        """Go around closed lines."""
        periods = np.where(self.periods > 0, self.periods, np.inf)
        since = along - self.starts
        return along - np.floor(since / periods) * self.periods

"""The other way to put vertices on borders: generators whose cells reach a border are projected to it, in each round.

It is the recipe of M. Gunzburger's lecture on centroidal Voronoi tessellations. Nobody says how many vertices a border
gets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_in_range
from cvtimg.meshes.borders import sampled
from cvtimg.meshes.fields import Field
from cvtimg.meshes.outlines import Outline
from cvtimg.meshes.sliding import places_at
from cvtimg.meshes.triangulation import Borders

Points = NDArray[np.float64]

#: Samples of the region for each vertex, and rounds of Lloyd's method.
_SAMPLES, _ROUNDS = 60, 60


def project_to_borders(
    outline: Outline, field: Field, n: int, corners: Points, rng: np.random.Generator
) -> tuple[Borders, Points]:
    """Place n vertices, of which (C, 2) corners stay; return those on borders, and those inside."""
    track = _Track.of(outline, field)
    check_in_range("n", n, n > len(corners), f"more than {len(corners)}, the number of corners")
    samples = field.seeds(_SAMPLES * n, rng)
    samples = samples[outline.contains(samples)]
    weights = field.metric(samples)[:, 0]
    points = np.concatenate([corners, samples[rng.choice(len(samples), n - len(corners), replace=False)]])
    for _ in range(_ROUNDS):
        points = _centers(points, samples, weights)
        points[: len(corners)] = corners
        on_border, along = track.reached(points, len(corners))
        points[on_border] = track.places_at(along)
    inside = np.ones(n, bool)
    inside[: len(corners)] = inside[on_border] = False
    return track.borders(outline, along), points[inside]


def _centers(points: Points, samples: Points, weights: NDArray[np.float64]) -> Points:
    """Return the centers of mass of the cells; where no sample is nearest, the point itself."""
    from scipy.spatial import cKDTree

    own = cKDTree(points).query(samples)[1]
    masses = np.bincount(own, weights, len(points))
    sums = np.stack([np.bincount(own, weights * samples[:, axis], len(points)) for axis in (0, 1)], axis=1)
    return np.where(masses[:, None] > 0, sums / np.maximum(masses, 1e-300)[:, None], points)


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    """All lines of an outline as one, of points (P, 2), with the length until each and the line that it is of."""

    places: Points
    lengths: NDArray[np.float64]
    line_of: NDArray[np.intp]

    @classmethod
    def of(cls, outline: Outline, field: Field) -> _Track:
        places, line_of = sampled(outline.lines, field)
        steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        steps[np.diff(line_of) > 0] = 1  # so that lines are apart
        return cls(places, np.append(0, np.cumsum(steps)), line_of)

    def reached(self, points: Points, n_corners: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Find the points, but for corners, whose cells reach a border, and the nearest place of each on it."""
        from scipy.spatial import cKDTree

        on_border = np.unique(cKDTree(points).query(self.places)[1])
        on_border = on_border[on_border >= n_corners]
        near = cKDTree(self.places).query(points[on_border])[1]
        best, along = np.full(len(near), np.inf), self.lengths[near]
        for start in (near - 1, near):
            low = np.clip(start, 0, len(self.places) - 2)
            a, step = self.places[low], self.places[low + 1] - self.places[low]
            share = ((points[on_border] - a) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-300)
            share = np.clip(share, 0, 1)
            gaps = np.linalg.norm(a + share[:, None] * step - points[on_border], axis=1)
            better = (gaps < best) & (self.line_of[low] == self.line_of[low + 1])
            best[better] = gaps[better]
            along[better] = (self.lengths[low] + share * (self.lengths[low + 1] - self.lengths[low]))[better]
        return on_border, along

    def places_at(self, along: NDArray[np.float64]) -> Points:
        return places_at(along, self.lengths, self.places)

    def borders(self, outline: Outline, along: NDArray[np.float64]) -> Borders:
        """Join the vertices on each line in their order."""
        chains, sides = [], []
        for number, line in enumerate(outline.lines):
            own = np.flatnonzero(self.line_of == number)
            start, stop = self.lengths[own[0]], self.lengths[own[-1]]
            inner = np.unique(along[(along > start) & (along < stop)])
            if (line[0] == line[-1]).all():
                if len(inner) < 3:
                    inner = start + (np.arange(3) + 0.5) / 3 * (stop - start)
                chain = self.places_at(np.append(inner, inner[0]))
            else:
                chain = np.concatenate([line[:1], self.places_at(inner), line[-1:]])
            chains.append(chain)
            sides.append(np.repeat(outline.sides[number : number + 1], len(chain) - 1, axis=0))
        points, index = np.unique(np.concatenate(chains), axis=0, return_inverse=True)
        last = np.cumsum([len(chain) for chain in chains]) - 1
        joined = np.ones(len(index), bool)
        joined[last] = False
        starts = np.flatnonzero(joined)
        edges = np.stack([index.ravel()[starts], index.ravel()[starts + 1]], axis=1).astype(np.int32)
        return Borders(points, edges, np.concatenate(sides))

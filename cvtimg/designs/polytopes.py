"""Parts of the unit cube that linear constraints leave, such as mixtures, as samples that fill them evenly.

Samples are drawn by hit-and-run (R. Smith, Operations Research 32 (1984) 1296-1308, doi 10.1287/opre.32.6.1296): each
of many chains goes along a random line to a random place between its ends, which needs no luck however thin the part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_that

_Floats = NDArray[np.float64]

#: Chains; and rounds of as many steps as there are dimensions, after which chains forget where they began.
_CHAINS, _ROUNDS = 4096, 12
#: Rows whose limits are nearer to each other are equalities; parts that are thinner have no inside.
_EQUAL, _THIN = 1e-12, 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Polytope:
    """Points x of the unit cube with low <= rows @ x <= high."""

    rows: _Floats  # (k, d)
    low: _Floats  # (k,)
    high: _Floats  # (k,)

    @property
    def is_equal(self) -> NDArray[np.bool_]:
        """Which rows (k,) are equalities."""
        return self.high - self.low <= _EQUAL

    def contains(self, points: _Floats) -> NDArray[np.bool_]:
        """Tell which of (n, d) points keep to the rows, but for rounding."""
        values = points @ self.rows.T
        return np.asarray(((values >= self.low - _THIN) & (values <= self.high + _THIN)).all(axis=1))

    def samples(self, n: int, rng: np.random.Generator) -> _Floats:
        """Draw at least n points (m, d), evenly within the least plane that has them all."""
        from scipy.linalg import null_space

        is_equal = self.is_equal
        basis = null_space(np.vstack([self.rows[is_equal], np.zeros((1, self.rows.shape[1]))]))
        walls, ends = self._walls(~is_equal)
        start = self._center(is_equal, walls, ends, basis)
        walls, ends = walls @ basis, ends - walls @ start
        n_dims = basis.shape[1]
        places, drawn = np.zeros((_CHAINS, n_dims)), []
        shape: _Floats = np.eye(n_dims)
        for round_ in range(_ROUNDS + -(-n // _CHAINS)):
            for _ in range(n_dims):
                _step(places, shape, walls, ends, rng)
            if round_ < _ROUNDS:  # lines go more often along where the part is long
                spread = np.cov(places.T).reshape(n_dims, n_dims) + _THIN**2 * np.eye(n_dims)
                shape = np.asarray(np.linalg.cholesky(spread), np.float64)
            else:
                drawn.append(start + places @ basis.T)
        return np.clip(np.concatenate(drawn), 0, 1)

    def onto_planes(self, points: _Floats) -> _Floats:
        """Move (n, d) points, which are about there, to where all equalities hold."""
        rows = self.rows[self.is_equal]
        missed = points @ rows.T - self.low[self.is_equal]
        return np.asarray(points - missed @ np.linalg.pinv(rows).T)

    def _walls(self, is_wall: NDArray[np.bool_]) -> tuple[_Floats, _Floats]:
        """Return rows (q, d) and what their products (q,) are at most, with those of the cube."""
        rows, cube = self.rows[is_wall], np.eye(self.rows.shape[1])
        walls = np.concatenate([rows, -rows, cube, -cube])
        ends = np.concatenate([self.high[is_wall], -self.low[is_wall], np.ones(len(cube)), np.zeros(len(cube))])
        return walls[np.isfinite(ends)], ends[np.isfinite(ends)]

    def _center(self, is_equal: NDArray[np.bool_], walls: _Floats, ends: _Floats, basis: _Floats) -> _Floats:
        """Return the point (d,) that is farthest from all walls."""
        from scipy.optimize import linprog

        lengths = np.linalg.norm(walls @ basis, axis=1)[:, None]
        planes = np.column_stack([self.rows[is_equal], np.zeros(is_equal.sum())])
        farthest = np.append(np.zeros(walls.shape[1]), -1.0)
        found = linprog(farthest, np.hstack([walls, lengths]), ends, planes, self.low[is_equal], (None, None))
        has_inside = found.status == 0 and found.x[-1] > _THIN and basis.shape[1] > 0
        check_that("constraints", has_inside, "leave more than a point of the box")
        return np.asarray(found.x[:-1])


def _step(places: _Floats, shape: _Floats, walls: _Floats, ends: _Floats, rng: np.random.Generator) -> None:
    """Move each of (c, k) places along a line of its own to a random place within the walls."""
    along = rng.normal(size=places.shape) @ shape.T
    room, speed = ends - places @ walls.T, along @ walls.T
    with np.errstate(divide="ignore", invalid="ignore"):
        times = room / speed
    forth = np.where(speed > 0, times, np.inf).min(axis=1)
    back = np.where(speed < 0, times, -np.inf).max(axis=1)
    places += (back + (forth - back) * rng.random(len(places)))[:, None] * along

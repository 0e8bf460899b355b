"""What is known before any vertex moves: those on borders, and sizes with which there are as many as are wanted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from cvtimg._shared.budgets import MOST_IN_MEMORY
from cvtimg._shared.checks import check_count, check_in_range, check_positive, check_that, refuse
from cvtimg._shared.progress import first_few
from cvtimg._shared.types import Points
from cvtimg.meshes.anisotropy import MatrixFunction, MetricField
from cvtimg.meshes.borders import Crowding, place_on_borders
from cvtimg.meshes.fields import PER_AREA, Field, lengths_of
from cvtimg.meshes.outlines import Outline
from cvtimg.meshes.sizes import SizeLike, size_field
from cvtimg.meshes.triangulation import Borders, PlaneTriangulation

#: Where nothing is said of sizes, edges are no longer than the diagonal of the region by this number.
_PARTS = 70
#: A number of vertices is met when it is as near as this part of it.
NEAR = 0.01
#: Rounds of scaling sizes until that is so: with more, those that borders keep from it take longer.
ROUNDS = 8
#: Sizes vary where the logarithms of the metric do by more.
_VARIES = 0.4


#: Factor by which sizes are larger at most where borders need too many vertices: with more, all that may go have gone.
_COARSEST = 100.0
#: Part of the usual distance from vertices to edges of other lines that is left if need be, with smaller angles: if
#: borders need too many then, there are too few. With more, fewer are enough for none.
_CLOSEST = 0.5
#: Part of the edge length there that no vertex starts nearer to one on a border: with more, there is no room for all.
_GAP = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Wanted:
    """How many vertices, or how long edges."""

    n: int | None
    size: SizeLike
    grade: float
    least: float
    metric: MatrixFunction | None

    @classmethod
    def checked(
        cls,
        n: int | None,
        edge_length: float | None,
        size: SizeLike | None,
        grade: float,
        least: float,
        diameter: float,
        metric: MatrixFunction | None = None,
    ) -> Wanted:
        """Check what the user gave."""
        if n is not None:
            n = check_count("n", n, MOST_IN_MEMORY, "what memory holds")
        ways = {"n": n, "edge_length": edge_length, "size": size, "metric": metric}
        given = [name for name, value in ways.items() if value is not None]
        is_clear = given in ([], ["n"], ["edge_length"], ["size"], ["metric"], ["n", "size"], ["n", "metric"])
        check_that(" and ".join(given), is_clear, "be n, edge_length, size, metric, n and size, or n and metric")
        if edge_length is not None:
            check_positive("edge_length", edge_length)
        check_positive("grade", grade)
        otherwise = 1.0 if given else diameter / _PARTS
        wanted = next((each for each in (edge_length, size) if each is not None), otherwise)
        return cls(n, wanted, float(grade), least, metric)

    def field(self, outline: Outline, ends: Points) -> Field:
        """Make the field of sizes; at some points they may be lower than around."""
        if self.metric is not None:
            return MetricField.of(self.metric, outline, self.n, ends)
        field = size_field(outline, self.size, self.n, self.least, ends)
        count = field.count
        allowed = f"ask for at most {MOST_IN_MEMORY} vertices, which memory holds, not {count:.3g}"
        check_that("sizes", count <= MOST_IN_MEMORY, allowed)
        return field


@dataclass(frozen=True, slots=True)
class Plan:
    """Vertices on borders, and sizes around them."""

    borders: Borders
    field: Field

    @property
    def number(self) -> int:
        """About how many vertices a mesh has: two triangles for each inner vertex, by Euler's formula."""
        n_boundary = int((self.borders.sides.min(axis=1) <= 0).sum())
        return max(round(self.field.count + n_boundary / 2 + 1), self.n_on_borders)

    @property
    def n_on_borders(self) -> int:
        """How many vertices are there already."""
        return len(self.borders.points)

    def varies(self, inner: Points) -> bool:
        """Whether sizes differ from place to place, on borders and at points (N, 2) inside."""
        metric = self.field.metric(np.concatenate([self.borders.points, inner]))
        return self.field.isotropic and float(np.ptp(np.log(metric[:, 0]))) > _VARIES


def plan_mesh(outline: Outline, wanted: Wanted, alone: Points) -> Plan:
    """Place vertices on borders, and (A, 2) alone, with sizes that come to the wanted number.

    Where borders need too many, first curves get one edge where they had two, then sizes grow faster, and are larger.
    """
    ends = np.concatenate([alone, outline.nodes[outline.ends.T.ravel()]])
    _check_fits(outline, wanted, len(outline.nodes) + len(alone))
    start = wanted.field(outline, ends)
    place, how = partial(_placed, outline, alone), Crowding(wanted.grade, wanted.least)
    if wanted.n is None:
        return place(start, how)
    factor, before = 1.0, np.inf
    coarser = Crowding(max(how.grade, 1.0), how.least, 1, wanted.n)
    for _ in first_few(range(ROUNDS), 0.5):
        most = wanted.n if how.on_curves == 2 else 2 * wanted.n
        plan = place(start.scaled(factor), replace(how, most=most))
        if plan.n_on_borders > wanted.n and how.on_curves == 2:  # areas are given up before angles
            how = replace(how, on_curves=1)
            coarsest = place(start.scaled(_COARSEST), replace(coarser, most=np.inf, nearness=_CLOSEST))
            _check_fits(outline, wanted, coarsest.n_on_borders)
            for nearness in ((1 + _CLOSEST) / 2, 1.0):  # edges that crowd by less do so by more, too
                plan = place(coarsest.field, replace(coarser, nearness=nearness))
                if plan.n_on_borders > wanted.n:
                    return coarsest
                coarsest = plan
            continue
        ratio = plan.number / wanted.n
        if abs(ratio - 1) < NEAR and plan.n_on_borders <= wanted.n:
            return plan
        if ratio > max(before, 1) ** 0.5:  # short edges on borders need the excess: sizes grow faster
            how = replace(how, grade=min(1.5 * how.grade, max(how.grade, 1.0)))
        factor, before = factor * ratio**0.5, ratio
    if plan.n_on_borders <= wanted.n:
        return plan
    low, high = np.log([factor, _COARSEST * factor])
    best = coarsest
    for _ in range(5):
        middle = (low + high) / 2
        plan = place(start.scaled(np.exp(middle)), coarser)
        is_fit = plan.n_on_borders <= wanted.n
        best, low, high = (plan, low, middle) if is_fit else (best, middle, high)
    return best


def _placed(outline: Outline, alone: Points, field: Field, how: Crowding) -> Plan:
    borders, field = place_on_borders(outline, field.limited(how.grade, how.least), how)
    if len(alone):
        from scipy.spatial import cKDTree

        # Sizes around fixed points that are on no border are no larger than their distances.
        points = np.concatenate([borders.points, alone])
        gaps = cKDTree(points).query(alone, 2)[0][:, 1]
        corners = np.append(borders.corners, np.ones(len(alone), bool))
        borders, field = replace(borders, points=points, corners=corners), field.lowered(alone, gaps, how.grade)
    return Plan(borders, field)


def _check_fits(outline: Outline, wanted: Wanted, n_least: int) -> None:
    """Refuse fewer vertices than there must be, and say by how large details there would be less."""
    if wanted.n is None or n_least <= wanted.n:
        return
    size = outline.detail_for(wanted.n // 5)  # points of borders, which leave vertices for what is inside
    details = f"; or give min_size={size:.1g}, or simplify={size / 2:.1g}, to leave out details of the border"
    hint = details if size > wanted.least else ""
    refuse("n", wanted.n, f"at least {n_least}, the vertices that the border needs{hint}")


def place_inside(borders: Borders, field: Field, n: int, rng: np.random.Generator) -> Points:
    """Draw (n, 2) points inside of borders, in order along a curve."""
    from scipy.spatial import cKDTree

    if n <= 0:
        return np.empty((0, 2))
    frame = PlaneTriangulation.constrained(borders, np.empty((0, 2)))
    used = np.unique(frame.triangles).astype(np.int32)
    tree = cKDTree(frame.points[used])
    part = _GAP
    wanted = n + np.pi / 2 * part**2 * PER_AREA * len(used)  # half of a disk around each on a border stays free
    for _ in range(16):
        points = field.seeds(round(wanted), rng)
        near = tree.query(points)[1]
        far = lengths_of(field.metric(points), points - frame.points[used[near]]) > part
        points, near = points[far], near[far]
        _, shares = frame.locate(points, used[near])
        points = points[shares.min(axis=1) > 1e-9]
        if len(points) >= n:
            return points[((np.arange(n) + 0.5) * len(points) / n).astype(np.intp)]
        if wanted > 4 * n:
            part *= 0.8  # there is no room
        wanted = min(wanted * n / max(len(points), 1), 8.0 * n) + 1
    check_in_range("n", n, False, f"less by {n - len(points)}: the border leaves no room")
    return points

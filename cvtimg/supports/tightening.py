"""Covers with smaller disks: of which fewer meet.

Disks shrink to what no others can spare, and take over places from each other where that lets fewer of them meet.
What is not covered is looked for at the corners of the arrangement, as in the proof, so that a cover stays one. No disk
becomes smaller than its own Voronoi cell: else some would vanish, and others grow instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.supports import _covering
from cvtimg.supports.rows import as_rows, overlaps
from cvtimg.supports.sight import Outline

_Floats = NDArray[np.float64]

#: Disks may grow to this times their first radius.
_GROWTH = 1.5
#: Parts of what they can spare that disks give up in turn, so that the first do not take all.
_PARTS = (0.3, 0.3, 0.5, 0.5, 1.0, 1.0, 1.0)
#: Share of its radius by which a disk holds more than it must.
_BEYOND = 1e-7
#: Rounds of exchanges at most, and the steps of all together, which grow as the cube of how many disks meet one.
_ROUNDS, _STEPS = 6, 4e8
_TRIALS, _HELPERS = 3, 12
#: Most disks that change in one exchange.
_MOST_CHANGED = 512
#: Share of the size of the region by which places beside a barrier are beside it.
_ASIDE = 1e-10


def tighten(points: _Floats, radii: _Floats, floors: _Floats, outline: Outline, order: int) -> _Floats:
    """Find smaller radii, not below floors, that cover a region `order` times, as `radii` do."""
    n_points = len(points)
    limits = _GROWTH * radii
    meets = overlaps(points, limits)
    own, other = meets.spread(np.arange(n_points))
    own, other = own[own != other], other[own != other]
    pairs = as_rows(own, other, n_points)
    gaps = np.linalg.norm(points[own] - points[other], axis=1)
    near = outline.around(points, limits)
    # Edges of shadows are not looked at: what may meet one stays as it is.
    frozen = _meet_shadows(points, limits, outline)
    frozen[own[frozen[other]]] = True
    limits[frozen] = 0
    free = np.flatnonzero(~frozen).astype(np.int32)
    radii = radii.copy()
    cover = (points, pairs.starts, pairs.items, gaps, outline.barriers, outline.n_boundary, *near, limits, order)
    state = (outline.blocking, outline.tolerance, _ASIDE * outline.size, np.empty(n_points, np.int32), radii)

    def shrink(part: float) -> None:
        turns = free[np.argsort(-radii[free])]
        _covering.shrink(turns, part, _BEYOND, floors, *cover, *state)

    for part in _PARTS:
        shrink(part)
    scratch = np.empty(_MOST_CHANGED, np.int32), np.empty(_MOST_CHANGED)
    n_meet = len(overlaps(points, radii).items) / n_points
    n_rounds = int(min(_ROUNDS, _STEPS // (n_points * n_meet**4) + 1))
    random = np.random.default_rng(0)
    for _ in range(n_rounds):
        turns, scale = random.permutation(free), float(radii.mean())
        if not _covering.exchange(turns, _TRIALS, _HELPERS, scale, _BEYOND, floors, *cover, *state, *scratch):
            break
    shrink(1.0)
    return radii


def _meet_shadows(points: _Floats, radii: _Floats, outline: Outline) -> NDArray[np.bool_]:
    """Tell which disks hold an end of a barrier that casts a shadow."""
    found = np.zeros(len(points), bool)
    for tip in outline.tips:
        found |= np.linalg.norm(points - tip, axis=1) <= radii
    return found

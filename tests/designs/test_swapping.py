"""Swaps against SciPy's discrepancies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.stats.qmc import discrepancy

from cvtimg.designs import _designs
from cvtimg.designs.latin import even_out, latinize


@pytest.mark.parametrize(("periodic", "kind"), [(False, "CD"), (True, "WD")])
@pytest.mark.parametrize("n_dims", [1, 2, 4])
def test_a_swap_is_made_exactly_if_it_lowers_the_discrepancy(n_dims: int, periodic: bool, kind: str) -> None:
    rng = np.random.default_rng(n_dims)
    points = latinize(rng.random((11, n_dims)))
    tries = np.stack([rng.integers(n_dims, size=60), rng.integers(10, size=60)], axis=1).astype(np.int32)
    expected, n_designs, least = points.copy(), 0, 0.12**2
    for axis, rank in tries:
        pair = np.argsort(expected[:, axis])[rank : rank + 2]
        swapped = expected.copy()
        swapped[pair, axis] = expected[pair[::-1], axis]
        apart = swapped[pair][:, None] - np.delete(swapped, pair, axis=0)
        apart = np.abs(apart - np.rint(apart)) if periodic else apart
        lower = discrepancy(swapped, method=kind) < discrepancy(expected, method=kind) - 1e-13
        if lower and (apart**2).sum(axis=2).min() >= least:
            expected, n_designs = swapped, n_designs + 1
    places, order = points - 0.5, np.ascontiguousarray(np.argsort(points, axis=0).T, np.int32)
    assert _designs.swap_coordinates(places, order, tries, least, periodic) == n_designs
    np.testing.assert_allclose(places + 0.5, expected, atol=1e-12)
    assert (order == np.argsort(expected, axis=0).T).all()
    assert (n_designs > 0) == (n_dims > 1)


def test_evened_points_stay_latin_and_apart() -> None:
    rng = np.random.default_rng(0)
    points, existing = latinize(rng.random((60, 3))), rng.random((5, 3))
    moved = even_out(points, existing, False, 10_000_000, rng)
    np.testing.assert_allclose(np.sort(moved, axis=0), np.sort(points, axis=0))
    before, after = (discrepancy(np.concatenate([some, existing])) for some in (points, moved))
    assert after < 0.9 * before
    assert pdist(moved).min() >= min(pdist(points)) - 1e-12
    assert (even_out(points[:1], existing, False, 10_000_000, rng) == points[:1]).all()

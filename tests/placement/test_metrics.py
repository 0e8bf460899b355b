"""Gauges."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from cvtimg.placement import Gauge, as_gauge

HEXAGON = [[np.cos(a), np.sin(a)] for a in np.arange(6) * np.pi / 3]
ODD = [[2, 0], [0, 1], [-1, 0], [0, -3]]
EVERY = pytest.mark.parametrize(
    "gauge", [as_gauge(m) for m in (1, 2, 3.5, 20, np.inf, "triangle", HEXAGON, ODD)], ids=str
)
STEPS = np.random.default_rng(0).standard_normal((200, 2))


@EVERY
def test_slopes_are_those_of_lengths_which_scale_keep_the_triangle_inequality_and_their_bound(gauge: Gauge) -> None:
    for step, slope in zip(STEPS[:40], gauge.slopes(STEPS[:40]), strict=True):
        numeric = approx_fprime(step, lambda y: gauge.lengths(y[None])[0], 1e-7)
        np.testing.assert_allclose(slope, numeric, atol=1e-5)
    np.testing.assert_allclose(gauge.lengths(3 * STEPS), 3 * gauge.lengths(STEPS))
    both = gauge.lengths(STEPS + STEPS[::-1])
    assert (both <= gauge.lengths(STEPS) + gauge.lengths(STEPS[::-1]) + 1e-12).all()
    ratio = gauge.lengths(STEPS) / np.linalg.norm(STEPS, axis=1)
    assert (gauge.least(2) * (1 - 1e-12) <= ratio).all()


def test_corners_of_a_polygon_are_at_distance_1() -> None:
    np.testing.assert_allclose(as_gauge(ODD).lengths(np.array(ODD, float)), 1)
    np.testing.assert_allclose(as_gauge(ODD[::-1]).lengths(np.array(ODD, float)), 1)


def test_p_norms_are_those_of_numpy() -> None:
    for p in (1, 2, 3.5, 20, np.inf):
        np.testing.assert_allclose(as_gauge(p).lengths(STEPS), np.linalg.norm(STEPS, p, axis=1))

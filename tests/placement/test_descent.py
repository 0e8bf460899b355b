"""Descents over the moments of cells."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg.engine.methods import Stopping
from cvtimg.placement import DESCENTS, PixelMoments, Terms

LONG = Stopping(tolerance=0, max_iterations=200)


@pytest.fixture(scope="module")
def moments() -> PixelMoments:
    y, x = np.mgrid[:60, :80]
    return PixelMoments(np.exp(-((x - 30) ** 2 + (y - 20) ** 2) / 600) + 0.02)


def start(n: int) -> NDArray[Any]:
    return np.random.default_rng(0).random((n, 2)) * [80, 60]


@pytest.mark.parametrize("method", DESCENTS)
def test_energy_never_rises(method: str, moments: PixelMoments) -> None:
    energies = DESCENTS[method](moments, start(80), Terms(Stopping(0, 60))).energies
    assert len(energies) > 20
    assert (np.diff(energies) < 0).all()


@pytest.mark.parametrize("method", DESCENTS)
def test_generators_end_at_the_centers_of_mass_of_their_cells(method: str, moments: PixelMoments) -> None:
    end = DESCENTS[method](moments, start(12), Terms(Stopping(0, 1000)))
    assert end.converged
    np.testing.assert_allclose(end.generators, end.moments.centroids, atol=1e-3)


def test_l_bfgs_ends_lower_than_lloyd_after_as_many_moves(moments: PixelMoments) -> None:
    ends = {name: DESCENTS[name](moments, start(200), Terms(Stopping(0, 40))).energies[-1] for name in DESCENTS}
    assert ends["l-bfgs"] < ends["over-relaxed"] < ends["lloyd"]


@pytest.mark.parametrize("method", DESCENTS)
def test_fixed_generators_stay_and_the_others_do_not_mind(method: str, moments: PixelMoments) -> None:
    free = np.arange(40) >= 7
    end = DESCENTS[method](moments, start(40), Terms(LONG, free=free))
    assert (end.generators[:7] == start(40)[:7]).all()
    np.testing.assert_allclose(end.generators[7:], end.moments.centroids[7:], atol=0.05)


@pytest.mark.parametrize("method", DESCENTS)
def test_a_projection_holds_after_every_move(method: str, moments: PixelMoments) -> None:
    def onto_a_line(there: NDArray[Any], before: NDArray[Any]) -> NDArray[Any]:
        return np.where(np.arange(len(there))[:, None] < 10, there * [1, 0] + [0, 30], there)

    first = onto_a_line(start(40), start(40))
    end = DESCENTS[method](moments, first, Terms(Stopping(0, 50), project=onto_a_line))
    assert (end.generators[:10, 1] == 30).all()
    assert end.energies[-1] < end.energies[0]

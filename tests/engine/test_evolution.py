from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import reference
from numpy.typing import NDArray

from cvtimg import tessellate

#: E. Ruspini, Information and Control 15 (1969) 22-32, doi 10.1016/S0019-9958(69)90591-9.
RUSPINI = [
    4, 53, 5, 63, 10, 59, 9, 77, 13, 49, 13, 69, 12, 88, 15, 75, 18, 61, 19, 65, 22, 74, 27, 72, 28, 76, 24, 58, 27,
    55, 28, 60, 30, 52, 31, 60, 32, 61, 36, 72, 28, 147, 32, 149, 35, 153, 33, 154, 38, 151, 41, 150, 38, 145, 38,
    143, 32, 143, 34, 141, 44, 156, 44, 149, 44, 143, 46, 142, 47, 149, 49, 152, 50, 142, 53, 144, 52, 152, 55, 155,
    54, 124, 60, 136, 63, 139, 86, 132, 85, 115, 85, 96, 78, 94, 74, 96, 97, 122, 98, 116, 98, 124, 99, 119, 99, 128,
    101, 115, 108, 111, 110, 111, 108, 116, 111, 126, 115, 117, 117, 115, 70, 4, 77, 12, 83, 21, 61, 15, 69, 15, 78,
    16, 66, 18, 58, 13, 64, 20, 69, 21, 66, 23, 61, 25, 76, 27, 72, 31, 64, 30,
]  # fmt: skip
#: 202 places of Europe, by M. Grötschel and O. Holland: gr202 of G. Reinelt, ORSA J. Computing 3 (1991) 376-384, doi
#: 10.1287/ijoc.3.4.376.
PLACES = [
    37.44, -25.4, 38.43, -9.08, 41.11, -8.36, 37.23, -5.59, 36.32, -6.18, 36.43, -4.25, 37.13, -3.41, 37.53,
    -4.46, 38.21, -0.29, 39.28, -0.22, 41.23, 2.11, 41.38, -0.53, 40.24, -3.41, 41.39, -4.43, 43.15, -2.58,
    43.22, -8.23, 38.54, 1.26, 39.34, 2.39, 42.3, 1.31, 44.5, -0.34, 43.36, 1.26, 43.18, 5.24, 43.42, 7.15,
    43.42, 7.23, 42.42, 9.27, 45.5, 1.16, 45.26, 4.24, 45.45, 4.51, 45.1, 5.43, 48.24, -4.29, 48.05, -1.41,
    47.13, -1.33, 47.23, 0.41, 49.3, 0.08, 48.52, 2.2, 49.15, 4.02, 47.19, 5.01, 48.41, 6.12, 48.35, 7.45,
    49.36, 6.09, 50.38, 5.34, 50.5, 4.2, 50.38, 3.04, 51.03, 3.43, 51.13, 4.25, 51.26, 5.28, 51.55, 4.28, 52.22,
    4.54, 52.05, 5.08, 53.13, 6.33, 50.23, -4.1, 50.43, -1.54, 50.5, -0.08, 51.29, -3.13, 51.27, -2.35, 51.3,
    -0.1, 52.3, -1.5, 53.25, -2.55, 53.3, -2.15, 53.23, -1.3, 53.5, -1.35, 54.59, -1.35, 55.57, -3.13, 55.53,
    -4.15, 56.28, -3, 57.1, -2.04, 60.09, -1.09, 62.01, -6.46, 51.54, -8.28, 52.4, -8.38, 53.2, -6.15, 54.35,
    -5.55, 55, -7.19, 64.09, -21.51, 64.11, -51.44, 76.34, -68.47, 70.4, 23.42, 68.26, 17.25, 65.01, 25.28,
    61.3, 23.45, 60.27, 22.17, 60.1, 24.58, 63.25, 10.25, 60.23, 5.2, 58.58, 5.45, 59.55, 10.45, 57.43, 11.58,
    55.36, 13, 58.25, 15.37, 59.2, 18.03, 57.38, 18.18, 56.09, 10.13, 55.24, 10.23, 55.4, 12.35, 53.04, 8.49,
    53.33, 9.59, 54.2, 10.08, 54.05, 12.07, 51.57, 7.37, 52.24, 9.44, 52.07, 11.38, 52.31, 13.24, 50.47, 6.05,
    50.44, 7.05, 50.56, 6.59, 51.12, 6.47, 51.17, 7.17, 51.28, 7.01, 51.28, 7.13, 51.32, 7.13, 51.31, 7.28,
    51.19, 9.29, 50.58, 11.01, 51.29, 11.58, 51.19, 12.2, 50.5, 12.55, 51.03, 13.44, 49.14, 6.59, 50.07, 8.4,
    49.25, 8.43, 49.48, 9.56, 49.27, 11.04, 49.03, 8.24, 48.46, 9.11, 49.01, 12.06, 48.08, 11.34, 46.12, 6.09,
    46.31, 6.38, 46.57, 7.26, 47.33, 7.35, 47.23, 8.32, 47.16, 11.24, 47.48, 13.02, 48.18, 14.18, 48.13, 16.2,
    47.05, 15.27, 45.03, 7.4, 45.28, 9.12, 45.27, 11, 45.27, 12.21, 45.4, 13.46, 44.25, 8.57, 44.29, 11.2,
    43.46, 11.15, 43.55, 12.28, 39.2, 9, 41.54, 12.29, 40.51, 14.17, 41.27, 15.34, 41.07, 16.52, 40.28, 17.15,
    38.11, 15.33, 37.3, 15.06, 38.07, 13.21, 35.54, 14.31, 53.24, 14.32, 54.23, 18.4, 53.08, 18, 52.25, 16.55,
    51.46, 19.3, 52.15, 21, 53.09, 23.09, 51.06, 17, 50.16, 19, 50.03, 19.58, 51.15, 22.35, 49.45, 13.23, 50.05,
    14.26, 49.5, 18.17, 49.12, 16.37, 48.09, 17.07, 48.43, 21.15, 47.3, 19.05, 47.32, 21.38, 46.05, 18.13,
    46.15, 20.09, 45.45, 21.13, 46.47, 23.36, 47.1, 27.35, 45.48, 24.09, 45.39, 25.37, 44.26, 26.06, 44.11,
    28.39, 46.03, 14.31, 45.2, 14.27, 45.48, 15.58, 43.31, 16.27, 43.52, 18.25, 44.5, 20.3, 42.38, 18.07, 41.59,
    21.26, 41.2, 19.5, 42.41, 23.19, 42.09, 24.45, 43.13, 27.55, 42.3, 27.28, 39.36, 19.56, 40.38, 22.56, 38.15,
    21.44, 37.58, 23.43, 35.2, 25.09, 35.1, 33.22,
]  # fmt: skip
#: Least energies by numbers of generators, proven by O. du Merle, P. Hansen, B. Jaumard, N. Mladenović, SIAM J.
#: Scientific Computing 21 (2000) 1485-1505, doi 10.1137/S1064827597328327; of the places by D. Aloise, P. Hansen,
#: L. Liberti, Mathematical Programming 134 (2012) 539-565, doi 10.1007/s10107-011-0437-7.
OPTIMA = {
    ("ruspini", 2): (89337.83, 51063.48, 12881.05, 10126.72, 8575.41, 7126.20, 6149.64, 5181.65, 4446.28),
    ("iris", 2): (152.347951760, 78.851441426, 57.228473214, 46.446182051, 39.039987246, 34.298229665, 29.988943950,
                  27.786092417, 25.834054819),
    ("places", 5): (8894.904,), ("places", 15): (2320.080,), ("places", 30): (799.311,),
}  # fmt: skip


@pytest.fixture(scope="module")
def tables() -> dict[str, NDArray[Any]]:
    from sklearn.datasets import load_iris

    return {
        "ruspini": np.array(RUSPINI).reshape(-1, 2),
        "places": np.array(PLACES).reshape(-1, 2),
        "iris": load_iris().data,
    }


@pytest.mark.parametrize(("name", "fewest"), OPTIMA)
def test_the_best_effort_reaches_proven_optima(name: str, fewest: int, tables: dict[str, NDArray[Any]]) -> None:
    for n_generators, least in enumerate(OPTIMA[name, fewest], fewest):
        found = [tessellate(tables[name], n_generators, effort="best", rng=seed).energy for seed in range(5)]
        # Some searches end at a minimum next to the least.
        assert max(found) < 1.006 * least
        np.testing.assert_allclose(min(found), least, rtol=1e-6)


@pytest.mark.parametrize("effort", ["balanced", "best"])
def test_evolution_is_not_above_ten_starts(effort: str) -> None:
    from sklearn.cluster import KMeans
    from sklearn.datasets import load_wine

    rows = load_wine().data
    rows = (rows - rows.mean(axis=0)) / rows.std(axis=0)
    for n_generators in (5, 10, 30):
        ten = KMeans(n_generators, n_init=10, random_state=0).fit(rows).inertia_
        assert tessellate(rows, n_generators, effort=effort).energy < 1.001 * ten


def test_evolution_keeps_locked_generators_and_counts_weights(tables: dict[str, NDArray[Any]]) -> None:
    rows = tables["iris"]
    locked, density = rows[[0, 100]] + 0.5, np.arange(len(rows)) % 3
    result = tessellate(rows, 6, locked=locked, density=density, effort="best")
    np.testing.assert_allclose(result.generators[:2], locked, rtol=1e-6)
    np.testing.assert_allclose(result.energy, reference.energy(rows, density, result.generators), rtol=1e-6)
    alone = tessellate(rows, 6, locked=locked, density=density, effort="fast")
    assert result.energy <= alone.energy


def test_evolution_lowers_the_energy_that_weights_cells_by_volume(tables: dict[str, NDArray[Any]]) -> None:
    found = [
        tessellate(tables["iris"], 25, volume_power=2, effort=effort).weighted_energy for effort in ("fast", "best")
    ]
    assert found[1] < found[0]


def test_equal_rows_may_be_fewer_than_asked_for() -> None:
    rows = np.repeat(np.eye(3), 50, axis=0)
    assert tessellate(rows, 3, effort="best").energy == 0
    with pytest.raises(ValueError, match=r"must be in 1\.\.3"):
        tessellate(rows, 4, effort="best")


def test_the_callback_stops_evolution(tables: dict[str, NDArray[Any]]) -> None:
    seen: list[float] = []
    tessellate(tables["iris"], 10, effort="best", callback=lambda _, energy: bool(seen.append(energy)) or len(seen) > 3)
    assert len(seen) == 4


@pytest.mark.parametrize(("n_rows", "n_dims", "k"), [(3000, 10, 30), (3000, 2, 20), (40_000, 8, 20)])
def test_separated_clusters_are_all_found(n_rows: int, n_dims: int, k: int) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        centers = 20 * rng.permuted(np.tile(np.arange(k), (n_dims, 1)), axis=1).T
        rows = centers[rng.integers(0, k, n_rows)] + rng.normal(size=(n_rows, n_dims))
        found = tessellate(rows, k, rng=seed).generators
        assert len(set(((centers[:, None] - found) ** 2).sum(axis=2).argmin(axis=1))) == k


def test_a_far_row_of_many_has_a_generator() -> None:
    rows = np.random.default_rng(0).random((40_000, 5))
    rows[12345] = -9999
    result = tessellate(rows, 4)
    assert result.masses.min() == 1
    assert result.energy < 1.01 * tessellate(np.delete(rows, 12345, axis=0), 3).energy

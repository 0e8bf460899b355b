from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from dask import array as da
from reference import at_threads
from relations.relation import Relation, close, equal, not_above, quick_and_wide
from scipy.spatial.distance import cdist
from sklearn.cluster import KMeans

from cvtimg import CVT, energy_curve, tessellate
from cvtimg._shared.types import Floats

Rows = Floats
#: How often each of 200 rows stands in a table.
TIMES = 1 + np.arange(200) % 3
TAKEN_AS_OFTEN = partial(np.repeat, repeats=TIMES, axis=0)


def clusters(rng: np.random.Generator) -> Rows:
    """Rows in 5 clusters that are well apart, so that the generators of lowest energy are clear."""
    n_dims = int(rng.integers(1, 9))
    centers = 40 * np.eye(5, n_dims) + 60 * np.arange(5)[:, None]
    return centers[np.arange(200) % 5] + rng.normal(size=(200, n_dims))


def with_far(value: float, n_rows: int = 1) -> Callable[[Rows], Rows]:
    return lambda rows: np.vstack([rows, np.full((n_rows, rows.shape[1]), value)])


def energy(rows: Rows, **how: Any) -> float:
    return tessellate(rows, 5, **how).energy


def energy_of_six(rows: Rows) -> float:
    """With a generator more, which far rows take."""
    return tessellate(rows, 6).energy


def tables(rng: np.random.Generator) -> Rows:
    """Rows of any kind, some of a wide range."""
    n_rows, n_dims = int(rng.integers(30, 400)), int(rng.integers(1, 20))
    rows = rng.normal(size=(n_rows, n_dims)) * 10.0 ** rng.integers(-3, 4, n_dims)
    if rng.random() < 0.5:
        rows[rng.integers(n_rows, size=3)] = 10.0 ** rng.integers(3, 13)
    return rows + 10.0 ** rng.integers(0, 7)


def one_start(rows: Rows) -> float:
    return float(KMeans(5, n_init=1, random_state=0).fit(rows).inertia_)


def times(factor: float) -> Callable[[float, float], None]:
    return lambda before, after: close(1e-9)(before * factor, after)


def of_heavy(rows: Rows) -> float:
    return tessellate(rows, 5, density=np.full(len(rows), 1e200)).energy / 1e200


def labels_of(rows: Rows) -> Any:
    return tessellate(rows, 5).labels


def curve_at(k: int) -> Callable[[Rows], float]:
    return lambda rows: float(energy_curve(rows, 8).energies[k - 1])


def in_blocks(rows: Rows) -> Any:
    return da.from_array(with_far(1e9)(rows), chunks=(64, -1))


_CHANGES: list[tuple[str, Any, Any, Any, Any, Any]] = [
    ("an offset", clusters, energy, lambda rows: rows + 1e7, close(1e-6), None),
    ("a scale", clusters, energy, lambda rows: rows * 1024, times(2.0**20), None),
    ("another order of rows", clusters, energy, np.random.default_rng(1).permutation, close(1e-9), None),
    ("weights of 1e200", clusters, energy, lambda rows: rows, close(1e-9), of_heavy),
    ("weights as repetition", clusters, partial(energy, density=TIMES), TAKEN_AS_OFTEN, close(1e-6), energy),
    ("another seed", clusters, energy, lambda rows: rows, close(1e-6), partial(energy, rng=7)),
    ("three threads", tables, labels_of, lambda rows: rows, equal, lambda r: at_threads(lambda: labels_of(r))[1]),
    ("each row twice", clusters, energy, lambda rows: np.repeat(rows, 2, axis=0), times(2), None),
    ("a row at -9999", clusters, energy, with_far(-9999), close(1e-6), energy_of_six),
    ("50 rows at -99999", clusters, energy, with_far(-99999, 50), close(1e-6), energy_of_six),
    ("3 rows at 1e12", clusters, energy, with_far(1e12, 3), close(1e-6), energy_of_six),
    ("a far row in blocks", clusters, energy, in_blocks, close(1e-6), energy_of_six),
    ("a row at -1e20", clusters, energy, with_far(-1e20), close(1e-6), energy_of_six),
    ("a far row of a curve", clusters, curve_at(5), with_far(-1e8), close(1e-3), curve_at(6)),
    ("a row of a curve at -1e20", clusters, curve_at(5), with_far(-1e20), close(1e-3), curve_at(6)),
    ("KMeans from one start", tables, energy, lambda rows: rows, not_above(1.001), one_start),
]
RELATIONS = [
    Relation("tessellate", change, inputs, result, changed, follows, since="2026-11-27", rival=rival)
    for change, inputs, result, changed, follows, rival in _CHANGES
]
test_clusters_follow_their_rows, test_clusters_follow_any_rows = quick_and_wide(RELATIONS)


@pytest.mark.parametrize("seed", range(6))
def test_labels_masses_and_energies_are_those_of_the_generators(seed: int) -> None:
    rows = tables(np.random.default_rng(seed))
    weights = np.random.default_rng(seed).random(len(rows))
    blocks = tessellate(da.from_array(rows, chunks=(50, -1)), 5)
    plain, weighted = tessellate(rows, 5), tessellate(rows, 5, density=weights)
    locked = tessellate(rows, 5, locked=rows[:1])
    equal(rows[0], locked.generators[0])
    fitted = CVT(5).fit(rows, sample_weight=weights)
    centers, score = fitted.cluster_centers_, fitted.score(rows, sample_weight=weights)
    results = [(*_parts(plain), None), (*_parts(weighted), weights), (*_parts(locked), None), (*_parts(blocks), None)]
    results += [(centers, fitted.labels_, fitted.masses_, fitted.inertia_, weights)]
    results += [(centers, fitted.predict(rows), fitted.masses_, -score, weights)]
    for generators, labels, masses, total, density in results:
        own = np.ones(len(rows)) if density is None else density
        apart = cdist(rows, generators)
        np.testing.assert_array_less(apart[np.arange(len(rows)), labels], apart.min(axis=1) * (1 + 1e-9) + 1e-300)
        np.testing.assert_allclose(masses, np.bincount(labels, own, 5), rtol=1e-12)
        np.testing.assert_allclose(total, (own * apart.min(axis=1) ** 2).sum(), rtol=1e-9)


def _parts(result: Any) -> tuple[Any, ...]:
    return result.generators, np.asarray(result.labels), result.masses, result.energy


def test_means_of_float64_rows_are_means_in_float64() -> None:
    rows = np.array([[3.0, 0.1], [4.0, 0.3], [103.7, 5.0], [104.1, 6.0]]) + 0.0
    generators = np.sort(tessellate(rows, 2).generators, axis=0)
    equal(np.array([[3.5, 0.2], [103.9, 5.5]]).round(12), generators.round(12))
    assert generators[0, 0] == 3.5

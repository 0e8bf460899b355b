from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from dask import array as da
from reference import of_three_threads
from relations.relation import Relation, close, equal, not_above, quick_and_wide
from relations.remembering import beside
from sklearn.cluster import KMeans

from cvtimg import energy_curve, tessellate
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
    return da.from_array(rows, chunks=(64, -1))


def from_generators(rows: Rows) -> float:
    return energy(rows, init=tessellate(rows, 5).generators, effort="fast")


def shares(rows: Rows, **how: Any) -> Rows:
    """Return the energies of up to five clusters as shares of that of one; a sixth may divide any of these."""
    energies = energy_curve(rows, 6, effort="balanced", **how).energies[:5]
    return energies / energies[0]


def resumed(stops: Callable[[Path, int], bool]) -> Callable[[Rows], float]:
    """Return what stops a tessellation of blocks, which is saved in a file from the descent on, and goes on."""

    def energy_of(rows: Rows) -> float:
        with TemporaryDirectory() as folder:
            path = Path(folder, "a.npz")
            energy(in_blocks(rows), checkpoint=path, callback=lambda step, _: stops(path, step))
            return energy(in_blocks(rows), checkpoint=path)

    return energy_of


def of_blocks(rows: Rows) -> float:
    return energy(in_blocks(rows))


_CHANGES: list[tuple[str, Any, Any, Any, Any, Any]] = [
    ("an offset", clusters, energy, lambda rows: rows + 1e7, close(1e-6), None),
    ("a scale", clusters, energy, lambda rows: rows * 1024, times(2.0**20), None),
    ("another order of rows", clusters, energy, np.random.default_rng(1).permutation, close(1e-9), None),
    ("weights of 1e200", clusters, energy, lambda rows: rows, close(1e-9), of_heavy),
    ("weights as repetition", clusters, partial(energy, density=TIMES), TAKEN_AS_OFTEN, close(1e-6), energy),
    ("another seed", clusters, energy, lambda rows: rows, close(1e-6), partial(energy, rng=7)),
    ("three threads", tables, labels_of, lambda rows: rows, equal, of_three_threads(labels_of)),
    ("each row twice", clusters, energy, lambda rows: np.repeat(rows, 2, axis=0), times(2), None),
    ("a row at -9999", clusters, energy, with_far(-9999), close(1e-6), energy_of_six),
    ("50 rows at -99999", clusters, energy, with_far(-99999, 50), close(1e-6), energy_of_six),
    ("3 rows at 1e12", clusters, energy, with_far(1e12, 3), close(1e-6), energy_of_six),
    ("a far row in blocks", clusters, energy, lambda rows: in_blocks(with_far(1e9)(rows)), close(1e-6), energy_of_six),
    ("blocks", clusters, energy, in_blocks, close(1e-6), None),
    ("a constant column", clusters, energy, lambda rows: np.insert(rows, 1, 7, axis=1), close(1e-9), None),
    ("its own generators", tables, from_generators, lambda rows: rows, not_above(1 + 1e-9), energy),
    ("a row at -1e20", clusters, energy, with_far(-1e20), close(1e-6), energy_of_six),
    ("a far row of a curve", clusters, curve_at(5), with_far(-1e8), close(1e-3), curve_at(6)),
    ("a row of a curve at -1e20", clusters, curve_at(5), with_far(-1e20), close(1e-3), curve_at(6)),
    ("KMeans from one start", tables, energy, lambda rows: rows, not_above(1.001), one_start),
]
#: Changes after which clusters are the same, whatever their number.
_OF_CURVES: dict[str, Callable[[Rows], Rows]] = {
    "an offset": lambda rows: rows + 1e5,
    "a scale": lambda rows: rows * 1024,
    "another order of rows": np.random.default_rng(1).permutation,
    "columns in another order": lambda rows: rows[:, ::-1],
    "a constant column": lambda rows: np.insert(rows, 1, 7, axis=1),
    "each row twice": lambda rows: np.repeat(rows, 2, axis=0),
    "weights as repetition": TAKEN_AS_OFTEN,
    "another seed": lambda rows: rows,
}
RELATIONS = [
    Relation("tessellate", change, inputs, result, changed, follows, since="2026-11-27", rival=rival)
    for change, inputs, result, changed, follows, rival in _CHANGES
] + [
    Relation(
        "energy_curve",
        change,
        clusters,
        partial(shares, density=TIMES) if changed is TAKEN_AS_OFTEN else shares,
        changed,
        close(0.02),
        since="2026-11-28",
        because="clusters are cut in one of several ways beyond their number",
        rival=partial(shares, rng=7) if change == "another seed" else shares,
    )
    for change, changed in _OF_CURVES.items()
]
RELATIONS += [
    beside("tessellate", change, tables, of_blocks, resumed(stops))
    for change, stops in {
        "stopped and resumed": lambda path, _: path.exists(),
        "stopped in the search and resumed": lambda _, step: step > 0,
    }.items()
]
test_clusters_follow_their_rows, test_clusters_follow_any_rows = quick_and_wide(RELATIONS)


def test_means_of_float64_rows_are_means_in_float64() -> None:
    rows = np.array([[3.0, 0.1], [4.0, 0.3], [103.7, 5.0], [104.1, 6.0]]) + 0.0
    generators = np.sort(tessellate(rows, 2).generators, axis=0)
    equal(np.array([[3.5, 0.2], [103.9, 5.5]]).round(12), generators.round(12))
    assert generators[0, 0] == 3.5

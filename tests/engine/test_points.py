"""Passes over points, and from where on each of two ways is taken."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cvtimg._shared.types import Array, Floats, Ints
from cvtimg.engine import EFFORTS, METHODS, evolution, tessellation
from cvtimg.engine.all_counts import chain
from cvtimg.engine.methods import Conditions, Ends, Iteration, Method, Stopping
from cvtimg.engine.points import Points, cell_moments, float32_suffices, pack
from cvtimg.engine.samples import pack_in_order
from cvtimg.engine.search import search


def summed_by_hand(rows: Array, density: Floats, labels: Ints, n_cells: int) -> Floats:
    """Sum (K, D + 1) as kernels do: by parts, by tiles of 64, and cells with ten points of a tile in eight lanes."""
    (n_rows, n_dims), tile = rows.shape, 64
    n_tiles = -(-n_rows // tile)
    padded, weights = np.zeros((n_tiles * tile, n_dims + 1)), np.zeros(n_tiles * tile)
    padded[:n_rows], padded[n_rows:], weights[:n_rows] = np.c_[rows, np.ones(n_rows)], np.append(rows[-1], 1), density
    labels = np.append(labels, np.zeros(n_tiles * tile - n_rows, np.int32))
    n_parts = min(max(n_tiles // 256, 1), 32)
    parts = np.zeros((n_parts, n_cells, n_dims + 1))
    for sums, first, last in zip(parts, range(n_parts), range(1, n_parts + 1), strict=True):
        for t in range(n_tiles * first // n_parts, n_tiles * last // n_parts):
            some = slice(t * tile, (t + 1) * tile)
            left, terms = labels[some].copy(), weights[some, None] * padded[some]
            n_members = tile if n_dims <= 4 else 0
            while (left >= 0).any() and n_members >= 10:
                is_member = left == left[left >= 0][0]
                lanes = (is_member[:, None] * terms).reshape(-1, 8, n_dims + 1)
                total = np.zeros((8, n_dims + 1))
                for lane in lanes:
                    total += lane
                for half in (4, 2, 1):
                    total[:half] += total[half : 2 * half]
                sums[left[is_member][0]] += total[0]
                left[is_member], n_members = -1, int(is_member.sum())
            for i in np.flatnonzero(left >= 0):
                sums[left[i]] += terms[i]
    return parts.sum(axis=0)


@pytest.mark.parametrize(
    ("n_rows", "n_dims", "n_cells"), [(4000, 4, 5), (4000, 5, 5), (64 * 511, 1, 1), (64 * 513, 1, 1), (540_700, 1, 1)]
)
def test_sums_of_cells_have_the_bits_of_a_plain_sum_in_the_same_order(n_rows: int, n_dims: int, n_cells: int) -> None:
    rng = np.random.default_rng(n_dims)
    rows, density = rng.normal(size=(n_rows, n_dims)).astype(np.float32), rng.random(n_rows)
    labels = rng.integers(0, n_cells, n_rows, np.int32)
    points = pack(rows, density, center=np.zeros(n_dims))
    padded = np.append(labels, np.zeros(len(points.density) - n_rows)).astype(np.int32)
    masses, sums = cell_moments(points, padded, n_cells)
    assert (np.c_[sums, masses] == summed_by_hand(rows, density, labels, n_cells)).all()


@pytest.mark.parametrize("loss", [1e-6, tessellation._LOSS_OF_COLORS])
def test_float32_suffices_where_wrong_labels_raise_the_energy_by_less_than_is_allowed(loss: float) -> None:
    allowed = {"loss": loss} if loss > 1e-6 else {}
    points: Any = SimpleNamespace(n_dims=4, energy_about_origin=1.0)
    least = 2 * 2.0**-24 / np.sqrt(loss)
    assert float32_suffices(points, 1.2 * least, **allowed)
    assert not float32_suffices(points, 0.8 * least, **allowed)


@pytest.mark.parametrize(("n_dims", "n_generators", "ordered"), [(4, 40, True), (5, 40, False), (4, 39, False)])
def test_tables_are_sorted_where_cells_that_are_far_are_ruled_out(
    n_dims: int, n_generators: int, ordered: bool
) -> None:
    rows = np.random.default_rng(0).random((200, n_dims))
    assert (pack_in_order(rows, np.ones(200), n_generators)[1] is not None) == ordered


@pytest.mark.parametrize(
    ("n_rows", "n_generators", "n_fewer", "rests"),
    [
        (140_000, 8, 17_500, {(1e-3, 100), (1e-2, 5), (1e-4, 100)}),
        (20_000, 8, 2_500, {(1e-3, 100), (1e-2, 5), (2e-3, 8)}),
        (20_000, 64, 5_000, {(1e-3, 100), (1e-2, 5), (2e-3, 8)}),
    ],
)
def test_searches_are_on_fewer_points_and_rest_soon(
    n_rows: int, n_generators: int, n_fewer: int, rests: set[tuple[float, int]]
) -> None:
    seen = set()

    def descend(points: Points, generators: Floats, conditions: Conditions) -> Iteration:
        seen.add((points.n_points, conditions.stopping.tolerance, conditions.stopping.max_iterations))
        return METHODS["lloyd"](points, generators, conditions)

    points = pack(np.random.default_rng(0).random((n_rows, 2)), np.ones(n_rows), in_order=True)
    conditions = Conditions(Stopping(1e-9, 9), np.random.default_rng(0))
    if n_rows > 100_000:
        search(points, np.zeros((0, 2)), n_generators, "split", Method(descend), conditions, EFFORTS["best"])
    else:
        chain(points, n_generators, Method(descend), conditions)
    assert {(tolerance, most) for n_points, tolerance, most in seen if n_points == n_fewer} == rests
    assert {n_points for n_points, *_ in seen} <= {n_fewer, n_rows}


# Evolution


@pytest.mark.parametrize(
    ("size", "apart", "n_elders"),
    [(0.75, 1.0, 3 + 7), (1.5, 1.0, 3), (1.5, 0.7e-5, 1), (1.5, 1.4e-5, 3), (0.75, 0.7e-5, 3 + 7)],
)
def test_elders_of_random_seeds_are_sought_where_that_takes_milliseconds(
    size: float, apart: float, n_elders: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ends(points: Any, sets: Floats, conditions: Conditions) -> Ends:
        return Ends(sets, np.linspace(1, 1 + apart, len(sets)) if len(sets) > 1 else np.full(1, 3.0))

    def seeds(points: Any, given: Floats, n_generators: int, n_swaps: int, rng: Any) -> Floats:
        assert n_swaps == 2
        return rng.random((len(given), n_generators, 1))

    monkeypatch.setattr(evolution, "transfer_of_sets", ends)
    monkeypatch.setattr(evolution, "seed_sets", seeds)
    monkeypatch.setattr(evolution, "random", lambda points, n, rng: rng.random((n, 1)))
    points: Any = SimpleNamespace(tiles=np.empty((int(size * 2**24) // (8 + 16), 1, 1), np.int8))
    effort = evolution.Evolution(9, 7, 5, 3, 1, 1.0, 1.0, int(1.2 * 2**24))
    conditions = Conditions(Stopping.after(1), np.random.default_rng(0))
    elders = evolution._elders(points, np.zeros((0, 1)), 8, "split", conditions, effort)
    assert len(elders.energies) == n_elders

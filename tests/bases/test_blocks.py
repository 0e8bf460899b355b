"""Bases of Dask arrays are those of arrays in memory, worked on in their blocks, and say which block is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg import key_frames, reduced_basis
from cvtimg.blocks import BlockError, as_blocks

dask = pytest.importorskip("dask")
import dask.array as da  # noqa: E402

TIMES = np.linspace(0, 1, 90)[:, None, None]
PLACES = np.linspace(0, 6, 11 * 13).reshape(11, 13)
NOISE = np.random.default_rng(2).normal(0, 1e-3, (90, 11, 13))
FIELDS = np.sin(PLACES) * TIMES + np.cos(2 * PLACES) * TIMES**2 + np.sin(5 * PLACES * TIMES) + 40 + NOISE


@pytest.fixture(autouse=True)
def short_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cvtimg.bases.snapshots._LEAST_ROWS", 16)
    monkeypatch.setattr("cvtimg.bases.snapshots._BLOCK_BYTES", 16 * FIELDS[0].nbytes)


def lazy(fields: NDArray[Any] = FIELDS) -> Any:
    return da.from_array(fields, chunks=(7, 5, 13))


def spans(modes: NDArray[Any], others: NDArray[Any]) -> Any:
    """Return the sines of the angles between two subspaces."""
    return np.sqrt(np.maximum(0, 1 - np.linalg.svd(modes @ others.T)[1] ** 2))


@pytest.mark.parametrize("kind", ["pod", "cvt", "cvod"])
def test_a_basis_of_blocks_is_that_of_the_array(kind: str) -> None:
    found, whole = (reduced_basis(given, 3, kind=kind, n_cells=2) for given in (lazy(), FIELDS))
    assert found.shape == (11, 13)
    np.testing.assert_allclose(found.mean, FIELDS.reshape(90, -1).mean(axis=0), rtol=1e-12)
    assert found.energy == pytest.approx(whole.energy, rel=1e-8)
    assert found.variance == pytest.approx(((FIELDS - FIELDS.mean(axis=0)) ** 2).sum())
    np.testing.assert_array_equal(found.labels, whole.labels)
    for modes, others in zip(found.modes, whole.modes, strict=True):
        assert spans(modes, others).max() < 1e-5
    projected = found.project(lazy())
    np.testing.assert_allclose(projected.residuals, found.project(FIELDS).residuals, rtol=1e-9)
    np.testing.assert_allclose(found.reconstruct(projected), whole.reconstruct(whole.project(FIELDS)), atol=1e-6)


@pytest.mark.parametrize("scheduler", ["sync", "threads"])
def test_bits_do_not_depend_on_who_works(scheduler: str) -> None:
    expected = reduced_basis(lazy(), 4)
    with dask.config.set(scheduler=scheduler, num_workers=3):
        again = reduced_basis(lazy(), 4)
    np.testing.assert_array_equal(expected.modes, again.modes)
    np.testing.assert_array_equal(expected.energies, again.energies)


def test_each_pass_reads_each_block_once() -> None:
    read: list[int] = []

    def rows(start: int) -> NDArray[Any]:
        read.append(start)
        return FIELDS[start : start + 30]

    parts = [da.from_delayed(dask.delayed(rows, pure=False)(at), (30, 11, 13), float) for at in (0, 30, 60)]
    with dask.config.set(scheduler="sync"):
        reduced_basis(da.concatenate(parts), 4, passes=2)
    assert sorted(read) == [0, 0, 0, 30, 30, 60, 60]  # the first also for a center of the products


def test_key_frames_of_blocks() -> None:
    np.testing.assert_array_equal(key_frames(lazy(), 5).indices, key_frames(FIELDS, 5).indices)


def test_a_block_that_is_wrong_is_named() -> None:
    holed = FIELDS.copy()
    holed[40, 3, 3] = np.nan
    with pytest.raises(BlockError, match=r"block 1: snapshots must be finite: number 40 contains NaN or infinity"):
        reduced_basis(lazy(holed), 3)

    def unreadable() -> NDArray[Any]:
        raise OSError("tape torn")

    broken = da.from_delayed(dask.delayed(unreadable)(), (21, 11, 13), float)
    with pytest.raises(BlockError, match=r"block 4: cannot be read \(OSError: tape torn\)"):
        reduced_basis(da.concatenate([lazy()[:84], broken]), 3)


def test_blocks_that_are_no_snapshots_are_refused() -> None:
    unknown = lazy()[da.from_array(TIMES[:, 0, 0] > 0.5, chunks=7)]
    with pytest.raises(ValueError, match="snapshots must have a known shape"):
        reduced_basis(unknown, 3)
    with pytest.raises(ValueError, match="snapshots must have no weights"):
        reduced_basis(as_blocks(np.eye(4), np.ones(4)), 3)

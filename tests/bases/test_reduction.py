from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cvtimg import reduced_basis, write_image
from cvtimg._shared.types import Array
from cvtimg.bases import KINDS, Basis, as_snapshots, read_basis
from cvtimg.pictures import Frames, write_frames, write_pages

RNG = np.random.default_rng(0)
#: Decaying singular values, with a large mean that all have in common.
LEFT = np.linalg.qr(RNG.normal(size=(60, 20)))[0]
RIGHT = np.linalg.qr(RNG.normal(size=(300, 20)))[0]
SNAPSHOTS = (LEFT * 100 * 0.7 ** np.arange(20)) @ RIGHT.T + 500


def left_out(snapshots: Array, basis: Basis) -> float:
    """Squared distance of snapshots to the nearest subspace, by least squares."""
    rows = snapshots.reshape(len(snapshots), -1).astype(float)
    apart = []
    for center, modes in zip(basis.centers, basis.modes, strict=True):
        fit = np.linalg.lstsq(modes.T.astype(float), (rows - center).T, rcond=None)[0].T
        apart.append(((rows - center - fit @ modes) ** 2).sum(axis=1))
    return float(np.min(apart, axis=0).sum())


@pytest.mark.parametrize("kind", KINDS)
def test_energies_are_those_of_the_training_snapshots_fall_with_each_mode_and_modes_are_orthonormal(kind: str) -> None:
    basis = reduced_basis(SNAPSHOTS, 4, kind=kind, n_cells=3)
    assert basis.energy == pytest.approx(left_out(SNAPSHOTS, basis))
    assert basis.explained == pytest.approx(1 - basis.energy / SNAPSHOTS.var(axis=0).sum() / len(SNAPSHOTS))
    for modes in basis.modes:
        assert modes @ modes.T == pytest.approx(np.eye(4), abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_projections_reconstruct_what_lies_in_the_basis_and_residuals_tell_what_does_not(kind: str) -> None:
    basis = reduced_basis(SNAPSHOTS, 4, kind=kind, n_cells=3)
    inside = basis.reconstruct(basis.project(SNAPSHOTS))
    again = basis.project(inside)
    assert basis.reconstruct(again) == pytest.approx(inside)
    assert again.residuals.max() < 1e-6
    stranger = basis.mean + 50 * np.random.default_rng(1).normal(size=SNAPSHOTS.shape[1])
    assert basis.project(stranger[None]).residuals[0] > 0.9


def test_cells_of_a_cvod_follow_regimes_that_one_basis_cannot() -> None:
    regimes = [np.linalg.qr(RNG.normal(size=(200, 2)))[0] for _ in range(3)]
    rows = np.concatenate([RNG.normal(size=(40, 2)) @ axes.T + 9 * RNG.normal(size=200) for axes in regimes])
    cvod = reduced_basis(rows, 2, kind="cvod", n_cells=3)
    assert cvod.energy < 1e-12 * cvod.variance
    assert [len(set(cvod.labels[start : start + 40])) for start in (0, 40, 80)] == [1, 1, 1]
    assert reduced_basis(rows, 2).energy > 100 * max(cvod.energy, 1e-12)


@pytest.mark.parametrize("kind", ["cvt", "cvod"])
def test_medoids_are_the_members_nearest_to_their_cell_mean(kind: str) -> None:
    basis = reduced_basis(SNAPSHOTS, 3, kind=kind, n_cells=4)
    for cell, medoid in enumerate(basis.medoids):
        members = np.flatnonzero(basis.labels == cell)
        apart = ((SNAPSHOTS[members] - SNAPSHOTS[members].mean(axis=0)) ** 2).sum(axis=1)
        assert medoid == members[apart.argmin()]


def test_the_shape_of_snapshots_is_kept() -> None:
    fields = SNAPSHOTS.reshape(60, 10, 30)
    basis = reduced_basis(fields, 3)
    assert basis.shape == (10, 30)
    assert basis.reconstruct(basis.project(fields)).shape == fields.shape
    with pytest.raises(ValueError, match=r"snapshots of shape \(300,\) must be \(10, 30\)"):
        basis.project(SNAPSHOTS)


def test_snapshots_on_disk_in_blocks_give_the_same_basis(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = reduced_basis(SNAPSHOTS, 5)
    np.save(tmp_path / "rows.npy", SNAPSHOTS)
    monkeypatch.setattr("cvtimg.bases.snapshots.BLOCK_BYTES", 300 * 8 * 7)
    blocks = reduced_basis(tmp_path / "rows.npy", 5)
    assert blocks.energies == pytest.approx(whole.energies)
    assert abs(np.einsum("nd,nd->n", blocks.modes[0], whole.modes[0])) == pytest.approx(np.ones(5))


def test_auto_takes_the_elbow_of_the_energy() -> None:
    noise = RNG.normal(size=(80, 300))
    rows = np.linalg.qr(RNG.normal(size=(80, 6)))[0] @ np.linalg.qr(RNG.normal(size=(300, 6)))[0].T * 900 + noise
    assert reduced_basis(rows, "auto").n_modes == 6


def test_saved_bases_come_back(tmp_path: Path) -> None:
    basis = reduced_basis(SNAPSHOTS, 2, kind="cvod", n_cells=2)
    basis.save(tmp_path / "a.npz")
    again = read_basis(tmp_path / "a.npz")
    assert (again.modes == basis.modes).all()
    assert (again.kind, again.shape, again.variance) == (basis.kind, basis.shape, basis.variance)
    with pytest.raises(FileExistsError):
        basis.save(tmp_path / "a.npz")
    with pytest.raises(ValueError, match=r"suffix='\.txt' must be one of \.npz"):
        basis.save(tmp_path / "a.txt")
    (tmp_path / "b.npz").write_bytes(b"no basis")
    with pytest.raises(OSError, match="is not a reduced basis"):
        read_basis(tmp_path / "b.npz")


def test_equal_snapshots_need_no_mode() -> None:
    for kind in ("pod", "cvod"):
        basis = reduced_basis(np.ones((5, 4)), 1, kind=kind, n_cells=1)
        assert basis.energy == 0
        assert basis.explained == 1
        assert reduced_basis(np.ones((5, 4)), "auto", kind=kind, n_cells=1).n_modes == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "dct"}, "kind='dct' must be one of pod, cvt, cvod"),
        ({"n_modes": 60}, r"n_modes=60 must be in 1\.\.59, for 60 snapshots of 300 values"),
        ({"n_modes": 0}, "n_modes=0 must be in"),
        ({"snapshots": np.array([[1.0, np.nan], [0, 1]])}, "snapshots must be finite: number 0"),
        ({"snapshots": np.zeros((0, 3))}, r"snapshots of shape \(0, 3\) must be"),
        ({"snapshots": np.zeros(4)}, r"snapshots of shape \(4,\) must be"),
        ({"snapshots": np.array([["a", "b"]])}, "snapshots of type <U1 must be of integers"),
    ],
)
def test_bad_arguments_are_named(options: dict[str, Any], message: str) -> None:
    given = {"snapshots": SNAPSHOTS, "n_modes": 1, **options}
    with pytest.raises((TypeError, ValueError), match=message):
        reduced_basis(given.pop("snapshots"), given.pop("n_modes"), **given)


def test_snapshots_that_differ_limit_modes_and_cells() -> None:
    same = np.repeat(np.eye(3)[:2], 5, axis=0)
    with pytest.raises(ValueError, match=r"^n_modes=4 must be in 1\.\.2, the number of snapshots that differ"):
        reduced_basis(same, 4, kind="cvt")
    with pytest.raises(ValueError, match=r"^n_cells=4 must be in 1\.\.2, the number of snapshots that differ"):
        reduced_basis(same, 1, kind="cvod", n_cells=4)
    assert reduced_basis(same, "auto", kind="cvt").n_modes <= 2


@pytest.mark.parametrize("shape", [(60, 300), (300, 60), (40, 6, 7)])
def test_small_arrays_have_the_modes_of_a_singular_value_decomposition(shape: tuple[int, ...]) -> None:
    rows = np.random.default_rng(1).normal(size=shape) + 5  # energies that fall slowly
    flat = rows.reshape(len(rows), -1)
    lengths = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False) ** 2
    basis = reduced_basis(rows, 10)
    np.testing.assert_allclose(basis.energies, lengths.sum() - np.r_[0, lengths[:10].cumsum()], rtol=1e-10)
    missed = ((rows - basis.reconstruct(basis.project(rows))) ** 2).sum()
    np.testing.assert_allclose(missed, lengths[10:].sum(), rtol=1e-10)


def test_a_share_of_the_variance_takes_as_few_modes_as_explain_it() -> None:
    rows = np.diag([8.0, 4, 2, 1, 0.5, 0.25])
    for share in (0.5, 0.9, 0.99):
        n_modes = reduced_basis(rows, share).n_modes
        assert reduced_basis(rows, n_modes).explained >= share - 1e-12
        assert n_modes == 1 or reduced_basis(rows, n_modes - 1).explained < share
    with pytest.raises(ValueError, match=r"n_modes=0\.9 must be a whole number"):
        reduced_basis(rows, 0.9, kind="cvt")


def test_weights_are_repetitions_and_uncentered_modes_are_those_about_0() -> None:
    rows, weights = np.random.default_rng(2).normal(size=(30, 50)) + 2, np.arange(30) % 3
    weighted, repeated = reduced_basis(rows, 5, weights=weights), reduced_basis(np.repeat(rows, weights, axis=0), 5)
    np.testing.assert_allclose(weighted.energies, repeated.energies, rtol=1e-9)
    np.testing.assert_allclose(weighted.mean, repeated.mean, rtol=1e-9)
    lengths = np.linalg.svd(rows, compute_uv=False) ** 2
    basis = reduced_basis(rows, 5, centered=False)
    np.testing.assert_allclose(basis.energies, lengths.sum() - np.r_[0, lengths[:5].cumsum()], rtol=1e-9)
    assert not basis.mean.any()
    for wrong in ({"weights": weights}, {"centered": False}):
        with pytest.raises(ValueError, match="must be given with kind='pod'"):
            reduced_basis(rows, 5, kind="cvt", **wrong)


IMAGES = np.random.default_rng(1).integers(0, 256, (5, 6, 8, 3), np.uint8)


def rows_of(snapshots: Any) -> Array:
    return np.concatenate([block for _, block in as_snapshots(snapshots).blocks()])


def test_a_folder_a_film_and_an_array_give_the_same_rows(tmp_path: Path) -> None:
    folder = tmp_path / "images"
    folder.mkdir()
    for number, image in enumerate(IMAGES):
        write_image(folder / f"{number}.png", image)
    write_frames(tmp_path / "film.png", Frames(tuple(IMAGES), (40,) * 5, 0))
    write_pages(tmp_path / "pages.tif", IMAGES)
    frames = Frames(tuple(IMAGES.copy()), (40,) * 5, 0)
    expected = IMAGES.reshape(5, -1)
    for given in (IMAGES, folder, tmp_path / "film.png", tmp_path / "pages.tif", frames, sorted(folder.iterdir())):
        assert as_snapshots(given).shape == (6, 8, 3)
        assert (rows_of(given) == expected).all()


def test_arrays_on_disk_and_lazy_ones_are_read_in_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    zarr = pytest.importorskip("zarr")
    dask = pytest.importorskip("dask.array")
    rows = IMAGES.reshape(5, -1).astype(np.float64)
    zarr.create_array(str(tmp_path / "a.zarr"), data=rows)
    np.save(tmp_path / "a.npy", rows)
    monkeypatch.setattr("cvtimg.bases.snapshots.BLOCK_BYTES", rows[0].nbytes * 2)
    for given in (tmp_path / "a.zarr", tmp_path / "a.npy", dask.from_array(rows, chunks=(2, 50))):
        assert [block.shape[0] for _, block in as_snapshots(given).blocks()] == [2, 2, 1]
        assert (rows_of(given) == rows).all()


def test_images_of_different_sizes_and_one_alone_are_no_snapshots(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", IMAGES[0])
    write_image(tmp_path / "b.png", IMAGES[1, :3])
    with pytest.raises(ValueError, match=r"b\.png of shape \(3, 8, 3\) must be \(6, 8, 3\), as .*a\.png is"):
        rows_of(tmp_path)
    with pytest.raises(ValueError, match="is one image; snapshots must be"):
        as_snapshots(tmp_path / "a.png")

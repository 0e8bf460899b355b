from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg import write_image
from cvtimg.bases import as_snapshots
from cvtimg.pictures import Frames, write_frames

IMAGES = np.random.default_rng(1).integers(0, 256, (5, 6, 8, 3), np.uint8)


def rows_of(snapshots: Any) -> NDArray[Any]:
    return np.concatenate([block for _, block in as_snapshots(snapshots).blocks()])


def test_a_folder_a_film_and_an_array_give_the_same_rows(tmp_path: Path) -> None:
    folder = tmp_path / "images"
    folder.mkdir()
    for number, image in enumerate(IMAGES):
        write_image(folder / f"{number}.png", image)
    write_frames(tmp_path / "film.png", Frames(tuple(IMAGES), (40,) * 5, 0))
    frames = Frames(tuple(IMAGES.copy()), (40,) * 5, 0)
    expected = IMAGES.reshape(5, -1)
    for given in (IMAGES, folder, tmp_path / "film.png", frames, sorted(folder.iterdir())):
        assert as_snapshots(given).shape == (6, 8, 3)
        assert (rows_of(given) == expected).all()


def test_arrays_on_disk_and_lazy_ones_are_read_in_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    zarr = pytest.importorskip("zarr")
    dask = pytest.importorskip("dask.array")
    rows = IMAGES.reshape(5, -1).astype(np.float64)
    zarr.create_array(str(tmp_path / "a.zarr"), data=rows)
    np.save(tmp_path / "a.npy", rows)
    monkeypatch.setattr("cvtimg.bases.snapshots._BLOCK_BYTES", rows[0].nbytes * 2)
    for given in (tmp_path / "a.zarr", tmp_path / "a.npy", dask.from_array(rows, chunks=(2, 50))):
        assert [block.shape[0] for _, block in as_snapshots(given).blocks()] == [2, 2, 1]
        assert (rows_of(given) == rows).all()


def test_images_of_different_sizes_are_named(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", IMAGES[0])
    write_image(tmp_path / "b.png", IMAGES[1, :3])
    with pytest.raises(ValueError, match=r"b\.png of shape \(3, 8, 3\) must be \(6, 8, 3\), as .*a\.png is"):
        rows_of(tmp_path)


def test_one_image_is_no_set_of_snapshots(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", IMAGES[0])
    with pytest.raises(ValueError, match="is one image; snapshots must be"):
        as_snapshots(tmp_path / "a.png")

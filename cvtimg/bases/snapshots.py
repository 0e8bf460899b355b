"""Snapshots, wherever they are: arrays in memory or on disk, animations, and folders of images, read in blocks."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_numbers, check_shape, check_that
from cvtimg._shared.extras import optional
from cvtimg._shared.types import Array
from cvtimg.blocks.rows import BLOCK_BYTES
from cvtimg.files.finding import find_images
from cvtimg.files.remote import is_remote, local_copy, url_of
from cvtimg.pictures.files import read_image
from cvtimg.pictures.frames import Frames, is_animated, read_frames


@dataclass(frozen=True, slots=True, eq=False)
class Snapshots:
    """N snapshots of one shape, read in blocks."""

    n_snapshots: int
    shape: tuple[int, ...]  # of one snapshot, which has D values
    dtype: np.dtype[np.generic]  # of the blocks: float32 or float64
    read: Callable[[int, int], Any]  # from start and stop to that part of the snapshots, (stop - start, ...)

    @property
    def n_dims(self) -> int:
        """Values per snapshot, D."""
        return math.prod(self.shape)

    def blocks(self) -> Iterator[tuple[slice, Array]]:
        """Yield (m, D) blocks in order, each with the rows that it holds."""
        n_rows = max(1, BLOCK_BYTES // (self.n_dims * self.dtype.itemsize))
        for start in range(0, self.n_snapshots, n_rows):
            stop = min(start + n_rows, self.n_snapshots)
            yield slice(start, stop), _checked(self.read(start, stop), start, (stop - start, self.n_dims), self.dtype)


def _checked(rows: object, start: int, shape: tuple[int, ...], dtype: np.dtype[np.generic]) -> Array:
    block = np.asarray(rows, dtype).reshape(shape)
    finite = np.isfinite(block).all(axis=1)
    first = f"be finite: number {start + int(np.argmin(finite))} contains NaN or infinity"
    check_that("snapshots", finite.all(), first)
    return block


def as_snapshots(snapshots: object) -> Snapshots:
    """Return snapshots of any kind as `Snapshots`.

    Parameters
    ----------
    snapshots : array-like, Frames, path, or sequence of paths
        An (N, ...) array of numbers, N >= 1: NumPy, memory-mapped, zarr, HDF5 or Dask, of which some rows are loaded at
        a time. A path names a folder of images of one size, an animation (GIF, APNG, WebP), a .npy file, which
        is memory-mapped, or a .zarr array. A sequence of paths names the images themselves.

    Returns
    -------
    Snapshots

    Examples
    --------
    >>> as_snapshots(np.zeros((5, 4, 3), np.uint8)).shape
    (4, 3)
    """
    if isinstance(snapshots, Snapshots):
        return snapshots
    if isinstance(snapshots, Frames):
        return _of_array(np.stack(snapshots.images))
    if isinstance(snapshots, (str, os.PathLike)):
        return _of_path(Path(snapshots))
    if isinstance(snapshots, Sequence) and snapshots and isinstance(snapshots[0], (str, os.PathLike)):
        return _of_images([Path(path) for path in snapshots])
    return _of_array(snapshots if hasattr(snapshots, "shape") else np.asarray(snapshots))


def _of_array(array: Any) -> Snapshots:
    shape, dtype = tuple(array.shape), np.dtype(array.dtype)
    check_shape("snapshots", shape, len(shape) >= 2 and 0 not in shape, "(N, ...) with at least one value each")
    check_numbers("snapshots", dtype)
    # float32 holds 8-bit and 16-bit images exactly, and lets a file of them pass at half the cost.
    single = dtype.itemsize <= 2 or dtype == np.float32
    return Snapshots(
        int(array.shape[0]),
        tuple(int(side) for side in array.shape[1:]),
        np.dtype(np.float32 if single else np.float64),
        lambda start, stop: array[start:stop],
    )


def _of_path(path: Path) -> Snapshots:
    suffix = path.suffix.lower()
    if suffix == ".zarr":
        zarr = optional("zarr", "zarr")

        return _of_array(zarr.open_array(url_of(path), mode="r"))
    if path.is_dir() or (is_remote(path) and not suffix):
        return _of_images(find_images(path))
    if suffix == ".npy":
        with local_copy(path) as file:
            return _of_array(np.load(file, mmap_mode=None if is_remote(path) else "r"))
    if is_animated(path):
        return _of_array(np.stack(read_frames(path).images))
    raise ValueError(f"{path} is one image; snapshots must be images, an animation, or a .npy or .zarr array")


def _of_images(paths: Sequence[Path]) -> Snapshots:
    first = read_image(paths[0])

    def read(start: int, stop: int) -> Array:
        images = [read_image(path) for path in paths[start:stop]]
        for path, image in zip(paths[start:stop], images, strict=True):
            if image.shape != first.shape:
                raise ValueError(f"{path} of shape {image.shape} must be {first.shape}, as {paths[0]} is")
        return np.stack(images)

    dtype = np.dtype(np.float32 if first.dtype.itemsize <= 2 else np.float64)
    return Snapshots(len(paths), first.shape, dtype, read)

"""Snapshots, wherever they are, read in blocks; and in a few coordinates: a randomized singular value decomposition.

Everything else works on the coordinates, so its cost does not depend on the size of a snapshot, and the snapshots are
read only a few times.

N. Halko, P.-G. Martinsson, J. A. Tropp, SIAM Review 53 (2011) 217-288, doi 10.1137/090771806.
"""

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg._shared.budgets import MOST_IN_MEMORY
from cvtimg._shared.checks import check_numbers, check_shape, check_that, refuse_masked
from cvtimg._shared.extras import optional
from cvtimg._shared.threads import one_blas_thread
from cvtimg._shared.types import Array, Floats
from cvtimg.blocks.rows import BLOCK_BYTES
from cvtimg.files.finding import find_images
from cvtimg.files.remote import is_remote, local_copy, url_of
from cvtimg.pictures.files import read_image
from cvtimg.pictures.frames import Frames, is_animated, read_frames
from cvtimg.pictures.pages import read_pages


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
            block = np.asarray(self.read(start, stop), self.dtype).reshape(stop - start, self.n_dims)
            finite = np.isfinite(block).all(axis=1)
            first = f"be finite: number {start + int(np.argmin(finite))} contains NaN or infinity"
            check_that("snapshots", finite.all(), first)
            yield slice(start, stop), block


def as_snapshots(snapshots: object) -> Snapshots:
    """Return snapshots of any kind as `Snapshots`.

    Parameters
    ----------
    snapshots : array-like, Frames, path, or sequence of paths
        An (N, ...) array of numbers, N >= 1: NumPy, memory-mapped, zarr, HDF5 or Dask, of which some rows are loaded at
        a time. A path names a folder of images of one size, an animation (GIF, APNG, WebP), the pages of a TIFF, a .npy
        file, which is memory-mapped, or a .zarr array. A sequence of paths names the images themselves.

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
    refuse_masked("snapshots", array)
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
        return _of_array(optional("zarr", "zarr").open_array(url_of(path), mode="r"))
    if path.is_dir() or (is_remote(path) and not suffix):
        return _of_images(find_images(path))
    if suffix == ".npy":
        with local_copy(path) as file:
            return _of_array(np.load(file, mmap_mode=None if is_remote(path) else "r"))
    if is_animated(path):
        return _of_array(np.stack(read_frames(path).images))
    pages = read_pages(path).images
    if len(pages) == 1:
        allowed = "images, pages, an animation or an array, .npy or .zarr"
        raise ValueError(f"{path} is one image; snapshots must be {allowed}")
    return _of_array(np.stack(pages))


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


#: Snapshots or values in each, the fewer of them, and values in all, up to which all directions are found: the cost of
#: at most 2^45 products, some seconds.
EXACT_RANK = 1 << 10


@dataclass(frozen=True, slots=True, eq=False)
class Sketch:
    """Snapshots less their mean, in the coordinates of their leading singular directions."""

    coordinates: Floats  # (N, R) with mean 0; columns are orthogonal, of falling length
    directions: Array  # (R, D) orthonormal rows
    mean: Floats  # (D,) of the snapshots
    variance: float  # sum of squared distances to the mean; what the coordinates miss of it is `missed`

    @property
    def missed(self) -> float:
        """The part of the variance outside of the directions, as an energy."""
        return max(self.variance - float((self.coordinates**2).sum()), 0.0)


@one_blas_thread
def sketch(
    snapshots: Snapshots, rank: int, rng: np.random.Generator, *, centered: bool = True, weights: Floats | None = None
) -> Sketch:
    """Sketch snapshots in at most `rank` coordinates.

    Of arrays that are small all directions are found, and the coordinates are those of a singular value decomposition.
    Coordinates are multiplied by the roots of the weights; the mean is 0 if they are not to be `centered`.
    """
    whole = min(snapshots.n_snapshots, snapshots.n_dims)
    rank = min(rank, whole)
    is_exact = whole <= EXACT_RANK and snapshots.n_snapshots * snapshots.n_dims <= MOST_IN_MEMORY // 2
    width, dtype = (whole, np.dtype(np.float64)) if is_exact else (rank, snapshots.dtype)
    directions = rng.standard_normal((snapshots.n_dims, width), np.float32).astype(dtype)
    # Products are taken about a snapshot at first, lest float32 lose what differs beside what all have in common.
    center = np.asarray(snapshots.read(0, 1), dtype).reshape(-1) * dtype.type(centered)
    heavy = np.ones(snapshots.n_snapshots) if weights is None else weights
    for _ in range(1 if is_exact else 2):
        values, mean, variance = _products(snapshots, directions, center, heavy, centered)
        center = mean.astype(dtype)
        basis = np.linalg.qr(values)[0]
        loads, rows = (basis * np.sqrt(heavy)[:, None]).astype(dtype), np.zeros((basis.shape[1], snapshots.n_dims))
        for part, block in snapshots.blocks():
            rows += loads[part].T @ (block - center)
        directions = np.linalg.qr(rows.T)[0].astype(dtype)
    left, lengths, right = np.linalg.svd(rows, full_matrices=False)
    coordinates = ((basis @ left) * lengths)[:, :rank]
    return Sketch(coordinates, right[:rank].astype(snapshots.dtype), mean, variance)


def _products(
    snapshots: Snapshots, directions: Array, center: Array, weights: Floats, centered: bool
) -> tuple[Floats, Floats, float]:
    """Return the (N, R) products of weighted snapshots less their mean with directions, the (D,) mean, the variance."""
    values, sums, squares = [], np.zeros(snapshots.n_dims), 0.0
    for rows, block in snapshots.blocks():
        apart = block - center
        values.append(apart @ directions)
        sums += np.einsum("n,nd->d", weights[rows], apart, dtype=np.float64)
        squares += float(np.einsum("n,nd,nd->", weights[rows], apart, apart, dtype=np.float64))
    joined, mass = np.concatenate(values).astype(np.float64), float(weights.sum())
    shift = sums / mass if centered else np.zeros_like(sums)
    variance = max(squares - mass * float(shift @ shift), 0.0)
    middle = weights @ joined / mass if centered else 0.0
    return np.sqrt(weights)[:, None] * (joined - middle), center + shift, variance

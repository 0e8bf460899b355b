"""Detail, for photographs: cells of patches in place of cells of colors, and in each cell a filter of its own.

A photograph has no few colors, but few kinds of patches: flat parts, edges of each direction, each texture. The
patches about all pixels are tessellated, and the covariance of a cell, less that of the noise, tells how what is left
of its patches after the generator, the residual, divides into picture and noise: Wiener's filter keeps the one and
drops the other. Each pixel is the mean of what the patches about it say.

P. Chatterjee and P. Milanfar, IEEE Trans. Image Processing 21 (2012) 1635-1649, doi 10.1109/TIP.2011.2172799.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.engine.points import assign, cell_energies, pack
from cvtimg.engine.tessellation import tessellate

Floats = NDArray[np.float32]

#: Patches are 5 x 5 pixels.
_REACH = 2
_SIDE = 2 * _REACH + 1
#: Cells are cells of so many principal components of the patches, found from so many patches.
_N_COMPONENTS = 12
_N_SAMPLES = 1 << 16
#: Each round finds the cells anew in what the last one restored. From the third on nothing is gained.
_ROUNDS = 3
#: Blur, in pixels, in which the first cells are found.
_FIRST_BLUR = 0.7
#: Patches that are held at once.
_CHUNK = 1 << 17


@dataclass(frozen=True, slots=True, eq=False)
class Detailed:
    """A picture restored by its patches: (H, W, C) image, (H, W) labels of the patches from 0, and the energy.

    The energy is the sum of the squared distances of the patches, in their principal components, to their generators.
    """

    image: Floats
    labels: NDArray[np.int32]
    energy: float


def restore_detail(
    fused: Floats, share: Floats, noise: float, n_generators: int, effort: str, rng: np.random.Generator
) -> Detailed:
    """Restore a picture of which some pixels are noisier than others.

    Parameters
    ----------
    fused : (H, W, C) array
        The noisy picture, unknown pixels filled in somehow.
    share : (H, W) array
        Least variance of the noise over that of each pixel: 1 for those known best, 0 for those not known.
    noise : float
        Standard deviation of the noise of those known best.
    n_generators : int
        Cells of patches.
    """
    from scipy.ndimage import gaussian_filter
    from threadpoolctl import threadpool_limits

    estimate = gaussian_filter(fused, (_FIRST_BLUR, _FIRST_BLUR, 0))
    known = share[:, :, None] > 0
    spread = noise**2 / np.maximum(share, share[share > 0].min())
    # The matrices are small: threads of the BLAS would spend their time in waiting for each other.
    with threadpool_limits(1, user_api="blas"):
        for _ in range(_ROUNDS):
            cells = _Cells.of(estimate, n_generators, effort, rng)
            filled = np.where(known, fused, estimate)
            filters = _filters(filled, spread, cells.labels, n_generators)
            # What is known ill is drawn towards the estimate, until all is known as well as what is known best: the
            # fixed point is that of a filter that weighs each pixel by its own noise.
            drawn = estimate + share[:, :, None] * (filled - estimate)
            estimate = _filtered(drawn, cells.labels, filters, noise**2)
    return Detailed(estimate, cells.labels, cells.energy)


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """Cells of the patches of a picture: (H, W) label of the patch about each pixel, and their energy."""

    labels: NDArray[np.int32]
    energy: float

    @classmethod
    def of(cls, image: Floats, n_generators: int, effort: str, rng: np.random.Generator) -> _Cells:
        n_pixels = image.shape[0] * image.shape[1]
        drawn = np.sort(rng.choice(n_pixels, min(n_pixels, _N_SAMPLES), replace=False))
        sample = _windows(image)[np.unravel_index(drawn, image.shape[:2])].reshape(len(drawn), -1)
        mean = sample.mean(axis=0)
        sample = sample - mean
        _, axes = np.linalg.eigh((sample.T @ sample).astype(np.float64))
        basis = axes[:, -_N_COMPONENTS:].astype(np.float32)
        generators = tessellate(sample @ basis, n_generators, effort=effort, rng=rng).generators
        labels, energy = np.empty(image.shape[:2], np.int32), 0.0
        for rows, patches in _chunks(image):
            points = pack((patches - mean) @ basis, np.ones(len(patches)), center=np.zeros(basis.shape[1]))
            nearest = assign(points, points.frame.inward(generators))
            labels[rows] = nearest[: points.n_points].reshape(labels[rows].shape)
            energy += points.frame.energy(cell_energies(points, points.frame.inward(generators), nearest).sum())
        return cls(labels, energy)


@dataclass(frozen=True, slots=True, eq=False)
class _Filters:
    """For each cell the mean patch (K, P), the axes (K, P, P) of what differs from it, and its variance (K, P)."""

    means: Floats
    axes: Floats
    variances: NDArray[np.float64]


def _filters(image: Floats, spread: Floats, labels: NDArray[np.int32], n_cells: int) -> _Filters:
    """Measure the cells of a noisy picture, and take the variance of the noise, `spread`, away from theirs."""
    from scipy.ndimage import uniform_filter

    size = image.shape[2] * _SIDE**2
    counts, noise = np.zeros(n_cells), np.zeros(n_cells)
    sums, squares = np.zeros((n_cells, size)), np.zeros((n_cells, size, size))
    patch_spread = uniform_filter(spread, _SIDE, mode="reflect")
    for rows, patches in _chunks(image):
        for cell, members in _members(labels[rows].ravel()):
            inside = patches[members]
            counts[cell] += len(members)
            noise[cell] += patch_spread[rows].ravel()[members].sum()
            sums[cell] += inside.sum(axis=0, dtype=np.float64)
            squares[cell] += inside.T @ inside
    masses = np.maximum(counts, 1)
    means = sums / masses[:, None]
    covariances = squares / masses[:, None, None] - means[:, :, None] * means[:, None, :]
    variances, axes = np.linalg.eigh(covariances)
    left = np.maximum(variances - (noise / masses)[:, None], 0)
    return _Filters(means.astype(np.float32), axes.astype(np.float32), left)


def _filtered(image: Floats, labels: NDArray[np.int32], filters: _Filters, variance: float) -> Floats:
    """Filter the patches of a picture in their cells, and put them together again.

    A patch counts by the inverse of the variance that its filter leaves.
    """
    height, width, n_bands = image.shape
    total = np.zeros((height + 2 * _REACH, width + 2 * _REACH, n_bands), np.float32)
    weight = np.zeros(total.shape[:2], np.float32)
    gains = filters.variances / (filters.variances + max(variance, 1e-30))
    trust = (1 / (gains.mean(axis=1) + 0.02)).astype(np.float32)
    gains = gains.astype(np.float32)
    for rows, patches in _chunks(image):
        near = labels[rows]
        for cell, members in _members(near.ravel()):
            mean, axes = filters.means[cell], filters.axes[cell]
            patches[members] = mean + ((patches[members] - mean) @ axes * gains[cell]) @ axes.T
        parts = patches.reshape(*near.shape, n_bands, _SIDE, _SIDE)
        trusted = trust[near]
        for down in range(_SIDE):
            for right in range(_SIDE):
                here = slice(rows.start + down, rows.stop + down), slice(right, right + width)
                total[here] += parts[:, :, :, down, right] * trusted[:, :, None]
                weight[here] += trusted
    inner = slice(_REACH, -_REACH)
    total[inner, inner] /= weight[inner, inner, None]
    return total[inner, inner]


def _windows(image: Floats) -> Floats:
    """(H, W, C, 5, 5) patches about all pixels; nothing is copied but the borders."""
    padded = np.pad(image, ((_REACH, _REACH), (_REACH, _REACH), (0, 0)), mode="symmetric")
    return np.lib.stride_tricks.sliding_window_view(padded, (_SIDE, _SIDE), axis=(0, 1))


def _chunks(image: Floats) -> Iterator[tuple[slice, Floats]]:
    """Go over the picture in bands of some rows: these, and their (N, P) patches, a copy."""
    windows = _windows(image)
    height, width = image.shape[:2]
    step = max(1, _CHUNK // width)
    for top in range(0, height, step):
        rows = slice(top, min(top + step, height))
        yield rows, windows[rows].reshape((rows.stop - top) * width, -1)


def _members(labels: NDArray[np.int32]) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Each label that there is, and where."""
    order = np.argsort(labels, kind="stable")
    cells, starts = np.unique(labels[order], return_index=True)
    for cell, members in zip(cells, np.split(order, starts[1:]), strict=True):
        yield int(cell), members

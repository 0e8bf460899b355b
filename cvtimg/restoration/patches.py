"""Detail, for photographs: cells of patches instead of cells of colors, with a filter for each cell.

A photograph has many colors but few kinds of patches: flat areas, edges in each direction, each texture. The patches
around all pixels are tessellated. The covariance of a cell minus that of the noise tells which part of the residuals of
its patches, after the generator, is signal and which is noise; a Wiener filter keeps the former. Each pixel is the mean
of what the patches that contain it say.

P. Chatterjee and P. Milanfar, IEEE Trans. Image Processing 21 (2012) 1635-1649, doi 10.1109/TIP.2011.2172799.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.choices import EffortName
from cvtimg.engine.points import assign, cell_energies, pack
from cvtimg.engine.tessellation import tessellate

Floats = NDArray[np.float32]

#: Patches are 5 x 5 pixels.
_REACH = 2
_SIDE = 2 * _REACH + 1
#: Patches are clustered by this many principal components, found from this many patches.
_N_COMPONENTS = 12
_N_SAMPLES = 1 << 16
#: Each round finds the cells in the result of the last one. A fourth gains nothing.
_ROUNDS = 3
#: Blur, in pixels, of the image in which the first cells are found.
_FIRST_BLUR = 0.7
#: Number of patches in memory at once.
_CHUNK = 1 << 17


@dataclass(frozen=True, slots=True, eq=False)
class Detailed:
    """An image restored by its patches: (H, W, C) image, (H, W) labels of the patches from 0, and the energy.

    The energy is the sum of the squared distances of patches to their generators, in principal components.
    """

    image: Floats
    labels: NDArray[np.int32]
    energy: float


def restore_detail(
    fused: Floats, share: Floats, noise: float, n_generators: int, effort: EffortName, rng: np.random.Generator
) -> Detailed:
    """Restore an image in which some pixels are noisier than others.

    Parameters
    ----------
    fused : (H, W, C) array
        The noisy image, with unknown pixels filled in.
    share : (H, W) array
        Smallest variance of the noise divided by that of each pixel: 1 for pixels known best, 0 for unknown ones.
    noise : float
        Standard deviation of the noise of the pixels known best.
    n_generators : int
        Number of cells of patches.
    """
    from scipy.ndimage import gaussian_filter
    from threadpoolctl import threadpool_limits

    estimate = gaussian_filter(fused, (_FIRST_BLUR, _FIRST_BLUR, 0))
    known = share[:, :, None] > 0
    variance = noise**2 / np.maximum(share, share[share > 0].min())
    # The matrices are small: threads of the BLAS would spend their time waiting for each other.
    with threadpool_limits(1, user_api="blas"):
        for _ in range(_ROUNDS):
            cells = _Cells.of(estimate, n_generators, effort, rng)
            filled = np.where(known, fused, estimate)
            filters = _filters(filled, variance, cells.labels, n_generators)
            # Noisier pixels are drawn toward the estimate until all are as good as the best: the fixed point is that of
            # a filter that weights each pixel by its own noise.
            drawn = estimate + share[:, :, None] * (filled - estimate)
            estimate = _filtered(drawn, cells.labels, filters, noise**2)
    return Detailed(estimate, cells.labels, cells.energy)


@dataclass(frozen=True, slots=True, eq=False)
class _Cells:
    """Cells of the patches of an image: (H, W) label of the patch around each pixel, and their energy."""

    labels: NDArray[np.int32]
    energy: float

    @classmethod
    def of(cls, image: Floats, n_generators: int, effort: EffortName, rng: np.random.Generator) -> _Cells:
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
    """Mean patch of each cell, (K, P), and the axes, (K, P, P), and variances, (K, P), of what differs from it."""

    means: Floats
    axes: Floats
    variances: NDArray[np.float64]


def _filters(image: Floats, variance: Floats, labels: NDArray[np.int32], n_cells: int) -> _Filters:
    """Measure the cells of a noisy image, and subtract the variance of the noise from theirs."""
    from scipy.ndimage import uniform_filter

    size = image.shape[2] * _SIDE**2
    counts, noise = np.zeros(n_cells), np.zeros(n_cells)
    sums, squares = np.zeros((n_cells, size)), np.zeros((n_cells, size, size))
    patch_variance = uniform_filter(variance, _SIDE, mode="reflect")
    for rows, patches in _chunks(image):
        for cell, members in _members(labels[rows].ravel()):
            inside = patches[members]
            counts[cell] += len(members)
            noise[cell] += patch_variance[rows].ravel()[members].sum()
            sums[cell] += inside.sum(axis=0, dtype=np.float64)
            squares[cell] += inside.T @ inside
    masses = np.maximum(counts, 1)
    means = sums / masses[:, None]
    covariances = squares / masses[:, None, None] - means[:, :, None] * means[:, None, :]
    variances, axes = np.linalg.eigh(covariances)
    left = np.maximum(variances - (noise / masses)[:, None], 0)
    return _Filters(means.astype(np.float32), axes.astype(np.float32), left)


def _filtered(image: Floats, labels: NDArray[np.int32], filters: _Filters, variance: float) -> Floats:
    """Filter the patches of an image by cell, and assemble the image.

    Patches are weighted by the inverse of the variance that their filter leaves.
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
    """(H, W, C, 5, 5) patches around all pixels; only the borders are copied."""
    padded = np.pad(image, ((_REACH, _REACH), (_REACH, _REACH), (0, 0)), mode="symmetric")
    return np.lib.stride_tricks.sliding_window_view(padded, (_SIDE, _SIDE), axis=(0, 1))


def _chunks(image: Floats) -> Iterator[tuple[slice, Floats]]:
    """Yield bands of rows and a copy of their (N, P) patches."""
    windows = _windows(image)
    height, width = image.shape[:2]
    step = max(1, _CHUNK // width)
    for top in range(0, height, step):
        rows = slice(top, min(top + step, height))
        yield rows, windows[rows].reshape((rows.stop - top) * width, -1)


def _members(labels: NDArray[np.int32]) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Yield each label that occurs, and where."""
    order = np.argsort(labels, kind="stable")
    cells, starts = np.unique(labels[order], return_index=True)
    for cell, members in zip(cells, np.split(order, starts[1:]), strict=True):
        yield int(cell), members

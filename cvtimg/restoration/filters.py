"""One Wiener filter for each group of patches, and the image that the filtered patches make.

What a patch differs by from the mean of its group is signal and noise; the covariance of the group tells how much of
each direction is signal. P. Chatterjee and P. Milanfar, IEEE Trans. Image Processing 21 (2012) 1635-1649, doi
10.1109/TIP.2011.2172799.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.progress import each
from cvtimg._shared.threads import in_parts, side_by_side
from cvtimg.restoration import _patches
from cvtimg.restoration.patches import REACH, SIDE, Groups, windows
from cvtimg.restoration.spectrum import SharedNoise
from cvtimg.restoration.versions import Floats

_Doubles = NDArray[np.float64]

#: Covariances of a thread in memory at once.
_CHUNK = 64
#: The estimate has lost some detail, so its covariances are raised by this.
_GAIN = 1.1
#: So often, power of this many times that of the noise is halved in the covariance of noisy patches; and more where
#: patches are few, because their noise is uneven.
_BENDS, _BENT, _UNEVENLY = 2, 1.2, 0.7
#: Added to the variance that a filter leaves, as a share of that of the noise: no patch is trusted without limit.
_LEFT_ANYWAY = 0.02
#: Every covariance has this share of the variance of noise in all directions, so that its inverse exists, and this part
#: of its trace, so that float32 is precise enough.
_RIDGE, _PRECISE = 1e-4, 1e-7
#: Filters are applied this often, each time to an image whose noisier pixels are drawn to the last; and once where all
#: but this share of the pixels are known to within this factor of the usual precision.
_ROUNDS, _UNEVEN, _EVEN = 2, 0.02, 0.5
#: Filters of so many blocks are kept for another round.
_KEPT = 4
#: Unknown pixels, filled from nearby, are taken to have this times less precision than those known around them.
_FILLED = 0.4
#: Side, in pixels, of the windows in which the usual precision is found.
_NEAR = 15
#: Pixels known better than the mean of their group by more than this factor would make rounds diverge.
_LARGEST_STEP = 1.9


@dataclass(frozen=True, slots=True, eq=False)
class Noisy:
    """A noisy image, what it is taken to be, and how well its pixels are known; with a border of `REACH` pixels."""

    #: (H + 4, W + 4, C): the noisy image, anything where nothing is known, and an estimate of it without noise
    values: Floats
    estimate: Floats
    precision: Floats  # (H + 4, W + 4): 1 / variance of the noise of each pixel; 0 where nothing is known
    shared: SharedNoise | None = None  # what pixels share of their noise; None where it is white

    @property
    def usual_variance(self) -> float:
        """Variance of the noise at the mean precision of known pixels."""
        n_known = np.count_nonzero(self.precision)
        return n_known / max(float(self.precision.sum(dtype=np.float64)), 1e-30)

    def part(self, block: PatchBlock) -> Noisy:
        """Return a block with its own border."""
        here = _with_border(block)
        values, estimate, precision = (
            np.ascontiguousarray(image[here]) for image in (self.values, self.estimate, self.precision)
        )
        return Noisy(values, estimate, precision, self.shared)

    def bands(self, chosen: slice) -> Noisy:
        """Return some of the bands."""
        values, estimate = (np.ascontiguousarray(image[:, :, chosen]) for image in (self.values, self.estimate))
        return Noisy(values, estimate, self.precision, self.shared and self.shared.of_bands(chosen))


@dataclass(frozen=True, slots=True, eq=False)
class PatchBlock:
    """A part of an image, as rows and columns, and groups of the patches around its pixels."""

    rows: slice
    columns: slice
    groups: Groups


def filtered(noisy: Noisy, blocks: Sequence[PatchBlock], from_estimate: bool) -> Floats:
    """(H, W, C) image, from patches filtered by group, of blocks that do not overlap."""
    # Patches reach from block to block: a pixel is the mean of all patches that contain it, whichever block they are
    # of. Covariances are those of patches of the estimate, or else those of the noisy patches less the noise.
    estimate = noisy.estimate
    usual = noisy.usual_variance
    rounds = 1 if np.mean(noisy.precision < _EVEN / usual) <= _UNEVEN else _ROUNDS

    def filtering_of(block: PatchBlock) -> _Filtering:
        return _Filtering.of(noisy.part(block), block, from_estimate, usual)

    # The filters of a large image are made again for each round: together they would fill the memory.
    kept = list(side_by_side(filtering_of, blocks)) if rounds > 1 and len(blocks) <= _KEPT else []
    for _ in each(range(rounds)):
        # Noisier pixels are drawn toward the estimate until all are as good as their group: the fixed point is that of
        # a filter that weights each pixel by its own noise.
        change = noisy.precision[:, :, None] * (noisy.values - estimate)
        total = np.zeros_like(estimate)
        weight = np.zeros_like(noisy.precision)

        def sums_of(number: int, estimate: Floats = estimate, change: Floats = change) -> tuple[Floats, Floats]:
            return (kept[number] if kept else filtering_of(blocks[number])).sums(estimate, change)

        for block, (sums, weights) in zip(each(blocks), side_by_side(sums_of, range(len(blocks))), strict=True):
            total[_with_border(block)] += sums
            weight[_with_border(block)] += weights
        inner = slice(REACH, -REACH)
        joined = total[inner, inner] / weight[inner, inner, None]
        estimate = estimate.copy()
        estimate[inner, inner] = joined
    return joined


@dataclass(frozen=True, slots=True, eq=False)
class _Filtering:
    """A block with its filters, the variances of the noise in its groups, and the (G, 25) weight of their pixels."""

    block: PatchBlock
    filters: _Filters
    variances: _Doubles
    trust: Floats

    @classmethod
    def of(cls, part: Noisy, block: PatchBlock, from_estimate: bool, usual: float) -> _Filtering:
        """Make the filters of a block from its part of an image."""
        variances = _variances(part.precision, block.groups, usual)
        filters = _Filters.of(part, block.groups, variances, from_estimate)
        # Weighted by the inverse of the variance that the filters leave, relative to that of all.
        trust = usual / variances[:, None] / (filters.left() + _LEFT_ANYWAY)
        return cls(block, filters, variances, trust.astype(np.float32))

    def sums(self, estimate: Floats, change: Floats) -> tuple[Floats, Floats]:
        """Weighted sums of the filtered patches, and their weights, in the block and its border."""
        here = _with_border(self.block)
        groups, shape = self.block.groups, (self.block.rows, self.block.columns)
        height, width = (side.stop - side.start for side in shape)
        own_estimate, own_change = np.ascontiguousarray(estimate[here]), np.ascontiguousarray(change[here])
        patches = self.filters.applied(own_estimate, own_change, groups, self.variances)
        group_of = groups.of_pixels().reshape(height, width)
        sums, weights = np.empty_like(own_estimate), np.empty(own_estimate.shape[:2], np.float32)

        def join(first: int, last: int) -> None:
            _patches.join_patches(patches, group_of, self.trust, sums, weights, first, last)

        in_parts(join, len(sums), work=patches.size)
        return sums, weights


def _with_border(block: PatchBlock) -> tuple[slice, slice]:
    """Return where a block and its border lie in an image with a border."""
    rows, columns = block.rows, block.columns
    return slice(rows.start, rows.stop + 2 * REACH), slice(columns.start, columns.stop + 2 * REACH)


def _variances(precision: Floats, groups: Groups, usual: float) -> _Doubles:
    """(G,) variance of the noise in the patches of each group: that of the mean precision of known pixels."""
    from scipy.ndimage import maximum_filter, uniform_filter

    def around(image: Floats) -> Floats:
        return image[REACH:-REACH, REACH:-REACH].ravel()

    n_known = groups.sums(around(uniform_filter((precision > 0).astype(np.float32), SIDE)))
    total = groups.sums(around(uniform_filter(precision, SIDE)))
    best = np.maximum.reduceat(around(maximum_filter(precision, SIDE))[groups.order], groups.bounds[:-1])
    variances = np.divide(n_known, total, out=np.full(len(groups), usual), where=total > 1e-6 / usual)
    return np.minimum(variances, _LARGEST_STEP / np.maximum(best.astype(np.float64), 1e-30))


@dataclass(frozen=True, slots=True, eq=False)
class _Filters:
    """The (G, P) mean patch and the (G, P, R) filter of each group; columns from P on are 0."""

    means: Floats
    matrices: Floats
    shared: _Doubles | None  # (P, P): covariance of the noise, of mean variance 1; None where it is white

    @classmethod
    def of(cls, noisy: Noisy, groups: Groups, variances: _Doubles, from_estimate: bool) -> _Filters:
        known = noisy.precision[:, :, None] > 0
        image = noisy.estimate if from_estimate else np.where(known, noisy.values, noisy.estimate)
        image = np.ascontiguousarray(image, np.float32)
        size = SIDE**2 * image.shape[2]
        columns = -(-size // 16) * 16
        means, matrices = np.empty((len(groups), size), np.float32), np.empty((len(groups), size, columns), np.float32)
        noise = None if from_estimate else _noise_by_place(noisy.precision, groups, image.shape[2])
        shared = None if noisy.shared is None else noisy.shared.of_patches(SIDE)
        factor = None if shared is None else np.asarray(np.linalg.cholesky(shared), np.float64)

        def make(first: int, last: int) -> None:
            for start in range(first, last, _CHUNK):
                stop = min(start + _CHUNK, last)
                here = slice(start, stop)
                padded = np.empty((stop - start, columns, columns), np.float32)
                covariances = padded[:, :size, :size]
                _patches.measure_groups(image, groups.order, groups.bounds, means, padded, start, stop)
                if factor is not None:
                    covariances[:] = _whitened(covariances, factor)
                if noise is None:
                    covariances *= _GAIN
                else:
                    _lessen_noise(padded, noise[here], variances[here], groups.sizes[here])
                diagonal = np.einsum("gii->gi", covariances)
                diagonal += np.maximum(_RIDGE * variances[here], _PRECISE * diagonal.sum(axis=1))[:, None]
                _patches.make_filters(padded, variances, matrices, start, stop)
                _pass_singular(matrices[here])
                if factor is not None:
                    _unwhiten(matrices[here, :, :size], factor)

        in_parts(make, len(groups), work=float(groups.sizes.sum()) * size**2 / 16 + len(groups) * size**3 / 8)
        return cls(means, matrices, shared)

    def left(self) -> Floats:
        """(G, 25) variance that remains at each place of a patch, as a share of that of the noise."""
        size = self.means.shape[1]
        matrices = self.matrices[:, :, :size]
        if self.shared is None:
            diagonal = np.einsum("gii->gi", matrices)
        else:
            diagonal = np.einsum("gij,ij->gj", matrices, self.shared.astype(np.float32))
        return diagonal.reshape(len(diagonal), SIDE**2, -1).mean(axis=2)

    def applied(self, image: Floats, change: Floats, groups: Groups, steps: _Doubles) -> Floats:
        """(N, P) filtered patches of the image plus `steps` of each group times the change."""
        size = self.means.shape[1]
        patches = np.empty((len(groups.order), size), np.float32)
        order, bounds = groups.order, groups.bounds

        def apply(first: int, last: int) -> None:
            _patches.filter_groups(image, change, steps, order, bounds, self.means, self.matrices, patches, first, last)

        in_parts(apply, len(groups), work=len(patches) * size**2 / 16)
        return patches


def _pass_singular(filters: Floats) -> None:
    """Let everything pass where noise is so far below what is shown that float32 cannot invert a covariance."""
    singular = ~np.isfinite(filters.sum(axis=(1, 2)))
    filters[singular] = np.eye(*filters.shape[1:], dtype=np.float32)


def _whitened(covariances: Floats, factor: _Doubles) -> _Doubles:
    """Covariances of patches divided by the factor, which white noise is multiplied by to become theirs."""
    whiten = np.linalg.inv(factor)
    return np.asarray(whiten @ covariances @ whiten.T)


def _unwhiten(filters: Floats, factor: _Doubles) -> None:
    """Turn filters of patches divided by the factor into filters of patches; both multiply rows from the right."""
    whiten = np.linalg.inv(factor).astype(np.float32)
    filters[:] = whiten.T @ filters @ factor.T.astype(np.float32)


def _noise_by_place(precision: Floats, groups: Groups, n_bands: int) -> _Doubles:
    """(G, P) variance of the noise at each place of the patches of each group."""
    from scipy.ndimage import uniform_filter

    usual = uniform_filter((precision > 0).astype(np.float32), _NEAR)
    near = uniform_filter(precision, _NEAR)
    anywhere = precision.mean() / max((precision > 0).mean(), 1e-30)
    least = np.divide(near, usual, out=np.full_like(near, anywhere), where=usual > 1e-3)
    variance = 1 / np.maximum(precision, _FILLED * np.maximum(least, 1e-3 * anywhere))
    patches = windows(variance[:, :, None]).reshape(len(groups.order), -1)
    return np.repeat(groups.sums(patches) / groups.sizes[:, None], n_bands, axis=1)


def _lessen_noise(covariances: Floats, noise: _Doubles, variances: _Doubles, sizes: NDArray[np.int64]) -> None:
    """Turn (G, R, R) covariances of noisy patches, 0 from P on, into those of what they show."""
    # A direction of power p keeps p^2 / (p + b): about p - b where it is strong, and little where it is noise alone.
    # That is p less b times a Wiener filter for noise of variance b, so that no eigenvalues are needed.
    size = noise.shape[1]
    diagonal = np.einsum("gii->gi", covariances)[:, :size]
    diagonal += variances[:, None] - noise + _PRECISE * diagonal.sum(axis=1, keepdims=True)
    bends = _BENT * variances * (1 + _UNEVENLY * np.sqrt(size / sizes))
    filters = np.empty_like(covariances[:, :size])
    for _ in range(_BENDS):
        _patches.make_filters(covariances.copy(), bends, filters, 0, len(filters))
        _pass_singular(filters)
        covariances[:, :size] -= bends[:, None, None].astype(np.float32) * filters

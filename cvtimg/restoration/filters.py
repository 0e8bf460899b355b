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
from cvtimg.restoration.noise import SharedNoise
from cvtimg.restoration.patches import REACH, SIDE, Groups
from cvtimg.restoration.versions import Floats

_Doubles = NDArray[np.float64]
#: Every covariance has this part of its trace in all directions, so that float32 is precise enough.
_PRECISE = 1e-7
#: Covariances of the estimate, which has lost some detail, are raised by this factor.
_GAIN = 1.1
#: Twice, power of so many times that of the noise is halved in the covariance of noisy patches.
_BENT = 1.5
#: Added to the variance that a filter leaves, as a share of that of the noise: none is perfect.
_LEFT = 0.02
#: Share of the variance of noise that every covariance has, so that it has an inverse.
_RIDGE = 1e-4
#: Filters are applied twice where more than this share of the pixels are known half as well as usual or worse; and kept
#: for that of so many blocks.
_UNEVEN, _KEPT = 0.02, 4
#: So many times may pixels be known better than the mean of their group; beyond 2, what they are drawn by would grow.
_STEP = 1.9


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
        images = self.values, self.estimate, self.precision
        values, estimate, precision = (np.ascontiguousarray(image[block.bordered]) for image in images)
        return Noisy(values, estimate, precision, self.shared)

    def bands(self, chosen: slice) -> Noisy:
        """Return some of the bands."""
        values, estimate = (np.ascontiguousarray(image[:, :, chosen]) for image in (self.values, self.estimate))
        own = np.eye(self.values.shape[2])[:, chosen]
        return Noisy(values, estimate, self.precision, self.shared and self.shared.along(own))


@dataclass(frozen=True, slots=True, eq=False)
class PatchBlock:
    """A part of an image, as rows and columns, and groups of the patches around its pixels."""

    rows: slice
    columns: slice
    groups: Groups

    @property
    def bordered(self) -> tuple[slice, slice]:
        """Where the block and its border lie in an image with a border."""
        rows, columns = (slice(side.start, side.stop + 2 * REACH) for side in (self.rows, self.columns))
        return rows, columns


def filtered(noisy: Noisy, blocks: Sequence[PatchBlock], from_estimate: bool) -> Floats:
    """(H, W, C) image, from patches filtered by group, of blocks that do not overlap."""
    # Patches reach from block to block: a pixel is the mean of all patches that contain it, whichever block they are
    # of. Covariances are those of patches of the estimate, or else those of the noisy patches less the noise.
    usual, estimate, inner = noisy.usual_variance, noisy.estimate.copy(), slice(REACH, -REACH)
    rounds = 2 if np.mean(noisy.precision < 0.5 / usual) > _UNEVEN else 1

    def filters_of(block: PatchBlock) -> _Filters:
        return _Filters.of(noisy.part(block), block, from_estimate, usual)

    # The filters of a large image are made again for each round: together they would fill the memory.
    kept = list(side_by_side(filters_of, blocks)) if rounds > 1 and len(blocks) <= _KEPT else []
    for _ in each(range(rounds)):
        # Noisier pixels are drawn toward the estimate until all are as good as their group: the fixed point is that of
        # a filter that weights each pixel by its own noise.
        change = noisy.precision[:, :, None] * (noisy.values - estimate)
        total, weight = np.zeros_like(estimate), np.zeros_like(noisy.precision)

        def sums_of(number: int, estimate: Floats = estimate, change: Floats = change) -> tuple[Floats, Floats]:
            return (kept[number] if kept else filters_of(blocks[number])).sums(estimate, change)

        for block, (sums, weights) in zip(each(blocks), side_by_side(sums_of, range(len(blocks))), strict=True):
            total[block.bordered] += sums
            weight[block.bordered] += weights
        estimate[inner, inner] = total[inner, inner] / weight[inner, inner, None]
    return estimate[inner, inner]


@dataclass(frozen=True, slots=True, eq=False)
class _Filters:
    """A block with the filters of its groups."""

    block: PatchBlock
    means: Floats  # (G, P): mean patches
    matrices: Floats  # (G, P, P): filters
    variances: _Doubles  # (G,): of the noise
    trust: Floats  # (G, 25): weight of the pixels of filtered patches

    @classmethod
    def of(cls, noisy: Noisy, block: PatchBlock, from_estimate: bool, usual: float) -> _Filters:
        """Make the filters of a block from its part of an image."""
        groups, variances = block.groups, _variances(noisy.precision, block.groups, usual)
        known = noisy.precision[:, :, None] > 0
        image = noisy.estimate if from_estimate else np.where(known, noisy.values, noisy.estimate)
        size = SIDE**2 * image.shape[2]
        means, matrices = np.empty((len(groups), size), np.float32), np.empty((len(groups), size, size), np.float32)
        shared = noisy.shared.of_patches(SIDE) if noisy.shared else np.eye(size)
        # White noise times the factor is that of patches; these are divided by it, filtered, and multiplied again.
        factor = np.linalg.cholesky(shared)
        whiten = np.linalg.inv(factor)

        def make(first: int, last: int, chunk: int = 64) -> None:
            for start in range(first, last, chunk):
                stop = min(start + chunk, last)
                here = slice(start, stop)
                _patches.measure_groups(image, groups.order, groups.bounds, means, matrices, start, stop)
                covariances, variance = matrices[here], variances[here]
                if noisy.shared:
                    covariances[:] = whiten @ covariances @ whiten.T
                if from_estimate:
                    covariances *= _GAIN
                else:
                    _lessen_noise(covariances, variance)
                diagonal = np.einsum("gii->gi", covariances)
                diagonal += np.maximum(_RIDGE * variance, _PRECISE * diagonal.sum(axis=1))[:, None]
                _patches.make_filters(covariances, variance)
                if noisy.shared:
                    covariances[:] = whiten.T @ covariances @ factor.T

        in_parts(make, len(groups), work=float(groups.sizes.sum()) * size**2 / 16 + len(groups) * size**3 / 8)
        # The variance that remains at each place of a patch, as a share of that of the noise.
        left = np.einsum("gij,ij->gj", matrices, np.float32(shared)).reshape(len(groups), SIDE**2, -1).mean(axis=2)
        trust = usual / variances[:, None] / (left + _LEFT)
        return cls(block, means, matrices, variances, trust.astype(np.float32))

    def sums(self, estimate: Floats, change: Floats) -> tuple[Floats, Floats]:
        """Weighted sums of the filtered patches, and their weights, in the block and its border."""
        groups, size = self.block.groups, self.means.shape[1]
        image, own_change = (np.ascontiguousarray(one[self.block.bordered]) for one in (estimate, change))
        patches = np.empty((len(groups.order), size), np.float32)
        height, width = (side - 2 * REACH for side in image.shape[:2])
        group_of = groups.of_pixels().reshape(height, width)
        sums, weights = np.empty_like(image), np.empty(image.shape[:2], np.float32)
        about = groups.order, groups.bounds, self.means, self.matrices

        def apply(first: int, last: int) -> None:
            _patches.filter_groups(image, own_change, self.variances, *about, patches, first, last)

        def join(first: int, last: int) -> None:
            _patches.join_patches(patches, group_of, self.trust, sums, weights, first, last)

        in_parts(apply, len(groups), work=len(patches) * size**2 / 16)
        in_parts(join, len(sums), work=patches.size)
        return sums, weights


def _variances(precision: Floats, groups: Groups, usual: float) -> _Doubles:
    """(G,) variance of the noise in the patches of each group: that of the mean precision of known pixels."""
    from scipy.ndimage import maximum_filter, uniform_filter

    def around(image: Floats) -> Floats:
        return image[REACH:-REACH, REACH:-REACH].ravel()

    n_known = groups.sums(around(uniform_filter((precision > 0).astype(np.float32), SIDE)))
    total = groups.sums(around(uniform_filter(precision, SIDE)))
    best = np.maximum.reduceat(around(maximum_filter(precision, SIDE))[groups.order], groups.bounds[:-1])
    variances = np.divide(n_known, total, out=np.full(len(groups), usual), where=total > 1e-6 / usual)
    return np.minimum(variances, _STEP / np.maximum(best.astype(np.float64), 1e-30))


def _lessen_noise(covariances: Floats, variances: _Doubles) -> None:
    """Turn (G, P, P) covariances of noisy patches into those of what they show."""
    # A direction of power p keeps p^2 / (p + b): about p - b where it is strong, and little where it is noise alone.
    # That is p less b times a Wiener filter for noise of variance b, so that no eigenvalues are needed.
    bends = _BENT * variances
    for _ in range(2):
        filters = covariances.copy()
        _patches.make_filters(filters, bends)
        covariances -= bends[:, None, None].astype(np.float32) * filters

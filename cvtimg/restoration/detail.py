"""Detail, for photographs: groups of patches instead of cells of colors, and one Wiener filter for each group.

A photograph has many colors but few kinds of patches: flat areas, edges in each direction, each texture. The patches
around all pixels are tessellated by their main components, and each cell is cut in two, across its main axis, until
groups are small. Groups are small enough for one covariance to describe all patches in them: what a patch differs by
from the mean of its group is signal and noise, and the covariance tells how much of each direction is signal.
P. Chatterjee and P. Milanfar, IEEE Trans. Image Processing 21 (2012) 1635-1649, doi 10.1109/TIP.2011.2172799.

Each pass compares the patches of the last estimate, so groups become purer and can be smaller. The first pass takes
covariances from the noisy patches; later ones from the estimate, as an oracle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise, product, starmap
from typing import Any

import numpy as np
from scipy.fft import dct
from scipy.ndimage import gaussian_filter, uniform_filter
from scipy.special import ndtr

import cvtimg.restoration._patches as _patches
from cvtimg._shared.choices import AutoEffortName, EffortName
from cvtimg._shared.progress import each, part
from cvtimg._shared.threads import in_parts, in_stripes, side_by_side
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Ints, Ints64
from cvtimg.engine.points import assign, pack
from cvtimg.engine.seeding import TooFewSamplesError
from cvtimg.engine.tessellation import Tessellation, tessellate
from cvtimg.restoration.alignment import moved
from cvtimg.restoration.evidence import Evidence
from cvtimg.restoration.noise import SharedNoise
from cvtimg.restoration.versions import Clipped, Versions, fill, fuse

#: Patches are 5 x 5 pixels.
REACH = 2
SIDE = 2 * REACH + 1

#: Patches, at least, from which principal components are found: time grows with them.
_N_SAMPLES = 1 << 14
#: Ratio of the noise of bands up to which it is taken for equal, and bands are not scaled by what is chance.
_EQUAL = 1.25
#: Times that opponent colors count, beside lightness: they vary less, so noise hides less of what differs.
_CHROMA = 2
#: Factor of covariances of the estimate, which has lost some detail: more keeps detail, and noise.
_GAIN = 1.1
#: Times the power of the noise that is halved, twice, in the covariance of noisy patches: more takes more away.
_BENT = 1.5
#: Share of the variance of the noise added to what a filter leaves, as none is perfect: more evens weights out.
_LEFT = 0.02
#: Share of its mean variance that shared noise has in any direction of a patch, so that its covariance has an inverse.
_ANYWHERE = 0.01
#: Precision of unknown pixels, filled from nearby, as a part of the usual one.
_FILLED = 0.4
#: Filters are applied twice where more than this share of the pixels are known half as well as usual or worse; and kept
#: for that number of blocks.
_UNEVEN, _KEPT = 0.02, 4
#: Factor by which pixels may be known better than the mean of their group; beyond 2, what they are drawn by would grow.
_STEP = 1.9
#: Largest number of patches in a group, pass by pass; and of pixels for which passes are affordable: one over a
#: megapixel takes some seconds.
_PASSES = {"fast": (800, 80), "balanced": (600, 150, 80, 60), "best": (600, 150, 80, 60, 60)}
_AFFORDABLE: dict[EffortName, int] = {"best": 1 << 18, "balanced": 1 << 22}
#: Kinds of patches, before they are cut into groups: time grows with them.
_KINDS = 32
#: Pixels of blur of the first estimate of an image: more takes away noise and detail.
_BLUR = 0.7
#: Standard deviations of noise by which an estimate may be beside what is seen: one pixel in 400 is, by chance.
_FAR = 3.0
#: Pixels along the longest side of the blocks in which patches are grouped, each by a thread: memory grows with them.
_BLOCK = 256
#: Standard deviations of the noise that patches a pixel apart differ by: more groups near ones, which are alike.
_PLACE = 0.24
#: Pass from which on versions that were moved keep their own pixels; the last in any case.
_OWN = 3
#: Pixels of blur with which these are compared with the first; how often what is not noise counts, so that more leaves
#: out more of what has moved; and variances of noise from which on it surely is none.
_NEAR, _STRICT, _SURE = 1.5, 48.0, 1.5


def denoised(evidence: Evidence, effort: AutoEffortName, rng: np.random.Generator) -> tuple[Floats32, Versions]:
    """(H, W, C) image of versions of one look, or of a single one, by groups of patches; also return what was used."""
    versions, trust, suspicion = evidence.versions, evidence.trust, evidence.suspicion
    fused, _ = fuse(versions, trust)
    if not evidence.noise.is_seen and (versions.coverage > 0).all():
        return fused, versions
    n_pixels = versions.coverage.size
    passes = passes_of(effort, n_pixels)
    variance = max(min(evidence.variances(versions)), versions.rounding**2 / 12)
    kept = suspicion.first_kept(versions, fused) if suspicion else versions
    del fused  # of large images each takes much memory
    values, weights = fuse(kept, trust)
    estimate = gaussian_filter(values, _BLUR, axes=(0, 1))
    axes = Axes.of(evidence.noise.bands, estimate)
    # Holes are filled first, by passes in which known pixels count as a blur tells of them: else little would change.
    filling, most = passes[: len(passes) // 2] if np.min(weights) == 0 else (), np.float32(np.inf)
    if filling:
        most = np.float32(weights.sum() / max((weights * np.square(values - estimate).mean(axis=2)).sum(), 1e-30))
    # Groups are what matters: the kinds that they are cut from need no better estimate.
    with part(0, 0):  # it takes little of the time
        kinds = Kinds.of(axes.looks(with_border(axes.along(estimate))), min(_KINDS, n_pixels), rng)
    for number, largest in each(list(enumerate(filling + passes, -len(filling)))):
        if suspicion and number > -len(filling):
            kept = suspicion.kept(versions, estimate)
        is_late = number >= min(_OWN, len(passes) - 1)
        values, weights = _fused(kept, evidence, variance, estimate, own=is_late)
        precision = np.minimum(weights / np.float32(variance), most if number < 0 else np.inf)
        seen, smooth = (with_border(axes.along(bands)) for bands in (values, estimate))
        shared = evidence.noise.shared and evidence.noise.shared.along(axes.matrix)
        noisy = Noisy(seen, smooth, with_border(precision[:, :, None])[:, :, 0], shared)
        image = _pass(noisy, axes, kinds, largest, from_estimate=number not in {0, -len(filling)})
        even = np.maximum(versions.noisiness(estimate), np.float32(1))  # lights may seem noisy
        estimate = matmul(_within_noise(image, noisy, even), np.linalg.inv(axes.matrix).astype(np.float32))
    if not evidence.noise.is_seen:
        estimate = np.where((weights > 0)[:, :, None], values, estimate)
    return estimate, kept


def passes_of(effort: AutoEffortName, n_pixels: int) -> tuple[int, ...]:
    """Return the largest number of patches in a group in each of the passes over an image."""
    affordable = next((name for name, most in _AFFORDABLE.items() if n_pixels <= most), "fast")
    return _PASSES[affordable if effort == "auto" else effort]


def _pass(noisy: Noisy, axes: Axes, kinds: Kinds, largest: int, from_estimate: bool) -> Floats32:
    """Group the patches of each block, and filter the groups of all blocks."""
    height, width = (side - 2 * REACH for side in noisy.precision.shape)
    near = np.float32(_PLACE * np.sqrt(noisy.usual_variance))

    def grouped(at: tuple[slice, slice]) -> Groups:
        rows, columns = at
        seen = noisy.estimate[rows.start : rows.stop + 2 * REACH, columns.start : columns.stop + 2 * REACH]
        features = kinds.features(axes.looks(seen))
        places = near * np.indices((rows.stop - rows.start, columns.stop - columns.start)).reshape(2, -1).T
        around = np.concatenate([features, places], axis=1, dtype=np.float32)
        return Groups(rows, columns, *group_patches(around, kinds.label(features), largest))

    places = list(product(_parts(height), _parts(width)))
    with part(0, 0.2):
        blocks = [block for _, block in zip(each(places), side_by_side(grouped, places), strict=True)]
    with part(0.2, 1):
        images = [filtered(noisy.bands(bands), blocks, from_estimate) for bands in each(axes.slices)]
    return np.concatenate(images, axis=2)


def _within_noise(image: Floats32, noisy: Noisy, even: Floats32) -> Floats32:
    """(H, W, C) image, no further from the noisy one, over pixels and windows, than noise has that, but by chance."""
    # Filters lower small lights, which are unlike all else.
    values, precision = (band[REACH:-REACH, REACH:-REACH] for band in (noisy.values, noisy.precision))
    with np.errstate(divide="ignore"):  # where nothing is known
        most = _FAR / np.sqrt(even * precision)[:, :, None]
    for side in (1,) if noisy.shared else (3, 1):
        apart = uniform_filter(np.where(np.isfinite(most), image - values, 0), (side, side, 0))
        image = image - (apart - np.clip(apart, -most / side, most / side))
    return image


def _parts(side: int) -> list[slice]:
    """Cut a side into equal parts."""
    n_parts = -(-side // _BLOCK)
    return list(starmap(slice, pairwise(side * number // n_parts for number in range(n_parts + 1))))


def _fused(
    versions: Versions, evidence: Evidence, variance: float, estimate: Floats32, *, own: bool
) -> tuple[Floats32, Floats32]:
    """Fuse versions with what an estimate of what they show tells of each: (H, W, C) values, and (H, W) weights."""
    # Clipped values follow the true ones less than others do, and are less noisy: both is undone about the estimate.
    # Of versions that were moved by fractions of a pixel, `own` takes the pixels as they were; and they count less
    # where they differ from the first by more than noise: that is finer than the pixels, or has moved by itself.
    white, source, ends_of_first = versions.white, evidence.given, (False, False)
    total, weights = np.zeros_like(estimate), np.zeros(estimate.shape[:2], np.float32)
    first, first_known, spread = versions.bands(0), versions.known[:, :, 0], versions.noisiness(estimate)
    for version, share in enumerate(evidence.trust.astype(np.float32)):
        known, values = versions.known[:, :, version], versions.bands(version) if version else first
        is_moved = version > 0 and evidence.aligned
        if is_moved and own:
            transform = evidence.alignment.transforms[version]
            values, seen = moved(source.bands(version), source.known[:, :, version], transform, estimate)
            known = known & seen
        weight = known * share / spread
        if is_moved:
            noise = variance * (1 / share + 1 / evidence.trust[0])
            both = known & first_known
            apart = gaussian_filter(both * np.square(values - first).mean(axis=2), _NEAR)
            near = np.maximum(gaussian_filter(both.astype(np.float32), _NEAR), np.float32(1e-3))
            excess = np.maximum(apart / near - noise, 0)
            # The variance of noise, as a part of that and of what is not noise.
            weight *= noise / (noise + _STRICT * excess**2 / (excess + _SURE * noise))
        if white is not None:
            sigma = np.sqrt(np.float32(variance / share) * spread)[:, :, None]
            ends = clipped_ends(values, known[:, :, None], estimate, sigma, white)
            # Versions that were moved by fractions of a pixel hide where they were clipped; the first is never moved.
            ends_of_first = ends_of_first if version else ends
            values = _unclipped(values, weight, estimate, sigma, white, tuple(map(max, ends, ends_of_first)))
        total += weight[:, :, None] * np.where(known[:, :, None], values, 0)
        weights += weight
    return fill(total, weights), weights


def _unclipped(
    values: Floats32, weight: Floats32, true: Floats32, sigma: Floats32, white: float, ends: tuple[bool, ...]
) -> Floats32:
    """Return values as they were before they were clipped at some ends; their weights are overwritten."""

    def part(rows: slice) -> Floats32:
        clipped, near = Clipped.of(true[rows], sigma[rows], white, ends), true[rows]
        weight[rows] /= (clipped.variance / clipped.slope**2).mean(axis=2)
        return near + (values[rows] - clipped.added - near) / clipped.slope

    return np.concatenate(in_stripes(part, len(true), work=64.0 * true.size)) if any(ends) else values


def clipped_ends(values: Floats32, known: Bools, true: Floats32, sigma: Floats32, white: float) -> tuple[bool, bool]:
    """Tell whether known values pile up at 0 and at `white` as Gaussian noise that is clipped there would."""

    def piles_up(end: float) -> bool:
        n_there = sum(in_stripes(lambda rows: np.count_nonzero((values[rows] == end) & known[rows]), len(true), work))

        def expected(rows: slice) -> float:
            away = np.abs(np.clip(true[rows], 0, white) - end) / sigma[rows]
            return float(ndtr(-away).sum(dtype=np.float64, where=known[rows]))

        return bool(n_there) and bool(n_there >= sum(in_stripes(expected, len(true), 16 * work)) / 2)

    work = 4.0 * true.size
    return piles_up(0.0), piles_up(white)


# --- patches, and groups of those that look alike


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """Axes along which the bands of an image have equal noise, at most a few of them at a time."""

    matrix: Floats  # (C, C): maps bands to axes
    slices: tuple[slice, ...]  # axes that are filtered together

    @classmethod
    def of(cls, noise_by_band: list[Floats], image: Floats32, most: int = 4) -> Axes:
        """Give bands, (C,) in each version, equal noise; of more than `most`, put what they share first."""
        n_bands = image.shape[2]
        slices = tuple(slice(first, first + most) for first in range(0, n_bands, most))
        noise = np.stack(noise_by_band)
        least = np.maximum(np.nanmean(noise, axis=0) if np.isfinite(noise).any() else np.ones(n_bands), 1e-30)
        equal = least.max() <= _EQUAL * least.min()
        scales = np.ones(n_bands) if equal else np.sqrt(np.mean(least**2)) / least
        rows = image.reshape(-1, n_bands)[:: max(1, image.size // (n_bands * _N_SAMPLES))] * scales
        turned = np.linalg.eigh(np.cov(rows.T))[1][:, ::-1] if len(slices) > 1 else np.eye(n_bands)
        return cls(scales[:, None] * turned, slices)

    def along(self, image: Floats32) -> Floats32:
        """(H, W, C) image, by axes."""
        return matmul(image, self.matrix.astype(np.float32))

    def looks(self, image: Floats32) -> Floats32:
        """(H, W, D) what patches are compared by: opponent colors of three bands, or the first axes."""
        if image.shape[2] != 3:
            return image[:, :, self.slices[0]]
        # Cosines of three bands are lightness, red against blue, and green against both.
        return matmul(image, (dct(np.eye(3), norm="ortho") * [1, _CHROMA, _CHROMA]).astype(np.float32))


def cells_of(rows: Array, most: int, **how: Any) -> Tessellation:
    """Tessellate rows, which may have fewer different values than cells: then each has its own."""
    try:
        return tessellate(rows, most, **how)
    except TooFewSamplesError as error:  # to count them first would take time, and rounding makes some that are none
        return tessellate(rows, error.n_distinct, **how)


@dataclass(frozen=True, slots=True, eq=False)
class Kinds:
    """Cells of the patches of an image."""

    mean: Floats32  # (P,): mean patch
    basis: Floats32  # (P, D): main components of the patches
    generators: Floats  # (K, D): kinds of patches, in these components

    @classmethod
    def of(cls, bordered: Floats32, n_generators: int, rng: np.random.Generator, n_components: int = 16) -> Kinds:
        """Find kinds of patches from some patches of an image with a border of `REACH` pixels."""
        patches = windows(bordered)
        n_pixels = patches.shape[0] * patches.shape[1]
        drawn = np.sort(rng.choice(n_pixels, min(n_pixels, max(_N_SAMPLES, 50 * n_generators)), replace=False))
        sample = patches[np.unravel_index(drawn, patches.shape[:2])].reshape(len(drawn), -1)
        mean = sample.mean(axis=0)
        sample = sample - mean
        _, axes = np.linalg.eigh(matmul(sample.T, sample).astype(np.float64))
        basis = axes[:, -n_components:].astype(np.float32)
        points = matmul(sample, basis)
        return cls(mean, basis, cells_of(points, n_generators, effort="fast", rng=rng).generators)

    def features(self, bordered: Floats32, chunk: int = 1 << 15) -> Floats32:
        """(N, D) features of the patches of an image with a border of `REACH` pixels, about `chunk` at a time."""
        patches = windows(bordered)

        def part(rows: slice) -> Floats32:
            return matmul(patches[rows].reshape(-1, len(self.mean)) - self.mean, self.basis)

        step = max(1, chunk // patches.shape[1])
        return np.concatenate(in_stripes(part, len(patches), work=float(patches.size * self.basis.shape[1]), n=step))

    def label(self, features: Floats32) -> Ints:
        """(N,) kind of each patch, from 0."""
        points = pack(features, np.ones(len(features)), center=np.zeros(features.shape[1]))
        return assign(points, points.frame.inward(self.generators))[: points.n_points]


@dataclass(frozen=True, slots=True, eq=False)
class Groups:
    """Groups of the patches around the pixels of a part of an image."""

    rows: slice
    columns: slice
    order: Ints  # (N,): pixels in the order of their groups
    bounds: Ints64  # (G + 1,): where each group begins

    def __len__(self) -> int:
        return len(self.bounds) - 1

    @property
    def sizes(self) -> Ints64:
        """(G,) number of patches of each group."""
        return np.diff(self.bounds)

    @property
    def bordered(self) -> tuple[slice, slice]:
        """Where the part and its border lie in an image with a border."""
        rows, columns = (slice(side.start, side.stop + 2 * REACH) for side in (self.rows, self.columns))
        return rows, columns


def group_patches(features: Floats32, labels: Ints, largest: int) -> tuple[Ints, Ints64]:
    """Cut cells, (N,) from 0, in two by features, (N, D), until no group has more than `largest` patches."""
    # Returned are the (N,) patches in the order of their groups, and (G + 1,) where each group begins.
    order = np.argsort(labels, kind="stable").astype(np.int32)
    bounds = np.flatnonzero(np.diff(labels[order], prepend=-1, append=-1)).astype(np.int64)
    while True:
        large = np.flatnonzero(np.diff(bounds) > largest)
        if not len(large):
            return order, bounds
        starts, stops, cuts = bounds[large], bounds[large + 1], np.empty(len(large), np.int64)
        halve = partial(_patches.halve_groups, features, order, starts, stops, cuts)
        in_parts(halve, len(large), work=float((stops - starts).sum()) * features.shape[1] ** 2 / 8)
        bounds = np.insert(bounds, large + 1, cuts)


def matmul(image: Floats32, matrix: Floats32) -> Floats32:
    """Multiply by a matrix, without warnings."""
    # NumPy's BLAS for 64-bit ARM computes in lanes that hold no numbers, and raises their flags of division by zero.
    with np.errstate(all="ignore"):
        return image @ matrix


def with_border(image: Floats32) -> Floats32:
    """Mirror the border of an image, so that there is a patch around each pixel."""
    return np.pad(image, ((REACH, REACH), (REACH, REACH), (0, 0)), mode="symmetric")


def windows(bordered: Floats32) -> Floats32:
    """(H, W, 5, 5, C) view of the patches of an (H + 4, W + 4, C) image."""
    seen = np.lib.stride_tricks.sliding_window_view(bordered, (SIDE, SIDE), axis=(0, 1))
    return np.moveaxis(seen, 2, 4)


# --- filters


@dataclass(frozen=True, slots=True, eq=False)
class Noisy:
    """A noisy image, what it is taken to be, and how well its pixels are known; with a border of `REACH` pixels."""

    #: (H + 4, W + 4, C): the noisy image, anything where nothing is known, and an estimate of it without noise
    values: Floats32
    estimate: Floats32
    precision: Floats32  # (H + 4, W + 4): 1 / variance of the noise of each pixel; 0 where nothing is known
    shared: SharedNoise | None = None  # what pixels share of their noise; None where it is white

    @property
    def usual_variance(self) -> float:
        """Variance of the noise at the mean precision of known pixels."""
        n_known = np.count_nonzero(self.precision)
        return n_known / max(float(self.precision.sum(dtype=np.float64)), 1e-30)

    def bands(self, chosen: slice) -> Noisy:
        """Return some of the bands."""
        values, estimate = (np.ascontiguousarray(image[:, :, chosen]) for image in (self.values, self.estimate))
        matrix = np.eye(self.values.shape[2])[:, chosen]
        return Noisy(values, estimate, self.precision, self.shared and self.shared.along(matrix))


def filtered(noisy: Noisy, blocks: Sequence[Groups], from_estimate: bool) -> Floats32:
    """(H, W, C) image, from patches filtered by group, of blocks that do not overlap."""
    # Patches reach from block to block: a pixel is the mean of all patches that contain it, whichever block they are
    # of. Covariances are those of patches of the estimate, or else those of the noisy patches less the noise.
    usual, estimate, inner = noisy.usual_variance, noisy.estimate.copy(), slice(REACH, -REACH)
    rounds = 2 if np.mean(noisy.precision < 0.5 / usual) > _UNEVEN else 1

    filters_of = partial(_Filters.of, noisy, from_estimate, usual)
    # The filters of a large image are made again for each round: together they would fill the memory.
    kept = list(side_by_side(filters_of, blocks)) if rounds > 1 and len(blocks) <= _KEPT else []
    for _ in each(range(rounds)):
        # Noisier pixels are drawn toward the estimate until all are as good as their group: the fixed point is that of
        # a filter that weights each pixel by its own noise.
        total, weight = np.zeros_like(estimate), np.zeros_like(noisy.precision)

        def sums_of(number: int, estimate: Floats32 = estimate) -> tuple[Floats32, Floats32]:
            return (kept[number] if kept else filters_of(blocks[number])).sums(noisy, estimate)

        for block, (sums, weights) in zip(each(blocks), side_by_side(sums_of, range(len(blocks))), strict=True):
            total[block.bordered] += sums
            weight[block.bordered] += weights
        estimate[inner, inner] = total[inner, inner] / weight[inner, inner, None]
    return estimate[inner, inner]


@dataclass(frozen=True, slots=True, eq=False)
class _Filters:
    """The filters of the groups of a block."""

    groups: Groups
    means: Floats32  # (G, P): mean patches
    matrices: Floats32  # (G, P, P): filters
    variances: Floats  # (G,): of the noise
    trust: Floats32  # (G, 25): weight of the pixels of filtered patches

    @classmethod
    def of(cls, noisy: Noisy, from_estimate: bool, usual: float, groups: Groups) -> _Filters:
        """Make the filters of a block of an image."""
        precision, image = noisy.precision[groups.bordered], np.ascontiguousarray(noisy.estimate[groups.bordered])
        variances = _variances(precision, groups, usual)
        if not from_estimate:
            image = np.where(precision[:, :, None] > 0, noisy.values[groups.bordered], image)
        size = SIDE**2 * image.shape[2]
        means, matrices = np.empty((len(groups), size), np.float32), np.empty((len(groups), size, size), np.float32)
        noise = None if from_estimate else _noise_by_place(precision, groups, image.shape[2])
        shared = covariance_of(noisy.shared) if noisy.shared else np.eye(size)
        # White noise times the factor is that of patches; these are divided by it, filtered, and multiplied again.
        factor = np.linalg.cholesky(shared)
        whiten = np.linalg.inv(factor)

        def make(here: slice) -> None:
            _patches.measure_groups(image, groups.order, groups.bounds, means, matrices, here.start, here.stop)
            covariances, variance = matrices[here], variances[here]
            if noisy.shared:
                covariances[:] = whiten @ covariances @ whiten.T
            if noise is None:
                covariances *= _GAIN
            else:
                _lessen_noise(covariances, noise[here], variance)
            _patches.make_filters(covariances, variance)
            if noisy.shared:
                covariances[:] = whiten.T @ covariances @ factor.T

        work = float(groups.sizes.sum()) * size**2 / 16 + len(groups) * size**3 / 8
        in_stripes(make, len(groups), work, n=64)
        # The variance that remains at each place of a patch, as a share of that of the noise.
        left = np.einsum("gij,ij->gj", matrices, np.float32(shared)).reshape(len(groups), SIDE**2, -1).mean(axis=2)
        trust = usual / variances[:, None] / (left + _LEFT)
        return cls(groups, means, matrices, variances, trust.astype(np.float32))

    def sums(self, noisy: Noisy, estimate: Floats32) -> tuple[Floats32, Floats32]:
        """Weighted sums of the filtered patches, and their weights, in the block and its border."""
        groups, size = self.groups, self.means.shape[1]
        image = np.ascontiguousarray(estimate[groups.bordered])
        own_change = noisy.precision[groups.bordered][:, :, None] * (noisy.values[groups.bordered] - image)
        patches = np.empty((len(groups.order), size), np.float32)
        sums, weights = np.empty_like(image), np.empty(image.shape[:2], np.float32)
        group_of = np.empty([side - 2 * REACH for side in image.shape[:2]], np.int32)
        group_of.ravel()[groups.order] = np.repeat(np.arange(len(groups), dtype=np.int32), groups.sizes)
        about = self.variances, groups.order, groups.bounds, self.means, self.matrices
        apply = partial(_patches.filter_groups, image, own_change, *about, patches)
        join = partial(_patches.join_patches, patches, group_of, self.trust, sums, weights)
        in_parts(apply, len(groups), work=len(patches) * size**2 / 16)
        in_parts(join, len(sums), work=patches.size)
        return sums, weights


def covariance_of(shared: SharedNoise) -> Floats:
    """(P, P) covariance of the noise of patches, as a part of its mean variance; some in each direction."""
    places, lags = np.indices((SIDE, SIDE)).reshape(2, -1).T, len(shared.autocovariance) // 2
    rows, columns = np.moveaxis(places[:, None] - places, 2, 0) + lags
    size = SIDE**2 * len(shared.bands)
    covariance = shared.autocovariance[rows, columns].transpose(0, 2, 1, 3).reshape(size, size)
    values, axes = np.linalg.eigh((covariance + covariance.T) / 2)
    raised = (axes * np.maximum(values, _ANYWHERE * values.mean())) @ axes.T
    return np.asarray(raised * (size / np.trace(raised)))


def _variances(precision: Floats32, groups: Groups, usual: float) -> Floats:
    """(G,) variance of the noise in the patches of each group: that of the mean precision of their pixels."""
    patches, starts = windows(precision[:, :, None]).reshape(len(groups.order), -1)[groups.order], groups.bounds[:-1]
    means = np.add.reduceat(patches.mean(axis=1, dtype=np.float32), starts, dtype=np.float64) / groups.sizes
    best = np.maximum.reduceat(patches.max(axis=1), starts)
    variances = np.divide(1, means, out=np.full(len(groups), usual), where=means > 1e-6 / usual)
    return np.minimum(variances, _STEP / np.maximum(best.astype(np.float64), 1e-30))


def _noise_by_place(precision: Floats32, groups: Groups, n_bands: int) -> Floats:
    """(G, P) variance of the noise at each place of the patches of each group."""
    usual = precision.mean() / max((precision > 0).mean(), 1e-30)
    variance = np.reciprocal(np.maximum(precision, np.float32(_FILLED * usual)), dtype=np.float32)
    patches = windows(variance[:, :, None]).reshape(len(groups.order), -1)[groups.order]
    sums = np.add.reduceat(patches, groups.bounds[:-1], axis=0, dtype=np.float64)
    return np.repeat(sums / groups.sizes[:, None], n_bands, axis=1)


def _lessen_noise(covariances: Floats32, noise: Floats, variances: Floats) -> None:
    """Turn (G, P, P) covariances of noisy patches into those of what they show."""
    # A direction of power p keeps p^2 / (p + b): about p - b where it is strong, and little where it is noise alone.
    # That is p less b times a Wiener filter for noise of variance b, so that no eigenvalues are needed.
    np.einsum("gii->gi", covariances)[:] += variances[:, None] - noise
    bends = _BENT * variances
    for _ in range(2):
        filters = covariances.copy()
        _patches.make_filters(filters, bends)
        covariances -= bends[:, None, None].astype(np.float32) * filters

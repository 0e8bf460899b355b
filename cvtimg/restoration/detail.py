"""Detail, for photographs: groups of patches instead of cells of colors, with a filter for each group.

Each pass compares the patches of the last estimate, so groups become purer and can be smaller. The first pass takes
covariances from the noisy patches; later ones from the estimate, as an oracle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise, product, starmap

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.choices import AutoEffortName, EffortName
from cvtimg._shared.progress import each, part
from cvtimg._shared.threads import side_by_side
from cvtimg.restoration.alignment import own_pixels
from cvtimg.restoration.clipping import Clipped, clipped_ends
from cvtimg.restoration.evidence import Evidence
from cvtimg.restoration.filters import Noisy, PatchBlock, filtered
from cvtimg.restoration.masked import masked_means
from cvtimg.restoration.merging import measured
from cvtimg.restoration.patches import REACH, Axes, Kinds, group_patches, with_border
from cvtimg.restoration.result import Found
from cvtimg.restoration.suspicion import first_estimate
from cvtimg.restoration.versions import Floats, Versions, fill, fuse

# --- an image at half its size, where noise is half as strong, and what that tells of the image itself
# Small patches leave noise of low frequencies, which shows as blotches in flat areas. At half the size the same patches
# reach twice as far and remove it. Detail is not there, so only low frequencies are taken, and only where both sizes
# agree up to some noise.
# G. Facciolo, N. Pierazzo, J.-M. Morel, SIAM J. Imaging Sciences 10 (2017) 1603-1626, doi 10.1137/17M1111826, for
# putting scales together; the weight is our own.

#: Blur, in pixels of the half size, of what is taken from there, and of the first estimate of an image.
_LOW, FIRST_BLUR = 1.0, 0.7
#: Side of the windows in which the sizes are compared, and the squared difference at which half is taken, as a share of
#: the variance of the noise.
_AROUND, _HALF = 7, 0.03


def halved(noisy: Noisy) -> Noisy:
    """Halve the size of a noisy image; blurred, it is the first estimate of itself."""
    from scipy.ndimage import gaussian_filter

    inner = slice(REACH, -REACH)
    precision = noisy.precision[inner, inner, None]
    shared = noisy.shared and noisy.shared.halved()
    gain = np.float32(noisy.shared.variance / shared.variance if noisy.shared and shared else 4)
    weight = gain * _half(precision)
    total = gain * _half(precision * noisy.values[inner, inner])
    values = np.divide(total, weight, out=_half(noisy.estimate[inner, inner]), where=weight > 0)
    estimate = gaussian_filter(values, (FIRST_BLUR, FIRST_BLUR, 0))
    return Noisy(with_border(values), with_border(estimate), with_border(weight)[:, :, 0], shared)


def with_low_frequencies(estimate: Floats, coarse: Floats, variance: float) -> Floats:
    """(H, W, C) estimate, with low frequencies from an estimate of half the size where they agree."""
    # `variance` is that of the noise that the image had.
    from scipy.ndimage import gaussian_filter, uniform_filter, zoom

    height, width = estimate.shape[:2]
    apart = coarse - _half(estimate)
    strength = uniform_filter(np.square(apart).mean(axis=2), _AROUND) / np.float32(_HALF * variance)
    apart = gaussian_filter(apart, (_LOW, _LOW, 0)) / (1 + strength[:, :, None] ** 2)
    added: Floats = zoom(apart, (2, 2, 1), order=1, grid_mode=True, mode="nearest")
    return estimate + added[:height, :width]


def _half(image: Floats) -> Floats:
    """(ceil(H / 2), ceil(W / 2), C) means of 2 x 2 pixels; an odd last row or column counts twice."""
    height, width = image.shape[:2]
    even = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) * np.float32(0.25)


# --- detail

#: Largest number of patches in a group, pass by pass.
_PASSES = {"fast": (800, 80), "balanced": (600, 150, 80, 60), "best": (600, 150, 80, 60, 60)}
#: Largest number of pixels for which these are affordable: a pass over a megapixel takes some seconds.
_AFFORDABLE: tuple[tuple[int, EffortName], ...] = ((1 << 18, "best"), (1 << 22, "balanced"))
#: Kinds of patches by default.
_AUTO_KINDS = 32
#: How often the size is halved to find low frequencies, the passes there, and the shortest side of a size.
_HALVINGS, _LOW_PASSES, _SHORTEST = 2, (600, 150, 80, 60), 32
#: Part of the time that an image takes of that for it and for half its size, which has a quarter of the pixels.
_FULL_SIZE = 0.85
#: Part of the time until kinds of patches are found.
_SORTED = 0.02
#: Patches this many pixels apart differ as much as by a standard deviation of the noise: near ones are more alike.
_PLACE = 0.24
#: Longest side, in pixels, of the blocks in which patches are grouped, each by a thread.
_BLOCK = 256
#: The pass from which on versions that were moved keep their own pixels; the last pass in any case.
_OWN_FROM = 3
#: Blur, in pixels, over which these are compared with the first, and the least share of pixels that both must know.
_NEAR_BY, _FEW = 1.5, 0.02
#: How much what is not noise counts, and its size, as a part of noise, from which on it surely is not.
_STRICT, _SURE = 48.0, 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Detailed:
    """An image restored by its patches."""

    image: Floats  # (H, W, C)
    labels: NDArray[np.int32]  # (H, W): kind of the patch around each pixel, from 0
    energy: float  # sum of the squared distances of patches to their generators, in principal components


def affordable_effort(n_pixels: int) -> EffortName:
    """Choose an effort that restores images of any size within minutes."""
    return next((effort for most, effort in _AFFORDABLE if n_pixels <= most), "fast")


def denoise_versions(
    evidence: Evidence, n_generators: int | None, effort: AutoEffortName, rng: np.random.Generator
) -> Found:
    """Restore an image from versions of one look, or denoise a single one, by groups of patches of some kinds."""
    from scipy.ndimage import gaussian_filter
    from threadpoolctl import threadpool_limits

    if not evidence.is_noisy and (evidence.versions.coverage > 0).all():
        return _unchanged(evidence)
    n_generators = n_generators or min(_AUTO_KINDS, evidence.versions.coverage.size)
    versions, trust, suspicion = evidence.versions, evidence.trust, evidence.suspicion
    variance = max(min(evidence.variances(versions)), versions.rounding**2 / 12)
    passes = _PASSES[affordable_effort(versions.coverage.size) if effort == "auto" else effort]
    kept = suspicion.kept(versions, first_estimate(fuse(versions, trust)[0])) if suspicion else versions
    estimate: Floats = gaussian_filter(fuse(kept, trust)[0], (FIRST_BLUR, FIRST_BLUR, 0))
    axes = Axes.of(evidence.noise_by_band, estimate)
    # Groups are what matters: the kinds that they are cut from need no better estimate.
    with part(0, _SORTED):
        kinds = Kinds.of(axes.looks(with_border(axes.along(estimate))), n_generators, rng)
    # The matrices are small: threads of the BLAS would spend their time waiting for each other.
    with threadpool_limits(1, user_api="blas"), part(_SORTED, _FULL_SIZE):
        for number, largest in each(list(enumerate(passes))):
            if suspicion and number:
                kept = suspicion.kept(versions, estimate)
            values, precision = _fused(
                kept, evidence, variance, estimate, own=number >= min(_OWN_FROM, len(passes) - 1)
            )
            noisy = Noisy(
                with_border(axes.along(values)),
                with_border(axes.along(estimate)),
                with_border(precision[:, :, None] / np.float32(variance))[:, :, 0],
                evidence.shared and evidence.shared.along(axes.matrix),
            )
            done = _pass(noisy, axes, kinds, largest, from_estimate=number > 0)
            estimate = axes.back(done.image)
    with threadpool_limits(1, user_api="blas"), part(_FULL_SIZE, 1):
        lower = _with_low_frequencies(done.image, noisy, axes, kinds, _HALVINGS)
        estimate = axes.back(lower)
    labels = done.labels + 1
    generators, masses = measured(versions, trust, labels, n_generators)
    rows = estimate.reshape(labels.size, -1)
    colors, _ = masked_means(rows, np.ones_like(rows), labels.ravel(), np.zeros((n_generators, rows.shape[1])))
    return Found(labels, generators, masses, colors, (done.energy,), kept.coverage, image=estimate)


def _unchanged(evidence: Evidence) -> Found:
    """Return the mean of versions without noise, as one kind of patches."""
    versions = evidence.versions
    image, _ = fuse(versions, evidence.trust)
    labels = np.ones(image.shape[:2], np.int32)
    generators, masses = measured(versions, evidence.trust, labels, 1)
    colors = image.mean(axis=(0, 1), dtype=np.float64)[None]
    return Found(labels, generators, masses, colors, (0.0,), versions.coverage, image=image)


def _with_low_frequencies(image: Floats, noisy: Noisy, axes: Axes, kinds: Kinds, n_halvings: int) -> Floats:
    """(H, W, C) image whose low frequencies are those of the noisy one restored at half its size, and so on."""
    if n_halvings == 0 or min(image.shape[:2]) < 2 * _SHORTEST:
        return image
    half = halved(noisy)
    with part(0, _FULL_SIZE):
        for number, largest in each(list(enumerate(_LOW_PASSES))):
            coarse = _pass(half, axes, kinds, largest, from_estimate=number > 0).image
            half = replace(half, estimate=with_border(coarse))
    with part(_FULL_SIZE, 1):
        coarse = _with_low_frequencies(coarse, half, axes, kinds, n_halvings - 1)
    return with_low_frequencies(image, coarse, 4 * half.usual_variance)


def _pass(noisy: Noisy, axes: Axes, kinds: Kinds, largest: int, from_estimate: bool) -> Detailed:
    """Group the patches of each block, and filter the groups of all blocks."""
    height, width = (side - 2 * REACH for side in noisy.precision.shape)
    labels, energy, blocks = np.empty((height, width), np.int32), 0.0, []
    near = np.float32(_PLACE * np.sqrt(noisy.usual_variance))

    def grouped(at: tuple[slice, slice]) -> tuple[PatchBlock, NDArray[np.int32], Floats]:
        rows, columns = at
        seen = noisy.estimate[rows.start : rows.stop + 2 * REACH, columns.start : columns.stop + 2 * REACH]
        features = kinds.features(axes.looks(seen))
        own, apart = kinds.label(features)
        shape = rows.stop - rows.start, columns.stop - columns.start
        places = near * np.indices(shape).reshape(2, -1).T
        groups = group_patches(np.concatenate([features, places], axis=1, dtype=np.float32), own, largest)
        return PatchBlock(rows, columns, groups), own.reshape(shape), apart

    for block, own, apart in side_by_side(grouped, list(product(_parts(height), _parts(width)))):
        blocks.append(block)
        labels[block.rows, block.columns] = own
        energy += float(apart.sum(dtype=np.float64))
    images = [filtered(noisy.bands(bands), blocks, from_estimate) for bands in each(axes.slices)]
    return Detailed(np.concatenate(images, axis=2), labels, energy)


def _parts(side: int) -> list[slice]:
    """Cut a side into equal parts."""
    n_parts = -(-side // _BLOCK)
    return list(starmap(slice, pairwise(side * number // n_parts for number in range(n_parts + 1))))


def _fused(
    versions: Versions, evidence: Evidence, variance: float, estimate: Floats, *, own: bool
) -> tuple[Floats, Floats]:
    """Fuse versions with what an estimate of what they show tells of each: (H, W, C) values, and (H, W) weights."""
    # Clipped values follow the true ones less than others do, and are less noisy: both is undone about the estimate.
    # Of versions that were moved by fractions of a pixel, `own` takes the pixels as they were; and they count less
    # where they differ from the first by more than noise: that is finer than the pixels, or has moved by itself.
    transforms, white = evidence.alignment.transforms, versions.white
    total, weights, first_ends = np.zeros_like(estimate), np.zeros(estimate.shape[:2], np.float32), (False, False)
    first, first_known = versions.bands(0), versions.known[:, :, 0]
    for version, share in enumerate(evidence.trust):
        sigma = float(np.sqrt(variance / share))
        known, values = versions.known[:, :, version], versions.bands(version)
        moved = version > 0 and evidence.aligned
        if moved and own:
            source = evidence.given
            values, seen = own_pixels(source.bands(version), source.known[:, :, version], transforms[version], estimate)
            known = known & seen
        weight = known * np.float32(share)
        if moved:
            noise = variance * (1 / share + 1 / evidence.trust[0])
            weight *= _agreeing(values - first, known & first_known, noise)
        if white is not None:
            own_ends = clipped_ends(values[known], estimate[known], sigma, white)
            # Versions that were moved by fractions of a pixel hide where they were clipped; the first is never moved.
            first_ends = first_ends if version else own_ends
            clipped = Clipped.of(estimate, sigma, white, (own_ends[0] or first_ends[0], own_ends[1] or first_ends[1]))
            weight /= (clipped.variance / clipped.slope**2).mean(axis=2)
            values = estimate + (values - clipped.added - estimate) / clipped.slope
        total += weight[:, :, None] * np.where(known[:, :, None], values, 0)
        weights += weight
    return fill(total, weights), weights


def _agreeing(apart: Floats, known: NDArray[np.bool_], noise: float) -> Floats:
    """(H, W) weight, 0..1, of a version: the variance of `noise` as a part of that and of what is not noise."""
    from scipy.ndimage import gaussian_filter

    share = gaussian_filter(known.astype(np.float32), _NEAR_BY)
    squares = gaussian_filter(np.where(known, np.square(apart).mean(axis=2), 0), _NEAR_BY)
    near = np.divide(squares, share, out=np.zeros_like(squares), where=share > _FEW)
    excess = np.maximum(near - noise, 0)
    return noise / (noise + _STRICT * excess**2 / (excess + _SURE * noise))

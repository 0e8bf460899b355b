"""Detail, for photographs: groups of patches instead of cells of colors, with a filter for each group.

Each pass compares the patches of the last estimate, so groups become purer and can be smaller. The first pass takes
covariances from the noisy patches; later ones from the estimate, as an oracle.

Small patches leave noise of low frequencies, which shows as blotches in flat areas. At half the size the same patches
reach twice as far and remove it. Detail is not there, so only low frequencies are taken, and only where both sizes
agree up to some noise. G. Facciolo, N. Pierazzo, J.-M. Morel, SIAM J. Imaging Sciences 10 (2017) 1603-1626, doi
10.1137/17M1111826, for putting scales together; the weight is our own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise, product, starmap

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.choices import AutoEffortName, EffortName
from cvtimg._shared.progress import each, part
from cvtimg._shared.threads import side_by_side
from cvtimg.restoration.agreement import first_estimate
from cvtimg.restoration.alignment import own_pixels
from cvtimg.restoration.clipping import Clipped, clipped_ends
from cvtimg.restoration.evidence import Evidence
from cvtimg.restoration.filters import Noisy, PatchBlock, filtered
from cvtimg.restoration.patches import REACH, Axes, Kinds, group_patches, with_border
from cvtimg.restoration.versions import Floats, Versions, fill, fuse

#: Largest number of patches in a group, pass by pass.
_PASSES = {"fast": (800, 80), "balanced": (600, 150, 80, 60), "best": (600, 150, 80, 60, 60)}


@dataclass(frozen=True, slots=True)
class Effort:
    """How an image is restored."""

    #: Largest numbers of pixels for which passes are affordable: one over a megapixel takes some seconds
    affordable: tuple[tuple[int, EffortName], ...] = ((1 << 18, "best"), (1 << 22, "balanced"))
    kinds: int = 32  # of patches, before they are cut into groups
    halvings: int = 2  # of the size, to find low frequencies
    shortest: int = 32  # side of a size
    blur: float = 0.7  # pixels, of the first estimate of an image
    block: int = 256  # longest side, in pixels, of the blocks in which patches are grouped, each by a thread
    place: float = (
        0.24  # what patches a pixel apart differ by, in standard deviations of the noise: near ones are alike
    )
    agree: float = 0.03  # part of the noise by which sizes differ where half of low frequencies is taken,
    window: int = 7  # in windows of so many pixels
    times: tuple[float, float] = (0.02, 0.85)  # parts of the time in which kinds are found, and until sizes are halved
    own: int = 3  # pass from which on versions that were moved keep their own pixels; the last in any case
    near: float = 1.5  # blur, in pixels, over which these are compared with the first,
    some: float = 0.02  # where so much of what is near is known
    strict: float = 48.0  # how much what is not noise counts there
    sure: float = 1.5  # size of that, as a part of noise, from which on it surely is not noise


EFFORT = Effort()


def denoised(evidence: Evidence, effort: AutoEffortName, rng: np.random.Generator) -> tuple[Floats, Versions]:
    """(H, W, C) image of versions of one look, or of a single one, by groups of patches; also return what was used."""
    from scipy.ndimage import gaussian_filter

    versions, trust, suspicion = evidence.versions, evidence.trust, evidence.suspicion
    fused, _ = fuse(versions, trust)
    if not evidence.noise.is_seen and (versions.coverage > 0).all():
        return fused, versions
    n_pixels = versions.coverage.size
    if effort == "auto":
        effort = next((name for most, name in EFFORT.affordable if n_pixels <= most), "fast")
    passes = _PASSES[effort]
    variance = max(min(evidence.variances(versions)), versions.rounding**2 / 12)
    kept = suspicion.kept(versions, first_estimate(fused)) if suspicion else versions
    estimate: Floats = gaussian_filter(fuse(kept, trust)[0], (EFFORT.blur, EFFORT.blur, 0))
    axes = Axes.of(evidence.noise.bands, estimate)
    # Groups are what matters: the kinds that they are cut from need no better estimate.
    known, passed = EFFORT.times
    with part(0, known):
        kinds = Kinds.of(axes.looks(with_border(axes.along(estimate))), min(EFFORT.kinds, n_pixels), rng)
    with part(known, passed):
        for number, largest in each(list(enumerate(passes))):
            if suspicion and number:
                kept = suspicion.kept(versions, estimate)
            own = number >= min(EFFORT.own, len(passes) - 1)
            values, precision = _fused(kept, evidence, variance, estimate, own=own)
            noisy = Noisy(
                with_border(axes.along(values)),
                with_border(axes.along(estimate)),
                with_border(precision[:, :, None] / np.float32(variance))[:, :, 0],
                evidence.noise.shared and evidence.noise.shared.along(axes.matrix),
            )
            image = _pass(noisy, axes, kinds, largest, from_estimate=number > 0)
            estimate = axes.back(image)
    with part(passed, 1):
        return axes.back(_with_low_frequencies(image, noisy, axes, kinds, EFFORT.halvings)), kept


def _pass(noisy: Noisy, axes: Axes, kinds: Kinds, largest: int, from_estimate: bool) -> Floats:
    """Group the patches of each block, and filter the groups of all blocks."""
    height, width = (side - 2 * REACH for side in noisy.precision.shape)
    near = np.float32(EFFORT.place * np.sqrt(noisy.usual_variance))

    def grouped(at: tuple[slice, slice]) -> PatchBlock:
        rows, columns = at
        seen = noisy.estimate[rows.start : rows.stop + 2 * REACH, columns.start : columns.stop + 2 * REACH]
        features = kinds.features(axes.looks(seen))
        places = near * np.indices((rows.stop - rows.start, columns.stop - columns.start)).reshape(2, -1).T
        around = np.concatenate([features, places], axis=1, dtype=np.float32)
        return PatchBlock(rows, columns, group_patches(around, kinds.label(features), largest))

    places = list(product(_parts(height), _parts(width)))
    with part(0, 0.2):
        blocks = [block for _, block in zip(each(places), side_by_side(grouped, places), strict=True)]
    with part(0.2, 1):
        images = [filtered(noisy.bands(bands), blocks, from_estimate) for bands in each(axes.slices)]
    return np.concatenate(images, axis=2)


def _parts(side: int) -> list[slice]:
    """Cut a side into equal parts."""
    n_parts = -(-side // EFFORT.block)
    return list(starmap(slice, pairwise(side * number // n_parts for number in range(n_parts + 1))))


def _with_low_frequencies(image: Floats, noisy: Noisy, axes: Axes, kinds: Kinds, n_halvings: int) -> Floats:
    """(H, W, C) image whose low frequencies are those of the noisy one restored at half its size, and so on."""
    if n_halvings == 0 or min(image.shape[:2]) < 2 * EFFORT.shortest:
        return image
    half = halved(noisy)
    with part(0, EFFORT.times[1]):
        for number, largest in each(list(enumerate(_PASSES["balanced"]))):
            coarse = _pass(half, axes, kinds, largest, from_estimate=number > 0)
            half = replace(half, estimate=with_border(coarse))
    with part(EFFORT.times[1], 1):
        coarse = _with_low_frequencies(coarse, half, axes, kinds, n_halvings - 1)
    return with_low_frequencies(image, coarse, 4 * half.usual_variance)


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
    estimate = gaussian_filter(values, (EFFORT.blur, EFFORT.blur, 0))
    return Noisy(with_border(values), with_border(estimate), with_border(weight)[:, :, 0], shared)


def with_low_frequencies(estimate: Floats, coarse: Floats, variance: float) -> Floats:
    """(H, W, C) estimate, with low frequencies from an estimate of half the size where they agree."""
    # `variance` is that of the noise that the image had. What is taken is blurred by a
    # pixel.
    from scipy.ndimage import gaussian_filter, uniform_filter, zoom

    height, width = estimate.shape[:2]
    apart = coarse - _half(estimate)
    strength = uniform_filter(np.square(apart).mean(axis=2), EFFORT.window) / np.float32(EFFORT.agree * variance)
    apart = gaussian_filter(apart, (1, 1, 0)) / (1 + strength[:, :, None] ** 2)
    added: Floats = zoom(apart, (2, 2, 1), order=1, grid_mode=True, mode="nearest")
    return estimate + added[:height, :width]


def _half(image: Floats) -> Floats:
    """(ceil(H / 2), ceil(W / 2), C) means of 2 x 2 pixels; an odd last row or column counts twice."""
    height, width = image.shape[:2]
    even = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) * np.float32(0.25)


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
            sigma = float(np.sqrt(variance / share))
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

    share = gaussian_filter(known.astype(np.float32), EFFORT.near)
    squares = gaussian_filter(np.where(known, np.square(apart).mean(axis=2), 0), EFFORT.near)
    near = np.divide(squares, share, out=np.zeros_like(squares), where=share > EFFORT.some)
    excess = np.maximum(near - noise, 0)
    return noise / (noise + EFFORT.strict * excess**2 / (excess + EFFORT.sure * noise))

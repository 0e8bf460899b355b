"""Detail, for photographs: groups of patches instead of cells of colors, with a filter for each group.

Each pass compares the patches of the last estimate, so groups become purer and can be smaller. The first pass takes
covariances from the noisy patches; later ones from the estimate, as an oracle.
"""

from itertools import pairwise, product, starmap

import numpy as np
from scipy.ndimage import gaussian_filter, uniform_filter

from cvtimg._shared.choices import AutoEffortName, EffortName
from cvtimg._shared.progress import each, part
from cvtimg._shared.threads import in_stripes, side_by_side
from cvtimg._shared.types import Bools, Floats32
from cvtimg.restoration.alignment import moved
from cvtimg.restoration.evidence import Evidence
from cvtimg.restoration.patches import REACH, Axes, Groups, Kinds, Noisy, filtered, group_patches, with_border
from cvtimg.restoration.versions import Clipped, Versions, fill, fuse

#: Largest number of patches in a group, pass by pass; and of pixels for which passes are affordable: one over a
#: megapixel takes some seconds.
_PASSES = {"fast": (800, 80), "balanced": (600, 150, 80, 60), "best": (600, 150, 80, 60, 60)}
_AFFORDABLE: dict[EffortName, int] = {"best": 1 << 18, "balanced": 1 << 22}
#: Kinds of patches, before they are cut into groups.
_KINDS = 32
#: Blur, in pixels, of the first estimate of an image.
_BLUR = 0.7
#: Standard deviations of noise by which an estimate may be beside what is seen: one pixel in 400 is, by chance.
_FAR = 3.0
#: Longest side, in pixels, of the blocks in which patches are grouped, each by a thread.
_BLOCK = 256
#: What patches a pixel apart differ by, in standard deviations of the noise: near ones are alike.
_PLACE = 0.24
#: Pass from which on versions that were moved keep their own pixels; the last in any case.
_OWN = 3
#: Blur, in pixels, over which these are compared with the first; how much what is not noise counts there, and as which
#: part of noise it surely is not noise.
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
        noisy = Noisy(
            with_border(axes.along(values)),
            with_border(axes.along(estimate)),
            with_border(precision[:, :, None])[:, :, 0],
            evidence.noise.shared and evidence.noise.shared.along(axes.matrix),
        )
        image = _pass(noisy, axes, kinds, largest, from_estimate=number not in {0, -len(filling)})
        even = np.maximum(versions.noisiness(estimate), np.float32(1))  # lights may seem noisy
        estimate = axes.back(_within_noise(image, noisy, even))
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
    white, source, ends = versions.white, evidence.given, list[tuple[bool, bool]]()
    total, weights = np.zeros_like(estimate), np.zeros(estimate.shape[:2], np.float32)
    first, first_known, spread = versions.bands(0), versions.known[:, :, 0], versions.noisiness(estimate)

    def add(version: int, share: np.float32) -> None:
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
            excess = np.maximum(
                apart / np.maximum(gaussian_filter(both.astype(np.float32), _NEAR), np.float32(1e-3)) - noise, 0
            )
            # The variance of noise, as a part of that and of what is not noise.
            weight *= noise / (noise + _STRICT * excess**2 / (excess + _SURE * noise))
        sigma = np.sqrt(np.float32(variance / share) * spread)[:, :, None]
        clips = False, False
        if white is not None:
            ends.append(clipped_ends(values, known[:, :, None], estimate, sigma, white))
            # Versions that were moved by fractions of a pixel hide where they were clipped; the first is never moved.
            clips = ends[0][0] or ends[-1][0], ends[0][1] or ends[-1][1]

        def add_rows(rows: slice) -> None:
            near, seen = estimate[rows], values[rows]
            if white is not None and any(clips):
                clipped = Clipped.of(near, sigma[rows], white, clips)
                weight[rows] /= (clipped.variance / clipped.slope**2).mean(axis=2)
                seen = near + (seen - clipped.added - near) / clipped.slope
            total[rows] += weight[rows][:, :, None] * np.where(known[rows][:, :, None], seen, 0)
            weights[rows] += weight[rows]

        in_stripes(add_rows, len(estimate), work=(64.0 if any(clips) else 8.0) * estimate.size)

    for version, share in enumerate(evidence.trust.astype(np.float32)):
        add(version, share)
    return fill(total, weights), weights


def clipped_ends(values: Floats32, known: Bools, true: Floats32, sigma: Floats32, white: float) -> tuple[bool, bool]:
    """Tell whether known values pile up at 0 and at `white` as Gaussian noise that is clipped there would."""
    from scipy.special import ndtr

    def piles_up(end: float) -> bool:
        n_there = int(np.count_nonzero((values == end) & known))
        away = np.abs(np.clip(true, 0, white) - end) / sigma if n_there else true
        return n_there > 0 and n_there >= float(ndtr(-away).sum(dtype=np.float64, where=known)) / 2

    return piles_up(0.0), piles_up(white)

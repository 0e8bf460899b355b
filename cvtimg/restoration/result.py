"""Results of restoration, and how segments of versions become one: cells of stacked values, a color for each.

A segment that is painted over in one of three versions has a diluted generator: a third of the way to the color that
covers it. Each rule of renormalization undoes that in its own way.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.choices import EffortName, SpaceName
from cvtimg._shared.pixels import peak
from cvtimg._shared.progress import each
from cvtimg._shared.records import Claims, ReadOnly, never_rises
from cvtimg._shared.types import Array, Bools, Floats, Floats32, Indices, Ints
from cvtimg.colors.spaces import from_space
from cvtimg.elbow.curves import auto_count
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import encode_image, write_image
from cvtimg.pictures.showing import natural_limits, shown
from cvtimg.restoration.detail import cells_of
from cvtimg.restoration.evidence import Evidence
from cvtimg.restoration.noise import SharedNoise
from cvtimg.restoration.versions import Versions, fuse
from cvtimg.segmentation.edge_weight import EdgeWeighted, descend

#: Blurs, in pixels, of the images in which the search for segments begins; the lowest end is kept.
_BLURS = {"fast": (1.0,), "balanced": (0.0, 1.5), "best": (0.0, 0.75, 1.5, 3.0)}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Denoised(ReadOnly):
    """An image made of several versions, or of one.

    Attributes
    ----------
    image : (H, W) or (H, W, C) array
        The image, of the shape and type of the first version, without alpha.
    alpha : (H, W) array or None
        Alpha, if all versions have the same; where it differs, it tells what is missing, and is None.
    coverage : (H, W) int32 array
        Number of versions that know each pixel.
    left_out : (H, W) int32 array
        Number of these that were left out there, because they disagree with the others; see `hidden`.
    noise : (S,) float64 array
        Standard deviation of the noise of each version, given or estimated, in the units of its color space; NaN where
        too little is known to estimate it.
    noise_shared : (2 L + 1, 2 L + 1, C, C) float64 array or None
        Autocovariance of the noise over rows, columns and bands, if pixels next to each other or the bands of a pixel
        share noise; in its middle, the covariance of these bands. None where all noise is independent.
    noise_lines : (C, 2) float64 array or None
        Variance of the noise of weight 1 in each band, as a constant and a slope: constant + slope x level. None where
        noise is even or was taken to be.
    noisy : bool
        Whether there is noise to take away: more than rounding to integers leaves, or what was given. If not, `denoise`
        returns the version itself, or the mean of several.
    impulses : (S,) float64 array
        Share of the known pixels of each version that are impulses, as of salt and pepper, and were not used.
    stripes : (S, 2) float64 array
        Standard deviations of what was taken away of the rows and of the columns of each version: offsets or gains.
    weights : (S,) float64 array
        Weight of each version, with mean 1.
    shifts : (S, 2) float64 array
        Pixels by which the center of each version was moved, down and to the right.
    transforms : (S, 3, 3) float64 array
        Homogeneous matrices that map pixels (x, y, 1) of the first version to those of each.
    exposures : (S, C, 2) float64 array or None
        Gain and offset that brought each band of each version to the exposure of the first, if versions were aligned.
    models : tuple of str
        Model of the motion of each version; see `align` of `restore`.
    misfits : (S,) float64 array
        What each version, in place, differs by from the one that most fit, less noise, as a part of the fine structure:
        0 where it is the same, about 2 for another image. Above 0.25, versions do not fit. NaN for channels.
    """

    image: Array
    alpha: Array | None
    coverage: Ints
    left_out: Ints
    noise: Floats
    noise_shared: Floats | None
    noise_lines: Floats | None
    noisy: bool
    impulses: Floats
    stripes: Floats
    weights: Floats
    shifts: Floats
    transforms: Floats
    exposures: Floats | None
    models: tuple[str, ...]
    misfits: Floats

    def _claims(self) -> Claims:
        yield "no more versions are left out than there are", self.left_out <= self.coverage
        yield "what is known is finite", np.isfinite(self.image[self.coverage > 0])

    @classmethod
    def of(
        cls,
        places: Array,
        used: Versions,
        evidence: Evidence,
        space: SpaceName,
        *,
        bands: Indices | None = None,
        **more: Any,
    ) -> Self:
        """Make a result of (H, W, C) places in a color space, the versions `used`, and `more` of its fields."""
        # `bands` tells which band of the versions used each of the image is; -1: none, and it has no noise.
        versions, noise = evidence.placed, evidence.noise
        bands = np.arange(places.shape[2]) if bands is None else bands

        def of_all(values: Array | None, *axes: int, other: ArrayLike = 0.0) -> Floats | None:
            if values is None:
                return None
            for axis in axes:
                values = np.where((bands < 0).reshape(-1, *[1] * (-axis - 1)), other, np.take(values, bands, axis))
            return values

        rows = from_space(places.reshape(-1, places.shape[2]).astype(np.float64), space, versions.dtypes[0])
        return cls(
            image=rows.reshape(places.shape[:2] if versions.grey else places.shape),
            alpha=versions.alpha,
            coverage=versions.coverage,
            left_out=versions.coverage - used.coverage,
            noise=noise.levels,
            noise_shared=of_all(noise.shared.autocovariance if noise.shared else None, -2, -1),
            noise_lines=of_all(evidence.noise_lines, -2),
            noisy=noise.is_seen,
            impulses=evidence.defects.impulses,
            stripes=evidence.defects.stripes,
            weights=evidence.trust,
            shifts=evidence.alignment.shifts(places.shape),
            transforms=evidence.alignment.transforms,
            exposures=of_all(versions.tones, -2, other=(1.0, 0.0)),
            models=evidence.alignment.models,
            misfits=evidence.misfits,
            **more,
        )

    @property
    def noise_neighbors(self) -> float:
        """Correlation of the noise of pixels next to each other in a row; 0 where noise is white."""
        return 0.0 if self.noise_shared is None else SharedNoise(self.noise_shared).neighbors

    def with_alpha(self) -> Array:
        """(H, W) or (H, W, C) image, with its alpha as the last channel if there is any."""
        return self.image if self.alpha is None else np.dstack([self.image, self.alpha])

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the image with its alpha, as `write_image` does."""
        write_image(path, self.with_alpha(), overwrite=overwrite)

    def _repr_png_(self) -> bytes:
        bands = self.image.reshape(*self.image.shape[:2], -1)
        bands = bands[:, :, :3] if bands.shape[2] >= 3 else bands[:, :, :1]
        return encode_image(".png", shown(bands, natural_limits(bands)))

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        noise = ", ".join(f"{level:.3g}" for level in self.noise[:8]) + (", ..." if len(self.noise) > 8 else "")
        return (
            f"{type(self).__name__}({width} x {height} pixels of {self.image.dtype} from {len(self.weights)} versions, "
            f"noise=[{noise}], unknown={(self.coverage == 0).mean():.2%}, left_out={(self.left_out > 0).mean():.2%})"
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class Restoration(Denoised):
    """An image in flat segments, restored from several versions. It has all of `Denoised`, and what follows.

    Attributes
    ----------
    labels : (H, W) int32 array
        Segment of each pixel, 1..K, from dark to bright. K can be less than requested, because segments can vanish.
    generators : (K, S, C) float64 array
        Mean of each segment in each version, in the units of the versions; NaN where a version does not know the
        segment, and in bands that it does not have.
    colors : (K, C) float64 array
        Color of each segment, after renormalization.
    edge_weight : float
        Penalty for each pair of near pixels in different segments, in squared 8-bit levels.
    energies : tuple of float
        Energy before each sweep and at the end, which never rises: the sum over pixels and versions of weight times
        squared distance to the generator, plus the penalties of edges.
    converged : bool
        Whether the segments converged.
    """

    labels: Ints
    generators: Floats
    colors: Floats
    edge_weight: float
    energies: tuple[float, ...]
    converged: bool

    def _claims(self) -> Claims:
        yield from Denoised._claims(self)
        yield "energies never rise", never_rises(self.energies)
        yield "labels are those of colors", (self.labels >= 0) & (self.labels <= len(self.colors))

    @property
    def energy(self) -> float:
        """Energy at the end."""
        return self.energies[-1]


# --- segments


def merge_versions(
    evidence: Evidence,
    n_generators: int | None,
    *,
    edge_weight: float | None,
    renormalize: str,
    effort: EffortName,
    space: SpaceName,
) -> Restoration:
    """Find segments of pixels whose stacked values are alike, and one color for each; None picks their number."""
    versions, trust = evidence.versions, evidence.trust
    if evidence.suspicion:
        versions = evidence.suspicion.first_kept(versions, fuse(versions, trust)[0])
    unit, cost = versions.level(space) ** 2, edge_weight
    if cost is None:  # half or twice as much serves nearly as well
        cost = 0.5 * max(evidence.variances(versions)) / unit
    if n_generators is None:
        seen = versions.coverage.ravel() > 0  # what is filled in does not tell
        n_generators, _ = auto_count(_fused_rows(versions, evidence, 1.5)[seen], 32)
        sharp = _fused_rows(versions, evidence, 0.0)[seen]  # a drawing of two colors has more once it is blurred
        mixed = np.einsum("ij,j->i", sharp, np.pi ** np.arange(sharp.shape[1]))
        n_generators = min(n_generators, len(np.unique(mixed)))
    # All bands of all versions, side by side, and the version of each.
    values = np.concatenate([versions.bands(version) for version in range(versions.n_versions)], axis=2)
    version_of = np.repeat(np.arange(versions.n_versions), [band.shape[2] for band in versions.stack])
    weights = np.where(versions.known, trust.astype(np.float32), np.float32(0))[:, :, version_of]
    center = values[weights > 0].mean(dtype=np.float64)
    values = values - np.float32(center)  # so that float32 is precise enough

    def settled(labels: Ints, some: Bools) -> EdgeWeighted:
        """Lower the energy in some bands from initial labels until they rest."""
        cells = descend(values[:, :, some], labels, n_generators, edge_weight=cost * unit, weights=weights[:, :, some])
        return replace(cells, generators=cells.generators + np.float32(center))

    # The search begins in cells of the colors of the versions fused and blurred, where nothing is missing.
    looks = (_fused_rows(versions, evidence, blur) for blur in each(_BLURS[effort]))
    starts = (cells_of(rows, n_generators, effort=effort).labels + 1 for rows in looks)
    ends = (settled(start.reshape(versions.known.shape[:2]), version_of >= 0) for start in starts)
    end = min(ends, key=lambda end: end.energies[-1])
    bands = [version_of == version for version in range(1 if evidence.channels else versions.n_versions)]
    generators, masses = (np.stack([values[:, some] for some in bands]) for values in (end.generators, end.masses))
    levels = Levels(versions, end.labels, generators, masses, lambda version: settled(end.labels, bands[version]))
    colors = RENORMALIZATIONS[renormalize](levels)
    white = peak(evidence.placed.dtypes[0]) if space != "rgb" else 1.0
    told = from_space(colors, space, np.dtype(np.float64)) * white
    # Segments that are left, from dark to bright.
    order = np.lexsort((*told.T[::-1], told.sum(axis=1)))
    order = order[np.bincount(end.labels.ravel(), minlength=len(told) + 1)[1:][order] > 0]
    rank = np.zeros(len(told) + 1, np.int32)
    rank[order + 1] = np.arange(1, len(order) + 1)
    labels = rank[end.labels]
    by_version = np.full((len(order), versions.n_versions, int(np.bincount(version_of).max())), np.nan)
    for version, dtype in enumerate(evidence.placed.dtypes):
        some = version_of == version
        places = np.where(end.masses > 0, end.generators, np.nan)[order][:, some]
        white = peak(dtype) if space != "rgb" else 1.0
        by_version[:, version, : np.count_nonzero(some)] = from_space(places, space, np.dtype(np.float64)) * white
    return Restoration.of(
        colors[order][labels - 1],
        versions,
        evidence,
        space,
        labels=labels,
        generators=by_version,
        colors=told[order],
        edge_weight=cost,
        energies=end.energies,
        converged=end.converged,
    )


def _fused_rows(versions: Versions, evidence: Evidence, blur: float) -> Floats32:
    """(N, C) colors of the versions fused and blurred; channels side by side."""
    trust, numbers = evidence.trust, [*range(versions.n_versions)]
    looks = [[number] for number in numbers] if evidence.channels else [numbers]
    parts = [fuse(versions, trust, blur, some)[0] * np.float32(np.sqrt(trust[some].mean())) for some in looks]
    return np.concatenate(parts, axis=2).reshape(versions.known[:, :, 0].size, -1)


# --- renormalization


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """Segments of versions, from which their colors are made."""

    versions: Versions
    labels: Ints  # (H, W): labels from 1
    generators: Floats  # (S, K, C): means and weights of the segments in each version; of channels, in the first
    masses: Floats
    #: Takes the number of a version and returns its segments once they have settled in it alone
    alone: Callable[[int], EdgeWeighted]


def mean_colors(levels: Levels) -> Floats:
    """(K, C) mean of the known values of each segment in all versions."""
    totals = levels.masses.sum(axis=0)
    sums = (levels.masses * levels.generators).sum(axis=0)
    return np.divide(sums, totals, out=levels.generators.mean(axis=0), where=totals > 0)


def median_colors(levels: Levels) -> Floats:
    """(K, C) median of the known values of each segment: right while less than half of it is painted over."""
    colors, known = mean_colors(levels), levels.versions.known
    some = range(len(levels.masses))
    values = np.concatenate([levels.versions.bands(version)[known[:, :, version]] for version in some])
    labels = np.concatenate([levels.labels[known[:, :, version]] for version in some])
    for label in np.unique(labels):
        colors[label - 1] = np.median(values[labels == label], axis=0)
    return colors


def range_colors(levels: Levels) -> Floats:
    """(K, C) median over the versions of the level that each segment has in that version alone."""
    # In a single version, painted-over parts belong to the background and no longer dilute the level of the rest, so
    # the levels span the range of the versions again. Levels are those of segments, not of the least and greatest
    # pixels, which are the noisiest. A segment that has less than a thousandth of every version keeps its mean.
    colors, told = mean_colors(levels), []
    for end in map(levels.alone, range(len(levels.masses))):
        enough = end.masses >= max(1e-3 * float(end.masses.sum(axis=0).max()), 1e-12)
        told.append(np.where(enough, end.generators, np.nan))
    some = ~np.isnan(told).all(axis=(0, 2))
    colors[some] = np.nanmedian(np.array(told)[:, some], axis=0)
    return colors


#: The registry: names for `renormalize` and ``--renormalize``; "none" keeps the means.
RENORMALIZATIONS: dict[str, Callable[[Levels], Floats]] = {
    "range": range_colors,
    "median": median_colors,
    "none": mean_colors,
}

"""Multichannel reconstruction: one good picture from several bad ones, none of which holds it all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_count, check_edge_weight, check_non_negative
from cvtimg.colors.spaces import from_space, peak, to_space
from cvtimg.elbow.curves import auto_count
from cvtimg.engine.search import EFFORTS
from cvtimg.engine.tessellation import tessellate
from cvtimg.restoration.alignment import align as align_versions
from cvtimg.restoration.masked import MaskedCells, average_masked, masked_cells, masked_means
from cvtimg.restoration.patches import restore_detail
from cvtimg.restoration.renormalization import RENORMALIZATIONS, Evidence
from cvtimg.restoration.versions import (
    Floats,
    Versions,
    averaged_versions,
    disagreement,
    fuse,
    noise_of,
    stack_versions,
    trust_in,
)
from cvtimg.segmentation.averaging import Averaging, as_averaging
from cvtimg.segmentation.edge_weight import EdgeWeighted, descend

#: The edge weight as a multiple of the variance of the noise. Half of it or twice as much serves nearly as well.
_EDGE_WEIGHT_PER_VARIANCE = 0.5
#: For "auto" as many cells of patches; or the elbow of this many, in a picture with this blur.
_AUTO_DETAIL, _AUTO_MAX, _AUTO_BLUR = 96, 32, 1.5
#: Blurs, in pixels, of the pictures in which the search for segments begins; where it ends lowest is kept.
_BLURS = {"fast": (1.0,), "balanced": (0.0, 1.5), "best": (0.0, 0.75, 1.5, 3.0)}


@dataclass(frozen=True, slots=True, eq=False)
class Restoration:
    """A picture put together from several versions.

    Attributes
    ----------
    image : (H, W) or (H, W, C) array
        The picture, of the shape and type of the first version, without alpha.
    labels : (H, W) int32 array
        The segment of each pixel, 1..K, from dark to bright. K can be less than was asked for: segments can vanish.
    generators : (K, S, C) float64 array
        The mean of what each version knows of each segment, in the units of the versions; NaN where it knows nothing
        of it, and in bands that it does not have.
    colors : (K, C) float64 array
        The one color of each segment, renormalized.
    coverage : (H, W) int32 array
        How many versions knew each pixel.
    noise : (S,) float64 array
        Estimated standard deviation of the noise of each version, in the units of its color space; NaN where too
        little is known to tell.
    weights : (S,) float64 array
        How much each version counted, with mean 1.
    shifts : (S, 2) float64 array
        By how many pixels each version was moved, down and to the right.
    edge_weight : float
        What each pair of near pixels in different segments cost, in squared levels of 8 bits.
    energy : float
        Sum over pixels and versions of weight times squared distance to the generator, and the edges; with `detail`
        of the squared distance of patches to theirs.
    energies : tuple of float
        Before each sweep, and at the end; they never rise.
    converged : bool
        Whether the segments had come to rest.
    """

    image: NDArray[Any]
    labels: NDArray[np.int32]
    generators: NDArray[np.float64]
    colors: NDArray[np.float64]
    coverage: NDArray[np.int32]
    noise: NDArray[np.float64]
    weights: NDArray[np.float64]
    shifts: NDArray[np.float64]
    edge_weight: float
    energy: float
    energies: tuple[float, ...]
    converged: bool

    def __post_init__(self) -> None:
        for array in (self.image, self.labels, self.generators, self.colors, self.coverage, self.noise):
            array.flags.writeable = False
        for array in (self.weights, self.shifts):
            array.flags.writeable = False


def restore(
    images: Sequence[Any],
    n_generators: int | str,
    *,
    masks: Sequence[ArrayLike | None] | None = None,
    nodata: float | None = None,
    weights: ArrayLike | None = None,
    align: bool = False,
    channels: bool = False,
    space: str = "rgb",
    averaging: str | Averaging | None = None,
    edge_weight: float | str = "auto",
    volume_power: float = 0,
    renormalize: str | None = "range",
    detail: bool = False,
    effort: str = "balanced",
    rng: int | np.random.Generator = 0,
) -> Restoration:
    """Put one picture together from several noisy and incomplete versions of it.

    The values of all versions at a pixel, stacked, are one sample; segments are cells of a tessellation of the samples
    in which what is not known has no weight. An object that one version lacks is still nearer to the generator of the
    object than to that of the background, so the union of what the versions show comes back. Pixels that no version
    knows follow those around them.

    Parameters
    ----------
    images : sequence of (H, W) or (H, W, C) arrays, or Pillow images
        The versions, all of one size: uint8, uint16 or floating point. What is not known is NaN, or has alpha 0 (of
        two or four channels the last is alpha), or is said by `masks` or `nodata`. One version alone is denoised.
    n_generators : int or "auto"
        Number of segments K to begin with; with `detail`, of cells of patches, for which 64 to 128 serve. "auto" is
        the elbow of the energy of the versions fused and blurred, up to 32, where what is painted over may count as a
        color of its own; with `detail` 96.
    masks : sequence of (H, W) arrays or None, optional
        For each version what it knows: True, or not 0, is known. None knows all.
    nodata : float, optional
        A pixel that has this value in all bands is not known.
    weights : (S,) array, optional
        How much each version counts, > 0; by default the inverse variance of its noise, which is estimated.
    align : bool
        Move each version to the place of the first, by whole pixels and parts.
    channels : bool
        The versions are not of one look, but different channels of one scene, such as day and night: they share
        segments and no color. They may differ in bands and type, and the image is the first of them.
    space : {"rgb", "linear", "lab", "oklab"}
        Where distances are measured. Floating point is cut to 0..1 but for "rgb".
    averaging : {"before", "after"} or Averaging, optional
        Average what each version knows before the search for segments, or the segments after it, as in `segment`.
    edge_weight : float or "auto"
        What each pair of pixels within 3 pixels costs if they are in different segments, in squared levels of 8 bits
        whatever the depth, as if white were 255. 0 is nothing; "auto" is half the variance of the noise, or of what
        versions disagree by, which is more where some are painted over.
    volume_power : float
        Each segment counts by its share of the picture to this power.
    renormalize : {"range", "median", "none"} or None
        How the generators of the versions become one color. Where versions are painted over, the mean of a segment
        is diluted. "range" gives it the level that it has in each version taken for itself, where what is painted
        over goes to the background, so that colors span the range of the versions again; "median" the median of all
        that is known of it; "none" or None its mean. With `detail` colors stay means.
    detail : bool
        For photographs: cells of patches of 5 x 5 pixels, and in each a filter that gives back what its generator
        leaves out. Averaging, edge weight and volume power are not for it.
    effort : {"fast", "balanced", "best"}
        From how many blurred pictures the search for segments starts: 1, 2 or 4.
    rng : int or numpy.random.Generator
        Seed of the patches that are drawn for `detail`.

    Returns
    -------
    Restoration

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here, or no version knows any pixel; the message names it.

    Notes
    -----
    The distance of a pixel to a generator is the sum of weight times squared distance over the versions that know it.
    Divided by the sum of these weights it would find the same nearest generator; as it stands it also weighs rightly
    against the edges, for a pixel that few versions know has less to say. Renormalization is our reading of the
    pictures of restored full contrast in the lecture; its text does not define it.

    References
    ----------
    M. Gunzburger, lecture "Centroidal Voronoi Tessellations"; Q. Du, M. Gunzburger, L. Ju, X. Wang, J. Math. Imaging
    Vision 24 (2006) 177-194, doi 10.1007/s10851-005-3620-4; J. Wang, L. Ju, X. Wang, IEEE Trans. Image Processing 18
    (2009) 1844-1858, for the edges.

    Examples
    --------
    Each of three versions lacks another part of a bar; nothing tells which.

    >>> import numpy as np
    >>> from cvtimg import restore
    >>> bar = np.full((9, 30), 20, np.uint8)
    >>> bar[3:6] = 220
    >>> versions = [bar.copy() for _ in range(3)]
    >>> for number, version in enumerate(versions):
    ...     version[:, 10 * number : 10 * number + 8] = 20
    >>> bool((restore(versions, 2).image == bar).all())
    True
    """
    check_choice("effort", effort, EFFORTS)
    rule = check_choice("renormalize", renormalize or "none", RENORMALIZATIONS)
    power = check_non_negative("volume_power", volume_power)
    versions = stack_versions(images, masks, nodata, space, channels=channels)
    shifts = np.zeros((versions.n_versions, 2))
    if align:
        versions, shifts = align_versions(versions)
    noise = noise_of(versions)
    trust = trust_in(versions, weights, noise)
    average = as_averaging(averaging)
    data = averaged_versions(versions, average) if average and average.when == "before" else versions
    gain = average.noise_gain if average and data is not versions else 1.0
    told = [_variance(noise, trust) * gain, np.nan if channels else disagreement(data, trust)]
    told = [variance for variance in told if np.isfinite(variance)] or [0.0]
    unit = _level(versions, space) ** 2
    cost = check_edge_weight(edge_weight)
    if cost is None:
        cost = _EDGE_WEIGHT_PER_VARIANCE * max(told) / unit
    if detail:
        _check_detail(average, edge_weight, power, channels)
        cost = 0.0
    work = _Work(versions, data, trust, 0, average, cost * unit, power, rule, effort, channels)
    work = replace(work, n_generators=work.count(n_generators, detail))
    found = work.detailed(min(told), np.random.default_rng(rng)) if detail else work.segmented()
    return _in_order(found, versions, space, noise=noise, weights=trust, shifts=shifts, edge_weight=cost)


def _check_detail(averaging: Averaging | None, edge_weight: float | str, volume_power: float, channels: bool) -> None:
    """Refuse what makes no sense of patches."""
    if channels:
        raise ValueError("detail=True needs versions of one look; it cannot be with channels=True")
    if averaging or volume_power or edge_weight not in (0, "auto"):
        raise ValueError("detail=True takes no averaging, edge_weight or volume_power, which are of segments")


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Segments in the stacked space, in any order, and their colors; an image where it is not made of these."""

    labels: NDArray[np.int32]
    generators: NDArray[np.float64]
    masses: NDArray[np.float64]
    colors: NDArray[np.float64]
    energies: tuple[float, ...]
    converged: bool = True
    image: Floats | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Work:
    """What is to be done with some versions."""

    versions: Versions
    data: Versions
    trust: NDArray[np.float64]
    n_generators: int
    averaging: Averaging | None
    edge_weight: float
    volume_power: float
    rule: str
    effort: str
    channels: bool

    def count(self, n_generators: int | str, detail: bool) -> int:
        """Check the number of generators, or find it."""
        if not isinstance(n_generators, str):
            return check_count("n_generators", n_generators, self.versions.known[:, :, 0].size, "the number of pixels")
        check_choice("n_generators", n_generators, ("auto",))
        return _AUTO_DETAIL if detail else auto_count(self.fused_rows(_AUTO_BLUR), _AUTO_MAX)[0]

    def segmented(self) -> _Found:
        """Find segments of pixels whose stacked values are alike."""
        values, weights = self.data.values, self.data.weights(self.trust)
        values = values - np.float32(values[weights > 0].mean(dtype=np.float64))  # float32 then holds what matters
        ends = [self.settle(values, weights, self.start(blur)) for blur in _BLURS[self.effort]]
        end = min(ends, key=lambda end: end.energies[-1])
        generators, masses = self.measured(end.labels)

        def alone(version: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            own = self.versions.version_of == version
            settled = self.settle(values[:, :, own], weights[:, :, own], end.labels)
            means, loads = self.measured(settled.labels)
            return means[:, own], loads[:, own]

        seen = range(1 if self.channels else self.versions.n_versions)
        bands = [self.versions.version_of == version for version in seen]
        evidence = Evidence(
            values=[self.versions.bands(version) for version in seen],
            known=[self.versions.known[:, :, version] for version in seen],
            labels=end.labels,
            generators=np.stack([generators[:, own] for own in bands]),
            masses=np.stack([masses[:, own] for own in bands]),
            alone=alone,
        )
        colors = RENORMALIZATIONS[self.rule](evidence)
        return _Found(end.labels, generators, masses, colors, end.energies, end.converged)

    def detailed(self, variance: float, rng: np.random.Generator) -> _Found:
        """Find cells of patches, and filter in each what its generator leaves."""
        fused, weight = fuse(self.versions, self.trust)
        noise = float(np.sqrt(variance / weight.max()))
        found = restore_detail(fused, weight / weight.max(), noise, self.n_generators, self.effort, rng)
        labels = found.labels + 1
        generators, masses = self.measured(labels)
        rows = found.image.reshape(labels.size, -1)
        nothing = np.zeros((self.n_generators, rows.shape[1]))
        colors, _ = masked_means(rows, np.ones_like(rows), labels.ravel(), nothing)
        return _Found(labels, generators, masses, colors, (found.energy,), image=found.image)

    def measured(self, labels: NDArray[np.int32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(K, D) means of segments in the versions as they came, and (K, D) the weight behind them."""
        rows = self.versions.values.reshape(labels.size, -1)
        loads = self.versions.weights(self.trust).reshape(rows.shape)
        return masked_means(rows, loads, labels.ravel(), np.zeros((self.n_generators, rows.shape[1])))

    def start(self, blur: float) -> NDArray[np.int32]:
        """(H, W) cells, from 1, of the colors of the versions fused and blurred: nothing is missing there."""
        cells = tessellate(self.fused_rows(blur), self.n_generators, effort=self.effort)
        return (cells.labels + 1).reshape(self.data.known.shape[:2])

    def fused_rows(self, blur: float) -> Floats:
        """(N, C) colors of the versions fused and blurred; channels side by side."""
        parts = [fuse(look, trust, blur)[0] * np.float32(np.sqrt(trust.mean())) for look, trust in self.looks()]
        picture = np.concatenate(parts, axis=2)
        return picture.reshape(-1, picture.shape[2])

    def looks(self) -> list[tuple[Versions, NDArray[np.float64]]]:
        """Versions that look alike, with the trust in them: all together, or each channel by itself."""
        if not self.channels:
            return [(self.data, self.trust)]
        return [(self.data.only(number), self.trust[[number]]) for number in range(self.data.n_versions)]

    def settle(self, values: Floats, weights: Floats, labels: NDArray[np.int32]) -> EdgeWeighted | MaskedCells:
        """Lower the energy from some labels to where they rest."""
        average = self.averaging if self.averaging and self.averaging.when == "after" else None
        if self.edge_weight:
            return descend(
                values,
                average_masked(values, weights, labels, self.n_generators, average).labels if average else labels,
                self.n_generators,
                edge_weight=self.edge_weight,
                weights=weights,
                volume_power=self.volume_power,
            )
        end = masked_cells(values, weights, labels, self.n_generators, volume_power=self.volume_power)
        return average_masked(values, weights, end.labels, self.n_generators, average) if average else end


def _level(versions: Versions, space: str) -> float:
    """Return a level of 8 bits in the units of the first version's color space."""
    white = np.array([[peak(versions.dtype)]], versions.dtype)
    return float(to_space(white, space)[0, 0]) / 255


def _variance(noise: NDArray[np.float64], trust: NDArray[np.float64]) -> float:
    """Variance of the noise of a value of weight 1; NaN where no version tells."""
    told = np.isfinite(noise)
    return float((trust * noise**2)[told].mean()) if told.any() else np.nan


def _in_order(found: _Found, versions: Versions, space: str, **about: Any) -> Restoration:
    """Order the segments that are left from dark to bright, and bring places back to colors."""
    deep = np.dtype(np.float64)
    white = peak(versions.dtype) if space != "rgb" else 1.0
    n_left = np.bincount(found.labels.ravel(), minlength=len(found.colors) + 1)[1:]
    colors = from_space(found.colors, space, deep) * white
    order = np.lexsort((*colors.T[::-1], colors.sum(axis=1)))
    order = order[n_left[order] > 0]
    rank = np.zeros(len(colors) + 1, np.int32)
    rank[order + 1] = np.arange(1, len(order) + 1)
    labels = rank[found.labels]
    places = found.colors[order][labels - 1] if found.image is None else found.image
    rows = from_space(places.reshape(labels.size, -1).astype(np.float64), space, versions.dtype)
    image = rows.reshape(labels.shape if versions.grey else (*labels.shape, -1))
    generators = np.where(found.masses > 0, found.generators, np.nan)[order]
    return Restoration(
        image=image,
        labels=labels,
        generators=_by_version(generators, versions, space),
        colors=colors[order],
        coverage=versions.coverage,
        energy=found.energies[-1],
        energies=found.energies,
        converged=found.converged,
        **about,
    )


def _by_version(generators: NDArray[np.float64], versions: Versions, space: str) -> NDArray[np.float64]:
    """(K, S, C) generators in the units of each version, NaN in bands that a version does not have."""
    n_bands = np.bincount(versions.version_of)
    apart = np.full((len(generators), versions.n_versions, int(n_bands.max())), np.nan)
    for version, n in enumerate(n_bands):
        places = generators[:, versions.version_of == version]
        known = ~np.isnan(places).any(axis=1)
        white = peak(versions.dtypes[version]) if space != "rgb" else 1.0
        apart[known, version, :n] = from_space(places[known], space, np.dtype(np.float64)) * white
    return apart

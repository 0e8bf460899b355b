"""The result of a restoration, and how segments found in the stacked space become one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import peak
from cvtimg._shared.records import ReadOnly
from cvtimg.colors.spaces import from_space
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import encode_image, write_image
from cvtimg.pictures.showing import natural_limits, shown
from cvtimg.restoration.evidence import Evidence
from cvtimg.restoration.versions import Floats, Versions


@dataclass(frozen=True, slots=True, eq=False)
class Restoration(ReadOnly):
    """An image restored from several versions.

    Attributes
    ----------
    image : (H, W) or (H, W, C) array
        The restored image, of the shape and type of the first version, without alpha.
    labels : (H, W) int32 array
        Segment of each pixel, 1..K, from dark to bright. K can be less than requested, because segments can vanish.
    generators : (K, S, C) float64 array
        Mean of each segment in each version, in the units of the versions; NaN where a version does not know the
        segment, and in bands that it does not have.
    colors : (K, C) float64 array
        Color of each segment, after renormalization.
    coverage : (H, W) int32 array
        Number of versions that know each pixel.
    left_out : (H, W) int32 array
        Number of these that were left out there, because they disagree with the others; see `hidden`.
    noise : (S,) float64 array
        Standard deviation of the noise of each version, given or estimated, in the units of its color space; NaN where
        too little is known to estimate it.
    noise_shared : (2 L + 1, 2 L + 1, C, C) float64 array or None
        Autocovariance of the noise over rows, columns and bands, if `detail` was asked for and pixels next to each
        other share noise; in its middle, the covariance of the bands of a pixel. None where noise is white.
    noise_lines : (C, 2) float64 array or None
        Variance of the noise of weight 1 in each band, as a constant and a slope: constant + slope x level. None where
        noise is even, or `detail` was not asked for.
    noisy : bool
        Whether there is noise to take away: more than rounding to integers leaves, or what was given. If not, `detail`
        returns the version itself, or the mean of several.
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
    detail : bool
        Whether detail was restored, and `labels` are kinds of patches.
    edge_weight : float
        Penalty for each pair of near pixels in different segments, in squared 8-bit levels.
    energy : float
        Sum over pixels and versions of weight times squared distance to the generator, plus the penalties of edges;
        with `detail`, of the squared distances of patches to their generators.
    energies : tuple of float
        Energy before each sweep and at the end; it never rises.
    converged : bool
        Whether the segments converged.
    """

    image: NDArray[Any]
    labels: NDArray[np.int32]
    generators: NDArray[np.float64]
    colors: NDArray[np.float64]
    coverage: NDArray[np.int32]
    left_out: NDArray[np.int32]
    noise: NDArray[np.float64]
    noise_shared: NDArray[np.float64] | None
    noise_lines: NDArray[np.float64] | None
    noisy: bool
    weights: NDArray[np.float64]
    shifts: NDArray[np.float64]
    transforms: NDArray[np.float64]
    exposures: NDArray[np.float64] | None
    models: tuple[str, ...]
    misfits: NDArray[np.float64]
    detail: bool
    edge_weight: float
    energy: float
    energies: tuple[float, ...]
    converged: bool

    @property
    def noise_neighbors(self) -> float:
        """Correlation of the noise of pixels next to each other in a row; 0 where noise is white."""
        if self.noise_shared is None:
            return 0.0
        middle = len(self.noise_shared) // 2
        here, near = (np.einsum("cc->", self.noise_shared[middle, middle + apart]) for apart in (0, 1))
        return float(near / here)

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the restored image, as `write_image` does."""
        write_image(path, self.image, overwrite=overwrite)

    def _repr_png_(self) -> bytes:
        bands = self.image.reshape(*self.image.shape[:2], -1)
        bands = bands[:, :, :3] if bands.shape[2] >= 3 else bands[:, :, :1]
        return encode_image(".png", shown(bands, natural_limits(bands)))

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        noise = ", ".join(f"{one:.3g}" for one in self.noise[:8]) + (", ..." if len(self.noise) > 8 else "")
        return (
            f"Restoration({width} x {height} pixels of {self.image.dtype} from {len(self.weights)} versions, "
            f"{len(self.colors)} segments, noise=[{noise}], unknown={(self.coverage == 0).mean():.2%}, "
            f"left_out={(self.left_out > 0).mean():.2%})"
        )


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Segments in the stacked space, in any order; versions used at each pixel; and an image not made of segments."""

    labels: NDArray[np.int32]
    generators: NDArray[np.float64]
    masses: NDArray[np.float64]
    colors: NDArray[np.float64]
    energies: tuple[float, ...]
    used: NDArray[np.int32]
    edge_weight: float = 0.0
    converged: bool = True
    image: Floats | None = None


def in_order(found: Found, evidence: Evidence, space: SpaceName) -> Restoration:
    """Sort the segments that are left from dark to bright, and convert places in the color space to colors."""
    versions = evidence.placed
    deep = np.dtype(np.float64)
    white = peak(versions.dtype) if space != "rgb" else 1.0
    n_left = np.bincount(found.labels.ravel(), minlength=len(found.colors) + 1)[1:]
    bend = versions.bend
    straight = bend.straight if bend else np.asarray
    colors = from_space(straight(found.colors), space, deep) * white
    order = np.lexsort((*colors.T[::-1], colors.sum(axis=1)))
    order = order[n_left[order] > 0]
    rank = np.zeros(len(colors) + 1, np.int32)
    rank[order + 1] = np.arange(1, len(order) + 1)
    labels = rank[found.labels]
    places = straight(found.colors[order][labels - 1] if found.image is None else found.image)
    rows = from_space(places.reshape(labels.size, -1).astype(np.float64), space, versions.dtype)
    image = rows.reshape(labels.shape if versions.grey else (*labels.shape, -1))
    generators = np.where(found.masses > 0, found.generators, np.nan)[order]
    return Restoration(
        image=image,
        labels=labels,
        generators=_by_version(generators, versions, space),
        colors=colors[order],
        coverage=versions.coverage,
        left_out=versions.coverage - found.used,
        noise=evidence.noise * evidence.unit,
        noise_shared=evidence.shared.autocovariance * evidence.unit**2 if evidence.shared else None,
        noise_lines=bend.lines(evidence.variances(versions)[0]) if bend else None,
        noisy=evidence.is_noisy,
        weights=evidence.trust,
        shifts=evidence.alignment.shifts(labels.shape),
        transforms=evidence.alignment.transforms,
        exposures=versions.tones,
        models=evidence.alignment.models,
        misfits=evidence.misfits,
        detail=found.image is not None,
        edge_weight=found.edge_weight,
        energy=found.energies[-1],
        energies=found.energies,
        converged=found.converged,
    )


def _by_version(generators: NDArray[np.float64], versions: Versions, space: SpaceName) -> NDArray[np.float64]:
    """(K, S, C) generators in the units of each version, NaN in bands that a version does not have."""
    n_bands = np.bincount(versions.version_of)
    apart = np.full((len(generators), versions.n_versions, int(n_bands.max())), np.nan)
    for version, n in enumerate(n_bands):
        places = generators[:, versions.version_of == version]
        places = versions.bend.straight(places) if versions.bend else places
        known = ~np.isnan(places).any(axis=1)
        white = peak(versions.dtypes[version]) if space != "rgb" else 1.0
        apart[known, version, :n] = from_space(places[known], space, np.dtype(np.float64)) * white
    return apart

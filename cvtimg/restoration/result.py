"""Results of restoration, and how segments found in the stacked space become one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.choices import SpaceName
from cvtimg._shared.records import Claims, ReadOnly, never_rises
from cvtimg._shared.types import Array, Floats, Indices, Ints
from cvtimg.colors.spaces import from_space
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import encode_image, write_image
from cvtimg.pictures.showing import natural_limits, shown
from cvtimg.restoration.evidence import Evidence
from cvtimg.restoration.noise import SharedNoise
from cvtimg.restoration.versions import Versions


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

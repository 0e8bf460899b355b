"""What versions are: flat drawings, whose few colors explain what they show, or photographs; and how noisy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.threads import one_blas_thread
from cvtimg.engine import tessellate
from cvtimg.restoration.evidence import prepare
from cvtimg.restoration.merging import level_of
from cvtimg.restoration.noise import mean_noise, noise_of_bands
from cvtimg.restoration.versions import fuse, stack_versions, trust_in

#: Blur, in pixels, which removes most of the noise.
_BLUR = 2.0
#: A drawing has so many colors at most in this part of the pixels, those farthest from edges, some of which are looked
#: at. What they leave is below the variance of noise: drawings up to 0.6, photographs from 3 times that on.
_COLORS, _AWAY, _SAMPLED = 12, 0.5, 1 << 13


@one_blas_thread
def is_drawing(
    images: Sequence[Any],
    *,
    masks: Sequence[ArrayLike | None] | None = None,
    nodata: float | None = None,
    alpha: bool | None = None,
) -> bool:
    """Tell whether versions show a drawing in a few flat colors, for `restore`, and not a photograph, for `denoise`.

    Parameters
    ----------
    images, masks, nodata, alpha
        As in `restore`. Of versions that are out of place, give the first alone.

    Returns
    -------
    bool
        As far as noise lets see: a drawing where it hides what is faint.

    Examples
    --------
    >>> from cvtimg.restoration import is_drawing
    >>> is_drawing([np.eye(32)])
    True
    """
    from scipy.ndimage import gaussian_gradient_magnitude

    versions = stack_versions(images, masks, nodata, alpha=alpha)
    noise = mean_noise(noise_of_bands(versions))
    trust = trust_in(versions, None, noise)
    picture, weight = fuse(versions, trust, _BLUR)
    slopes = sum(np.square(gaussian_gradient_magnitude(band, 1.0)) for band in np.moveaxis(picture, 2, 0))
    slope = np.asarray(slopes).ravel()
    rows = picture.reshape(slope.size, -1)[slope <= np.quantile(slope, _AWAY)]
    rows = rows[:: -(-len(rows) // _SAMPLED)].astype(np.float64)
    cells = tessellate(rows, min(_COLORS, len(np.unique(rows, axis=0))), effort="fast")
    left = np.square(rows - cells.generators[cells.labels]).mean()
    noisy = float(np.mean(trust * np.nan_to_num(noise) ** 2))
    noisy /= max(float(weight.mean()), 1e-9) * 4 * np.pi * _BLUR**2
    return bool(left <= noisy + (versions.rounding / 2) ** 2)  # a level of 8 bits is lost by rounding


@dataclass(frozen=True, slots=True)
class MeasuredNoise:
    """The noise of versions, in 8-bit levels at any depth.

    Attributes
    ----------
    levels : tuple of float
        Standard deviation in each version; NaN where too little is known.
    slope : float
        How much the variance grows with each level, a mean over bands, as that of light does; 0 where noise is even.
    neighbors : float
        Correlation of the noise of pixels next to each other in a row; 0 where noise is white.
    """

    levels: tuple[float, ...]
    slope: float
    neighbors: float


@one_blas_thread
def measure_noise(
    images: Sequence[Any],
    *,
    masks: Sequence[ArrayLike | None] | None = None,
    nodata: float | None = None,
    alpha: bool | None = None,
) -> MeasuredNoise:
    """Measure the noise of versions of one image, or of a single one, as `denoise` does.

    Parameters
    ----------
    images, masks, nodata, alpha
        As in `restore`. Versions are in place.

    Returns
    -------
    MeasuredNoise

    References
    ----------
    G. Chen, F. Zhu, P. A. Heng, ICCV 2015, doi 10.1109/ICCV.2015.62, for the level.

    Examples
    --------
    >>> from cvtimg.restoration import measure_noise
    >>> rng = np.random.default_rng(0)
    >>> found = measure_noise([rng.normal(128, 5, (64, 64)).astype(np.uint8)])
    >>> 4 < found.levels[0] < 6, found.slope, found.neighbors
    (True, 0.0, 0.0)
    """
    given = stack_versions(images, masks, nodata, alpha=alpha)
    evidence = prepare(given, None, align=None, hidden="none", level=None, white=False)
    noise, lines, unit = evidence.noise, evidence.noise_lines, level_of(given, "rgb")
    slope = 0.0 if lines is None else float(lines[:, 1].mean() / unit)
    levels = tuple((noise.levels / unit).tolist())
    return MeasuredNoise(levels, slope, noise.shared.neighbors if noise.shared else 0.0)

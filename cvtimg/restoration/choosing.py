"""Versions restored as what they show: drawings in segments, photographs with their detail."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.choices import AlignName
from cvtimg._shared.types import Array, Bools
from cvtimg.files.whole import StrPath
from cvtimg.restoration.reconstruction import denoise, is_drawing, restore
from cvtimg.restoration.result import Denoised
from cvtimg.restoration.versions import with_tables

#: Arguments of `restore` alone, and of `denoise` alone.
FOR_SEGMENTS = {"n_generators", "channels", "edge_weight", "renormalize"}
FOR_PATCHES = {"noise_like", "rng", "luma", "chroma"}
#: Correlation of neighbors in what a restored drawing leaves of one version, from which on it was no drawing.
_STRUCTURE = 0.08


def restore_versions(
    images: Sequence[Any],
    paths: Sequence[StrPath] = (),
    *,
    flat: bool | None = None,
    masks: Sequence[ArrayLike | None] | None = None,
    nodata: float | None = None,
    alpha: bool | None = None,
    align: bool | AlignName = False,
    **options: Any,
) -> Denoised:
    """Restore versions of one image by `cvtimg.restore` or `cvtimg.denoise`, whichever suits what they show.

    Parameters
    ----------
    images, masks, nodata, alpha, align
        As in `cvtimg.restore`.
    paths : sequence of paths, optional
        Files of the images: what JPEG has rounded away of those is known from their tables, where detail is restored.
    flat : bool, optional
        Whether the image has few flat colors; by default as `is_drawing` tells, unless segments of a single image leave
        more of it than noise.
    **options
        Those of `cvtimg.restore` and of `cvtimg.denoise`; those of the other are left out.

    Examples
    --------
    >>> from cvtimg.restoration import restore_versions
    >>> type(restore_versions([np.eye(32)])).__name__
    'Restoration'
    """
    about: dict[str, Any] = {"masks": masks, "nodata": nodata, "alpha": alpha}
    for_detail = {name: value for name, value in options.items() if name not in FOR_SEGMENTS}
    for_segments = {name: value for name, value in options.items() if name not in FOR_PATCHES}
    if for_segments.get("effort") == "auto":
        del for_segments["effort"]
    if flat or (flat is None and is_drawing(images[: 1 if align else None], **about)):
        result = restore(images, align=align, **about, **for_segments)
        if flat or len(images) > 1 or not _leaves_structure(result.image, images[0], result.coverage > 0):
            return result
    images = [with_tables(image, path) for image, path in zip(images, paths, strict=True)] if paths else images
    return denoise(images, align=align, **about, **for_detail)


def _leaves_structure(image: Array, version: Array, known: Bools) -> bool:
    """Tell whether what a restored image leaves of a version is more than noise, as faint text is."""
    bands = image.reshape(*known.shape, -1)
    values = np.asarray(version).reshape(*known.shape, -1)[:, :, : bands.shape[2]]
    inside = known[:, :, None] & (values > values.min()) & (values < values.max())  # what is clipped has a mean
    apart = np.where(inside, values - bands.astype(np.float64), 0.0)
    power = np.square(apart).sum()
    pairs = [(apart[1:] * apart[:-1]).sum(), (apart[:, 1:] * apart[:, :-1]).sum()]
    return bool(power and np.mean(pairs) > _STRUCTURE * power)

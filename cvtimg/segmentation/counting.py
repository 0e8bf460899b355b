"""Objects counted without settings: what segments need to be told is measured on the image itself.

Two generators that vary across the image, of the background and of the objects, divide its pixels: each is the local
mean of its own pixels, so that uneven light moves both. An object that is dimmer than its neighbors is found when these
have been taken away, at half of its own contrast. Objects that touch are split where the logarithm of the distance to
the background has a saddle, that is, at necks that are narrow for their own size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_non_negative, check_partial_image, hints_at_keywords
from cvtimg.segmentation.noise import estimate_noise
from cvtimg.segmentation.result import Counting, Segmentation, measured
from cvtimg.segmentation.touching import BACKGROUNDS, numbered, split_at_saddles, with_own_borders

#: Blur before anything else, in pixels: by the noise, of this share of the contrast, and within these limits.
_BLUR_OF_NOISE, _BLURS = 4.0, (0.7, 3.0)
#: Blur of the generators, as a share of the longer side, and how many pixels of a class their global means count for.
_REACH, _PRIOR = 0.125, (0.02, 0.05)
_BLOCKS_IN_REACH = 4
_MAX_ROUNDS = 15
#: Times the noise that the blur leaves: by which objects differ from the background, and pixels of a dim one.
_SIGNIFICANT, _ABOVE_NOISE = 4.0, 5.0
#: The dimmest objects, as a share of the contrast of the others, and how often brighter ones are taken away.
_DIMMEST, _N_PEELS = 0.15, 3
#: Level of an object: of its pixels, this share is darker.
_LEVEL = 0.9
#: Rise, in the logarithm of the distance plus so many pixels, above a saddle between two objects.
_DEPTH, _OFFSET = 0.015, 0.7
_BLUR_OF_DISTANCE = 0.8
#: Objects whose radius is less are divided on a grid twice as fine.
_SMALL = 9.0
#: The least object, as a share of the usual one.
_LEAST = 0.12

_Floats = NDArray[np.float32]


@hints_at_keywords
def count_objects(
    image: Any, *, background: str = "largest", min_size: float | None = None, mask: ArrayLike | None = None
) -> Segmentation:
    """Find the objects of an image, such as nuclei in a micrograph, without settings.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Any integer or floating point type; of several bands the mean counts.
    background : {"largest", "darkest", "brightest"}
        What lies behind the objects: by default, what covers more than half of the image.
    min_size : float, optional
        Smallest object that counts, in pixels; by default 12 % of the usual one.
    mask : (H, W) array, optional
        Pixels to look at: those where the mask is not 0.

    Returns
    -------
    Segmentation
        Labels of the objects from 1, in reading order, and 0 for the background; none where nothing stands out from the
        noise. `counting` says what was measured.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it.

    See Also
    --------
    segment : With ``objects=True``, by a number of segments, and with settings for borders and necks.

    References
    ----------
    T. Chan, L. Vese, IEEE Transactions on Image Processing 10 (2001) 266-277, doi 10.1109/83.902291: regions by their
    means. C. Li et al., IEEE Transactions on Image Processing 17 (2008) 1940-1949, doi 10.1109/TIP.2008.2002304: means
    that are local. Objects one brightness after the other, and necks by the logarithm, are our own.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.segmentation import count_objects
    >>> down, right = np.mgrid[:60, :90]
    >>> discs = [(30, 25, 12), (30, 46, 12), (30, 74, 8)]
    >>> image = 200.0 * np.any([np.hypot(down - y, right - x) < r for y, x, r in discs], axis=0)
    >>> found = count_objects(image + np.random.default_rng(0).normal(0, 20, image.shape))
    >>> found.n_segments, round(found.counting.radius)
    (3, 12)
    """
    check_choice("background", background, BACKGROUNDS)
    least = None if min_size is None else check_non_negative("min_size", min_size)
    bands, inside = check_partial_image("image", image, mask)
    labels, counting = _counted(bands, inside, background, least)
    return measured(np.where(inside, labels, np.int32(0)), bands, counting=counting)


def _counted(
    bands: NDArray[Any], inside: NDArray[np.bool_], background: str, least: float | None
) -> tuple[NDArray[np.int32], Counting]:
    """Return the labels of objects, and what was measured to find them."""
    from scipy.ndimage import distance_transform_edt

    gray = bands.mean(axis=2, dtype=np.float32)
    gray[~inside] = np.median(gray[inside])
    smooth, blur, noise = _denoised(gray)
    contrast, step = _contrast(smooth, inside, background)
    bright = (contrast > 0.5) & inside
    if not bright.any() or abs(step) <= _SIGNIFICANT * noise:
        return np.zeros(inside.shape, np.int32), Counting(step < 0, blur, 0.0, 0.0)
    # In a disc, the mean of the squared distance to its rim is a sixth of its squared radius.
    radius = float(np.sqrt(6 * np.mean(distance_transform_edt(bright)[bright] ** 2)))
    threshold = float(np.clip(_ABOVE_NOISE * noise / abs(step), _DIMMEST, 0.5))
    objects = _split(contrast, inside, threshold, radius)
    objects = with_own_borders(objects, contrast[:, :, None], np.zeros(1, np.float32))
    sizes = np.bincount(objects.ravel())
    sizes[0] = 0
    if least is None:
        least = float(_LEAST * np.average(sizes, weights=sizes)) if sizes.any() else 0.0
    kept = numbered(np.where(sizes[objects] >= max(least, 1), objects, 0))
    return kept, Counting(step < 0, blur, radius, least)


def _denoised(gray: _Floats) -> tuple[_Floats, float, float]:
    """Return a blurred image, the blur that its noise calls for, and the noise that is left."""
    from scipy.ndimage import gaussian_filter

    noise = float(estimate_noise(gray)[0])
    first = gaussian_filter(gray, 2.0)
    bright = first > _otsu(first)
    step = float(first[bright].mean() - first[~bright].mean()) if 0 < bright.sum() < bright.size else 0.0
    blur = float(np.clip(_BLUR_OF_NOISE * noise / step, *_BLURS)) if step else _BLURS[0]
    return gaussian_filter(gray, blur), blur, noise / (2 * np.sqrt(np.pi) * blur)


def _otsu(image: _Floats) -> float:
    from skimage.filters import threshold_otsu

    return float(threshold_otsu(image)) if np.ptp(image) else float(image.flat[0])  # type: ignore[no-untyped-call]


def _contrast(image: _Floats, inside: NDArray[np.bool_], background: str) -> tuple[_Floats, float]:
    """Return where pixels lie between the generators of background, 0, and objects, 1, and their mean difference."""

    def generator(values: _Floats, of: NDArray[np.bool_], prior: float) -> _Floats:
        return _local_mean(values, of, _REACH * max(image.shape), prior)

    objects = (image > _otsu(image[inside])) & inside
    if background == "brightest" or (background == "largest" and 2 * objects.sum() > inside.sum()):
        objects = ~objects & inside
    contrast, step = np.zeros_like(image), 0.0
    for _ in range(_MAX_ROUNDS):
        if not objects.any() or not (inside & ~objects).any():
            break
        ground = generator(image, inside & ~objects, _PRIOR[0])
        above = generator(image - ground, objects, _PRIOR[1])
        step = float(above.mean())
        scale = np.where(above * step > 0, above, step or 1).astype(np.float32)
        contrast = (image - ground) / scale
        before, objects = objects, (contrast > 0.5) & inside
        if (objects != before).mean() < 1e-4:
            break
    return contrast, step


def _local_mean(values: _Floats, of: NDArray[np.bool_], reach: float, prior: float) -> _Floats:
    """Return the Gaussian mean of some pixels around each, drawn to the mean of all where there are few of them."""
    from scipy.ndimage import gaussian_filter, zoom

    size = max(int(reach / _BLOCKS_IN_REACH), 1)  # blocks are fine enough for what varies so slowly
    height, width = (-(-side // size) for side in of.shape)
    padding = [(0, height * size - of.shape[0]), (0, width * size - of.shape[1])]

    def blurred(pixels: NDArray[Any]) -> NDArray[np.float64]:
        blocks = np.pad(pixels, padding).reshape(height, size, width, size).sum(axis=(1, 3), dtype=np.float64)
        return np.asarray(gaussian_filter(blocks / size**2, reach / size, mode="nearest"))

    mean = values[of].mean(dtype=np.float64)
    local = (blurred(np.where(of, values, np.float32(0))) + prior * mean) / (blurred(of) + prior)
    whole = zoom(local.astype(np.float32), size, order=1, grid_mode=True, mode="nearest")
    return np.asarray(whole[: of.shape[0], : of.shape[1]])


def _split(contrast: _Floats, inside: NDArray[np.bool_], threshold: float, radius: float) -> NDArray[np.int32]:
    """Return labels of the objects, touching ones split at their necks."""
    from scipy.ndimage import distance_transform_edt, gaussian_filter, zoom

    fine = 2 if radius < _SMALL else 1
    if fine > 1:
        contrast = zoom(contrast, fine, order=1, grid_mode=True, mode="nearest")
        inside = inside.repeat(fine, axis=0).repeat(fine, axis=1)
    objects = _peeled(np.where(inside, contrast, np.float32(0)), threshold, round(max(radius * fine / 3, 1)))
    distance = gaussian_filter(distance_transform_edt(objects), _BLUR_OF_DISTANCE * fine, mode="nearest") / fine
    return split_at_saddles(np.log(np.where(objects, distance, 0) + _OFFSET), objects, _DEPTH)[::fine, ::fine]


def _peeled(contrast: _Floats, threshold: float, radius: int) -> NDArray[np.bool_]:
    """Return the pixels of objects at half of the contrast of each: bright ones first, then what they leave."""
    from scipy.ndimage import binary_dilation, binary_opening
    from skimage.measure import label
    from skimage.morphology import disk

    rest, found = contrast > threshold, np.zeros(contrast.shape, np.bool_)
    for _ in range(_N_PEELS):
        pieces = np.asarray(label(rest, connectivity=1))  # type: ignore[no-untyped-call]
        if not pieces.any():
            break
        values, own = contrast[rest], pieces[rest]
        order = np.lexsort((values, own))
        ends = np.cumsum(np.bincount(own)[1:])
        starts = ends - np.bincount(own)[1:]
        levels = values[order][starts + (_LEVEL * (ends - starts - 1)).astype(np.int64)]
        core = rest & (contrast > 0.5 * np.append(np.inf, levels)[pieces])
        found |= core
        rest = binary_opening(rest & ~binary_dilation(core, iterations=2), disk(radius))  # type: ignore[no-untyped-call]
    return found

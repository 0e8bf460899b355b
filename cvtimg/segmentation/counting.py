"""Objects counted without settings: what segments need to be told is measured on the image itself.

Two generators that vary across the image, of the background and of the objects, divide its pixels: each is the local
mean of its own pixels, so that uneven light moves both. An object that is dimmer than its neighbors is found when these
have been taken away, at half of its own median contrast. What a convex outline encloses is part of its object. Objects
that touch are split where the logarithm of the distance to the background has a saddle, that is, at necks that are
narrow for their own size.

Volumes are counted in the same way, with lengths in pixels of a plane. What needs several arrays at a time is done in
tiles that overlap.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import (
    check_choice,
    check_non_negative,
    check_partial_image,
    check_shape,
    check_that,
    hints_at_keywords,
)
from cvtimg.segmentation.local_means import local_mean, spread
from cvtimg.segmentation.noise import estimate_noise
from cvtimg.segmentation.result import Counting, Segmentation, measured
from cvtimg.segmentation.touching import BACKGROUNDS, numbers_of, split_at_saddles, with_own_borders

#: Blur before anything else, in pixels: by the noise, of this share of the contrast, and within these limits.
_BLUR_OF_NOISE, _BLURS = 4.0, (0.7, 3.0)
#: Blur of the generators, as a share of the longer side, and how many pixels of a class their global means count for.
#: Across planes, as a share of their number.
_REACH, _PRIOR, _REACH_ACROSS = 0.125, (0.02, 0.05), 0.25
_MAX_ROUNDS = 15
#: Planes of a volume in which noise is measured.
_SOME_PLANES = 9
#: Generators that vary so slowly are found on so many pixels.
_ENOUGH_PIXELS = 1 << 22
#: Pixels of a tile, and how far tiles overlap, in radii of the usual object.
_TILE, _OVERLAP = 1 << 24, 4.0
#: Times the noise that the blur leaves: by which objects differ from the background, and pixels of a dim one.
_SIGNIFICANT, _ABOVE_NOISE = 4.0, 5.0
#: The dimmest objects, as a share of the contrast of the others, and how often brighter ones are taken away.
_DIMMEST, _N_PEELS = 0.15, 3
#: What fills so much of its convex hull is one object; two discs that overlap by a sixth of their width fill as much.
_CONVEX = 0.93
#: Rise, in the logarithm of the distance plus so many pixels, above a saddle between two objects.
_DEPTH, _OFFSET = 0.015, 0.7
_BLUR_OF_DISTANCE = 0.8
#: Objects whose radius is less are divided on a grid twice as fine.
_SMALL = 9.0
#: The least object, as a share of the usual one.
_LEAST = 0.12

_Floats = NDArray[np.float32]
_Inside = NDArray[np.bool_]


@hints_at_keywords
def count_objects(
    image: Any,
    *,
    spacing: Sequence[float] | None = None,
    background: str = "largest",
    min_size: float | None = None,
    mask: ArrayLike | None = None,
) -> Segmentation:
    """Find the objects of an image or a volume, such as nuclei in a micrograph, without settings.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image; with `spacing`, (Z, H, W) or (Z, H, W, C) array
        Any integer or floating point type; of several bands the mean counts.
    spacing : (float, float, float), optional
        Distances of voxels along Z, H and W in any unit, for a volume of square pixels: the last two are the same.
    background : {"largest", "darkest", "brightest"}
        What lies behind the objects: by default, what covers more than half of the image.
    min_size : float, optional
        Smallest object that counts, in pixels or voxels; by default 12 % of the usual one.
    mask : array of the size of the image, optional
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
    cvtimg.labels.volume_table : Measures of objects in a volume.

    Notes
    -----
    Some 15 bytes a pixel are in use, and up to 1 GB more: about 5 GB for 60 planes of 2048 by 2048; a quarter of that
    took 1.2 GB.

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
    >>> discs = [(30, 25, 12.3), (30, 46, 12.3), (30, 74, 8.3)]
    >>> image = 200.0 * np.any([np.hypot(down - y, right - x) < r for y, x, r in discs], axis=0)
    >>> found = count_objects(image + np.random.default_rng(0).normal(0, 20, image.shape))
    >>> found.n_segments, 10 < found.counting.radius < 15
    (3, True)
    """
    check_choice("background", background, BACKGROUNDS)
    least = None if min_size is None else check_non_negative("min_size", min_size)
    if spacing is None:
        bands, inside = check_partial_image("image", image, mask)
        size: tuple[float, ...] = (1.0, 1.0)
    else:
        bands, inside = _volume(image, mask)
        size = (_between_planes(spacing), 1.0, 1.0)
    labels, counting = _counted(bands, inside, background, least, size)
    return measured(labels, bands, counting=counting)


def _volume(image: Any, mask: ArrayLike | None) -> tuple[NDArray[Any], _Inside]:
    """Check a volume; return it with an axis of bands, and its voxels that count."""
    volume = np.asarray(image)
    shape = volume.shape
    check_shape("image", shape, volume.ndim in (3, 4) and volume.size > 0, "(Z, H, W) or (Z, H, W, C), with spacing")
    check_that(f"image of type {volume.dtype}", volume.dtype.kind in "uif", "be of integers or floating point")
    bands = volume.reshape(*shape[:3], -1)
    inside = np.ones(shape[:3], np.bool_) if mask is None else np.asarray(mask) != 0
    check_shape("mask", inside.shape, inside.shape == shape[:3], f"{shape[:3]}, the size of the volume")
    if volume.dtype.kind == "f":
        inside = inside & np.isfinite(bands).all(axis=3)
    check_that("image", bool(inside.any()), "have at least one voxel that is in the mask and finite")
    return bands, inside


def _between_planes(spacing: Sequence[float]) -> float:
    """Return the distance of planes in pixels."""
    sides = np.asarray(spacing, np.float64)
    fits = sides.shape == (3,) and np.isfinite(sides).all() and sides.min() > 0
    check_that(f"spacing={spacing}", bool(fits), "be three distances > 0, along Z, H and W")
    check_that(f"spacing={spacing}", bool(np.isclose(sides[1], sides[2], rtol=0.01)), "be the same along H and W")
    return float(sides[0] / sides[1:].mean())


def _counted(
    bands: NDArray[Any], inside: _Inside, background: str, least: float | None, size: tuple[float, ...]
) -> tuple[NDArray[np.int32], Counting]:
    """Return the labels of objects, and what was measured to find them; `size` is that of pixels along the axes."""
    gray = bands.mean(axis=-1, dtype=np.float32)
    if not inside.all():
        gray[~inside] = np.median(gray[inside])
    smooth, blur, noise = _denoised(gray, size)
    del gray
    contrast, step = _contrast(smooth, inside, background)
    radius = _radius((contrast > 0.5) & inside, size)
    if not radius or abs(step) <= _SIGNIFICANT * noise:
        return np.zeros(inside.shape, np.int32), Counting(step < 0, blur, 0.0, 0.0)
    threshold = float(np.clip(_ABOVE_NOISE * noise / abs(step), _DIMMEST, 0.5))
    objects = np.zeros(inside.shape, np.int32)
    for tile, core in _tiles(inside.shape, round(_OVERLAP * radius)):
        found = _split(contrast[tile], inside[tile], threshold, radius, size)
        found = with_own_borders(found, contrast[tile][..., None], np.zeros(1, np.float32))
        _enter(objects[tile], found, core, int(objects.max()))
    sizes = np.bincount(objects.ravel())
    sizes[0] = 0
    if least is None:
        least = float(_LEAST * np.average(sizes, weights=sizes)) if sizes.any() else 0.0
    return numbers_of(sizes >= max(least, 1))[objects], Counting(step < 0, blur, radius, least)


def _radius(bright: _Inside, size: tuple[float, ...]) -> float:
    """Return the radius of the usual object, 0 if there is none; of a large image, in its middle."""
    from scipy.ndimage import distance_transform_edt

    side = max(int((_TILE / bright[..., 0, 0].size) ** 0.5), 1)
    starts = [max(length - side, 0) // 2 for length in bright.shape[-2:]]
    middle = bright[..., starts[0] : starts[0] + side, starts[1] : starts[1] + side]
    shown = _whole(middle if middle.any() else bright)
    if not shown.any():
        return 0.0
    # In a ball of n dimensions, the mean squared distance to its rim is 2 / (n + 1) (n + 2) of its squared radius.
    n = sum(length > 1 for length in shown.shape)
    mean = np.mean(distance_transform_edt(shown, size)[shown] ** 2)
    return float(np.sqrt((n + 1) * (n + 2) / 2 * mean))


def _tiles(shape: tuple[int, ...], overlap: int) -> Iterator[tuple[tuple[slice, ...], tuple[slice, ...]]]:
    """Yield overlapping tiles of planes, and the core of each, which belongs to no other, in its coordinates."""
    n_planes = int(np.prod(shape[:-2]))
    side = max(int((_TILE / n_planes) ** 0.5) - 2 * overlap, 4 * overlap, 1)
    along = []
    for length in shape[-2:]:
        n_parts = max(-(-length // side), 1) if length > side + 2 * overlap else 1
        ends = [length * part // n_parts for part in range(n_parts + 1)]
        parts = [(low, high, max(low - overlap, 0), min(high + overlap, length)) for low, high in pairwise(ends)]
        along.append([(slice(first, last), slice(low - first, high - first)) for low, high, first, last in parts])
    for down, right in product(*along):
        every = (slice(None),) * (len(shape) - 2)
        yield (*every, down[0], right[0]), (*every, down[1], right[1])


def _enter(objects: NDArray[np.int32], found: NDArray[np.int32], core: tuple[slice, ...], last: int) -> None:
    """Enter the objects of a tile whose middle is in its core, where no other is; numbers follow the last."""
    from scipy.ndimage import find_objects

    if tuple(part.stop - part.start for part in core[-2:]) == found.shape[-2:]:
        objects[:] = found
        return
    for label, box in enumerate(find_objects(found), start=1):
        here = found[box] == label
        middles = [part.start + at.mean() for part, at in zip(box, here.nonzero(), strict=True)][-2:]
        if all(part.start <= middle < part.stop for part, middle in zip(core[-2:], middles, strict=True)):
            last += 1
            objects[box][here & (objects[box] == 0)] = last


def _denoised(gray: _Floats, size: tuple[float, ...]) -> tuple[_Floats, float, float]:
    """Return a blurred image, the blur that its noise calls for, and the noise that is left."""
    from scipy.ndimage import gaussian_filter

    planes = gray.reshape(-1, *gray.shape[-2:])
    some = planes[:: -(-len(planes) // _SOME_PLANES)]
    noise = float(np.median([estimate_noise(plane)[0] for plane in some]))
    first = np.stack([gaussian_filter(plane, 2.0) for plane in some])
    bright = first > _otsu(first)
    step = float(first[bright].mean() - first[~bright].mean()) if 0 < bright.sum() < bright.size else 0.0
    blur = float(np.clip(_BLUR_OF_NOISE * noise / step, *_BLURS)) if step else _BLURS[0]
    sigmas = [blur / side for side in size]
    left = [min(1.0, (2 * np.sqrt(np.pi) * sigma) ** -0.5) for sigma in sigmas]
    return gaussian_filter(gray, sigmas), blur, noise * float(np.prod(left))


def _otsu(values: _Floats) -> float:
    from skimage.filters import threshold_otsu

    return float(threshold_otsu(values)) if np.ptp(values) else float(values.flat[0])  # type: ignore[no-untyped-call]


def _contrast(image: _Floats, inside: _Inside, background: str) -> tuple[_Floats, float]:
    """Return where pixels lie between the generators of background, 0, and objects, 1, and their mean difference.

    The image is overwritten.
    """
    apart = max(int(np.sqrt(image.size / _ENOUGH_PIXELS)), 1)
    some, counts = image[..., ::apart, ::apart], inside[..., ::apart, ::apart]
    reach = [_REACH_ACROSS * length for length in some.shape[:-2]] + [_REACH * max(some.shape[-2:])] * 2
    objects = (some > _otsu(some[counts])) & counts
    if background == "brightest" or (background == "largest" and 2 * objects.sum() > counts.sum()):
        objects = ~objects & counts
    step, generators = 0.0, None
    for _ in range(_MAX_ROUNDS):
        rest = counts & ~objects
        if not objects.any() or not rest.any():
            break
        ground = local_mean(some, rest, reach, _PRIOR[0])
        beyond = some - spread(ground, some.shape)
        above = local_mean(beyond, objects, reach, _PRIOR[1])
        step = float(spread(above, some.shape).mean())
        generators = ground, np.where(above * step > 0, above, step or 1).astype(np.float32)
        before, objects = objects, (beyond / spread(generators[1], some.shape) > 0.5) & counts
        if (objects != before).mean() < 1e-4:
            break
    if generators is None:
        return np.zeros_like(image), 0.0
    if image.ndim == 2:
        return _between(image, *generators), step
    along = [spread(field, (len(image), *field.shape[1:])) for field in generators]
    for plane, *fields in zip(image, *along, strict=True):
        plane[:] = _between(plane, *fields)
    return image, step


def _between(image: _Floats, ground: _Floats, scale: _Floats) -> _Floats:
    """Return where values lie between those of two fields that are known in blocks."""
    return (image - spread(ground, image.shape)) / spread(scale, image.shape)


def _split(
    contrast: _Floats, inside: _Inside, threshold: float, radius: float, size: tuple[float, ...]
) -> NDArray[np.int32]:
    """Return labels of the objects, touching ones split at their necks."""
    from scipy.ndimage import distance_transform_edt, gaussian_filter, zoom

    fine = 2 if radius < _SMALL and contrast.ndim == 2 else 1
    if fine > 1:
        contrast = zoom(contrast, fine, order=1, grid_mode=True, mode="nearest")
        inside = inside.repeat(fine, axis=0).repeat(fine, axis=1)
    objects = _peeled(np.where(inside, contrast, np.float32(0)), threshold, max(radius * fine / 3, 1), size)
    sigmas = [_BLUR_OF_DISTANCE * fine / side for side in size]
    distance = gaussian_filter(distance_transform_edt(objects, size).astype(np.float32), sigmas, mode="nearest") / fine
    height = np.log(np.where(objects, distance, np.float32(0)) + np.float32(_OFFSET))
    return split_at_saddles(height, objects, _DEPTH)[(slice(None, None, fine),) * contrast.ndim]


def _peeled(contrast: _Floats, threshold: float, radius: float, size: tuple[float, ...]) -> _Inside:
    """Return the pixels of objects at half of the contrast of each: bright ones first, then what they leave."""
    from scipy.ndimage import binary_dilation, distance_transform_edt, label, median

    rest, found = contrast > threshold, np.zeros(contrast.shape, np.bool_)
    for _ in range(_N_PEELS):
        pieces, n_pieces = label(rest)
        if np.count_nonzero(rest) * np.prod(size) <= radius**rest.ndim:
            break
        levels = np.append(np.inf, median(contrast, pieces, np.arange(1, n_pieces + 1)))
        core = rest & (contrast > 0.5 * levels[pieces])
        found |= core
        # What is left counts where it is thick: in balls of this radius.
        kernels = distance_transform_edt(rest & ~binary_dilation(core, iterations=2), size) > radius
        rest = distance_transform_edt(~kernels, size) <= radius if kernels.any() else kernels
    return _whole(found)


def _whole(objects: _Inside) -> _Inside:
    """Fill what convex outlines enclose: an object is whole whatever is in it, but between several is background."""
    from scipy.ndimage import binary_erosion, binary_fill_holes, find_objects, label
    from scipy.spatial import ConvexHull

    filled = np.asarray(binary_fill_holes(objects))
    pieces, n_pieces = label(filled)
    with_holes = np.bincount(pieces[filled & ~objects], minlength=n_pieces + 1) > 0
    whole = objects.copy()
    for number, box in enumerate(find_objects(pieces), start=1):
        if with_holes[number]:
            own = pieces[box] == number
            rim = np.argwhere(own & ~binary_erosion(own))
            corners = np.concatenate([rim + way for way in product((-0.5, 0.5), repeat=own.ndim)])
            if np.count_nonzero(own) > _CONVEX * ConvexHull(corners).volume:
                whole[box] |= own
    return whole

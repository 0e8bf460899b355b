"""Objects counted without settings: what segments need to be told is measured on the image itself.

Two generators that vary across the image, of the background and of the objects, divide its pixels: each is the local
mean of its own pixels, so that uneven light moves both. An object that is dimmer than its neighbors is found when these
have been taken away, at half of its own median contrast. What a convex outline encloses is part of its object. Objects
that touch are split where the logarithm of the distance to the background has a saddle, that is, at necks that are
narrow for their own size.

Volumes are counted in the same way, with lengths in pixels of a plane. What needs several arrays at a time is done in
tiles that overlap.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage

from cvtimg._shared.checks import check_choice, check_non_negative, check_partial_image, check_shape, check_that
from cvtimg._shared.messages import warn
from cvtimg._shared.types import Array, Bools, Floats32, ImageLike, Ints, Ints64
from cvtimg.engine.points import scale_for_float32
from cvtimg.segmentation.field_of_view import (
    CONVEX,
    SEVERAL,
    are_bright,
    evenly_lit,
    left_by_two,
    surroundings,
    within_margins,
    without_light,
)
from cvtimg.segmentation.local_means import PRIOR, REACH, local_mean, spread
from cvtimg.segmentation.necks import join_at_ripples
from cvtimg.segmentation.noise import MEDIAN_OF_NORMAL, noise_covariance, without_impulses
from cvtimg.segmentation.result import Counting, Segmentation, measured
from cvtimg.segmentation.touching import (
    BACKGROUNDS,
    ROUNDS,
    largest_by_label,
    numbers_of,
    split_at_saddles,
    with_own_borders,
)
from cvtimg.segmentation.values import from_nearest


@dataclass(frozen=True, slots=True)
class Settings:
    """What is an object, in shares of what is measured: lengths of the usual radius, contrasts of the usual one."""

    blur_of_noise: float = 4.0  # pixels of blur before anything else, for noise as large as the contrast
    blurs: tuple[float, float] = (0.7, 3.0)  # at least what sampling needs, also of distances; at most what keeps necks
    object_prior: float = 0.05  # how much the mean of all counts where objects are far, as ground is nowhere
    tile: int = 1 << 23  # pixels at a time, for 1 GB of memory; noise and generators do not need more
    above_noise: float = 5.0  # times the noise that the blur leaves, by which objects differ from the background
    dimmest: float = 0.15  # contrast of the dimmest objects
    thin: float = 1 / 3  # what brighter objects leave counts where it is thicker
    full: float = 0.7  # of their parts, what three of four discs of a clump fill; parts of objects with pores, 0.63
    spots: float = 0.001  # share of what lies deep in objects that is no part of them; more takes texture for gaps
    depth: float = 0.015  # of saddles, in the logarithm of the distance and the least blur
    small: float = 9.0  # objects of a smaller radius in pixels are divided on a grid twice as fine
    least_size: float = 0.12  # of the usual object's pixels
    most_discs: float = 4.0  # the usual object, in discs that fit in it: a rod has three, a ring more; overlap of tiles
    outline: float = 2.5  # noise of outlines, in pixels, per noise of contrast and pixel of blur: one over their slope
    most_cover: float = 0.9  # of what counts, by objects; above, the background is in doubt
    flat: float = 0.6  # of their width, how deep objects of a volume of cubes are at least; below, cubes are in doubt
    clipped: float = 3.0  # noises above the ground from which on nothing is ground; more takes dim objects for it
    doubt: float = 1.5  # of what terms of light miss, from which on contrasts count; more takes dim objects for light
    bin: float = 0.0625  # half the width of the bins of contrast in which pixels are counted


#: Those of `count_objects`.
SETTINGS = Settings()
#: Noise of outlines in pixels, of which ripples are told from necks, and the depth of necks if that is said.
_Necks = tuple[float, float | None]


def count_objects(
    image: ImageLike,
    *,
    spacing: Sequence[float] | None = None,
    background: str = "largest",
    min_size: float | None = None,
    diameter: float | None = None,
    neck_depth: float | None = None,
    min_contrast: float | None = None,
    exclude_edges: bool = False,
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
    diameter : float, optional
        Diameter of the usual object, in pixels of a plane, > 0; by default, it is measured.
    neck_depth : float, optional
        Split objects at necks that are narrower by more than this in radius, in pixels; infinity does not split. By
        default, necks are told from ripples of the outline.
    min_contrast : float, optional
        Least contrast of an object with the background, in 0..1 of that of the usual one; by default five times the
        noise, within 0.15 and 0.5.
    exclude_edges : bool
        Leave out objects at the edges of the image or volume, which may be cut off.
    mask : array of the size of the image, optional
        Pixels to look at: those where the mask is not 0.

    Returns
    -------
    Segmentation
        Labels of the objects from 1, in reading order, and 0 for the background; none where nothing stands out from the
        noise. `counting` says what was measured.

    Warns
    -----
    UserWarning
        If objects cover more than 90 % of what counts, if their radius is above half of the shorter side, or if those
        of a volume whose spacing is the same along all axes are flat.

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
    if diameter is not None:
        check_that(f"diameter={diameter}", 0 < diameter < np.inf, "be a finite number > 0, in pixels")
    if min_contrast is not None:
        check_that(f"min_contrast={min_contrast}", 0 < min_contrast <= 1, "be > 0 and at most 1, the usual contrast")
    if neck_depth is not None and neck_depth != np.inf:
        check_non_negative("neck_depth", neck_depth)
    bands, inside, size = checked_bands(image, spacing, mask)
    gray = bands.mean(axis=-1, dtype=np.float32)
    gray *= scale_for_float32(float(np.abs(gray[inside]).max()))
    inside = within_margins(gray, inside)
    shape = (-1, *gray.shape[-2:])
    for plane, seen in zip(gray.reshape(shape), inside.reshape(shape), strict=True):
        # What does not count may hold anything.
        plane[:] = without_impulses(from_nearest(plane, seen) if seen.any() and not seen.all() else plane)
    gray, doubt = without_light(gray, inside)
    while True:  # fields of view, one in another
        if not inside.all():
            gray[~inside] = np.median(gray[inside])
        smooth, blur, noise = denoised(gray, inside, size)
        contrast, step = contrast_of(smooth, inside, background)
        near = int(2 * blur) + 1
        outside = surroundings(gray, (contrast > 0.5) & inside, inside, near)
        if outside is None:
            break
        inside = inside & ~outside
        gray = evenly_lit(gray, inside, outside)
    del gray
    radius = _radius((contrast > 0.5) & inside, size) if diameter is None else diameter / 2
    white = noise / abs(step) if step else 0.0
    if not radius or SETTINGS.above_noise * white >= 1 or not _are_two(contrast, inside):
        labels, radius, least = np.zeros(inside.shape, np.int32), 0.0, 0.0
    else:
        noise = max(white, _noise_of_ground(contrast, inside, radius) if contrast.ndim == 2 else 0.0)
        threshold = float(np.clip(SETTINGS.above_noise * noise, SETTINGS.dimmest, 0.5))
        necks = SETTINGS.outline * noise * blur, neck_depth
        if diameter is not None and least is None:
            least = SETTINGS.least_size * (4 / 3 * radius**3 / size[0] if len(size) > 2 else radius**2) * np.pi
        labels = _in_tiles(contrast, inside, min_contrast or threshold, radius, size, necks)
        labels, least = sieved(labels, least)
        if doubt is not None:  # objects of a contrast that is not above the doubts about light may be light
            doubts = ndimage.median(doubt, labels, range(1, int(labels.max()) + 1))
            labels = numbers_of(np.append(False, SETTINGS.doubt * doubts < abs(step)))[labels]
        if exclude_edges:
            labels = numbers_of(~at_edges(labels))[labels]
    _warn_of_doubts(labels, inside, radius, size)
    return measured(labels, bands, counting=Counting(step < 0, blur, radius, least))


def at_edges(labels: Ints) -> Bools:
    """Tell of each label, from 0, whether it has pixels at an edge of the image, or voxels at a face of the volume."""
    ends = [labels.take(end, axis).ravel() for axis in range(labels.ndim) for end in (0, -1)]
    return np.bincount(np.concatenate(ends), minlength=int(labels.max(initial=0)) + 1) > 0


def _warn_of_doubts(labels: Ints, inside: Bools, radius: float, size: tuple[float, ...]) -> None:
    """Warn of counts that are doubtful, and say why."""
    if not labels.any():
        return
    cover = np.count_nonzero(labels) / np.count_nonzero(inside)
    if cover > SETTINGS.most_cover:
        warn(f"objects cover {cover:.0%} of what counts: the background may be what they are (background, mask)")
    if radius > 0.5 * min(labels.shape[-2:]):
        warn(f"the usual object has a radius of {radius:.0f} pixels, above half of the image (diameter, background)")
    if len(size) > 2 and size[0] == 1 and labels.shape[0] > 1:
        sides = [[part.stop - part.start for part in box] for box in ndimage.find_objects(labels)]
        deep, wide = np.median(sides, axis=0)[0], np.median(sides, axis=0)[1:].min()
        if deep < SETTINGS.flat * wide:
            warn(f"objects are flat, {deep:.0f} planes for {wide:.0f} pixels: are planes farther apart (spacing)?")


def checked_bands(
    image: Any, spacing: Sequence[float] | None, mask: ArrayLike | None
) -> tuple[Array, Bools, tuple[float, ...]]:
    """Return an image or a volume with an axis of bands, the pixels that count, and their sides in those of a plane."""
    if spacing is None:
        return *check_partial_image("image", image, mask), (1.0, 1.0)
    sides = np.asarray(spacing, np.float64)
    fits = sides.shape == (3,) and np.isfinite(sides).all() and sides.min() > 0
    check_that(f"spacing={spacing}", bool(fits), "be three distances > 0, along Z, H and W")
    check_that(f"spacing={spacing}", bool(np.isclose(sides[1], sides[2], rtol=0.01)), "be the same along H and W")
    shape = np.shape(image)
    check_shape("image", shape, len(shape) in (3, 4) and min(shape) > 0, "(Z, H, W) or (Z, H, W, C), with spacing")
    if mask is not None:
        check_shape("mask", np.shape(mask), np.shape(mask) == shape[:3], f"{shape[:3]}, the size of the volume")
        mask = np.reshape(mask, (-1, shape[2]))
    bands, inside = check_partial_image("image", np.reshape(image, (-1, *shape[2:])), mask)
    return bands.reshape(*shape[:3], -1), inside.reshape(shape[:3]), (float(sides[0] / sides[1:].mean()), 1.0, 1.0)


def sieved(objects: Ints, least: float | None) -> tuple[Ints, float]:
    """Leave out objects that are too small, number the others from 1, and return the least size."""
    sizes = np.bincount(objects.ravel())
    sizes[0] = 0
    if least is None:
        compact = sizes
        if objects.ndim == 2:  # long objects count as some of the largest discs in them
            discs = np.pi * largest_by_label(ndimage.distance_transform_edt(objects), objects) ** 2
            compact = np.minimum(sizes, SETTINGS.most_discs * discs)
        compact = np.sort(compact)
        pixels = np.cumsum(compact)
        least = float(SETTINGS.least_size * compact[np.searchsorted(pixels, pixels[-1] / 2)])
    return numbers_of(sizes >= max(least, 1))[objects], least


def _radius(bright: Bools, size: tuple[float, ...]) -> float:
    """Return the radius of the usual object, 0 if there is none; of a large image, in its middle."""
    tiles = [tile for tile, _ in _tiles(bright.shape, 0)]
    middle = bright[tiles[len(tiles) // 2]]
    shown = _whole(middle if middle.any() else bright)
    if not shown.any():
        return 0.0
    # In a ball of n dimensions, the mean squared distance to its rim is 2 / (n + 1) (n + 2) of its squared radius.
    n = sum(length > 1 for length in shown.shape)
    return float(np.sqrt((n + 1) * (n + 2) / 2 * np.mean(ndimage.distance_transform_edt(shown, size)[shown] ** 2)))


def _in_tiles(
    contrast: Floats32, inside: Bools, threshold: float, radius: float, size: tuple[float, ...], necks: _Necks
) -> Ints:
    """Label objects tile by tile; each is that of the tile in whose core its middle lies."""
    objects, last = np.zeros(inside.shape, np.int32), 0
    for tile, core in _tiles(inside.shape, round(SETTINGS.most_discs * radius)):
        parts = split(contrast[tile], inside[tile], threshold, radius, size, necks)
        parts = with_own_borders(parts, contrast[tile][..., None], np.zeros(1, np.float32))
        middles = ndimage.center_of_mass(parts > 0, parts, np.arange(1, int(parts.max()) + 1))
        is_in_core = [((at[-2:] >= core[0]) & (at[-2:] < core[1])).all() for at in map(np.asarray, middles)]
        numbers = numbers_of(np.array([False, *is_in_core]))
        free = (numbers[parts] > 0) & (objects[tile] == 0)
        objects[tile][free] = numbers[parts][free] + last
        last += int(numbers.max())
    return objects


def _tiles(shape: tuple[int, ...], overlap: int) -> Iterator[tuple[tuple[Any, ...], Ints64]]:
    """Yield overlapping tiles of planes, and the first and last corner of the core of each, which no other has."""
    side = max(int((SETTINGS.tile / np.prod(shape[:-2])) ** 0.5) - 2 * overlap, 4 * overlap, 1)
    lengths = np.array(shape[-2:])
    n_parts = np.where(lengths > side + 2 * overlap, -(-lengths // side), 1)
    along = [pairwise(np.arange(n + 1) * length // n) for length, n in zip(lengths, n_parts, strict=True)]
    for core in product(*along):
        first, last = np.array(core).T
        top, bottom = np.maximum(first - overlap, 0), np.minimum(last + overlap, lengths)
        yield (..., *map(slice, top, bottom)), np.array([first - top, last - top])


def denoised(gray: Floats32, inside: Bools, size: tuple[float, ...]) -> tuple[Floats32, float, float]:
    """Return a blurred image, the blur that its noise calls for, and the noise that is left."""
    planes = gray.reshape(-1, *gray.shape[-2:])
    every = -(-gray.size // SETTINGS.tile)
    some, known = planes[::every], inside.reshape(planes.shape)[::every]
    # Noise alone leaves 1 - 2 / pi of its variance about the means of its halves: dots, which leave less, are none.
    noise = np.median([noise_covariance(plane[..., None]) for plane in some])
    noise = float(min(noise, left_by_two(some[known]) / (1 - 2 / np.pi))) ** 0.5
    first = np.stack([ndimage.gaussian_filter(plane, 2.0) for plane in some])
    bright = are_bright(first)
    step = float(first[bright].mean() - first[~bright].mean()) if 0 < bright.sum() < bright.size else 0.0
    blur = float(np.clip(SETTINGS.blur_of_noise * noise / step, *SETTINGS.blurs)) if step else SETTINGS.blurs[0]
    sigmas = [blur / side for side in size]
    left = [min(1.0, (2 * np.sqrt(np.pi) * sigma) ** -0.5) for sigma in sigmas]
    return ndimage.gaussian_filter(gray, sigmas), blur, noise * float(np.prod(left))


def _noise_of_ground(contrast: Floats32, inside: Bools, radius: float) -> float:
    """Return the noise of the ground after the blur, in contrasts: what varies over less than the size of an object."""
    lag, noise, top = max(round(radius), 1), 0.0, 0.5
    for _ in range(ROUNDS):  # dim objects are no ground
        ground, steps = inside & (contrast < top), []
        for values, known in ((contrast, ground), (contrast.T, ground.T)):
            steps.append(np.abs(values[lag:] - values[:-lag])[known[lag:] & known[:-lag]])
        some = np.concatenate(steps)
        noise = float(np.median(some[:: max(some.size >> 20, 1)])) / (MEDIAN_OF_NORMAL * 2**0.5) if some.size else 0.0
        if SETTINGS.clipped * noise >= top:
            break
        top = SETTINGS.clipped * noise
    return noise


def _are_two(contrast: Floats32, inside: Bools) -> bool:
    """Tell whether fewer pixels lie halfway between ground and objects than at the ground: noise has most there."""
    values = contrast[inside]
    values = values[:: max(values.size >> 20, 1)]
    ground = values[values < 0.5]
    if not 0 < ground.size < values.size:
        return False
    width = SETTINGS.bin
    levels = np.append(np.arange(float(np.quantile(ground, 0.01)), 0.01, width), 0.0)
    most = max(np.count_nonzero(np.abs(values - level) < width) for level in levels)
    return bool(np.count_nonzero(np.abs(values - 0.5) < width) < most)


def contrast_of(image: Floats32, inside: Bools, background: str) -> tuple[Floats32, float]:
    """Return where pixels lie between the generators of background, 0, and objects, 1, and their mean difference.

    The image is overwritten.
    """
    apart = max(int(np.sqrt(image.size / SETTINGS.tile)), 1)
    some, counts = image[..., ::apart, ::apart], inside[..., ::apart, ::apart]
    reach = [2 * REACH * length for length in some.shape[:-2]] + [REACH * max(some.shape[-2:])] * 2
    objects = are_bright(some, some[counts]) & counts
    if background == "brightest" or (background == "largest" and 2 * objects.sum() > counts.sum()):
        objects = ~objects & counts
    step, generators = 0.0, None
    for _ in range(ROUNDS):
        rest = counts & ~objects
        if not objects.any() or not rest.any():
            break
        ground = local_mean(some, rest, reach, PRIOR)
        beyond = some - spread(ground, some.shape)
        above = local_mean(beyond, objects, reach, SETTINGS.object_prior)
        step = float(spread(above, some.shape).mean())
        generators = ground, np.where(above * step > 0, above, step or 1).astype(np.float32)
        before, objects = objects, (beyond / spread(generators[1], some.shape) > 0.5) & counts
        if (objects != before).mean() < 1e-4:
            break
    if generators is None:
        return np.zeros_like(image), 0.0
    planes = image.reshape(-1, *image.shape[-2:])
    blocks = [field.reshape(-1, *field.shape[-2:]) for field in generators]
    along = [spread(field, (len(planes), *field.shape[1:])) for field in blocks]
    for plane, *fields in zip(planes, *along, strict=True):
        ground, above = (spread(field, plane.shape) for field in fields)
        plane[:] = (plane - ground) / above
    return image, step


def split(
    contrast: Floats32, inside: Bools, threshold: float, radius: float, size: tuple[float, ...], necks: _Necks
) -> Ints:
    """Return labels of the objects, touching ones split at their necks."""
    fine = 2 if radius < SETTINGS.small and contrast.ndim == 2 else 1
    if fine > 1:
        contrast = ndimage.zoom(contrast, fine, order=3, grid_mode=True, mode="nearest")
        inside = inside.repeat(fine, axis=0).repeat(fine, axis=1)
    objects, shares = _peeled(np.where(inside, contrast, np.float32(0)), threshold, radius * fine, size)
    ripples, depth = necks
    # Halfway between the contrast at outlines and that of what lies deep in objects, gaps are open.
    away = ndimage.distance_transform_edt(objects, size)[objects]
    deep = shares[objects][away > np.median(away)] if away.size else away
    level = 0.5 * (0.5 + float(np.clip(np.quantile(deep, SETTINGS.spots), 0.5, 1))) if deep.size else 0.5
    distance = _distance(objects & (shares >= level), size, fine)
    if depth == np.inf:
        parts = np.asarray(ndimage.label(objects)[0], np.int32)
    elif depth is not None:
        parts = split_at_saddles(np.where(objects, distance, np.float32(0)), objects, depth)
    else:
        parts = _at_necks(distance, objects)
        if parts.ndim == 2:
            parts = join_at_ripples(parts, distance * fine, ripples, fine)
    return parts[(slice(None, None, fine),) * contrast.ndim]


def _distance(objects: Bools, size: tuple[float, ...], fine: int = 1) -> Floats32:
    """Return the distance to the background, blurred, in pixels of which each is `fine` of those of the objects."""
    sigmas = [SETTINGS.blurs[0] * fine / side for side in size]
    away = ndimage.distance_transform_edt(objects, size).astype(np.float32)
    return np.asarray(ndimage.gaussian_filter(away, sigmas, mode="nearest") / fine)


def _at_necks(distance: Floats32, objects: Bools) -> Ints:
    """Label the parts of objects between necks that are narrow for their own size."""
    height = np.log(np.where(objects, distance, np.float32(0)) + np.float32(SETTINGS.blurs[0]))
    return split_at_saddles(height, objects, SETTINGS.depth)


def _peeled(contrast: Floats32, threshold: float, radius: float, size: tuple[float, ...]) -> tuple[Bools, Floats32]:
    """Return the pixels of objects at half of the contrast of each: bright ones first, then what they leave.

    And of each pixel its share of the contrast of the piece of which it is; half, where it is none.
    """
    rest, shares = contrast > min(threshold, 0.5), np.full(contrast.shape, np.float32(0.5))
    thick = max(radius * SETTINGS.thin, 1)
    while np.count_nonzero(rest) * np.prod(size) > thick**rest.ndim:
        pieces, n_pieces = ndimage.label(rest)
        levels = np.append(np.inf, ndimage.median(contrast[rest], pieces[rest], np.arange(1, n_pieces + 1)))
        core = rest & (contrast > 0.5 * levels[pieces]) & (levels[pieces] >= threshold)
        if not core.any():
            break
        shares[core] = contrast[core] / levels[pieces[core]]
        # What is left counts where it is thick: in balls of this radius.
        kernels = ndimage.distance_transform_edt(rest & ~ndimage.binary_dilation(core, iterations=2), size) > thick
        rest = ndimage.distance_transform_edt(~kernels, size) <= thick if kernels.any() else kernels
    return _whole(shares > 0.5, radius), shares


def _whole(objects: Bools, radius: float = 0.0) -> Bools:
    """Fill what convex outlines enclose: an object is whole whatever is in it, but between several is background.

    What is no larger than three usual objects, if their radius is known, is no clump of several with pores between.
    """
    from skimage.measure import regionprops

    filled = ~_ground(objects)
    pieces, n_pieces = ndimage.label(filled)
    with_holes = np.bincount(pieces[filled & ~objects], minlength=n_pieces + 1) > 0
    whole = objects.copy()
    for region in regionprops(pieces * with_holes[pieces]):  # type: ignore[no-untyped-call]
        if region.solidity > CONVEX:
            piece = objects[region.slice] & region.image
            if np.count_nonzero(piece) <= SEVERAL * np.pi * radius**2 or not _are_discs(piece):
                whole[region.slice] |= region.image
    return whole


def _are_discs(piece: Bools) -> bool:
    """Tell whether a piece with pores is a clump of discs, each of which fills its part, and no object with holes."""
    piece = np.pad(piece, 1)
    if piece.ndim != 2 or ndimage.label(~piece)[1] <= SEVERAL:  # what is around, and pores; a ring has one
        return False
    distance = _distance(piece, (1.0, 1.0))
    parts = _at_necks(distance, piece)
    shares = np.pi * largest_by_label(distance, parts)[1:] ** 2 / np.bincount(parts.ravel())[1:]
    return bool(len(shares) > SEVERAL and np.quantile(shares, 0.25) > SETTINGS.full)


def _ground(objects: Bools) -> Bools:
    """Return what is no hole: open to the border, the widest, or around several objects thinner than the space there.

    The last is the inside of a ring, or of a dish.
    """
    pores, n_pores = ndimage.label(~objects)
    is_ground = at_edges(pores)
    sizes = np.bincount(pores.ravel(), minlength=n_pores + 1)
    sizes[0] = 0
    is_ground[sizes.argmax()] = True
    if not is_ground[1:].all():
        pieces, n_pieces = ndimage.label(objects, np.ones((3,) * objects.ndim))
        firsts = np.unique(pieces, return_index=True)[1][-n_pieces:]  # in reading order: what is before is around
        around = pores.ravel()[np.maximum(firsts - 1, 0)]
        thick = largest_by_label(ndimage.distance_transform_edt(objects), pieces)[1:]
        free = largest_by_label(ndimage.distance_transform_edt(~objects), pores)
        for pore in np.flatnonzero((np.bincount(around, minlength=n_pores + 1) >= SEVERAL) & ~is_ground):
            is_ground[pore] = free[pore] > np.sort(thick[around == pore])[-SEVERAL]
    is_ground[0] = False
    return is_ground[pores]

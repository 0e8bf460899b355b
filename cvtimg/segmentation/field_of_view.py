"""What an image shows beside its subject: margins of one value, and what lies around the field of a lens or a dish."""

import numpy as np
from scipy import ndimage

from cvtimg._shared.threads import one_blas_thread
from cvtimg._shared.types import Bools, Floats32
from cvtimg.segmentation.touching import FOR_CONTRAST, ROUNDS

#: Width of what hangs on to a field without being part of it, of the shorter side.
_HANGING = 0.02
#: Least share of its convex hull that a field fills: if its surroundings are objects, which may lie at its rim, and if
#: it is an object itself, which a clump, scalloped by the objects in it, shall not pass for.
CONVEX, _SMOOTH = 0.93, 0.97
#: Least number of objects on a field that is itself brighter or darker than the ground: fewer are holes of an object.
SEVERAL = 3
#: Least shares of the image that a field has (of what is next to a margin: the ground) and what is around it, and of
#: the rim of the image that this has.
_LEAST_FIELD, _LEAST_AROUND, _LEAST_RIM = 0.1, 0.005, 0.25
#: Pixels of the least thing that counts as an object in a field.
_SPECK = 9
#: Degree of the polynomial of light, and pixels that are enough for it.
_DEGREE, _ENOUGH_PIXELS = 4, 1 << 12


def within_margins(gray: Floats32, inside: Bools) -> Bools:
    """Leave out margins, each row, column or plane of one value: frames, bars and padding, several if one in another.

    Where a tenth or more of the pixels next to a margin have its value, it is the ground.
    """
    kept = [slice(0, length) for length in gray.shape]
    for axis in range(gray.ndim):
        for end in (0, -1):
            kept[axis] = _without_margin(gray[tuple(kept)], axis, end, kept[axis])
    within = np.zeros_like(inside)
    within[tuple(kept)] = inside[tuple(kept)]
    return within if np.ptp(gray[tuple(kept)]) and within.any() else inside


def _without_margin(gray: Floats32, axis: int, end: int, kept: slice) -> slice:
    """Return what is kept of an axis if the margin at its first (0) or last (-1) end is left out."""
    lines = np.moveaxis(gray, axis, 0).reshape(gray.shape[axis], -1)
    lines = lines[::-1] if end else lines
    flat = lines.min(axis=1) == lines.max(axis=1)
    width = int(np.argmin(flat)) if not flat.all() else 0
    # The last lines of a margin may be ground: noise-free images have much of it, of one value.
    while width and np.mean(lines[width] == lines[width - 1, 0]) >= _LEAST_FIELD:
        value = lines[width - 1, 0]
        while width and lines[width - 1, 0] == value:
            width -= 1
    return slice(kept.start, kept.stop - width) if end else slice(kept.start + width, kept.stop)


def surroundings(gray: Floats32, objects: Bools, inside: Bools, near: int) -> Bools | None:
    """Return what lies around the convex field of view of an image, with `near` pixels at its rim; None without one.

    The field is the largest part of the ground, of the objects, or of what has not the one value of all corners, its
    holes filled. In the last two cases it has several of the other class on it, and more borders for its size than its
    surroundings: optics cut smoothly, and what they cut off is empty.
    """
    box = ndimage.find_objects(inside.view(np.uint8))[0] if inside.any() else ()
    if objects.ndim != 2 or min(objects[box].shape) < 3:
        return None
    beyond = np.zeros_like(inside)
    gray, objects, inside = gray[box], objects[box], inside[box]
    corners = (slice(None, None, objects.shape[0] - 1), slice(None, None, objects.shape[1] - 1))
    candidates = [(inside & ~objects, None), (objects, ~objects)]
    if inside.all() and np.ptp(gray[corners]) == 0:
        candidates.append((gray != gray[0, 0], objects))
    for region, others in candidates:
        field = _largest_part(region, corners)
        if field is None or (inside & ~field).sum() <= _LEAST_AROUND * inside.sum():
            continue
        if _is_view(field, others, inside, near):
            beyond[box] = inside & ndimage.binary_dilation(~field, iterations=near)
            return beyond
    return None


def _largest_part(region: Bools, corners: tuple[slice, ...]) -> Bools | None:
    """Return the largest part of a region, its holes filled, without what hangs on by a narrow bridge.

    None if it is in a corner or less than a field.
    """
    wide = max(_HANGING * min(region.shape), 2.0)
    filled = np.asarray(ndimage.binary_fill_holes(region))
    if np.bincount(ndimage.label(filled)[0].ravel())[1:].max(initial=0) < _LEAST_FIELD * filled.size:
        return None
    # Beyond the image lies neither.
    core, n_parts = ndimage.label(ndimage.distance_transform_edt(np.pad(filled, 1, mode="edge"))[1:-1, 1:-1] > wide)
    if not n_parts:
        return None
    sizes = np.bincount(core.ravel())
    sizes[0] = 0
    largest = core == sizes.argmax()
    if largest[corners].any():
        return None
    field = np.asarray(filled & (ndimage.distance_transform_edt(~largest) <= wide))
    return None if field[corners].any() or field.mean() < _LEAST_FIELD else field


def _is_view(field: Bools, others: Bools | None, inside: Bools, near: int) -> bool:
    """Tell whether a field is one of view, with others on it that are to be there: see `surroundings`."""
    from skimage.morphology import convex_hull_image

    around = np.asarray(ndimage.label(~field | ~inside, np.ones((3, 3)))[0])
    rim = np.ones(field.shape, np.bool_)
    rim[1:-1, 1:-1] = False
    corners = around[:: len(around) - 1, :: around.shape[1] - 1]
    if np.isin(around[rim], corners).mean() < _LEAST_RIM:
        return False
    hull = convex_hull_image(field)  # type: ignore[no-untyped-call]
    if field.sum() < (CONVEX if others is None else _SMOOTH) * hull.sum():
        return False
    if others is None:
        return True
    within = field & ndimage.binary_erosion(field, iterations=near + 2)
    outer = inside & ~ndimage.binary_dilation(field, iterations=near + 2)
    if np.count_nonzero(np.bincount(ndimage.label(within & others)[0].ravel())[1:] > _SPECK) < SEVERAL:
        return False
    edges = np.zeros(field.shape, np.bool_)
    edges[1:] |= others[1:] != others[:-1]
    edges[:, 1:] |= others[:, 1:] != others[:, :-1]
    return not outer.any() or bool(edges[outer].mean() < edges[within].mean())


def evenly_lit(gray: Floats32, inside: Bools, outside: Bools) -> Floats32:
    """Divide a field of view that is brighter than what is around it by its light, which is brightest in the middle.

    What is around the field has more than one value behind a lens, but not where an image was cut out or turned.
    """
    corners = gray[:: len(gray) - 1, :: gray.shape[1] - 1]
    if np.quantile(gray[inside], 0.05) <= np.median(gray[outside]) or np.ptp(corners) == 0:
        return gray
    least = float(gray[inside].min())
    logs = np.log(np.maximum(gray if least > 0 else gray + np.float32(1 - least), np.finfo(np.float32).tiny))
    return np.where(inside, np.exp(logs - _light(logs, inside)), gray).astype(np.float32)


def are_bright(values: Floats32, some: Floats32 | None = None) -> Bools:
    """Tell which values are above Otsu's threshold of `some`, by default all; rounding has none."""
    from skimage.filters import threshold_otsu

    some, n_bins = values if some is None else some, 256
    if not some.size or not np.ptp(some) > n_bins * np.spacing(np.abs(some).max()):
        return np.zeros(values.shape, np.bool_)
    return np.asarray(values > threshold_otsu(some, n_bins))  # type: ignore[no-untyped-call]


def without_light(gray: Floats32, inside: Bools) -> tuple[Floats32, Floats32 | None]:
    """Take uneven light from an image if two levels then leave less than half of what they leave of the image as it is.

    It may be stronger than the contrast of objects, and two levels of the image are then its bright and its dark side.
    Light alone leaves what values were rounded by, which is nothing. Also return how far the light may be from the true
    one, None if none is taken: what its terms of the highest degree add, about as much as the terms that it has not.
    """
    if gray.ndim != 2:
        return gray, None
    smooth = ndimage.gaussian_filter(np.where(inside, gray, np.median(gray[inside])), FOR_CONTRAST)
    light = _light(smooth, inside)
    uneven, even = (left_by_two(values[inside]) for values in (smooth, smooth - light))
    if 2 * even >= uneven:
        return gray, None
    levels = np.unique(gray[inside])
    rounding = float(levels[-1] - levels[0]) / (len(levels) - 1)
    left = gray - light  # values are rounded by half of a level, and light is a level off at the ends
    doubt = np.abs(light - _light(smooth, inside, _DEGREE - 1))
    return left if np.ptp(left[inside]) > 3 * rounding else np.zeros_like(gray), doubt


def left_by_two(values: Floats32) -> float:
    """Return the mean squared distance of values to the nearer of two levels."""
    bright = are_bright(values)
    if not bright.any():
        return 0.0
    return float(np.square(values - np.where(bright, values[bright].mean(), values[~bright].mean())).mean())


@one_blas_thread  # for the bits must not depend on how many there are
def _light(values: Floats32, inside: Bools, degree: int = _DEGREE) -> Floats32:
    """(H, W) deviations from the median of the polynomial at the least mean distance, which objects hardly move."""
    from numpy.polynomial.polynomial import polygrid2d, polyvander2d

    every = max(int(np.sqrt(values.size / _ENOUGH_PIXELS)), 1)
    y, x = (every * places for places in np.nonzero(inside[::every, ::every]))
    down, right = (np.linspace(-1, 1, length) for length in values.shape)
    is_term = np.add.outer(range(degree + 1), range(degree + 1)) <= degree
    terms = polyvander2d(down[y], right[x], [degree, degree])[:, is_term.ravel()]
    some, weights, factors = values[y, x].astype(np.float64), np.ones(len(y)), np.zeros(is_term.shape)
    for _ in range(ROUNDS):
        weighted = (terms * weights[:, None]).T
        factors[is_term] = np.linalg.lstsq(weighted @ terms, weighted @ some)[0]
        misses = np.abs(some - terms @ factors[is_term])
        weights = 1 / np.maximum(misses, 0.1 * np.median(misses) + 1e-6)
    return np.asarray(polygrid2d(down, right, factors) - np.median(some), np.float32)

"""Checks of arguments that several modules share: every message gives the name, the value and what is allowed.

A module whose sentence is its own raises its own error.
"""

import os
import sys
from collections.abc import Callable, Collection
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.messages import warn
from cvtimg._shared.pixels import array_of, is_known, says_alpha
from cvtimg._shared.types import Array, Bools, Dtype, Floats, Floats32, Ints

_Name = TypeVar("_Name", bound=str)
#: What an image must have.
_COUNTING = "have at least one pixel that counts: finite, not masked, and in the mask"


def check_choice(name: str, value: _Name, choices: Collection[str]) -> _Name:
    """Return `value` if it is one of `choices`."""
    check_in_range(name, value, value in choices, f"one of {', '.join(choices)}")
    return value


def check_count(name: str, value: int, largest: int, reason: str) -> int:
    """Return `value` as an int in 1..largest; `reason` says what sets the largest."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name}={value!r} must be an integer in 1..{largest}, {reason}")
    if not 1 <= value <= largest:
        raise ValueError(f"{name}={value} must be in 1..{largest}, {reason}")
    return int(value)


def check_at_least(name: str, value: int, least: int, reason: str) -> int:
    """Return an integer that is at least `least`; `reason` says what sets that, or what else is allowed."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        error = ValueError if isinstance(value, (int, np.integer)) else TypeError
        raise error(f"{name}={value!r} must be an integer >= {least}, {reason}")
    return int(value)


def raise_unsupported(name: str, value: object, what: str, able: Collection[str]) -> NoReturn:
    """Refuse a combination of arguments that `value` does not support and those named in `able` do."""
    raise ValueError(f"{name}={value!r} does not support {what}; {' or '.join(able)} does")


def check_that(name: str, holds: bool | np.bool_, demand: str) -> None:
    """Refuse an argument that does not do what it must."""
    if not holds:
        raise ValueError(f"{name} must {demand}")


def check_in_range(name: str, value: object, is_allowed: bool | np.bool_, allowed: str) -> None:
    """Refuse a value that is not in the range that `allowed` describes."""
    if not is_allowed:
        refuse(name, value, allowed)


def refuse(name: str, value: object, allowed: str) -> NoReturn:
    """Refuse a value that is none of those that `allowed` describes."""
    raise ValueError(f"{name}={value!r} must be {allowed}")


def refuse_type(name: str, kind: object, allowed: str) -> NoReturn:
    """Refuse a value for its type."""
    raise TypeError(f"{name} of type {kind} must be {allowed}")


def check_needs(name: str, given: bool, other: str, has_other: bool) -> None:
    """Refuse an argument that does nothing without another."""
    if given and not has_other:
        raise ValueError(f"{name} needs {other}")


def check_excluded(name: str, given: bool, **others: object) -> None:
    """Refuse arguments that have no meaning beside another; None, False and 0 are not given."""
    if given and (wrong := [other for other, value in others.items() if value]):
        raise ValueError(f"{name} takes no {' or '.join(wrong)}")


def check_positive(name: str, value: float, unit: str = "") -> float:
    """Return `value` as a finite float > 0; `unit` says of what, or what else is allowed."""
    number = float(value)
    check_in_range(name, value, 0 < number < np.inf, f"a finite number > 0{unit and ', '}{unit}")
    return number


def check_non_negative(name: str, value: float) -> float:
    """Return `value` as a finite float >= 0."""
    number = float(value)
    check_in_range(name, value, 0 <= number < np.inf, "a finite number >= 0")
    return number


def check_edge_weight(edge_weight: float | str, name: str = "edge_weight") -> float | None:
    """Return an edge weight >= 0, or None for "auto"."""
    if not isinstance(edge_weight, str):
        return check_non_negative(name, edge_weight)
    check_in_range(name, edge_weight, edge_weight == "auto", "a finite number >= 0, or 'auto'")
    return None


def check_keywords(function: Any, given: Collection[str], known: Collection[str]) -> None:
    """Refuse keyword arguments that are neither `known` nor parameters."""
    for name in given:
        if name not in known:
            code = function.__code__
            names = [*code.co_varnames[1 : code.co_argcount + code.co_kwonlyargcount], *sorted(known)]
            wrong = f"{function.__name__}() got an unexpected keyword argument {name!r}"
            raise TypeError(f"{wrong}; options are {', '.join(names)}")


def refuse_path(name: str, value: object) -> None:
    """Refuse a path where its content is wanted."""
    if isinstance(value, (str, bytes, os.PathLike)) or (
        isinstance(value, (list, tuple)) and value and isinstance(value[0], (str, os.PathLike))
    ):
        raise TypeError(f"{name}={value!r} must be an array; read an image with cvtimg.read_image")


def refuse_masked(name: str, values: Any) -> None:
    """Refuse a masked array where nothing stands for what is masked."""
    if "numpy.ma" in sys.modules and np.ma.is_masked(values):  # which takes time to import
        n_masked = np.count_nonzero(np.ma.getmaskarray(values))
        raise ValueError(f"{name} has {n_masked} masked values and must have none: leave their rows out, or fill them")


#: Types of samples that the kernels read.
SAMPLE_DTYPES = (np.uint8, np.uint16, np.float32, np.float64)


def check_shape(name: str, shape: tuple[int, ...], is_allowed: bool, allowed: str) -> None:
    """Refuse an array whose shape is none of those that `allowed` describes."""
    if not is_allowed:
        raise ValueError(f"{name} of shape {tuple(shape)} must be {allowed}")


def check_channels(name: str, n_channels: int, allowed: Collection[int], reason: str) -> None:
    """Refuse a number of channels that is not allowed; `reason` says where that comes from."""
    if n_channels not in allowed:
        numbers = [str(number) for number in allowed]
        several = " or ".join([*([", ".join(numbers[:-1])] if numbers[1:] else []), numbers[-1]])
        raise ValueError(f"{name} of {n_channels} channels must have {several}, {reason}")


def check_numbers(name: str, dtype: np.dtype[np.generic]) -> None:
    """Refuse an array that is not of real numbers."""
    if dtype.kind not in "biuf":
        refuse_type(name, dtype, "of integers or of floating point numbers")


def check_finite(name: str, array: Array) -> None:
    """Refuse an array of floating point numbers that are not all finite."""
    if array.dtype.kind == "f":
        check_that(name, np.isfinite(array).all(), "be finite: it contains NaN or infinity")


def check_within(name: str, array: Array, low: float, high: float, reason: str = "") -> None:
    """Refuse an array with numbers that are not in low..high; `reason` says what sets these limits."""
    if array.size and not (array.min() >= low and array.max() <= high):  # NaN fails too
        least, most = (f"{end:g}" if array.dtype.kind == "f" else f"{end}" for end in (array.min(), array.max()))
        raise ValueError(f"{name} in {least}..{most} must be in {low:.15g}..{high:.15g}{reason}")


def check_returned(name: str, values: Array, n_points: int) -> None:
    """Refuse what a function of points returned if it is not one value per point."""
    if values.shape != (n_points,):
        raise ValueError(f"{name} returned shape {values.shape} and must return ({n_points},), one per point")


def check_values(name: str, values: ArrayLike, points: Array, holds: Callable[[Floats], Bools], allowed: str) -> Floats:
    """Return what a function of points returned as float64: one value per point, for each of which something holds."""
    array = np.asarray(values, np.float64)
    check_returned(name, array, len(points))
    wrong = np.flatnonzero(~holds(array))
    if len(wrong):
        refuse(f"{name} at {points[wrong[0]].tolist()}", float(array[wrong[0]]), allowed)
    return array


def check_rows(name: str, rows: object) -> Array:
    """Return `rows` as a C-contiguous, finite (N, D) array of a type that the kernels read."""
    refuse_path(name, rows)
    refuse_masked(name, rows)
    array = array_of(rows)
    check_shape(name, array.shape, array.ndim == 2 and array.size > 0, "(N, D) with N, D >= 1")
    warn_if_rounded(name, array)
    return as_samples(name, array)


def warn_if_rounded(name: str, array: Any) -> None:
    """Warn of integers that float64 does not hold: those of near values become the same."""
    if getattr(array, "dtype", None) in (np.int64, np.uint64) and array.size:
        largest = max(abs(int(array.min())), abs(int(array.max())))
        if largest > 1 << np.finfo(np.float64).nmant + 1:
            warn(f"{name} has integers up to {largest}, which are rounded beyond 2**53: subtract the least one first")


def check_density(density: ArrayLike | None, n_samples: int) -> Floats:
    """Return the weights of `n_samples` samples: finite, >= 0 and not all 0; ones by default."""
    if density is None:
        return np.ones(n_samples)
    return check_weights("density", density, (n_samples,), "sample")


def check_weights(name: str, weights: ArrayLike, shape: tuple[int, ...], of: str = "pixel") -> Floats:
    """Return weights, one for each pixel of an image of this shape: finite, >= 0 and not all 0."""
    refuse_masked(name, weights)
    array = np.asarray(weights, dtype=np.float64)
    check_shape(name, array.shape, array.shape == shape, f"{shape}, one weight for each {of}")
    holds = np.isfinite(array).all() and array.min() >= 0 and array.any()
    check_that(name, holds, "be finite and >= 0, and not all 0")
    return array


def check_places(name: str, places: ArrayLike, n_dims: int | None = None) -> Floats:
    """Return `places` as a finite, C-contiguous (N, D) float64 array, N >= 1."""
    array = np.asarray(places)
    is_table = array.ndim == 2 and array.size > 0 and n_dims in (None, array.shape[1])
    check_shape(name, array.shape, is_table, f"(N, {n_dims or 'D'}), a place in each row")
    check_numbers(name, array.dtype)
    array = np.ascontiguousarray(array, np.float64)
    check_finite(name, array)
    return array


def check_locked(locked: ArrayLike | None, n_generators: int, n_dims: int) -> Floats:
    """Return locked generators as a finite (L, D) array, L < `n_generators`; none by default."""
    if locked is None:
        return np.empty((0, n_dims))
    array = check_generators("locked", locked, len(np.asarray(locked)), n_dims)
    check_that("locked", len(array) < n_generators, f"have fewer than n_generators={n_generators}, not {len(array)}")
    return array


def check_generators(name: str, generators: ArrayLike, n_generators: int, n_dims: int) -> Floats:
    """Return `generators` as a finite (n_generators, n_dims) array."""
    array = np.asarray(generators, dtype=np.float64)
    shape = (n_generators, n_dims)
    check_shape(name, array.shape, array.shape == shape, f"{shape}, a row for each generator")
    check_finite(name, array)
    return array


def as_samples(name: str, array: Array) -> Array:
    """Booleans become uint8, integers of other widths float64; other types are refused."""
    array = array.astype(array.dtype.newbyteorder("="), copy=False)
    if array.dtype.kind in "biu" and array.dtype not in SAMPLE_DTYPES:
        array = array.astype(np.uint8 if array.dtype.kind == "b" else np.float64)
    elif array.dtype == np.float16:
        array = array.astype(np.float32)
    elif array.dtype not in SAMPLE_DTYPES:
        refuse_type(name, array.dtype, "of integers or of floating point numbers")
    check_finite(name, array)
    return np.ascontiguousarray(array)


def check_image(name: str, image: object) -> Array:
    """Return `image`, an array or a Pillow image, as a C-contiguous (H, W) or (H, W, C) array of its own type.

    Booleans become 0 and 255, and float16 float32.
    """
    array = array_of(image)
    _check_image_form(name, array)
    if array.dtype.kind == "b":
        return np.ascontiguousarray(array * np.uint8(255))
    if array.dtype.kind in "iu":
        return np.ascontiguousarray(array, array.dtype.newbyteorder("="))
    return as_samples(name, array)


def check_pixels(name: str, image: object, mask: ArrayLike | None) -> tuple[Array, Bools | None]:
    """Return an image of any integer or floating type, in native byte order, and the (H, W) pixels that count.

    These are the pixels in the mask that are finite and not masked, at least one; None stands for all. The others have
    the value of the first one that counts. Booleans become 0 and 255.
    """
    array = array_of(image)
    _check_image_form(name, array)
    check_numbers(name, array.dtype)
    inside = _inside(name, array, image, mask)
    if array.dtype.kind == "b":
        array = array * np.uint8(255)
    elif array.dtype.kind == "f" and array.dtype.itemsize not in (4, 8):
        array = array.astype(np.float32 if array.dtype.itemsize < 4 else np.float64)
    array = np.ascontiguousarray(array.astype(array.dtype.newbyteorder("="), copy=False)).view(np.ndarray)
    if inside is not None:
        array = array.copy()
        array[~inside] = array[inside][0]
    return array, inside


def check_alpha(alpha: bool | None, image: object, n_channels: int) -> bool:
    """Return whether the last channel of an image is alpha: as `alpha` says, or else as the image does."""
    if alpha and n_channels not in (2, 4):
        raise ValueError(f"alpha=True needs an image of 2 or 4 channels, not {n_channels}")
    return says_alpha(image) if alpha is None else bool(alpha)


def _check_image_form(name: str, array: Array) -> None:
    if array.dtype.kind in "USO":
        refuse_path(name, array.tolist())
    fits = array.ndim in (2, 3) and array.size > 0
    check_shape(name, array.shape, fits, "(H, W) or (H, W, C), none of them 0")


def _inside(name: str, array: Array, image: object, mask: ArrayLike | None) -> Bools | None:
    """Return the (H, W) pixels that count, at least one: in the mask, not masked, and finite; None for all."""
    shape = array.shape[:2]
    inside: Any = True if mask is None else np.asarray(mask) != 0
    check_shape("mask", np.shape(inside), mask is None or inside.shape == shape, f"{shape}, as the {name}")
    known: Any = True
    if array.dtype.kind == "f" and not (known := is_known(array.reshape(*shape, -1))).all():
        inside = inside & known
    if "numpy.ma" in sys.modules and isinstance(image, np.ma.MaskedArray):  # which takes time to import
        known = ~np.ma.getmaskarray(image).reshape(*shape, -1).any(axis=2)
        inside = inside if known.all() else inside & known
    check_that(name, np.any(inside), _COUNTING)
    return None if inside is True else np.asarray(inside)


def check_labels(name: str, labels: ArrayLike) -> Ints:
    """Return `labels` as a C-contiguous (H, W) int32 array of whole numbers >= 0."""
    refuse_masked(name, labels)
    array = np.asarray(labels)
    check_shape(name, array.shape, array.ndim == 2 and array.size > 0, "(H, W), none of them 0")
    if array.dtype.kind not in "biu":
        refuse_type(name, array.dtype, "integers")
    check_within(name, array, 0, np.iinfo(np.int32).max - 1)
    return np.ascontiguousarray(array, np.int32)


def check_labeled_image(name: str, image: object, labels: Ints) -> Array:
    """Return `image` as (H, W, C) samples; pixels of label 0 may hold anything, and are 0 if they are not finite."""
    array = array_of(image)
    alike = array.shape[:2] == labels.shape
    check_shape(name, array.shape, alike, f"{labels.shape}, as the labels, with channels or none")
    if array.dtype.kind == "f":
        masked = (labels == 0).reshape(labels.shape + (1,) * (array.ndim - 2))
        array = np.where(masked & ~np.isfinite(array), array.dtype.type(0), array)
    return check_image(name, array).reshape(*labels.shape, -1)


def check_partial_image(name: str, image: object, mask: ArrayLike | None) -> tuple[Array, Bools]:
    """Return `image` as an (H, W, C) array of samples, and the (H, W) pixels in the mask that are finite.

    Pixels that are masked in any band of a masked array are outside, and so are the transparent ones of an image that
    says that its last channel is alpha, which is not returned.
    """
    array = array_of(image)
    _check_image_form(name, array)
    inside = _inside(name, array, image, mask)
    if says_alpha(image):
        seen = array[..., -1] > 0
        inside = seen if inside is None else inside & seen
        check_that(name, inside.any(), "have a pixel in its mask that is not transparent")
        array = array[..., :-1]
    elif array.shape[2:] == (4,) and _may_be_alpha(array[..., -1]):
        warn(f"{name} has 4 channels that all count: if the last is alpha, give {name}[..., :3] and it as the mask")
    if array.dtype.kind == "f" and inside is not None:
        array = np.where(np.isfinite(array), array, array.dtype.type(0))
    array = check_image(name, array)
    return array.reshape(*array.shape[:2], -1), np.ones(array.shape[:2], bool) if inside is None else inside


def _may_be_alpha(band: Array) -> bool:
    """Whether a band of 8 bits is clear in some pixels, opaque in others, and little else."""
    opaque, clear = (int(np.count_nonzero(band == value)) for value in (255, 0))
    return band.dtype == np.uint8 and min(opaque, clear) > 0 and opaque + clear > band.size / 2


def check_picture_density(name: str, density: ArrayLike) -> Floats32:
    """Return the density of an image as an (H, W) float32 array: finite, >= 0 and not all 0."""
    refuse_masked(name, density)
    array = array_of(density)
    check_shape(name, array.shape, array.ndim == 2 and array.size > 0, "(H, W), none of them 0")
    check_numbers(name, array.dtype)
    low, high = float(array.min()), float(array.max())
    check_that(name, not np.isnan(low), "be finite: it contains NaN")
    if not (low >= 0 and high < np.inf):
        raise ValueError(f"{name} in {low:g}..{high:g} must be finite and >= 0")
    check_that(name, high > 0, "not be 0 everywhere")
    check_in_range(f"the largest {name}", high, 1e-30 <= high <= 1e30, "in 1e-30..1e+30, for single precision")
    return array.astype(np.float32, copy=False)


def check_colors(name: str, colors: ArrayLike, dtype: Dtype) -> Array:
    """Return `colors` as a (K, C) array of the type of an image, in whose units they are."""
    array = np.asarray(colors)
    array = array[:, np.newaxis] if array.ndim == 1 else array
    if array.ndim != 2 or 0 in array.shape or array.dtype.kind not in "uif":
        raise ValueError(f"{name} of shape {array.shape} must be numbers, (K,) or (K, C), and have colors")
    fits, allowed = np.isfinite(array).all(), "finite"
    if dtype.kind in "iu":
        low, high = np.iinfo(dtype).min, np.iinfo(dtype).max
        fits &= array.min() >= low and array.max() <= high and (array == np.rint(array)).all()
        allowed = f"whole numbers in {low}..{high}"
    check_that(name, fits, f"be {allowed}, as the image is of {dtype}")
    return np.ascontiguousarray(array, dtype)


def check_triangles(name: str, triangles: ArrayLike, n_points: int) -> Ints:
    """Return triangles as a (T, 3) int32 array of indices of points, T >= 1."""
    corners = np.asarray(triangles)
    check_shape(name, corners.shape, corners.ndim == 2 and corners.shape[1] == 3 and len(corners) > 0, "(T, 3), T >= 1")
    if corners.dtype.kind not in "iu":
        refuse_type(name, corners.dtype, "integers")
    check_within(name, corners, 0, n_points - 1, ", as the points")
    return corners.astype(np.int32, copy=False)


def check_have_area(name: str, areas: Floats) -> None:
    """Refuse triangles without area; the areas (T,) may have a sign."""
    flat = np.flatnonzero(areas == 0)
    check_that(f"{name}[{flat[0] if len(flat) else 0}]", not len(flat), "have an area > 0")

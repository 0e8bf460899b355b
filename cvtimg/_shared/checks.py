"""Checks of arguments: the one door through which all of them pass.

Every message gives the name, the value and what is allowed.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.pixels import array_of, pixels_inside, says_alpha

#: Types of samples that the kernels read.
SAMPLE_DTYPES = (np.uint8, np.uint16, np.float32, np.float64)
#: What people call arguments in other libraries.
_MEANT = {"k": "n_colors", "n_clusters": "n_colors", "colors": "n_colors", "seed": "rng", "random_state": "rng"}


def check_choice(name: str, value: str, choices: Collection[str]) -> str:
    """Return `value` if it is one of `choices`."""
    if value not in choices:
        raise ValueError(f"{name}={value!r} must be one of {', '.join(choices)}")
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


def check_at_most(name: str, number: int, most: int, what: str) -> None:
    """Refuse something that has more parts than can be handled."""
    if number > most:
        raise ValueError(f"{name} must have at most {most} {what}, not {number}")


def check_shares(shares: Mapping[str, float]) -> None:
    """Refuse named shares of a whole that are negative or do not add up to 1."""
    if not (min(shares.values()) >= 0 and abs(sum(shares.values()) - 1) <= 1e-12):
        given = " and ".join(f"{name}={float(share)}" for name, share in shares.items())
        raise ValueError(f"{given} must be >= 0, with sum 1")


def raise_unsupported(name: str, value: object, what: str, able: Collection[str]) -> NoReturn:
    """Refuse a combination of arguments that `value` does not support and those named in `able` do."""
    raise ValueError(f"{name}={value!r} does not support {what}; {' or '.join(able)} does")


def check_one_dimension(name: str, n_dims: int) -> None:
    """Refuse samples of more than one dimension where one is needed."""
    if n_dims != 1:
        raise ValueError(f"{name} needs samples of one dimension, not D={n_dims}")


def check_alone(name: str, others: Collection[str]) -> None:
    """Refuse other arguments, by their names, beside one that leaves nothing for them to do."""
    if others:
        raise ValueError(f"{name} must not be given with {' or '.join(others)}")


def check_any(name: str, count: int, wanted: str) -> None:
    """Refuse an argument that holds nothing of what is wanted."""
    if not count:
        raise ValueError(f"{name} must have {wanted}")


def check_in_range(name: str, value: object, is_allowed: bool, allowed: str) -> None:
    """Refuse a value that is not in the range that `allowed` describes."""
    if not is_allowed:
        raise ValueError(f"{name}={value!r} must be {allowed}")


def check_needs(name: str, given: bool, other: str, has_other: bool) -> None:
    """Refuse an argument that does nothing without another."""
    if given and not has_other:
        raise ValueError(f"{name} needs {other}")


def check_excluded(name: str, given: bool, **others: object) -> None:
    """Refuse arguments that have no meaning beside another; None, False and 0 are not given."""
    if given and (wrong := [other for other, value in others.items() if value]):
        raise ValueError(f"{name} takes no {' or '.join(wrong)}")


def check_non_negative(name: str, value: float) -> float:
    """Return `value` as a finite float >= 0."""
    number = float(value)
    if not 0 <= number < np.inf:
        raise ValueError(f"{name}={value!r} must be a finite number >= 0")
    return number


def check_in_unit_range(name: str, value: float) -> float:
    """Return `value` as a float in 0..1."""
    number = float(value)
    if not 0 <= number <= 1:
        raise ValueError(f"{name}={value!r} must be in 0..1")
    return number


def check_rows(name: str, rows: ArrayLike) -> NDArray[Any]:
    """Return `rows` as a C-contiguous, finite (N, D) array of a type that the kernels read."""
    refuse_path(name, rows)
    array = np.asarray(rows)
    if array.ndim != 2 or 0 in array.shape:
        raise ValueError(f"{name} of shape {array.shape} must be (N, D) with N, D >= 1")
    return _as_samples(name, array)


def refuse_path(name: str, value: object) -> None:
    """Refuse a path where its content is wanted."""
    if isinstance(value, (str, bytes, os.PathLike)) or (
        isinstance(value, (list, tuple)) and value and isinstance(value[0], (str, os.PathLike))
    ):
        raise TypeError(f"{name}={value!r} must be an array; read an image with cvtimg.read_image")


def check_keywords(function: str, given: Collection[str], known: Collection[str]) -> None:
    """Refuse keyword arguments that a function does not have, and name the one that was likely meant."""
    for name in given:
        if name not in known:
            meant = _MEANT.get(name)
            hint = f"; did you mean {meant}?" if meant else f"; options are {', '.join(sorted(known))}"
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}{hint}")


def check_image(name: str, image: Any) -> NDArray[Any]:
    """Return `image`, an array or a Pillow image, as a C-contiguous (H, W) or (H, W, C) array of samples."""
    array = array_of(image)
    _check_image_shape(name, array)
    return _as_samples(name, array)


def check_pixels(name: str, image: Any, mask: ArrayLike | None) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """Return an image of any integer or floating type, in native byte order, and the (H, W) pixels that count.

    These are the pixels in the mask that are finite and not masked, at least one; None stands for all. The others have
    the value of the first one that counts. Booleans become 0 and 255.
    """
    array = array_of(image)
    _check_image_shape(name, array)
    if array.dtype.kind not in "biuf":
        raise TypeError(f"{name} of type {array.dtype} must be of integers or of floating point numbers")
    if mask is not None and np.shape(mask) != array.shape[:2]:
        raise ValueError(f"mask of shape {np.shape(mask)} must be {array.shape[:2]}, as the {name}")
    inside = pixels_inside(array, image, mask)
    if array.dtype.kind == "b":
        array = array * np.uint8(255)
    elif array.dtype.kind == "f" and array.dtype.itemsize not in (4, 8):
        array = array.astype(np.float32 if array.dtype.itemsize < 4 else np.float64)
    array = np.ascontiguousarray(array.astype(array.dtype.newbyteorder("="), copy=False)).view(np.ndarray)
    if inside is not None:
        check_any(name, bool(inside.any()), "at least one pixel that is in the mask and finite")
        array = array.copy()
        array[~inside] = array[inside][0]
    return array, inside


def check_alpha(alpha: bool | None, image: Any, n_channels: int) -> bool:
    """Return whether the last channel of an image is alpha: as `alpha` says, or else as the image does."""
    if alpha and n_channels not in (2, 4):
        raise ValueError(f"alpha=True needs an image of 2 or 4 channels, not {n_channels}")
    return says_alpha(image) if alpha is None else bool(alpha)


def _check_image_shape(name: str, array: NDArray[Any]) -> None:
    if array.dtype.kind in "USO":
        refuse_path(name, array.tolist())
    if array.ndim not in (2, 3) or 0 in array.shape:
        raise ValueError(f"{name} of shape {array.shape} must be (H, W) or (H, W, C), none of them 0")


def check_labels(name: str, labels: ArrayLike) -> NDArray[np.int32]:
    """Return `labels` as a C-contiguous (H, W) int32 array of whole numbers >= 0."""
    array = np.asarray(labels)
    if array.ndim != 2 or 0 in array.shape:
        raise ValueError(f"{name} of shape {array.shape} must be (H, W), none of them 0")
    if array.dtype.kind not in "biu":
        raise TypeError(f"{name} of type {array.dtype} must be integers")
    low, high = int(array.min()), int(array.max())
    if low < 0 or high >= np.iinfo(np.int32).max:
        raise ValueError(f"{name} in {low}..{high} must be in 0..{np.iinfo(np.int32).max - 1}")
    return np.ascontiguousarray(array, np.int32)


def check_labeled_image(name: str, image: Any, labels: NDArray[np.int32]) -> NDArray[Any]:
    """Return `image` as (H, W, C) samples; pixels of label 0 may hold anything, and are 0 if they are not finite."""
    array = np.asarray(image)
    if array.shape[:2] != labels.shape:
        raise ValueError(f"{name} of shape {array.shape} must be {labels.shape}, as the labels, with channels or none")
    if array.dtype.kind == "f":
        masked = (labels == 0).reshape(labels.shape + (1,) * (array.ndim - 2))
        array = np.where(masked & ~np.isfinite(array), array.dtype.type(0), array)
    return check_image(name, array).reshape(*labels.shape, -1)


def check_partial_image(name: str, image: Any, mask: ArrayLike | None) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return `image` as an (H, W, C) array of samples, and the (H, W) pixels in the mask that are finite.

    Pixels that are masked in any band of a masked array are outside.
    """
    array = np.asarray(image)
    finite = np.isfinite(array) if array.dtype.kind == "f" else np.True_
    if isinstance(image, np.ma.MaskedArray):
        finite = finite & ~np.ma.getmaskarray(image)
    array = check_image(name, array if np.all(finite) else np.where(finite, array, array.dtype.type(0)))
    array = array.reshape(*array.shape[:2], -1)
    inside = np.ones(array.shape[:2], bool) if mask is None else np.asarray(mask) != 0
    if inside.shape != array.shape[:2]:
        raise ValueError(f"mask of shape {inside.shape} must be {array.shape[:2]}, as the {name}")
    if not np.all(finite):
        inside = inside & np.all(np.reshape(finite, array.shape), axis=2)
    if not inside.any():
        raise ValueError(f"{name} must have at least one pixel that is in the mask and finite, and not masked")
    return array, inside


def check_density(density: ArrayLike | None, n_samples: int) -> NDArray[np.float64]:
    """Return the weights of `n_samples` samples: finite, >= 0 and not all 0; ones by default."""
    if density is None:
        return np.ones(n_samples)
    return check_weights("density", density, (n_samples,), "sample")


def check_weights(name: str, weights: ArrayLike, shape: tuple[int, ...], of: str = "pixel") -> NDArray[np.float64]:
    """Return weights, one for each pixel of a picture of this shape: finite, >= 0 and not all 0."""
    array = np.asarray(weights, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"{name} of shape {array.shape} must be {shape}, one weight for each {of}")
    if not (np.isfinite(array).all() and array.min() >= 0 and array.any()):
        raise ValueError(f"{name} must be finite and >= 0, and not all 0")
    return array


def check_picture_density(name: str, density: ArrayLike) -> NDArray[np.float32]:
    """Return the density of a picture as an (H, W) float32 array: finite, >= 0 and not all 0."""
    array = np.asarray(density)
    if array.ndim != 2 or 0 in array.shape:
        raise ValueError(f"{name} of shape {array.shape} must be (H, W), none of them 0")
    if array.dtype.kind not in "biuf":
        raise TypeError(f"{name} of type {array.dtype} must be of integers or of floating point numbers")
    with np.errstate(over="ignore"):
        array = array.astype(np.float32, copy=False)
    if np.isnan(array).any():
        raise ValueError(f"{name} must be finite: it contains NaN")
    low, high = array.min(), array.max()
    if not (low >= 0 and high < np.inf):
        raise ValueError(f"{name} in {low:g}..{high:g} must be finite and >= 0")
    if high == 0:
        raise ValueError(f"{name} must not be 0 everywhere")
    return array


def check_places(name: str, places: ArrayLike, n_dims: int | None = None) -> NDArray[np.float64]:
    """Return `places` as a finite, C-contiguous (N, D) float64 array, N >= 1."""
    array = np.asarray(places)
    if array.ndim != 2 or 0 in array.shape or n_dims not in (None, array.shape[1]):
        raise ValueError(f"{name} of shape {array.shape} must be (N, {n_dims or 'D'}), a place in each row")
    if array.dtype.kind not in "biuf":
        raise TypeError(f"{name} of type {array.dtype} must be of integers or of floating point numbers")
    array = np.ascontiguousarray(array, np.float64)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite: it contains NaN or infinity")
    return array


def check_place_weights(name: str, weights: ArrayLike | None, n_places: int) -> NDArray[np.float64] | None:
    """Return the finite weights of power cells, one for each place; None of none."""
    if weights is None:
        return None
    array = np.ascontiguousarray(weights, np.float64)
    if array.shape != (n_places,):
        raise ValueError(f"{name} of shape {array.shape} must be ({n_places},), one weight for each place")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite")
    return array


def check_alike(name: str, several: Sequence[NDArray[Any]]) -> None:
    """Refuse arrays of colors that differ in type or number of channels, or none at all."""
    kinds = {(str(array.dtype), array.shape[1]) for array in several}
    if len(kinds) != 1:
        found = ", ".join(f"{dtype} x {n_channels}" for dtype, n_channels in sorted(kinds)) or "none"
        raise ValueError(f"{name} must have one type and number of channels, not {found}")


def check_colors(name: str, colors: ArrayLike, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return `colors` as a (K, C) array of the type of a picture, in whose units they are."""
    array = np.asarray(colors)
    array = array[:, np.newaxis] if array.ndim == 1 else array
    if array.ndim != 2 or 0 in array.shape or array.dtype.kind not in "uif":
        raise ValueError(f"{name} of shape {array.shape} must be numbers, (K,) or (K, C), and have colors")
    fits, whole = np.isfinite(array).all(), dtype.kind in "iu"
    if fits and whole:
        low, high = np.iinfo(dtype).min, np.iinfo(dtype).max
        fits = array.min() >= low and array.max() <= high and (array == np.rint(array)).all()
    if not fits:
        allowed = f"whole numbers in {np.iinfo(dtype).min}..{np.iinfo(dtype).max}" if whole else "finite"
        raise ValueError(f"{name} must be {allowed}, as the picture is of {dtype}")
    return np.ascontiguousarray(array, dtype)


def check_locked(locked: ArrayLike | None, n_generators: int, n_dims: int) -> NDArray[np.float64]:
    """Return locked generators as a finite (L, D) array, L < `n_generators`; none by default."""
    if locked is None:
        return np.empty((0, n_dims))
    array = check_generators("locked", locked, len(np.asarray(locked)), n_dims)
    if len(array) >= n_generators:
        raise ValueError(f"locked has {len(array)} generators and must have fewer than n_generators={n_generators}")
    return array


def check_generators(name: str, generators: ArrayLike, n_generators: int, n_dims: int) -> NDArray[np.float64]:
    """Return `generators` as a finite (n_generators, n_dims) array."""
    array = np.asarray(generators, dtype=np.float64)
    if array.shape != (n_generators, n_dims):
        raise ValueError(f"{name} of shape {array.shape} must be ({n_generators}, {n_dims}), a row for each generator")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite")
    return array


def _as_samples(name: str, array: NDArray[Any]) -> NDArray[Any]:
    """Booleans become uint8, integers of other widths float64; other types are refused."""
    array = array.astype(array.dtype.newbyteorder("="), copy=False)
    if array.dtype.kind in "biu" and array.dtype not in SAMPLE_DTYPES:
        array = array.astype(np.uint8 if array.dtype.kind == "b" else np.float64)
    elif array.dtype == np.float16:
        array = array.astype(np.float32)
    elif array.dtype not in SAMPLE_DTYPES:
        raise TypeError(f"{name} of type {array.dtype} must be of integers or of floating point numbers")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite: it contains NaN or infinity")
    return np.ascontiguousarray(array)


def check_same(what: str, found: Sequence[object]) -> None:
    """Refuse versions that differ in what they must share."""
    for number, other in enumerate(found):
        if other != found[0]:
            raise ValueError(f"images[{number}] has {what} {other} and images[0] has {found[0]}; they must be the same")


def check_masks(
    masks: Sequence[ArrayLike | None] | None, n_versions: int, shape: tuple[int, ...]
) -> list[NDArray[np.bool_]]:
    """Return a (H, W) bool mask for each version, True where it is known; all known by default."""
    if masks is None:
        return [np.ones(shape, np.bool_)] * n_versions
    if len(masks) != n_versions:
        raise ValueError(f"masks has {len(masks)} masks and must have {n_versions}, one for each version, or None")
    checked = []
    for number, mask in enumerate(masks):
        array = np.ones(shape, np.bool_) if mask is None else np.asarray(mask)
        if array.shape != shape:
            raise ValueError(f"masks[{number}] of shape {array.shape} must be {shape}, the size of the versions")
        checked.append(array != 0)
    return checked


def check_version_weights(weights: ArrayLike, n_versions: int) -> NDArray[np.float64]:
    """Return the weights of versions: finite and > 0."""
    array = np.asarray(weights, dtype=np.float64)
    if array.shape != (n_versions,):
        raise ValueError(f"weights of shape {array.shape} must be ({n_versions},), one for each version")
    if not (np.isfinite(array).all() and array.min() > 0):
        raise ValueError(f"weights={array.tolist()} must be finite and > 0")
    return array


def check_edge_weight(edge_weight: float | str) -> float | None:
    """Return an edge weight >= 0, or None for "auto"."""
    if not isinstance(edge_weight, str):
        return check_non_negative("edge_weight", edge_weight)
    if edge_weight != "auto":
        raise ValueError(f"edge_weight={edge_weight!r} must be a finite number >= 0, or 'auto'")
    return None

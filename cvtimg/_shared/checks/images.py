"""Checks of images, of their masks, labels and colors, and of several images that belong together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks.tables import as_samples, check_numbers, check_shape
from cvtimg._shared.checks.values import check_that, refuse_path, refuse_type
from cvtimg._shared.pixels import array_of, pixels_inside, says_alpha


def check_image(name: str, image: Any) -> NDArray[Any]:
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


def check_pixels(name: str, image: Any, mask: ArrayLike | None) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """Return an image of any integer or floating type, in native byte order, and the (H, W) pixels that count.

    These are the pixels in the mask that are finite and not masked, at least one; None stands for all. The others have
    the value of the first one that counts. Booleans become 0 and 255.
    """
    array = array_of(image)
    _check_image_form(name, array)
    check_numbers(name, array.dtype)
    if mask is not None:
        _check_mask_shape(mask, name, array)
    inside = pixels_inside(array, image, mask)
    if array.dtype.kind == "b":
        array = array * np.uint8(255)
    elif array.dtype.kind == "f" and array.dtype.itemsize not in (4, 8):
        array = array.astype(np.float32 if array.dtype.itemsize < 4 else np.float64)
    array = np.ascontiguousarray(array.astype(array.dtype.newbyteorder("="), copy=False)).view(np.ndarray)
    if inside is not None:
        check_that(name, inside.any(), "have at least one pixel that is in the mask and finite")
        array = array.copy()
        array[~inside] = array[inside][0]
    return array, inside


def check_alpha(alpha: bool | None, image: Any, n_channels: int) -> bool:
    """Return whether the last channel of an image is alpha: as `alpha` says, or else as the image does."""
    if alpha and n_channels not in (2, 4):
        raise ValueError(f"alpha=True needs an image of 2 or 4 channels, not {n_channels}")
    return says_alpha(image) if alpha is None else bool(alpha)


def _check_image_form(name: str, array: NDArray[Any]) -> None:
    if array.dtype.kind in "USO":
        refuse_path(name, array.tolist())
    check_image_shape(name, array.shape)


def check_image_shape(name: str, shape: tuple[int, ...]) -> None:
    """Refuse what does not have the shape of an image."""
    check_shape(name, shape, len(shape) in (2, 3) and 0 not in shape, "(H, W) or (H, W, C), none of them 0")


def _check_mask_shape(mask: ArrayLike, name: str, image: NDArray[Any]) -> None:
    check_shape("mask", np.shape(mask), np.shape(mask) == image.shape[:2], f"{image.shape[:2]}, as the {name}")


def check_labels(name: str, labels: ArrayLike) -> NDArray[np.int32]:
    """Return `labels` as a C-contiguous (H, W) int32 array of whole numbers >= 0."""
    array = np.asarray(labels)
    check_shape(name, array.shape, array.ndim == 2 and array.size > 0, "(H, W), none of them 0")
    if array.dtype.kind not in "biu":
        refuse_type(name, array.dtype, "integers")
    low, high = int(array.min()), int(array.max())
    if low < 0 or high >= np.iinfo(np.int32).max:
        raise ValueError(f"{name} in {low}..{high} must be in 0..{np.iinfo(np.int32).max - 1}")
    return np.ascontiguousarray(array, np.int32)


def check_labeled_image(name: str, image: Any, labels: NDArray[np.int32]) -> NDArray[Any]:
    """Return `image` as (H, W, C) samples; pixels of label 0 may hold anything, and are 0 if they are not finite."""
    array = array_of(image)
    alike = array.shape[:2] == labels.shape
    check_shape(name, array.shape, alike, f"{labels.shape}, as the labels, with channels or none")
    if array.dtype.kind == "f":
        masked = (labels == 0).reshape(labels.shape + (1,) * (array.ndim - 2))
        array = np.where(masked & ~np.isfinite(array), array.dtype.type(0), array)
    return check_image(name, array).reshape(*labels.shape, -1)


def check_partial_image(name: str, image: Any, mask: ArrayLike | None) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return `image` as an (H, W, C) array of samples, and the (H, W) pixels in the mask that are finite.

    Pixels that are masked in any band of a masked array are outside.
    """
    array = array_of(image)
    finite = np.isfinite(array) if array.dtype.kind == "f" else np.True_
    if isinstance(image, np.ma.MaskedArray):
        finite = finite & ~np.ma.getmaskarray(image)
    array = check_image(name, array if np.all(finite) else np.where(finite, array, array.dtype.type(0)))
    array = array.reshape(*array.shape[:2], -1)
    inside = np.ones(array.shape[:2], bool) if mask is None else np.asarray(mask) != 0
    _check_mask_shape(inside, name, array)
    if not np.all(finite):
        inside = inside & np.all(np.reshape(finite, array.shape), axis=2)
    check_that(name, inside.any(), "have at least one pixel that is in the mask and finite, and not masked")
    return array, inside


def check_picture_density(name: str, density: ArrayLike) -> NDArray[np.float32]:
    """Return the density of a picture as an (H, W) float32 array: finite, >= 0 and not all 0."""
    array = array_of(density)
    check_shape(name, array.shape, array.ndim == 2 and array.size > 0, "(H, W), none of them 0")
    check_numbers(name, array.dtype)
    with np.errstate(over="ignore"):
        array = array.astype(np.float32, copy=False)
    check_that(name, not np.isnan(array).any(), "be finite: it contains NaN")
    low, high = array.min(), array.max()
    if not (low >= 0 and high < np.inf):
        raise ValueError(f"{name} in {low:g}..{high:g} must be finite and >= 0")
    check_that(name, high > 0, "not be 0 everywhere")
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
        check_shape(f"masks[{number}]", array.shape, array.shape == shape, f"{shape}, the size of the versions")
        checked.append(array != 0)
    return checked


def check_version_weights(weights: ArrayLike, n_versions: int) -> NDArray[np.float64]:
    """Return the weights of versions: finite and > 0."""
    array = np.asarray(weights, dtype=np.float64)
    check_shape("weights", array.shape, array.shape == (n_versions,), f"({n_versions},), one for each version")
    if not (np.isfinite(array).all() and array.min() > 0):
        raise ValueError(f"weights={array.tolist()} must be finite and > 0")
    return array

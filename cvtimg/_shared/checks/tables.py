"""Checks of arrays with one row per sample, point or generator."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks.values import check_that, refuse_path, refuse_type
from cvtimg._shared.pixels import array_of

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


def check_numbers(name: str, dtype: np.dtype[Any]) -> None:
    """Refuse an array that is not of real numbers."""
    if dtype.kind not in "biuf":
        refuse_type(name, dtype, "of integers or of floating point numbers")


def check_finite(name: str, array: NDArray[Any]) -> None:
    """Refuse an array of floating point numbers that are not all finite."""
    if array.dtype.kind == "f":
        check_that(name, np.isfinite(array).all(), "be finite: it contains NaN or infinity")


def check_within(name: str, array: NDArray[Any], low: float, high: float, reason: str = "") -> None:
    """Refuse an array with numbers that are not in low..high; `reason` says what sets these limits."""
    if array.size and not (array.min() >= low and array.max() <= high):  # NaN fails too
        least, most = (f"{end:g}" if array.dtype.kind == "f" else f"{end}" for end in (array.min(), array.max()))
        raise ValueError(f"{name} in {least}..{most} must be in {low:.15g}..{high:.15g}{reason}")


def check_fewer(name: str, n_rows: int, n_generators: int) -> None:
    """Refuse so many generators that stay where they are that none is left to move."""
    if n_rows >= n_generators:
        raise ValueError(f"{name} must have fewer than n_generators={n_generators}, not {n_rows}")


def check_returned(name: str, values: NDArray[Any], n_points: int) -> None:
    """Refuse what a function of points returned if it is not one value per point."""
    if values.shape != (n_points,):
        raise ValueError(f"{name} returned shape {values.shape} and must return ({n_points},), one per point")


def check_rows(name: str, rows: ArrayLike) -> NDArray[Any]:
    """Return `rows` as a C-contiguous, finite (N, D) array of a type that the kernels read."""
    refuse_path(name, rows)
    array = array_of(rows)
    check_shape(name, array.shape, array.ndim == 2 and array.size > 0, "(N, D) with N, D >= 1")
    return as_samples(name, array)


def check_density(density: ArrayLike | None, n_samples: int) -> NDArray[np.float64]:
    """Return the weights of `n_samples` samples: finite, >= 0 and not all 0; ones by default."""
    if density is None:
        return np.ones(n_samples)
    return check_weights("density", density, (n_samples,), "sample")


def check_weights(name: str, weights: ArrayLike, shape: tuple[int, ...], of: str = "pixel") -> NDArray[np.float64]:
    """Return weights, one for each pixel of a picture of this shape: finite, >= 0 and not all 0."""
    array = np.asarray(weights, dtype=np.float64)
    check_shape(name, array.shape, array.shape == shape, f"{shape}, one weight for each {of}")
    holds = np.isfinite(array).all() and array.min() >= 0 and array.any()
    check_that(name, holds, "be finite and >= 0, and not all 0")
    return array


def check_places(name: str, places: ArrayLike, n_dims: int | None = None) -> NDArray[np.float64]:
    """Return `places` as a finite, C-contiguous (N, D) float64 array, N >= 1."""
    array = np.asarray(places)
    is_table = array.ndim == 2 and array.size > 0 and n_dims in (None, array.shape[1])
    check_shape(name, array.shape, is_table, f"(N, {n_dims or 'D'}), a place in each row")
    check_numbers(name, array.dtype)
    array = np.ascontiguousarray(array, np.float64)
    check_finite(name, array)
    return array


def check_place_weights(name: str, weights: ArrayLike | None, n_places: int) -> NDArray[np.float64] | None:
    """Return the finite weights of power cells, one for each place; None of none."""
    if weights is None:
        return None
    array = np.ascontiguousarray(weights, np.float64)
    check_shape(name, array.shape, array.shape == (n_places,), f"({n_places},), one weight for each place")
    check_finite(name, array)
    return array


def check_locked(locked: ArrayLike | None, n_generators: int, n_dims: int) -> NDArray[np.float64]:
    """Return locked generators as a finite (L, D) array, L < `n_generators`; none by default."""
    if locked is None:
        return np.empty((0, n_dims))
    array = check_generators("locked", locked, len(np.asarray(locked)), n_dims)
    check_fewer("locked", len(array), n_generators)
    return array


def check_generators(name: str, generators: ArrayLike, n_generators: int, n_dims: int) -> NDArray[np.float64]:
    """Return `generators` as a finite (n_generators, n_dims) array."""
    array = np.asarray(generators, dtype=np.float64)
    shape = (n_generators, n_dims)
    check_shape(name, array.shape, array.shape == shape, f"{shape}, a row for each generator")
    check_finite(name, array)
    return array


def as_samples(name: str, array: NDArray[Any]) -> NDArray[Any]:
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

"""Images as arguments: arrays of any type, masked arrays, what has an array inside; alpha, and the white of a type."""

from typing import Any

import numpy as np

from cvtimg._shared.budgets import SAMPLES_OF_FIGURE
from cvtimg._shared.types import Array, Bools, Dtype

#: Pillow modes whose samples are grey or RGB, perhaps with alpha: others hold indices, ink or other coordinates.
_PLAIN_MODES = ("1", "L", "LA", "I", "I;16", "I;16L", "I;16B", "F", "RGB", "RGBA")


class AlphaArray(np.ndarray[Any, Any]):
    """An image whose last channel is alpha, (H, W, 2) or (H, W, 4): an array like any other, but for what it says.

    `cvtimg.read_image` returns one for a file with transparency, and so do the results of quantizing it. Views of all
    channels say the same, those of some or of new ones nothing.
    """


def array_of(image: Any) -> Array:
    """Return the array that an object is, has or exports: by NumPy, Pillow, ``__array__`` or the DLPack protocol."""
    mode = getattr(image, "mode", None)  # a tensor of torch has another kind of mode
    if isinstance(mode, str) and mode not in _PLAIN_MODES:
        image = image.convert("RGBA" if image.has_transparency_data else "RGB")
    if hasattr(image, "columns") and hasattr(image, "to_numpy"):
        return _of_frame(image)
    if hasattr(image, "__dlpack__") and not hasattr(image, "__array__"):
        return np.from_dlpack(image)
    return np.asarray(image)


def _of_frame(frame: Any) -> Array:
    """Return the numbers of a data frame of pandas or polars; truths are 0 and 1, and missing values NaN."""
    columns = []
    for number, name in enumerate(frame.columns):
        is_pandas = hasattr(frame, "iloc")
        column = frame.iloc[:, number] if is_pandas else frame[name]
        kind = getattr(column.dtype, "kind", None) or column.to_numpy().dtype.kind
        if kind not in "biuf":
            raise TypeError(f"column {name!r} of type {column.dtype} must be of numbers: choose the columns")
        if is_pandas and column.hasnans:
            columns.append(column.to_numpy(dtype=np.float64, na_value=np.nan))
        else:
            how = {"dtype": column.dtype.numpy_dtype} if hasattr(column.dtype, "numpy_dtype") else {}
            columns.append(column.to_numpy(**how))
    return np.stack(columns, axis=1)


def says_alpha(image: Any) -> bool:
    """Whether an image says that its last channel is alpha: by its Pillow mode, or as an `AlphaArray`."""
    if hasattr(image, "getbands"):
        return "A" in image.getbands() or bool(image.has_transparency_data)
    return isinstance(image, AlphaArray) and image.ndim == 3 and image.shape[2] in (2, 4)


def with_mark(image: Array, alpha: bool) -> Array:
    """Return an image that says whether its last channel is alpha."""
    return image.view(AlphaArray if alpha else np.ndarray)


def is_known(samples: Array, nodata: float | None = None) -> Bools:
    """(...) which of (..., C) samples are finite in all bands, and not `nodata` in all."""
    known = np.ones(samples.shape[:-1], np.bool_)
    if samples.dtype.kind == "f" and not (finite := np.isfinite(samples)).all():
        known &= finite.all(axis=-1)
    if nodata is not None:
        known &= (samples != nodata).any(axis=-1)
    return known


def not_black(mask: Array) -> Bools:
    """(H, W) pixels of an image of a mask, (H, W) or (H, W, C), that are not black; alpha plays no part."""
    bands = mask.reshape(*mask.shape[:2], -1)
    return np.asarray(((bands[:, :, :-1] if bands.shape[2] in (2, 4) else bands) > 0).any(axis=2))


def peak(dtype: Dtype) -> float:
    """Return the value of white: the largest integer of the type, or 1 for floating point."""
    return float(np.iinfo(dtype).max) if dtype.kind in "iu" else 1.0


def are_shades(samples: Array) -> bool:
    """Whether samples are shades as screens show them: of 8 bits, or from 0 to white and not all nearly black."""
    if samples.dtype == np.uint8:
        return True
    white, seen = peak(samples.dtype), samples[np.isfinite(samples)] if samples.dtype.kind == "f" else samples
    return bool(seen.size and seen.min() >= 0 and white / 16 <= seen.max() <= white)


def narrowed(samples: Array) -> Array:
    """Return a picture of wide integers in 8 or 16 bits if they fit and are nearly black by the white of their type."""
    kind, n_bytes = samples.dtype.kind, samples.dtype.itemsize
    is_wide = kind == "i" or (kind == "u" and n_bytes > 2)
    if is_wide and samples.size and not are_shades(samples) and samples.min() >= 0 and samples.max() <= 65535:
        return samples.astype(np.uint8 if samples.max() <= 255 else np.uint16)
    return samples


def white_among(samples: Array) -> float:
    """Return the value of white among finite samples: `peak`, but what most use where they are no share of that.

    That is where they leave 0..1, as floating point, or where all of them would be nearly black.
    """
    samples = narrowed(samples)
    if not samples.size or (samples.dtype.kind == "u" and samples.dtype.itemsize <= 2):
        return peak(samples.dtype)
    low, high = float(samples.min()), float(samples.max())
    is_share = low >= 0 and 1 / 255 <= high <= 1 if samples.dtype.kind == "f" else are_shades(samples)
    return peak(samples.dtype) if is_share or low == high else usual_range(samples) or high - low


def usual_range(*arrays: Array) -> float:
    """Return the range of all samples but one in a hundred at each end, of some: no hot pixel widens it."""
    some = np.concatenate([array.reshape(-1)[:: 1 + array.size // SAMPLES_OF_FIGURE] for array in arrays])
    return float(np.ptp(np.quantile(some.astype(np.float64), (0.01, 0.99))))


def white_of(dtype: Dtype) -> Any:
    """Return white as a sample of a type: `peak`, which is a float, rounds integers of 64 bits."""
    return dtype.type(np.iinfo(dtype).max if dtype.kind in "iu" else 1)


def psnr(mse: float | Array, white: float) -> Any:
    """Return the peak signal-to-noise ratio in dB of a mean squared error, infinite where that is 0."""
    with np.errstate(divide="ignore"):
        return 10 * np.log10(white**2 / np.asarray(mse, dtype=np.float64))

"""Images of any type as 8-bit colors to look at: deep and wide samples are stretched to the range that they fill."""

from collections.abc import Iterable, Sequence
from itertools import cycle, islice

import numpy as np
from PIL import ImageColor

from cvtimg._shared.budgets import ROWS_AT_ONCE
from cvtimg._shared.pixels import are_shades, peak
from cvtimg._shared.types import Array, Bytes

#: Parts of the samples that may be darker than black and brighter than white, so that a hot pixel hides nothing.
_TAIL = 0.001
#: Images whose brightest part is below this share of white are too dark to be shown as they are.
_DARK = 0.5
#: Colors of channels that are shown together, in the order of Fiji; of two they are those that all people tell apart.
_TINTS = ("red", "green", "blue", "white", "cyan", "magenta", "yellow")


def limits_to_show(images: Iterable[Array]) -> tuple[float, float]:
    """Return the values to show as black and as white: those that all but 0.1% of each image, (..., C), lie between.

    8-bit images, alpha, NaN and infinity are not considered.
    """
    deep = [_split_alpha(image)[0].ravel() for image in images if image.dtype != np.uint8]
    some = [values[:: max(1, values.size // ROWS_AT_ONCE)] for values in deep]
    some = [finite for values in some if (finite := values[np.isfinite(values)]).size]
    low = min((float(np.quantile(values, _TAIL, method="lower")) for values in some), default=0)
    high = max((float(np.quantile(values, 1 - _TAIL, method="higher")) for values in some), default=low)
    return low, high


def natural_limits(image: Array) -> tuple[float, float]:
    """Return 0 and white for an image, (..., C), that can be shown as it is; else `limits_to_show`."""
    low, high = limits_to_show([image])
    white = peak(image.dtype)
    return (0.0, white) if low >= 0 and _DARK * white <= high <= white else (low, high)


def limits_of_measurements(samples: Array) -> tuple[float, float] | None:
    """Return `limits_to_show` of (..., C) samples that are no shades of a screen; None for shades, or if all are 0."""
    return None if are_shades(samples) or not samples.any() else limits_to_show([samples])


def shown(image: Array, limits: tuple[float, float]) -> Bytes:
    """Return the colors to show, (..., 3), or (..., 4) with alpha, for an image with channels on the last axis.

    One or two channels are shown as gray by the first, four are RGB and alpha, and of others the first three count.
    """
    color, alpha = _split_alpha(image)
    if image.dtype != np.uint8:
        color, alpha = _stretched(color, *limits), _stretched(alpha, 0, peak(image.dtype))
    rgb = np.broadcast_to(color, (*color.shape[:-1], 3))
    return np.concatenate([rgb, alpha], axis=-1)


def usual_tints(n_channels: int) -> tuple[str, ...]:
    """Return names of the colors in which channels are shown together."""
    return ("green", "magenta") if n_channels == 2 else tuple(islice(cycle(_TINTS), n_channels))


def tint(color: str) -> tuple[int, ...]:
    """Return red, green and blue of a color in the notation of CSS, whose "green" is bright here, as in microscopes."""
    return ImageColor.getrgb("lime" if color == "green" else color)[:3]


def composed(channels: Array, tints: Sequence[str]) -> Bytes:
    """(H, W, 3) sum of channels (H, W, C) in colors, each stretched to the range that it fills; NaN is black."""
    total = np.zeros((*channels.shape[:2], 3), np.float32)
    for at, color in enumerate(tints):
        values = channels[..., at : at + 1].astype(np.float64)
        total += _stretched(values, *limits_to_show([values])) * np.float32(np.array(tint(color)) / 255)
    return np.rint(total.clip(0, 255)).astype(np.uint8)


def _split_alpha(image: Array) -> tuple[Array, Array]:
    """Separate the channels to show, (..., 1) or (..., 3), from alpha, (..., 1) or (..., 0)."""
    n_channels = image.shape[-1]
    return image[..., : 3 if n_channels >= 3 else 1], image[..., 3 : 4 if n_channels == 4 else 3]


def _stretched(values: Array, low: float, high: float) -> Bytes:
    span = high - low or 1.0
    levels = np.clip((values - np.float64(low)) * 255 / span, 0, 255)
    return np.rint(np.nan_to_num(levels, copy=False)).astype(np.uint8)

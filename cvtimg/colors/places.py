"""Places of colors: where they lie when distances are measured, with their transparency.

A color with alpha a lies at (a (s - m), a |w - m|), with s its place in the color space and m the middle between
black and white, w. Squared distances between such places are squared errors seen over a black background and over a
white one, their mean. So a color that cannot be seen costs nothing, and opaque colors are as far from each other as
without alpha.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg.colors.samples import ColorSamples
from cvtimg.colors.spaces import from_space, peak, to_space

#: Kinds of colors.
CLEAR, PARTLY, OPAQUE = range(3)


def has_alpha(n_channels: int) -> bool:
    """Whether the last of so many channels is alpha: of grey and alpha, or of RGBA."""
    return n_channels in (2, 4)


def kinds_of(colors: NDArray[Any]) -> NDArray[np.uint8]:
    """(N,) kind of each color: `CLEAR`, `PARTLY` transparent or `OPAQUE`."""
    if not has_alpha(colors.shape[1]):
        return np.full(len(colors), OPAQUE, np.uint8)
    alpha, white = colors[:, -1], peak(colors.dtype)
    if alpha.size and not (alpha.min() >= 0 and alpha.max() <= white):
        raise ValueError(f"alpha in {alpha.min()}..{alpha.max()} must be in 0..1, as the picture is of floating point")
    return np.where(alpha == 0, CLEAR, np.where(alpha == white, OPAQUE, PARTLY)).astype(np.uint8)


def allowed_for(kinds: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(3, K) whether a color of each kind may become one of K of these kinds: its own, if CLEAR or OPAQUE and there."""
    allowed = np.stack([kinds == CLEAR, np.ones(len(kinds), bool), kinds == OPAQUE])
    return allowed | ~allowed.any(axis=1, keepdims=True)


def to_places(colors: NDArray[Any], space: str) -> NDArray[Any]:
    """(N, D) places of (N, C) colors: D = C, and in the space "rgb" without alpha the colors themselves."""
    if not has_alpha(colors.shape[1]):
        return to_space(colors, space)
    middle, size = _middle(colors.shape[1] - 1, space, colors.dtype)
    share = colors[:, -1:] / peak(colors.dtype)
    seen = to_space(np.ascontiguousarray(colors[:, :-1]), space)
    return np.concatenate([(seen - middle) * share, share * size], axis=1)


def from_places(places: NDArray[np.float64], space: str, dtype: np.dtype[Any]) -> NDArray[Any]:
    """(N, C) colors of a type at places: the inverse of `to_places`. What has no alpha left is all zeros."""
    if not has_alpha(places.shape[1]):
        return from_space(places, space, dtype)
    middle, size = _middle(places.shape[1] - 1, space, dtype)
    white = peak(dtype)
    alpha = np.clip(places[:, -1:] / size, 0, 1) * white
    if dtype.kind == "u":
        alpha = np.rint(alpha)
    # The rounded alpha here lets the color make up for what rounding did.
    seen = np.divide(places[:, :-1] * white, alpha, out=np.zeros_like(places[:, :-1]), where=alpha > 0) + middle
    colors = np.concatenate([from_space(seen, space, dtype), alpha.astype(dtype)], axis=1)
    colors[alpha[:, 0] == 0] = 0
    return colors


def opaque_end(n_channels: int, space: str, dtype: np.dtype[Any]) -> float:
    """Return the last coordinate of opaque colors of so many channels, alpha with them."""
    return _middle(n_channels - 1, space, dtype)[1]


def _middle(n_channels: int, space: str, dtype: np.dtype[Any]) -> tuple[NDArray[np.float64], float]:
    """Return the middle between black and white, and how far both are from it."""
    ends = np.array([[0], [peak(dtype)]], dtype).repeat(n_channels, axis=1)
    black, white = to_space(ends, space).astype(np.float64)
    return (black + white) / 2, float(np.linalg.norm(white - black) / 2)


def agree(samples: ColorSamples, colors: NDArray[Any]) -> tuple[ColorSamples, NDArray[Any]]:
    """Bring samples and given colors to the same channels: to grey if both are, to alpha if one has some."""
    given, n_channels = colors.shape[1], samples.colors.shape[1]
    if given == n_channels:
        return samples, colors
    if max(given, n_channels) > 4:
        raise ValueError(f"colors of {given} channels must have {n_channels}, as the picture has")
    if has_alpha(given) and not has_alpha(n_channels) and (kinds_of(colors) == OPAQUE).all():
        colors = colors[:, :-1]
    if n_channels < 3 <= given and (colors[:, :1] == colors[:, 1:3]).all():
        colors = colors[:, 2:]
    channels = (n_channels, colors.shape[1])
    n_seen, alpha = 1 if max(channels) < 3 else 3, any(map(has_alpha, channels))
    return replace(samples, rows=widen(samples.colors, n_seen, alpha)), widen(colors, n_seen, alpha)


def with_alpha(colors: NDArray[Any]) -> NDArray[Any]:
    """Give colors alpha, opaque."""
    return np.concatenate([colors, np.full_like(colors[:, :1], peak(colors.dtype))], axis=1)


def widen(colors: NDArray[Any], n_seen: int, alpha: bool) -> NDArray[Any]:
    """Give colors so many channels, with grey in each of them, and alpha, opaque where they had none."""
    if has_alpha(colors.shape[1]):
        return np.concatenate([widen(colors[:, :-1], n_seen, False), colors[:, -1:]], axis=1)
    wide = np.repeat(colors, n_seen, axis=1) if colors.shape[1] == 1 else colors
    return with_alpha(wide) if alpha else wide


def without_idle_alpha(image: NDArray[Any]) -> NDArray[Any]:
    """Return a picture that is opaque all over without its alpha: three bytes a pixel are counted sooner than four."""
    if image.ndim == 2 or not has_alpha(image.shape[2]) or (image[..., -1] != peak(image.dtype)).any():
        return image
    return np.ascontiguousarray(image[..., :-1])

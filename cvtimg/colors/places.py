"""Places of colors, with their transparency: where they lie when distances are measured.

A color with alpha a lies at (a (s - m), a |w - m|), where s is its place in the color space, w that of white, and m the
middle between black and white. The squared distance between two such places is the mean of the squared errors seen
over a black and over a white background. So an invisible color costs nothing, and opaque colors are as far from each
other as without alpha.
"""

from dataclasses import replace

import numpy as np

from cvtimg._shared.checks import SAMPLE_DTYPES, check_channels, check_within
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.pixels import peak, white_of
from cvtimg._shared.types import Array, Bools, Bytes, Floats
from cvtimg.colors.samples import ColorSamples
from cvtimg.colors.spaces import from_space, to_space

#: Kinds of colors.
CLEAR, PARTLY, OPAQUE = range(3)


def has_alpha(n_channels: int) -> bool:
    """Whether images of this many channels can have alpha: grey and alpha, or RGBA."""
    return n_channels in (2, 4)


def kinds_of(colors: Array, alpha: bool) -> Bytes:
    """Return the (N,) kind of each color: `CLEAR`, `PARTLY` transparent or `OPAQUE`; `alpha` is the last channel."""
    if not alpha:
        return np.full(len(colors), OPAQUE, np.uint8)
    values, white = colors[:, -1], peak(colors.dtype)
    check_within("alpha", values, 0, white, f" for {colors.dtype}")
    return np.where(values == 0, CLEAR, np.where(values == white, OPAQUE, PARTLY)).astype(np.uint8)


def allowed_for(kinds: Bytes) -> Bools:
    """Return (3, K) whether a color of each kind may become each of K colors: CLEAR and OPAQUE ones keep their kind."""
    allowed = np.stack([kinds == CLEAR, np.ones(len(kinds), bool), kinds == OPAQUE])
    return allowed | ~allowed.any(axis=1, keepdims=True)


def to_places(colors: Array, space: SpaceName, alpha: bool) -> Array:
    """Return the (N, D) places of (N, C) colors: D = C, and in the space "rgb" without alpha the colors themselves."""
    if not alpha:
        places = to_space(colors, space)
        return places if places.dtype in SAMPLE_DTYPES else places.astype(np.float64)  # what kernels read
    center, size = middle(colors.shape[1] - 1, space, colors.dtype)
    share = colors[:, -1:] / peak(colors.dtype)
    seen = to_space(np.ascontiguousarray(colors[:, :-1]), space)
    return np.concatenate([(seen - center) * share, share * size], axis=1)


def from_places(places: Floats, space: SpaceName, dtype: np.dtype[np.generic], alpha: bool) -> Array:
    """Return the (N, C) colors of a type at places: the inverse of `to_places`. Transparent ones are all zeros."""
    if not alpha:
        return from_space(places, space, dtype)
    center, size = middle(places.shape[1] - 1, space, dtype)
    white = peak(dtype)
    share = np.clip(places[:, -1:] / size, 0, 1) * white
    if dtype.kind in "iu":
        share = np.rint(share)
    # With the rounded alpha here, the color makes up for the rounding.
    seen = np.divide(places[:, :-1] * white, share, out=np.zeros_like(places[:, :-1]), where=share > 0) + center
    colors = np.concatenate([from_space(seen, space, dtype), share.astype(dtype)], axis=1)
    colors[share[:, 0] == 0] = 0
    return colors


def middle(n_channels: int, space: SpaceName, dtype: np.dtype[np.generic]) -> tuple[Floats, float]:
    """Return the middle between black and white, and how far both are from it: the last coordinate of opaque colors."""
    ends = np.array([[0], [white_of(dtype)]], dtype).repeat(n_channels, axis=1)
    black, white = to_space(ends, space).astype(np.float64)
    return (black + white) / 2, float(np.linalg.norm(white - black) / 2)


def agree(samples: ColorSamples, colors: Array) -> tuple[ColorSamples, Array]:
    """Bring samples and given colors to the same channels: to grey if both are, to alpha if one of them has it."""
    # Colors of two and four channels have alpha, unless the samples have as many bands without.
    n_given, n_channels = colors.shape[1], samples.colors.shape[1]
    n_colors = n_channels - samples.alpha
    if n_given == n_channels:
        return samples, colors
    allowed = range(1, 5) if n_colors in (1, 3) else (n_channels,)
    check_channels("palette", n_given, allowed, f"for an image of {n_channels}")
    alpha = has_alpha(n_given)
    if alpha and not samples.alpha and (kinds_of(colors, alpha) == OPAQUE).all():
        colors, alpha = colors[:, :-1], False
    if n_colors < 3 <= n_given and (colors[:, :1] == colors[:, 1:3]).all():
        colors = colors[:, 2:]
    n_seen = max(n_colors, colors.shape[1] - alpha)
    return widen_samples(samples, n_seen, samples.alpha or alpha), widen(colors, alpha, n_seen, samples.alpha or alpha)


def with_alpha(colors: Array) -> Array:
    """Give colors an alpha channel, opaque."""
    return np.concatenate([colors, np.full_like(colors[:, :1], white_of(colors.dtype))], axis=1)


def widen(colors: Array, alpha: bool, n_seen: int, to_alpha: bool) -> Array:
    """Give colors this many channels, repeating grey, and an alpha channel, opaque if they had none."""
    if alpha:
        return np.concatenate([widen(colors[:, :-1], False, n_seen, False), colors[:, -1:]], axis=1)
    wide = np.repeat(colors, n_seen, axis=1) if colors.shape[1] == 1 else colors
    return with_alpha(wide) if to_alpha else wide


def widen_samples(samples: ColorSamples, n_seen: int, alpha: bool) -> ColorSamples:
    """Widen the colors of samples."""
    return replace(samples, rows=widen(samples.colors, samples.alpha, n_seen, alpha), alpha=alpha)


def without_idle_alpha(image: Array) -> Array:
    """Drop the alpha channel of an image that is opaque everywhere: three bytes per pixel are counted faster."""
    if (image[..., -1] != peak(image.dtype)).any():
        return image
    return np.ascontiguousarray(image[..., :-1])

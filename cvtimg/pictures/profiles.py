"""Convert images with embedded color profiles to sRGB."""

import io
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from PIL import Image, ImageCms

from cvtimg._shared.extras import optional
from cvtimg._shared.types import Array

T = TypeVar("T")
U = TypeVar("U")

# Relative colorimetric leaves colors within the sRGB gamut unchanged; the perceptual intent shifts all colors to make
# room for the few outside it. Black point compensation preserves shadow detail with print profiles.
_INTENT = ImageCms.Intent.RELATIVE_COLORIMETRIC
_FLAGS = ImageCms.Flags.BLACKPOINTCOMPENSATION

# Errors that littleCMS and Pillow raise for damaged profiles.
_UNREADABLE = (ImageCms.PyCMSError, OSError, ValueError, TypeError)


def apply_profile(image: Image.Image, icc: bytes, grey: bool) -> Image.Image:
    """Convert an L, RGB, RGBA or CMYK image to sRGB; `grey` if all its colors are gray.

    The image is returned unchanged if the profile is damaged or for another color space.
    """
    return _of_profile(icc, lambda profile: _convert(image, profile, grey), image)


def convert_deep(values: Array, icc: bytes) -> Array:
    """Convert uint16 (H, W, 3), or (H, W, 4) with alpha, to sRGB at full depth; otherwise like `apply_profile`."""
    if profile_space(icc) != "RGB" or not _of_profile(icc, _changes_rgb, False):
        return values
    imagecodecs = optional("imagecodecs", "codecs", "has a color profile at 16 bits, which needs")
    colors, how = np.ascontiguousarray(values[..., :3]), {"intent": int(_INTENT), "flags": int(_FLAGS)}
    colors = imagecodecs.cms_transform(colors, icc, _srgb_profile(), colorspace="rgb", outcolorspace="rgb", **how)
    return np.concatenate([colors, values[..., 3:]], axis=-1)


def kept_profile(icc: bytes, mode: str) -> bytes | None:
    """Return the profile of an image after reading: its own if it changed nothing, sRGB if colors were converted.

    None if the profile does not fit images of Pillow's `mode` and was therefore ignored.
    """
    space = profile_space(icc)
    if mode.startswith(("I", "F")):  # measurements, which are not converted
        return icc if space == "GRAY" else None
    grey = mode in ("1", "L", "LA")
    bands = "CMYK" if mode == "CMYK" else "RGB"
    if space != bands and not (grey and space == "GRAY"):
        return None
    changes = _of_profile(icc, _changes_rgb, None) if space == "RGB" else True
    return None if changes is None else _srgb_profile() if changes else icc


def profile_space(icc: bytes) -> str | None:
    """Return the color space of a profile, such as RGB or GRAY; None if it is damaged."""
    return _of_profile(icc, lambda profile: profile.profile.xcolor_space.strip(), None)


def _srgb_profile() -> bytes:
    """Build an sRGB profile without its creation date, so that files are reproducible."""
    content = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    content[24:36] = bytes(12)
    return bytes(content)


def profile_name(icc: bytes | None) -> str | None:
    """Return the description of a profile, or "unreadable" if it is damaged."""
    if not icc:
        return None
    return _of_profile(icc, lambda profile: ImageCms.getProfileDescription(profile).strip(), "unreadable")


def _of_profile(icc: bytes, find: Callable[[ImageCms.ImageCmsProfile], T], otherwise: U) -> T | U:
    """Return what a function finds in a profile, or `otherwise` if it is damaged."""
    try:
        return find(ImageCms.ImageCmsProfile(io.BytesIO(icc)))
    except _UNREADABLE:
        return otherwise


def _convert(image: Image.Image, profile: ImageCms.ImageCmsProfile, grey: bool) -> Image.Image:
    space = profile.profile.xcolor_space.strip()
    if grey and space in ("GRAY", "RGB"):
        ramp = Image.frombytes("L", (256, 1), bytes(range(256)))
        source = ramp if space == "GRAY" else ramp.convert("RGB")
        curve = _transform(profile, source.mode, "RGB").apply(source).getchannel("G")
        # One curve for all bands, so that gray stays gray.
        alpha = list(range(256)) if image.mode == "RGBA" else []
        levels = list(curve.tobytes())
        return image.point(levels * (len(image.getbands()) - bool(alpha)) + alpha)
    if space == image.mode.removesuffix("A"):
        transform = _transform(profile, image.mode, "RGBA" if image.mode == "RGBA" else "RGB")
        if image.mode == "CMYK" or _changes_colors(transform, image.mode):
            return transform.apply(image)
    return image


def _transform(profile: ImageCms.ImageCmsProfile, source: str, target: str) -> ImageCms.ImageCmsTransform:
    return ImageCms.buildTransform(profile, ImageCms.createProfile("sRGB"), source, target, _INTENT, _FLAGS)


def _changes_rgb(profile: ImageCms.ImageCmsProfile) -> bool:
    return _changes_colors(_transform(profile, "RGB", "RGB"), "RGB")


def _changes_colors(transform: ImageCms.ImageCmsTransform, mode: str) -> bool:
    """Return whether a transform does more than rounding; sRGB profiles have many names and versions."""
    grid = np.indices((6, 6, 6), np.uint8).reshape(3, 1, -1).transpose(1, 2, 0) * 51
    probe = Image.fromarray(grid).convert(mode)
    moved = np.asarray(transform.apply(probe)).astype(int) - np.asarray(probe)
    return bool(np.abs(moved).max() > 1)

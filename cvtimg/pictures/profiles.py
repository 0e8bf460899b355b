"""Embedded colour profiles: from what they describe to sRGB."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms

__all__ = ["apply_profile", "convert_deep", "kept_profile", "profile_name", "profile_space"]

# Relative colorimetric keeps each colour that sRGB can show as it is, where the perceptual
# intent shifts all of them to make room for the few that it cannot; black point compensation
# keeps the dark parts of print profiles apart.
_INTENT = ImageCms.Intent.RELATIVE_COLORIMETRIC
_FLAGS = ImageCms.Flags.BLACKPOINTCOMPENSATION

# What littleCMS and Pillow raise for a profile that is damaged.
UNREADABLE = (ImageCms.PyCMSError, OSError, ValueError, TypeError)


def apply_profile(image: Image.Image, icc: bytes, grey: bool) -> Image.Image:
    """Bring an L, RGB, RGBA or CMYK picture to sRGB; `grey` if all its colours are grey.

    A profile that is damaged or for another colour space says nothing about this picture, which
    comes back as it is: it is of use without.
    """
    try:
        return _convert(image, ImageCms.ImageCmsProfile(io.BytesIO(icc)), grey)
    except UNREADABLE:
        return image


def convert_deep(values: NDArray[Any], icc: bytes) -> NDArray[Any]:
    """Bring uint16 (H, W, 3) or (H, W, 4) with alpha to sRGB, at full depth; as `apply_profile` else."""
    try:
        profile = ImageCms.ImageCmsProfile(io.BytesIO(icc))
        if profile.profile.xcolor_space.strip() != "RGB":
            return values
        if not _changes_colors(_transform(profile, "RGB", "RGB"), "RGB"):
            return values
    except UNREADABLE:
        return values
    import imagecodecs

    colors = imagecodecs.cms_transform(
        np.ascontiguousarray(values[..., :3]),
        icc,
        _srgb_profile(),
        colorspace="rgb",
        outcolorspace="rgb",
        intent=int(_INTENT),
        flags=int(_FLAGS),
    )
    return np.concatenate([colors, values[..., 3:]], axis=-1)


def kept_profile(icc: bytes, mode: str) -> bytes | None:
    """Give the profile of a picture once it is read: its own if that changed nothing, sRGB if it was converted.

    None if it does not serve for pictures of Pillow's `mode`, so that it was ignored.
    """
    space = profile_space(icc)
    if mode.startswith(("I", "F")):  # measurements, which are not converted
        return icc if space == "GRAY" else None
    grey = mode in ("1", "L", "LA")
    bands = "CMYK" if mode == "CMYK" else "RGB"
    if space != bands and not (grey and space == "GRAY"):
        return None
    try:
        profile = ImageCms.ImageCmsProfile(io.BytesIO(icc))
        if space == "RGB" and not _changes_colors(_transform(profile, "RGB", "RGB"), "RGB"):
            return icc
    except UNREADABLE:
        return None
    return _srgb_profile()


def profile_space(icc: bytes) -> str | None:
    """Give the color space that a profile is for, such as RGB or GRAY; None for a damaged one."""
    try:
        return ImageCms.ImageCmsProfile(io.BytesIO(icc)).profile.xcolor_space.strip()
    except UNREADABLE:
        return None


def _srgb_profile() -> bytes:
    """Build the profile of sRGB, without the date of its making, so that a file is the same tomorrow."""
    content = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    content[24:36] = bytes(12)
    return bytes(content)


def profile_name(icc: bytes | None) -> str | None:
    """Give the description of a profile, "unreadable" for a damaged one."""
    if not icc:
        return None
    try:
        return ImageCms.getProfileDescription(ImageCms.ImageCmsProfile(io.BytesIO(icc))).strip()
    except UNREADABLE:
        return "unreadable"


def _convert(image: Image.Image, profile: ImageCms.ImageCmsProfile, grey: bool) -> Image.Image:
    space = profile.profile.xcolor_space.strip()
    if grey and space in ("GRAY", "RGB"):
        ramp = Image.frombytes("L", (256, 1), bytes(range(256)))
        source = ramp if space == "GRAY" else ramp.convert("RGB")
        curve = _transform(profile, source.mode, "RGB").apply(source).getchannel("G")
        # One curve for all bands, so that grey stays grey.
        alpha = list(range(256)) if image.mode == "RGBA" else []
        levels = list(curve.tobytes())
        return image.point(levels * (len(image.getbands()) - bool(alpha)) + alpha)
    if space == image.mode.removesuffix("A"):
        transform = _transform(profile, image.mode, "RGBA" if image.mode == "RGBA" else "RGB")
        if image.mode == "CMYK" or _changes_colors(transform, image.mode):
            return transform.apply(image)
    return image


def _transform(profile: ImageCms.ImageCmsProfile, source: str, target: str) -> ImageCms.ImageCmsTransform:
    return ImageCms.buildTransform(
        profile,
        ImageCms.createProfile("sRGB"),
        source,
        target,
        _INTENT,
        _FLAGS,
    )


def _changes_colors(transform: ImageCms.ImageCmsTransform, mode: str) -> bool:
    """Say whether a transform is more than rounding: sRGB comes under many names and versions."""
    grid = np.indices((6, 6, 6), np.uint8).reshape(3, 1, -1).transpose(1, 2, 0) * 51
    probe = Image.fromarray(grid).convert(mode)
    moved = np.asarray(transform.apply(probe)).astype(int) - np.asarray(probe)
    return bool(np.abs(moved).max() > 1)

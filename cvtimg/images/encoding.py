"""From arrays to the bytes of a picture file, by the suffix of its name."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

__all__ = ["encode_image", "encoder", "lossless_suffixes"]


class _Format(NamedTuple):
    name: str
    modes: tuple[str, ...]
    lossless: bool
    options: dict[str, Any]


# Deflate level 3 of Pillow 13 (zlib-ng), 12-megapixel photograph, one core of two:
#   256 colours: level 1 170 ms 4.7 MB, 3 190 ms 4.3 MB, 6 (Pillow's own choice) 490 ms 4.0 MB
#   16 colours:  level 1 125 ms 1.7 MB, 3 175 ms 1.6 MB, 6 460 ms 1.5 MB
#   24-bit RGB:  level 1 0.7 s 12.3 MB, 3 1.0 s 11.4 MB, 6 3.2 s 10.5 MB
# Run-length coding alone makes 16 colours smaller (1.4 MB, 100 ms), but doubles a page of text.
_PNG = _Format("PNG", ("1", "L", "P", "PA", "I;16", "RGB", "RGBA"), True, {"compress_level": 3})
_TIFF = _Format("TIFF", ("1", "L", "P", "I;16", "RGB", "RGBA"), True, {"compression": "tiff_adobe_deflate"})
# No chroma subsampling: overlays and flat segments have edges of pure colour.
_JPEG = _Format("JPEG", ("L", "RGB"), False, {"quality": 95, "subsampling": 0})
_FORMATS = {
    ".png": _PNG,
    ".tif": _TIFF,
    ".tiff": _TIFF,
    # exact: WebP otherwise rewrites the colours under full transparency.
    ".webp": _Format("WEBP", ("RGB", "RGBA"), True, {"lossless": True, "exact": True}),
    # optimize would renumber the palette.
    ".gif": _Format("GIF", ("1", "L", "P"), True, {"optimize": False}),
    ".bmp": _Format("BMP", ("1", "L", "P", "RGB"), True, {}),
    ".ppm": _Format("PPM", ("RGB",), True, {}),
    ".pgm": _Format("PPM", ("L", "I;16"), True, {}),
    ".jpg": _JPEG,
    ".jpeg": _JPEG,
}
_WIDER = {"1": "L", "L": "RGB"}
_CONTENT = {
    "1": "a 1-bit picture",
    "L": "a grey picture",
    "I;16": "a 16-bit grey picture",
    "RGB": "an RGB picture",
    "RGBA": "transparency",
}


def encode_image(suffix: str, image: NDArray[Any], *, palette: NDArray[np.uint8] | None = None) -> bytes:
    """Give what `write_image` would write into a file of this suffix.

    Parameters
    ----------
    suffix : str
        Such as ``".png"``, of those that `write_image` knows.
    image, palette
        As in `write_image`.

    Returns
    -------
    bytes

    Raises
    ------
    ValueError
        If the suffix is unknown, or the array or palette does not fit the format.

    Examples
    --------
    >>> from cvtimg.images.encoding import encode_image
    >>> encode_image(".png", np.zeros((2, 3), np.uint8))[1:4]
    b'PNG'
    """
    buffer = BytesIO()
    encoder(suffix, image, palette)(buffer)
    return buffer.getvalue()


def encoder(suffix: str, image: NDArray[Any], palette: NDArray[np.uint8] | None) -> Callable[[BinaryIO], None]:
    """Check that a picture fits a format, and give the function that writes it into a file."""
    suffix = suffix.lower()
    if suffix not in _FORMATS:
        raise ValueError(f"suffix {suffix!r} must be one of {', '.join(_FORMATS)}")
    form = _FORMATS[suffix]
    if palette is not None and not form.lossless:
        lossless = ", ".join(lossless_suffixes())
        raise ValueError(f"{suffix} would lose the colors of the palette; use one of {lossless}")
    picture = _direct(image) if palette is None else _indexed(image, palette, form)
    while picture.mode not in form.modes and picture.mode in _WIDER:
        picture = picture.convert(_WIDER[picture.mode])
    if picture.mode not in form.modes:
        able = ", ".join(name for name, one in _FORMATS.items() if picture.mode in one.modes)
        raise ValueError(f"{suffix} cannot hold {_CONTENT[picture.mode]}; use one of {able}")
    return lambda file: picture.save(file, form.name, **form.options)


def lossless_suffixes() -> list[str]:
    """List the suffixes of files that `write_image` writes without loss."""
    return [suffix for suffix, form in _FORMATS.items() if form.lossless]


def _direct(image: NDArray[Any]) -> Image.Image:
    image = np.asarray(image)
    grey = image.ndim == 2 and image.dtype in (bool, np.uint8, np.uint16)
    color = image.ndim == 3 and image.shape[2] in (3, 4) and image.dtype == np.uint8
    if not (grey or color) or image.size == 0:
        raise ValueError(
            f"image with shape={image.shape} and dtype={image.dtype} must be (H, W) bool, uint8 "
            "or uint16, or (H, W, 3) or (H, W, 4) uint8, and have pixels"
        )
    return Image.fromarray(np.ascontiguousarray(image))


def _indexed(indices: NDArray[Any], palette: NDArray[np.uint8], form: _Format) -> Image.Image:
    indices, palette = np.asarray(indices), np.asarray(palette)
    _check_indexed(indices, palette)
    alpha = palette[:, 3] if palette.shape[1] == 4 else np.full(len(palette), 255, np.uint8)
    clear = np.flatnonzero(alpha < 255)
    # GIF has one index that is transparent, and no half transparency.
    gif_clear = form.name == "GIF" and len(clear) == 1 and alpha[clear[0]] == 0
    if "P" not in form.modes or (len(clear) and "PA" not in form.modes and not gif_clear):
        return Image.fromarray(palette[:, : 4 if len(clear) else 3][indices])
    picture = Image.fromarray(np.ascontiguousarray(indices, np.uint8))
    picture.putpalette(palette[:, :3].tobytes())
    if len(clear):
        picture.info["transparency"] = int(clear[0]) if gif_clear else alpha.tobytes()
    return picture


def _check_indexed(indices: NDArray[Any], palette: NDArray[Any]) -> None:
    shape = palette.shape
    if palette.dtype != np.uint8 or palette.ndim != 2 or shape[1] not in (3, 4):
        raise ValueError(f"palette with shape={shape} and dtype={palette.dtype} must be (K, 3) or (K, 4) uint8")
    if not 1 <= len(palette) <= 256:
        raise ValueError(f"palette with {len(palette)} colors must have 1..256")
    if indices.ndim != 2 or indices.dtype.kind not in "iu" or indices.size == 0:
        raise ValueError(
            f"image with shape={indices.shape} and dtype={indices.dtype} must be (H, W) integer "
            "indices into the palette, and have pixels"
        )
    low, high = indices.min(), indices.max()
    if low < 0 or high >= len(palette):
        raise ValueError(f"indices {low}..{high} must be in 0..{len(palette) - 1}, the palette")

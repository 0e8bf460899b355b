"""Pictures and files on disk: the only part of cvtimg that reads or writes pictures.

A picture comes in as an upright sRGB array and goes out whole or not at all. Every file that
cannot be read or written ends in an `OSError` that says ``"{path}: {reason}"`` in one line.
"""

from __future__ import annotations

import errno
import logging
import re
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFile, UnidentifiedImageError

from cvtimg.files import NOT_RASTER, StrPath, find_images, one_line, whole_file
from cvtimg.profiles import apply_profile, profile_name

__all__ = ["ImageInfo", "find_images", "image_info", "lossless_suffixes", "read_image", "whole_file", "write_image"]

# Pillow logs some of what it also raises; without a handler that goes to stderr a second time.
logging.getLogger("PIL").addHandler(logging.NullHandler())

_UPRIGHT = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}


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


class _Quiet:
    """Hold Pillow's warnings back while at least one picture is open.

    Two `warnings.catch_warnings` that overlap in two threads restore each other's filters and can
    leave a filter behind for good. Here the first to enter sets it and the last to leave takes it
    away, without making the decoders wait for one another. Only warnings raised inside PIL are
    held back, so that another thread's own warnings still show.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._depth = 0
        self._saved = warnings.catch_warnings()

    def __enter__(self) -> None:
        with self._lock:
            if self._depth == 0:
                self._saved = warnings.catch_warnings()
                self._saved.__enter__()
                warnings.filterwarnings("ignore", module=r"PIL\.")
            self._depth += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth == 0:
                self._saved.__exit__(None, None, None)


_QUIET = _Quiet()


@dataclass(frozen=True, slots=True)
class ImageInfo:
    """What the header of a picture says.

    Attributes
    ----------
    width, height : int
        Size in pixels of the upright picture, as `read_image` returns it.
    format, mode : str
        Pillow's names, such as ``"PNG"`` and ``"RGB"``.
    bands : tuple of str
        Names of the bands, such as ``("R", "G", "B")``.
    bits : int
        Bits a band (an index in a palette picture) in the file.
    frames : int
        How many frames or pages; `read_image` reads the first.
    has_alpha : bool
        Whether the picture carries transparency of any kind.
    icc : str or None
        Description of the embedded colour profile, ``"unreadable"`` for a damaged one.
    """

    width: int
    height: int
    format: str
    mode: str
    bands: tuple[str, ...]
    bits: int
    frames: int
    has_alpha: bool
    icc: str | None


def read_image(path: StrPath) -> NDArray[Any]:
    """Read a picture as an upright sRGB array.

    Parameters
    ----------
    path : str or path-like
        Any raster picture that Pillow reads. Of several frames the first is taken.

    Returns
    -------
    ndarray, (H, W) or (H, W, C), C-contiguous
        uint8 (H, W) for 1-bit and grey; uint8 (H, W, 3) for RGB, palette, CMYK, YCbCr and LAB;
        uint8 (H, W, 4) for whatever has transparency; uint16 (H, W) for 16-bit grey;
        float32 (H, W) for floating point and for 32-bit integers outside 0..65535.

    Raises
    ------
    OSError
        If the file cannot be read; `FileNotFoundError`, `IsADirectoryError` and
        `PermissionError` where they apply.

    Notes
    -----
    Pillow gives 16-bit RGB as 8-bit RGB. Grey beyond 8 bits is taken for a measurement: its
    values stay as they are, without colour profile or transparency.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.zeros((2, 3, 3), np.uint8))
    ...     read_image(f"{folder}/a.png").shape
    (2, 3, 3)
    """
    with _opened(path) as image:
        depth = _depth(image)  # asked first: load() forgets how the file is coded
        image.load()
        _scale_transparent_color(image, depth)
        turn = _UPRIGHT.get(_orientation(image))
        upright = image if turn is None else image.transpose(turn)
        if image.mode == "F":
            return np.array(upright, np.float32)
        if image.mode.startswith("I"):
            return _deep_grey(np.asarray(upright))
        return np.array(_srgb(upright))


def image_info(path: StrPath) -> ImageInfo:
    """Read what the header of a picture says, and no pixels.

    Parameters
    ----------
    path : str or path-like
        Any raster picture that Pillow reads.

    Returns
    -------
    ImageInfo

    Raises
    ------
    OSError
        As `read_image` does, as far as the header tells.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.zeros((2, 3), np.uint16))
    ...     info = image_info(f"{folder}/a.png")
    >>> info.width, info.height, info.bits
    (3, 2, 16)
    """
    with _opened(path) as image:
        width, height = image.size
        # Pillow states the size of a TIFF upright already. A PNG's EXIF behind the pixels would
        # cost a decoding.
        known = image.format != "PNG" or "exif" in image.info
        if image.format != "TIFF" and known and _orientation(image) >= 5:
            width, height = height, width
        return ImageInfo(
            width=width,
            height=height,
            format=image.format or "",
            mode=image.mode,
            bands=image.getbands(),
            bits=_depth(image),
            frames=getattr(image, "n_frames", 1),
            has_alpha=image.has_transparency_data,
            icc=profile_name(image.info.get("icc_profile")),
        )


def write_image(
    path: StrPath,
    image: NDArray[Any],
    *,
    palette: NDArray[np.uint8] | None = None,
    overwrite: bool = False,
) -> None:
    """Write a picture whole or not at all, in the format that the suffix names.

    Parameters
    ----------
    path : str or path-like
        Ends in .png, .tif, .tiff, .webp (lossless), .gif, .bmp, .ppm, .pgm, .jpg or .jpeg.
    image : ndarray
        (H, W) bool, uint8 or uint16, or (H, W, 3) or (H, W, 4) uint8, in sRGB. With a palette
        (H, W) integers in 0..K-1.
    palette : ndarray, (K, 3) or (K, 4) uint8, 1 <= K <= 256, optional
        Writes an indexed picture, a PNG of the smallest of 1, 2, 4 and 8 bits that holds K
        colours. A format without palette or without its transparency gets the same colours as
        RGB or RGBA. No format that loses colours is taken.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    ValueError
        If the suffix is unknown, or the array or palette does not fit the format.
    FileExistsError
        If the file exists and `overwrite` is false.
    OSError
        If the file cannot be written. Nothing is left behind, an old file stays as it was.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     red_blue = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)
    ...     write_image(f"{folder}/a.png", np.array([[0, 1, 1]]), palette=red_blue)
    ...     image_info(f"{folder}/a.png").bits
    1
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _FORMATS:
        raise ValueError(f"{path}: suffix {suffix!r} must be one of {', '.join(_FORMATS)}")
    form = _FORMATS[suffix]
    if palette is not None and not form.lossless:
        lossless = ", ".join(lossless_suffixes())
        raise ValueError(f"{path}: {suffix} would lose the colors of the palette; use one of {lossless}")
    picture = _direct(image) if palette is None else _indexed(image, palette, form)
    while picture.mode not in form.modes and picture.mode in _WIDER:
        picture = picture.convert(_WIDER[picture.mode])
    if picture.mode not in form.modes:
        able = ", ".join(name for name, one in _FORMATS.items() if picture.mode in one.modes)
        raise ValueError(f"{path}: {suffix} cannot hold {_CONTENT[picture.mode]}; use one of {able}")
    with whole_file(path, overwrite=overwrite) as file:
        try:
            picture.save(file, form.name, **form.options)
        except Exception as error:  # encoders raise ValueError, OSError, SystemError and others
            raise OSError(f"{path}: cannot be written ({one_line(error)})") from error


def lossless_suffixes() -> list[str]:
    """List the suffixes of files that `write_image` writes without loss."""
    return [suffix for suffix, form in _FORMATS.items() if form.lossless]


@contextmanager
def _opened(path: StrPath) -> Iterator[ImageFile.ImageFile]:
    """Open a picture; whatever fails in the block is the file's fault and says so."""
    try:
        if Path(path).is_dir():  # Windows would say "permission denied"
            raise IsADirectoryError(errno.EISDIR, "is a directory, not a picture")
        with _QUIET, Path(path).open("rb") as file, Image.open(file) as image:
            if image.format in NOT_RASTER:
                raise UnidentifiedImageError
            yield image
    # On damaged files Pillow raises nearly every class there is: SyntaxError, struct.error,
    # EOFError, zlib.error, DecompressionBombError, MemoryError, IndexError, ...
    except Exception as error:
        known = isinstance(error, OSError) and error.errno is not None
        raise (type(error) if known else OSError)(f"{path}: {_why_unread(path, error)}") from error


def _why_unread(path: StrPath, error: Exception) -> str:
    if isinstance(error, FileNotFoundError):
        return "no such file"
    if isinstance(error, UnidentifiedImageError):
        empty = Path(path).stat().st_size == 0
        return "is empty" if empty else "is not a picture that Pillow can read"
    if isinstance(error, OSError) and error.errno is not None:
        return one_line(error)
    if isinstance(error, Image.DecompressionBombError):
        return f"has over {2 * (Image.MAX_IMAGE_PIXELS or 0)} pixels, Pillow's limit for safety"
    if isinstance(error, MemoryError):
        return "needs more memory than there is"
    return f"is truncated or damaged ({one_line(error)})"


def _depth(image: ImageFile.ImageFile) -> int:
    """Bits a band in the file, which Pillow may have widened or cut to 8."""
    if image.format == "PNG":
        coded = re.search(r";(\d+)", str(image.tile[0].args))
        if coded:
            return int(coded[1])
    if image.format == "TIFF":
        return int(getattr(image, "tag_v2", {}).get(258, (1,))[0])
    return {"1": 1, "I": 32, "F": 32}.get(image.mode, 16 if image.mode.startswith("I;16") else 8)


def _orientation(image: Image.Image) -> int:
    try:
        return int(image.getexif().get(0x0112, 1))
    except Exception:  # damaged metadata, of which Pillow makes any error, spoils no pixel
        return 1


def _scale_transparent_color(image: Image.Image, depth: int) -> None:
    """Bring a PNG's transparent colour to 8 bits: Pillow does so for the pixels alone."""
    color = image.info.get("transparency")
    if image.format != "PNG" or color is None:
        return
    if image.mode == "L" and depth in (2, 4):
        image.info["transparency"] = color * 255 // (2**depth - 1)
    elif image.mode == "RGB" and depth == 16:
        image.info["transparency"] = tuple(value >> 8 for value in color)


def _deep_grey(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.itemsize == 2 or (values.min() >= 0 and values.max() <= 65535):
        return values.astype(np.uint16)
    return values.astype(np.float32)


def _srgb(image: Image.Image) -> Image.Image:
    """Bring an 8-bit picture of any mode to L, RGB or RGBA in sRGB."""
    icc = image.info.get("icc_profile")
    grey = image.mode in ("1", "L", "LA")
    opaque = "L" if grey else "CMYK" if image.mode == "CMYK" else "RGB"
    mode = "RGBA" if image.has_transparency_data else opaque
    plain = image if image.mode == mode else image.convert(mode)
    if icc:
        plain = apply_profile(plain, icc, grey)
    # Pillow has undone the inversion of Adobe's CMYK JPEG when it decoded.
    return plain.convert("RGB") if plain.mode == "CMYK" else plain


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

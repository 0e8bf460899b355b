"""Encode arrays as image files, in the format given by a suffix."""

from collections.abc import Callable
from importlib.util import find_spec
from io import BytesIO
from typing import BinaryIO, NamedTuple

import numpy as np
from PIL import Image

from cvtimg._shared.checks import check_choice, check_that, check_within
from cvtimg._shared.choices import Arguments
from cvtimg._shared.extras import optional
from cvtimg._shared.pixels import says_alpha
from cvtimg._shared.records import PROVING, prove
from cvtimg._shared.types import Array, Bytes
from cvtimg.pictures.formats.geotiff import extra_tags
from cvtimg.pictures.formats.metadata import Metadata
from cvtimg.pictures.formats.png import deep_png, indexed, small_png
from cvtimg.pictures.formats.tiff import write_tiff

# Modes that Pillow lacks: 16-bit color, and any other arrays.
_DEEP = ("RGB;16", "RGBA;16")
_OTHER = "other"
_ALL = ("icc_profile", "dpi", "exif")
_EIGHT_BITS = ("1", "L", "RGB", "RGBA")
_PLAIN = (*_EIGHT_BITS, "I;16", *_DEEP)


class _Picture(NamedTuple):
    """Samples (H, W) or (H, W, C) with their mode, or (H, W) indices into (K, 3) or (K, 4) colors."""

    mode: str
    values: Array
    alpha: bool = False  # whether the last band is transparency
    colors: Bytes | None = None


class _Format(NamedTuple):
    name: str
    modes: tuple[str, ...]
    lossless: bool
    options: Arguments
    keeps: tuple[str, ...] = ()  # fields of Metadata, under Pillow's names


# Deflate level 3 of Pillow 13 (zlib-ng), 12-megapixel photograph in 24-bit RGB, one core of two: level 1 0.7 s 12.3 MB,
# 3 1.0 s 11.4 MB, 6 (Pillow's own choice) 3.2 s 10.5 MB.
_PNG = _Format("PNG", ("P", *_PLAIN), True, {"compress_level": 3}, _ALL)
_TIFF = _Format("TIFF", ("P", *_PLAIN, _OTHER), True, {"compression": "tiff_adobe_deflate"}, _ALL)
# No chroma subsampling: overlays and flat segments have edges of pure color.
_JPEG = _Format("JPEG", ("L", "RGB"), False, {"quality": 95, "subsampling": 0}, _ALL)
# AVIF is slightly lossy at any quality.
_AVIF = _Format("AVIF", ("RGB", "RGBA"), False, {"quality": 90, "subsampling": "4:4:4"}, ("icc_profile", "exif"))
_FORMATS = {
    ".png": _PNG,
    ".tif": _TIFF,
    ".tiff": _TIFF,
    # exact: otherwise WebP changes the colors of fully transparent pixels.
    ".webp": _Format("WEBP", ("RGB", "RGBA"), True, {"lossless": True, "exact": True}, ("icc_profile", "exif")),
    # optimize would renumber the palette; interlaced files are a tenth larger.
    ".gif": _Format("GIF", ("1", "L", "P"), True, {"optimize": False, "interlace": False}),
    ".bmp": _Format("BMP", ("1", "L", "P", "RGB"), True, {}, ("dpi",)),
    ".ppm": _Format("PPM", ("RGB",), True, {}),
    ".pgm": _Format("PPM", ("L", "I;16"), True, {}),
    ".jpg": _JPEG,
    ".jpeg": _JPEG,
    ".npy": _Format("NPY", (*_PLAIN, _OTHER), True, {}),
    **({".avif": _AVIF} if find_spec("PIL._avif") else {}),
}
#: Suffixes of formats that hold samples of any type.
SUFFIXES_OF_ANY_TYPE = tuple(suffix for suffix, form in _FORMATS.items() if _OTHER in form.modes)
_WIDER = {"1": "L", "L": "RGB"}
_CONTENT = {
    "1": "1-bit images",
    "L": "gray images",
    "I;16": "16-bit gray images",
    "RGB": "RGB images",
    "RGBA": "transparency",
    "RGB;16": "16-bit RGB images",
    "RGBA;16": "16-bit RGBA images",
    _OTHER: "floating point samples, integers other than uint8 and uint16, or bands that are not colors",
}


def encode_image(
    suffix: str,
    image: Array,
    *,
    palette: Bytes | None = None,
    alpha: bool | None = None,
    metadata: Metadata | None = None,
    optimize: bool = False,
    smallest: bool = False,
) -> bytes:
    """Encode an image as the bytes of the file with a suffix, such as ``".png"``, that `write_image` would write.

    Examples
    --------
    >>> from cvtimg.pictures import encode_image
    >>> encode_image(".png", np.zeros((2, 3), np.uint8))[1:4]
    b'PNG'
    """
    buffer = BytesIO()
    encoder(suffix, image, palette, alpha, metadata, optimize, smallest)(buffer)
    return buffer.getvalue()


def encoder(
    suffix: str,
    image: Array,
    palette: Bytes | None,
    alpha: bool | None,
    metadata: Metadata | None,
    optimize: bool,
    smallest: bool,
) -> Callable[[BinaryIO], None]:
    """Check that an image fits a format, and return the function that writes it to a file."""
    form = _FORMATS[check_choice("suffix", suffix := suffix.lower(), _FORMATS)]
    if palette is not None and not form.lossless:
        lossless = ", ".join(lossless_suffixes())
        raise ValueError(f"{suffix} would lose the colors of the palette; use one of {lossless}")
    if palette is None:
        n_bands = np.shape(image)[2] if np.ndim(image) > 2 else 1
        by_default = says_alpha(image) or (n_bands == 4 and _OTHER not in form.modes)
        picture = _direct(image, n_bands > 1 and (by_default if alpha is None else alpha))
    else:
        picture = _indexed(image, palette, form)
    mode = picture.mode
    while mode not in form.modes and mode in _WIDER:
        mode = _WIDER[mode]
    picture = picture._replace(mode=mode)
    if mode not in form.modes:
        able = ", ".join(name for name, it in _FORMATS.items() if mode in it.modes and it.lossless >= form.lossless)
        raise ValueError(f"{suffix} cannot hold {_CONTENT[mode]}; use one of {able}")
    if optimize and form.name != "PNG":
        raise ValueError(f"optimize is only for .png, not for {suffix}")

    def write(file: BinaryIO) -> None:
        buffer = BytesIO()
        _write(buffer if optimize else file, picture, form, metadata or Metadata(), smallest)
        if optimize:
            oxipng = optional("oxipng", "oxipng", "optimize needs")
            file.write(oxipng.optimize_from_memory(buffer.getvalue(), level=4))  # the lowest that sorts the palette
        if PROVING and form.lossless and form.name != "NPY" and mode in (*_EIGHT_BITS, "P"):
            prove(form.name, iter([("what is read is what was written", _reads_back(file, picture))]))

    return write


def image_suffixes() -> list[str]:
    """List the suffixes of formats that `write_image` writes; .avif if Pillow supports it."""
    return list(_FORMATS)


def lossless_suffixes() -> list[str]:
    """List the suffixes of formats that `write_image` writes losslessly."""
    return [suffix for suffix, form in _FORMATS.items() if form.lossless]


def _write(file: BinaryIO, picture: _Picture, form: _Format, metadata: Metadata, smallest: bool) -> None:
    mode, values, alpha, colors = picture
    kept = metadata.options(form.name, mode, form.keeps)
    if form.name == "NPY":
        np.save(file, values, allow_pickle=False)
    elif form.name == "PNG" and colors is not None:
        images = [indexed(values, colors)]
        if smallest:  # as gradients and gray photographs are, whose neighbors differ little
            is_gray = "icc_profile" not in kept and bool((colors[:, :1] == colors[:, 1:3]).all())
            bands = ([0] if is_gray else [0, 1, 2]) + [3] * int((colors[:, 3:] < 255).any())
            images.append(Image.fromarray(colors[:, bands[0] if bands == [0] else bands][values]))
        file.write(small_png(images, **kept))
    elif form.name == "PNG" and smallest and mode in ("L", "RGB", "RGBA"):
        file.write(small_png([Image.fromarray(values)], **kept))
    elif form.name == "PNG" and mode in _DEEP:
        file.write(deep_png(values, **kept))
    elif mode in (*_DEEP, _OTHER):
        given = metadata.options("", mode, ("icc_profile", "dpi"))
        # The predictor (differences of neighbors) makes all of these types smaller; that of floats needs an extra.
        predicted = values.dtype.kind != "f" or find_spec("imagecodecs") is not None
        told: Arguments = {"resolution": given.get("dpi"), "resolutionunit": "inch" if "dpi" in given else None}
        told |= {"iccprofile": given.get("icc_profile"), "extratags": extra_tags(metadata.geo, metadata.nodata)}
        predicted = predicted and values.dtype.itemsize < 8
        write_tiff(file, values, values.shape, values.dtype, alpha=alpha, predictor=predicted, **told)
    else:
        _by_pillow(picture).save(file, form.name, **form.options, **kept)


def _reads_back(file: BinaryIO, picture: _Picture) -> bool:
    """Whether a file has the pixels of a picture; colors of clear ones do not count."""
    written = picture.values if picture.colors is None else picture.colors[picture.values]
    file.seek(0)
    with Image.open(file) as image:
        after, before = (np.asarray(either.convert("RGBA")) for either in (image, Image.fromarray(written)))
    is_clear = (after[..., 3] == 0) & (before[..., 3] == 0)
    return bool(((after == before).all(axis=2) | is_clear).all())


def _by_pillow(picture: _Picture) -> Image.Image:
    if picture.colors is None:
        image = Image.fromarray(picture.values)
        return image if image.mode == picture.mode else image.convert(picture.mode)
    image = Image.fromarray(np.ascontiguousarray(picture.values, np.uint8))
    image.putpalette(picture.colors[:, :3].tobytes())
    if picture.colors.shape[1] == 4:
        image.info["transparency"] = int(picture.colors[:, 3].argmin())
    return image


def _direct(image: Array, alpha: bool) -> _Picture:
    image = np.asarray(image)
    numbers = image.dtype.kind in "iuf" and image.dtype.itemsize <= 8 and image.dtype != np.float16
    fits = image.ndim in (2, 3) and (numbers or (image.dtype == bool and image.ndim == 2)) and image.size > 0
    allowed = "be (H, W) or (H, W, C) integers, float32 or float64, or (H, W) bool, and have pixels"
    check_that(f"image of shape {image.shape} and type {image.dtype}", fits, allowed)
    values = np.ascontiguousarray(image[..., 0] if image.ndim == 3 and image.shape[2] == 1 else image)
    kinds = {np.bool_: {1: "1"}, np.uint8: {1: "L", 3: "RGB", 4: "RGBA"}}
    kinds[np.uint16] = {1: "I;16", 3: "RGB;16", 4: "RGBA;16"}
    n_bands = values.shape[2] if values.ndim == 3 else 1
    mode = kinds.get(values.dtype.type, {}).get(n_bands, _OTHER) if alpha == (n_bands == 4) else _OTHER
    return _Picture(mode, values, alpha)


def _indexed(indices: Array, palette: Bytes, form: _Format) -> _Picture:
    indices, palette = np.asarray(indices), np.asarray(palette)
    check_indexed(indices, palette)
    alpha = np.sort(palette[:, 3]) if palette.shape[1] == 4 else np.array([255])
    colors = np.ascontiguousarray(palette[:, : 4 if alpha[0] < 255 else 3])
    # GIF supports one transparent index, and no partial transparency.
    gif_clear = form.name == "GIF" and alpha[0] == 0 and (alpha[1:] == 255).all()
    if "P" not in form.modes or not (alpha[0] == 255 or gif_clear or form.name == "PNG"):
        return _direct(colors[indices], alpha[0] < 255)
    return _Picture("P", indices, colors=colors)


def check_indexed(indices: Array, palette: Array) -> None:
    """Check that a palette fits a file, and that all indices are in its range."""
    fits = palette.dtype == np.uint8 and palette.ndim == 2 and palette.shape[1] in (3, 4)
    given = f"palette of shape {palette.shape} and type {palette.dtype}"
    check_that(given, fits and 1 <= len(palette) <= 256, "be (K, 3) or (K, 4) uint8, K in 1..256")
    fits = indices.ndim == 2 and indices.dtype.kind in "iu" and indices.size > 0
    given = f"image of shape {indices.shape} and type {indices.dtype}"
    check_that(given, fits, "be (H, W) integer indices into the palette, and have pixels")
    check_within("indices", indices, 0, len(palette) - 1, ", the palette")


def as_stored(image: Array, suffix: str) -> tuple[Array, list[str]]:
    """Return an image in the type in which a format holds its samples, and a note where that is another.

    Integers keep their values: those of types that only .tif and .npy hold become uint16 for other formats.
    """
    odd = image.dtype.kind in "iu" and image.dtype not in (np.uint8, np.uint16)
    if not odd or suffix.lower() in SUFFIXES_OF_ANY_TYPE:
        return image, []
    low, high = int(image.min()), int(image.max())
    if low < 0 or high > 65535:
        able = " or ".join(SUFFIXES_OF_ANY_TYPE)
        raise ValueError(f"has {image.dtype} samples in {low}..{high}, which {suffix} cannot hold; write {able}")
    note = f"{image.dtype} samples are written as uint16 with the same values, as {suffix} cannot hold their type"
    return image.astype(np.uint16), [note]

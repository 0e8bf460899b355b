"""TIFF beyond what Pillow reads: more than 8 bits in color, many bands, floating point, and where on Earth it lies."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cvtimg._shared.threads import n_threads
from cvtimg.pictures.formats.arrays import as_samples, upright
from cvtimg.pictures.formats.opening import UnfitContentError, check_size

if TYPE_CHECKING:
    import tifffile

__all__ = [
    "GEO_TYPES",
    "TIFF_MAGICS",
    "Layout",
    "Place",
    "decode_tiff",
    "encode_tiff",
    "first_page",
    "geo_tags",
    "icc_profile",
    "is_turned",
    "tiff_tags",
]

#: Little and big endian, TIFF and BigTIFF.
TIFF_MAGICS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")

_BITS, _PHOTOMETRIC, _ORIENTATION, _N_SAMPLES = 258, 262, 274, 277
_EXTRA_SAMPLES, _SAMPLE_FORMAT, _ICC = 338, 339, 34675
_PIXEL_SCALE, _TIEPOINT, _MATRIX, _GEO_KEYS, _NODATA = 33550, 33922, 34264, 34735, 42113
_OF_SAMPLES = (_BITS, _PHOTOMETRIC, _ORIENTATION, _N_SAMPLES, _EXTRA_SAMPLES, _SAMPLE_FORMAT, _ICC)
#: Tags that say where a picture lies, with the types of their values in TIFF and in Python's struct.
GEO_TYPES = {
    _PIXEL_SCALE: (12, "d"),
    _TIEPOINT: (12, "d"),
    _MATRIX: (12, "d"),
    _GEO_KEYS: (3, "H"),
    34736: (12, "d"),
    34737: (2, "s"),
}
_RASTER_TYPE, _GEOGRAPHIC, _PROJECTED = 1025, 2048, 3072
_PIXEL_IS_POINT = 2
_USER_DEFINED = 32767
_GREYS, _RGB = (0, 1), 2
_PREMULTIPLIED = 1

Tags = Mapping[int, Any]


@dataclass(frozen=True, slots=True)
class Layout:
    """What the samples of a pixel mean.

    Attributes
    ----------
    n_samples, bits : int
        Samples a pixel, and bits of the largest.
    n_colors : int
        How many of the samples are color: 1 or 3.
    alpha : bool
        Whether one sample follows that is transparency.
    premultiplied : bool
        Whether the colors are multiplied by it.
    for_pillow : bool
        Whether Pillow gives such pixels without loss.
    """

    n_samples: int
    bits: int
    n_colors: int
    alpha: bool
    premultiplied: bool
    for_pillow: bool

    @classmethod
    def of(cls, tags: Tags) -> Layout:
        """Tell from the tags of a page."""
        photometric = tags.get(_PHOTOMETRIC)
        n_samples, bits = int(_first(tags.get(_N_SAMPLES, 1))), max(_numbers(tags.get(_BITS, 1)))
        extra = _numbers(tags.get(_EXTRA_SAMPLES, ()))
        n_colors = 3 if photometric == _RGB else 1
        # Some programs leave out what the fourth sample of RGB means; 999 is what CorelDRAW says.
        meaning = extra or ((2,) if photometric == _RGB else ())
        alpha = n_samples == n_colors + 1 and meaning in ((1,), (2,), (999,))
        bands = n_samples > n_colors + alpha
        deep = bits > 16 or (bits > 8 and n_samples > 1) or _first(tags.get(_SAMPLE_FORMAT, 1)) > 3
        for_pillow = photometric not in (*_GREYS, _RGB) or not (bands or deep)
        return cls(n_samples, bits, n_colors, alpha, alpha and meaning == (_PREMULTIPLIED,), for_pillow)


@dataclass(frozen=True, slots=True)
class Place:
    """Where on Earth a picture lies, as GeoTIFF says; None for what the file does not say.

    Attributes
    ----------
    geo_transform : tuple of float (a, b, c, d, e, f) or None
        From a place in the picture to one on the map: ``x = a * column + b * row + c``, ``y = d * column + e * row
        + f``, where (0, 0) is the upper left corner of the first pixel, and (0.5, 0.5) its center.
    epsg : int or None
        Number of the coordinate system in the EPSG register.
    nodata : float or None
        Value of pixels that are not known.
    """

    geo_transform: tuple[float, float, float, float, float, float] | None
    epsg: int | None
    nodata: float | None

    @classmethod
    def of(cls, tags: Tags) -> Place:
        """Tell from the tags of a page; what is damaged is not said."""
        keys: dict[int, int] = {}
        transform = epsg = nodata = None
        with suppress(TypeError, ValueError, IndexError):
            flat = [int(value) for value in tags.get(_GEO_KEYS, ())]
            keys = {flat[at]: flat[at + 3] for at in range(4, len(flat) - 3, 4) if flat[at + 1] == 0}
        code = keys.get(_PROJECTED, keys.get(_GEOGRAPHIC, _USER_DEFINED))
        epsg = code if 0 < code < _USER_DEFINED else None
        with suppress(TypeError, ValueError, IndexError):
            # Nobody turns maps; where one does, the upright picture lies elsewhere than the file says.
            if tags.get(_ORIENTATION, 1) == 1:
                transform = _transform(tags, point=keys.get(_RASTER_TYPE) == _PIXEL_IS_POINT)
        with suppress(TypeError, ValueError):
            nodata = float(str(tags[_NODATA]).strip("\0 ")) if _NODATA in tags else None
        return cls(transform, epsg, nodata)


def decode_tiff(file: BinaryIO) -> NDArray[Any]:
    """Read the first page: (H, W) for one sample a pixel, else (H, W, C), or with transparency (H, W, 4)."""
    import tifffile

    file.seek(0)
    with tifffile.TiffFile(file) as tiff:
        page, tags = first_page(tiff), tiff_tags(tiff)
        values = as_samples(_channels_last(page.asarray(maxworkers=n_threads()), page.axes))
    layout = Layout.of(tags)
    if values.ndim == 3 and layout.bits < 16 and layout.n_colors == 3 and values.dtype == np.uint16:
        values = np.rint(values * (65535 / (2**layout.bits - 1))).astype(np.uint16)
    if layout.premultiplied:
        values = _divide_by_alpha(values)
    if layout.alpha and values.shape[2] == 2:
        values = values[..., [0, 0, 0, 1]]
    icc = icc_profile(tags)
    if icc and values.dtype == np.uint16 and values.ndim == 3 and values.shape[2] == 3 + layout.alpha:
        from cvtimg.pictures.profiles import convert_deep

        values = convert_deep(values, icc)
    return upright(values, _first(tags.get(_ORIENTATION, 1)))


def first_page(tiff: tifffile.TiffFile) -> tifffile.TiffPage:
    """Give the first page, if it is a picture."""
    page: tifffile.TiffPage = tiff.pages.first
    if not {*page.axes} <= {*"YXS"} or page.size == 0 or page.dtype is None:
        raise UnfitContentError(f"holds an array of shape {page.shape}, and a picture is (H, W) or (H, W, C)")
    check_size(page.imagelength * page.imagewidth)
    return page


def tiff_tags(tiff: tifffile.TiffFile) -> dict[int, Any]:
    """Give the tags of the first page that are of use here."""
    tags = tiff.pages.first.tags
    return {code: tag.value for code in (*_OF_SAMPLES, *GEO_TYPES, _NODATA) if (tag := tags.get(code)) is not None}


def icc_profile(tags: Tags) -> bytes | None:
    """Give the embedded colour profile, if there is one."""
    return bytes(tags[_ICC]) if _ICC in tags else None


def tags_of(image: Image.Image) -> Tags:
    """Give the tags of the first page of a TIFF, none of another file."""
    tags: Tags = getattr(image, "tag_v2", {})
    return tags


def geo_tags(tags: Tags) -> dict[int, Any]:
    """Give the tags that say where an upright picture lies, if all is there to say it."""
    if Place.of(tags).geo_transform is None:
        return {}
    given = {code: tags[code] for code in GEO_TYPES if code in tags}
    # A value of its own is one of a row, but for text.
    return {code: value if isinstance(value, (tuple, str)) else (value,) for code, value in given.items()}


def is_turned(tags: Tags) -> bool:
    """Whether width and height change places in the upright picture."""
    return _first(tags.get(_ORIENTATION, 1)) in (5, 6, 7, 8)


def encode_tiff(
    file: BinaryIO,
    values: NDArray[Any],
    icc_profile: bytes | None = None,
    dpi: tuple[float, float] | None = None,
    geo: Tags | None = None,
) -> None:
    """Write an array (H, W) or (H, W, C): three bands are RGB, four RGB and alpha, others have no meaning."""
    import tifffile

    n_bands = values.shape[2] if values.ndim == 3 else 1
    color = n_bands in (3, 4)
    # Differences of neighbours make all that is written here smaller, but for what has not two of a kind.
    tifffile.imwrite(
        file,
        values,
        photometric="rgb" if color else "minisblack",
        planarconfig="contig" if n_bands > 1 else None,
        extrasamples=["unassalpha"] if n_bands == 4 else None if color else ["unspecified"] * (n_bands - 1),
        compression="adobe_deflate",
        predictor=values.dtype.itemsize < 8,
        iccprofile=icc_profile,
        resolution=dpi,
        resolutionunit="inch" if dpi else None,
        extratags=[_extra_tag(code, value) for code, value in (geo or {}).items()],
        metadata=None,
        software=False,
        maxworkers=n_threads(),
    )


def _extra_tag(code: int, value: Any) -> tuple[int, str, int, Any, bool]:
    """Word a tag as tifffile takes it."""
    kind = GEO_TYPES[code][1]
    return code, kind, 0 if kind == "s" else len(value), value, True


def _channels_last(values: NDArray[Any], axes: str) -> NDArray[Any]:
    values = np.moveaxis(values, axes.index("S"), -1) if "S" in axes else values
    return values[..., 0] if values.ndim == 3 and values.shape[2] == 1 else values


def _divide_by_alpha(values: NDArray[Any]) -> NDArray[Any]:
    alpha = values[..., -1:].astype(np.float64)
    top = np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1.0
    colors = np.divide(values[..., :-1] * np.float64(top), alpha, out=np.zeros(values[..., :-1].shape), where=alpha > 0)
    if values.dtype.kind == "u":
        colors = np.rint(np.minimum(colors, top))
    return np.concatenate([colors.astype(values.dtype), values[..., -1:]], axis=-1)


def _transform(tags: Tags, *, point: bool) -> tuple[float, float, float, float, float, float] | None:
    if _MATRIX in tags:
        matrix = [float(value) for value in tags[_MATRIX]]
        a, b, c, d, e, f = (matrix[at] for at in (0, 1, 3, 4, 5, 7))
    elif _PIXEL_SCALE in tags and _TIEPOINT in tags:
        column, row, _, x, y, _ = (float(value) for value in tags[_TIEPOINT][:6])
        a, b, d = float(tags[_PIXEL_SCALE][0]), 0.0, 0.0
        e = -float(tags[_PIXEL_SCALE][1])
        c, f = x - a * column, y - e * row
    else:
        return None
    half = 0.5 if point else 0.0  # the file places the center of a pixel
    return a, b, c - half * (a + b), d, e, f - half * (d + e)


def _numbers(value: Any) -> tuple[int, ...]:
    return tuple(int(one) for one in value) if isinstance(value, tuple) else (int(value),)


def _first(value: Any) -> int:
    return _numbers(value)[0]

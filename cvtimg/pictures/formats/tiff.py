"""TIFF images that Pillow does not read: color with more than 8 bits, many bands, floating point."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from contextlib import suppress
from enum import IntEnum
from itertools import islice
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np
from PIL import Image
from PIL.ExifTags import Base

from cvtimg._shared.choices import Arguments
from cvtimg._shared.pixels import peak, with_mark
from cvtimg._shared.threads import n_threads
from cvtimg._shared.types import Array, Bytes
from cvtimg.pictures.formats.arrays import as_samples, upright
from cvtimg.pictures.formats.geotiff import GeoTag, Tags
from cvtimg.pictures.formats.opening import UnfitContentError, check_size, selected
from cvtimg.pictures.formats.stored import Arrangement
from cvtimg.pictures.profiles import convert_deep

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

    import tifffile
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

#: First bytes of TIFF and BigTIFF files, little and big endian.
TIFF_MAGICS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")

_OF_SAMPLES = (
    *(Base.BitsPerSample, Base.PhotometricInterpretation, Base.Orientation, Base.SamplesPerPixel),
    *(Base.ExtraSamples, Base.SampleFormat, Base.InterColorProfile, Base.Compression, Base.ImageDescription),
)
#: Compression that Pillow's library for TIFF lacks, and tags of MetaMorph, whose stacks have one directory.
_WEBP, _OF_METAMORPH = 50001, {33628, 33629, 33630, 33631}


class _Value(IntEnum):
    """Values of tags, by what they are of."""

    PHOTOMETRIC_WHITE_IS_0, PHOTOMETRIC_BLACK_IS_0, PHOTOMETRIC_RGB, PHOTOMETRIC_PALETTE = 0, 1, 2, 3
    FORMAT_UNSIGNED = 1
    EXTRA_PREMULTIPLIED, EXTRA_ALPHA, EXTRA_OF_CORELDRAW = 1, 2, 999
    SUBFILE_REDUCED, SUBFILE_MASK = 1, 4


_SUBORDINATE = _Value.SUBFILE_REDUCED | _Value.SUBFILE_MASK
#: Metadata kept from ImageJ files, and attributes kept from the Pixels element of OME.
OF_IMAGEJ = ("spacing", "unit", "xunit", "yunit", "zunit", "finterval", "fps", "xorigin", "yorigin", "zorigin")
_OF_OME = ("PhysicalSizeX", "PhysicalSizeY", "PhysicalSizeZ", "TimeIncrement")
#: Values of ExtraSamples for transparency.
_ALPHA = ((_Value.EXTRA_PREMULTIPLIED,), (_Value.EXTRA_ALPHA,), (_Value.EXTRA_OF_CORELDRAW,))


class Layout(NamedTuple):
    """Meaning of the samples of a pixel."""

    # Samples per pixel, and bits of the largest sample.
    n_samples: int
    bits: int
    n_colors: int  # Number of color samples: 1 or 3
    alpha: bool  # Whether the next sample is transparency
    premultiplied: bool  # Whether the colors are premultiplied by alpha
    for_pillow: bool  # Whether Pillow reads such pixels without loss

    @classmethod
    def of(cls, tags: Tags) -> Layout:
        """Derive the layout from the tags of a page."""
        photometric = tags.get(Base.PhotometricInterpretation)
        n_samples, bits = int(_first(tags.get(Base.SamplesPerPixel, 1))), max(_numbers(tags.get(Base.BitsPerSample, 1)))
        extra = _numbers(tags.get(Base.ExtraSamples, ()))
        n_colors = 3 if photometric == _Value.PHOTOMETRIC_RGB else 1
        # An unspecified fourth sample is a band, such as near infrared.
        alpha = n_samples == n_colors + 1 and extra in _ALPHA
        bands = n_samples > n_colors + alpha
        unsigned = _first(tags.get(Base.SampleFormat, 1)) == _Value.FORMAT_UNSIGNED
        deep = bits > 16 or (bits > 8 and n_samples > 1) or not unsigned
        for_pillow = photometric not in (0, 1, _Value.PHOTOMETRIC_RGB) or not (bands or deep)
        for_pillow &= not holds_values(tags) and tags.get(Base.Compression) != _WEBP
        return cls(n_samples, bits, n_colors, alpha, alpha and extra == _ALPHA[0], for_pillow)


def decode_tiff(file: BinaryIO, *, keep_profile: bool = False, number: int = 0) -> Array:
    """Read a page, from 0: (H, W) for one sample per pixel, else (H, W, C)."""
    import tifffile

    file.seek(0)
    with tifffile.TiffFile(file) as tiff:
        page = first_page(tiff) if number == 0 else tiff.pages[number].aspage()
        tags = tiff_tags(page)
        values = page.asarray(maxworkers=n_threads())
        values = np.moveaxis(values, page.axes.index("S"), -1) if "S" in page.axes else values
    values = values[..., 0] if values.shape[2:] == (1,) else values
    values = upright(finished(values, tags, keep_profile=keep_profile), _first(tags.get(Base.Orientation, 1)))
    return with_mark(values, Layout.of(tags).alpha and values.shape[2:] == (4,))


def is_plain(tags: Tags) -> bool:
    """Whether samples are gray from black or RGB, of at least 8 bits, and upright."""
    upright = _first(tags.get(Base.Orientation, 1)) == 1
    plain = tags.get(Base.PhotometricInterpretation) in (_Value.PHOTOMETRIC_BLACK_IS_0, _Value.PHOTOMETRIC_RGB)
    return (plain or holds_values(tags)) and Layout.of(tags).bits >= 8 and upright


def holds_values(tags: Tags) -> bool:
    """Whether a palette only shows values, as the color tables of ImageJ and OME do."""
    return tags.get(Base.PhotometricInterpretation) == _Value.PHOTOMETRIC_PALETTE and describes_pages(tags)


def finished(values: Array, tags: Tags, *, keep_profile: bool = False) -> Array:
    """Bring samples to the full range of their type, to straight alpha and, with 16 bits, to sRGB."""
    values = as_samples(values)
    layout = Layout.of(tags)
    if values.ndim == 3 and layout.bits < 16 and layout.n_colors == 3 and values.dtype == np.uint16:
        values = np.rint(values * (65535 / (2**layout.bits - 1))).astype(np.uint16)
    if layout.premultiplied:
        values = _divide_by_alpha(values)
    if layout.alpha and values.shape[2] == 2:
        values = values[..., [0, 0, 0, 1]]
    icc = None if keep_profile else icc_profile(tags)
    if icc and values.dtype == np.uint16 and values.ndim == 3 and values.shape[2] == 3 + layout.alpha:
        values = convert_deep(values, icc)
    return values


def first_page(tiff: tifffile.TiffFile) -> tifffile.TiffPage:
    """Return the first page, of the series that is chosen if so, if it is an image."""
    page: tifffile.TiffPage = main_series(tiff)[0].keyframe if selected().series else tiff.pages.first
    height, width = size_of(page)
    if not {*page.axes} <= {*"YXS"} or page.size == 0 or page.dtype is None:
        raise UnfitContentError(f"holds an array of shape {page.shape}; an image must be (H, W) or (H, W, C)")
    check_size(height * width)
    return page


def size_of(page: tifffile.TiffPage) -> tuple[int, int]:
    """Return the height and width of a page, which damaged tags may give as bytes or as several numbers."""
    sides: tuple[Any, Any] = (page.imagelength, page.imagewidth)
    if not all(isinstance(side, int) for side in sides):
        raise UnfitContentError("is damaged: its width or its height is not one number")
    return sides


def count_pages(file: BinaryIO) -> int:
    """Count the pages of a file: 1 for formats other than TIFF; the complete pages of a truncated TIFF."""
    file.seek(0)
    start = file.read(1 << 12)  # in which the description of an ImageJ file begins
    size = 1
    if start.startswith(TIFF_MAGICS):
        size = max(size, len(main_pages(file)))
        # ImageJ, for large stacks, and MetaMorph store only the first page as a TIFF page.
        if selected().series or b"ImageJ=" in start or (size == 1 and _OF_METAMORPH.intersection(*_directories(file))):
            import tifffile

            file.seek(0)
            with suppress(Exception), tifffile.TiffFile(file) as tiff:  # errors are reported when the file is read
                n_pages = sum(part.size // part.keyframe.size for part in main_series(tiff))
                size = n_pages if selected().series else max(size, n_pages)
    file.seek(0)
    return size


def main_series(tiff: tifffile.TiffFile) -> list[tifffile.TiffPageSeries]:
    """List the series of a file, excluding reduced-size copies and masks; only the one that is chosen, if so."""
    kinds = [part.keyframe.aspage().tags.valueof(Base.NewSubfileType, 0) for part in tiff.series]
    series = [part for part, kind in zip(tiff.series, kinds, strict=True) if not kind & _SUBORDINATE]
    if not (number := selected().series):
        return series
    if number > len(series):
        raise UnfitContentError(f"has {len(series)} series, and no series {number}")
    return series[number - 1 : number]


def check_alone(file: BinaryIO) -> None:
    """Reject multi-page files where one image is expected, rather than silently ignoring pages."""
    if (n_pages := count_pages(file)) > 1:
        raise UnfitContentError(f"has {n_pages} pages, where one image is expected")


def main_pages(file: BinaryIO) -> list[int]:
    """List the numbers of the pages of a TIFF, excluding reduced-size copies and masks."""
    kinds = [directory.get(Base.NewSubfileType) for directory in _directories(file)]
    return [number for number, kind in enumerate(kinds) if not (isinstance(kind, int) and kind & _SUBORDINATE)]


def _directories(file: BinaryIO) -> list[ImageFileDirectory_v2]:
    """List the directories of the pages of a TIFF, as far as they are complete.

    `UnfitContentError` says that their chain is circular, of which tifffile makes many pages.
    """
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    file.seek(0)
    header = file.read(16)
    header = header[: 16 if header[:4] in TIFF_MAGICS[2:] else 8]
    pages: dict[int, ImageFileDirectory_v2] = {}
    with suppress(struct.error, OverflowError, OSError):  # cut off
        at = ImageFileDirectory_v2(header).next
        while at and at not in pages:
            file.seek(at)
            page = ImageFileDirectory_v2(header)
            page.next = -1
            page.load(file)
            if page.next == -1:  # cut off
                break
            pages[at], at = page, page.next
        if at in pages and len(pages) > 1:  # a single page may point to itself
            raise UnfitContentError("its chain of pages is circular")
    return [*pages.values()]


def stack_of(tiff: tifffile.TiffFile, n_pages: int) -> Arrangement:
    """Return how the pages of a file are arranged, and what its channels are called; of one page, as of Q."""
    series = main_series(tiff)
    axes = series[0].axes.replace("S", "").removesuffix("YX")
    if len(series) > 1:
        return Arrangement("Q", (n_pages,))
    lengths = dict(zip(series[0].axes, series[0].shape, strict=True))
    shape = tuple(lengths[axis] for axis in axes)
    names: tuple[str, ...] = ()
    if tiff.is_ome:
        elements = [*_ome_elements(tiff.ome_metadata or "", "Channel")]
        is_named = any(element.get("Name") for element in elements)
        names = tuple(str(element.get("Name") or element.get("ID", "")) for element in elements) if is_named else ()
    elif "C" in axes and len(labels := (tiff.imagej_metadata or {}).get("Labels", ())) == math.prod(shape):
        firsts = np.moveaxis(np.arange(len(labels)).reshape(shape), axes.index("C"), -1)
        names = tuple(str(labels[number]) for number in firsts.reshape(-1, firsts.shape[-1])[0].tolist())
    n_channels = lengths.get("C", 1) * lengths.get("S", 1)
    return Arrangement(axes or "Q", shape or (n_pages,), names if len(set(names)) == n_channels else ())


def _ome_elements(description: str, name: str) -> Iterator[Element]:
    """Yield the elements of a name in the image that is chosen of those that an OME file describes, or the first."""
    from xml.etree import ElementTree

    with suppress(ElementTree.ParseError, ValueError):
        root = ElementTree.fromstring(description)
        images = [element for element in root.iter() if element.tag.rpartition("}")[2] == "Pixels"]
        pixels = next(islice(images, (selected().series or 1) - 1, None), root)
        yield from (element for element in pixels.iter() if element.tag.rpartition("}")[2] == name)


def tiff_tags(page: tifffile.TiffPage) -> dict[int, Any]:
    """Return the tags of a page that cvtimg uses."""
    return {code: tag.value for code in (*_OF_SAMPLES, *GeoTag) if (tag := page.tags.get(code)) is not None}


def icc_profile(tags: Tags) -> bytes | None:
    """Return the embedded color profile, if any."""
    return bytes(tags[Base.InterColorProfile]) if Base.InterColorProfile in tags else None


def tags_of(image: Image.Image) -> Tags:
    """Return the tags of the first page of a TIFF; empty for other formats."""
    return getattr(image, "tag_v2", {})


def describes_pages(tags: Tags) -> bool:
    """Return whether ImageJ or OME describe the pages of a file, their axes and the size of their pixels."""
    return str(tags.get(Base.ImageDescription, "")).lstrip().startswith(("ImageJ=", "<?xml", "<OME"))


def is_turned(tags: Tags) -> bool:
    """Return whether width and height are swapped in the upright image."""
    return _first(tags.get(Base.Orientation, 1)) in (5, 6, 7, 8)


def write_tiff(
    file: BinaryIO,
    values: Any,
    shape: tuple[int, ...],
    dtype: np.dtype[np.generic],
    *,
    alpha: bool,
    before: tuple[int, ...] = (),
    palette: Bytes | None = None,
    **options: Any,
) -> None:
    """Write what tifffile takes for images (H, W) or (H, W, C), a stack of them if there are axes `before`.

    One band is gray and three are RGB; with `alpha`, the next is transparency. All others are unspecified. With a
    palette (K, 3) or (K, 4), whose alpha is left out, the images are indices.
    """
    import tifffile

    n_bands = shape[2] if len(shape) == 3 else 1
    n_colors = 3 if n_bands - alpha == 3 else 1
    colormap = None
    if palette is not None:
        colormap = np.zeros((3, 256), np.uint16)
        colormap[:, : len(palette)] = palette[:, :3].T.astype(np.uint16) * 257
    tifffile.imwrite(
        file,
        values,
        shape=(*before, *shape),
        dtype=dtype,
        photometric="palette" if palette is not None else "rgb" if n_colors == 3 else "minisblack",
        planarconfig="contig" if n_bands > 1 else None,
        extrasamples=["unassalpha"] * alpha + ["unspecified"] * (n_bands - n_colors - alpha) or None,
        colormap=colormap,
        software=False,
        maxworkers=n_threads(),
        **{
            "compression": "adobe_deflate",
            "metadata": None,
            "bigtiff": math.prod((*before, *shape)) * dtype.itemsize > 1 << 31,  # before compression
            **options,
        },
    )


def scale_of(tiff: tifffile.TiffFile) -> Arguments:
    """Collect the physical sizes that the file states."""
    tags = tiff.pages.first.aspage().tags
    scale: Arguments = {}
    across, down = tags.valueof(Base.XResolution), tags.valueof(Base.YResolution)
    if across and down and across[1] and down[1]:
        scale["resolution"] = (across[0] / across[1], down[0] / down[1])
        scale["resolutionunit"] = int(tags.valueof(Base.ResolutionUnit, 1))
    if tiff.is_imagej:
        given = tiff.imagej_metadata or {}
        scale |= {name: given[name] for name in OF_IMAGEJ if name in given}
    elif tiff.is_ome:
        for element in islice(_ome_elements(tiff.ome_metadata or "", "Pixels"), 1):
            for name in _OF_OME:
                with suppress(KeyError, ValueError):
                    scale[name] = float(element.attrib[name])
                if f"{name}Unit" in element.attrib:
                    scale[f"{name}Unit"] = element.attrib[f"{name}Unit"]
    return scale


def _divide_by_alpha(values: Array) -> Array:
    alpha = values[..., -1:].astype(np.float64)
    white = np.float64(peak(values.dtype))
    colors = np.divide(values[..., :-1] * white, alpha, out=np.zeros(values[..., :-1].shape), where=alpha > 0)
    if values.dtype.kind in "iu":
        colors = np.rint(np.minimum(colors, white))
    return np.concatenate([colors.astype(values.dtype), values[..., -1:]], axis=-1)


def _numbers(value: Any) -> tuple[int, ...]:
    return tuple(int(number) for number in value) if isinstance(value, tuple) else (int(value),)


def _first(value: object) -> int:
    return _numbers(value)[0]

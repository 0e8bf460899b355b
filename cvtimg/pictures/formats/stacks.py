"""Multi-page TIFF, with the axes and physical sizes of ImageJ and OME files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cvtimg._shared.threads import n_threads
from cvtimg.pictures.formats.decoding import decode, decode_opened, to_srgb
from cvtimg.pictures.formats.fits import FITS_MAGIC, decode_planes
from cvtimg.pictures.formats.opening import UnfitContentError, check_size, open_picture
from cvtimg.pictures.formats.tiff import (
    Layout,
    count_pages,
    finished,
    icc_profile,
    is_plain,
    is_subordinate,
    main_pages,
    sample_options,
    tiff_tags,
)

if TYPE_CHECKING:
    import tifffile

__all__ = ["Stack", "decode_page", "decode_stack", "encode_stack"]

_X_RESOLUTION, _Y_RESOLUTION, _RESOLUTION_UNIT = 282, 283, 296
#: Metadata kept from ImageJ files, and attributes kept from the Pixels element of OME.
_OF_IMAGEJ = ("spacing", "unit", "xunit", "yunit", "zunit", "finterval", "fps", "xorigin", "yorigin", "zorigin")
_OF_OME = ("PhysicalSizeX", "PhysicalSizeY", "PhysicalSizeZ", "TimeIncrement")
#: Sample types that ImageJ supports, by the number of channels.
_IMAGEJ_TYPES = {1: (np.uint8, np.uint16, np.float32), 3: (np.uint8,)}
_ORDER_OF_IMAGEJ = "TZC"


class Stack(NamedTuple):
    """Pages in file order; the fields are those of `cvtimg.pictures.Pages`."""

    images: Sequence[NDArray[Any]]
    axes: str
    shape: tuple[int, ...]
    kind: str
    scale: Mapping[str, Any]
    has_alpha: bool


def decode_stack(file: BinaryIO) -> Stack:
    """Read all pages; files of other formats are read as one page."""
    file.seek(0)
    if file.read(len(FITS_MAGIC)) == FITS_MAGIC:
        planes = decode_planes(file)
        return Stack(list(planes), "Q", (len(planes),), "", {}, False)
    size = count_pages(file)
    if size == 1:
        file.seek(0)
        return Stack([decode(file)], "Q", (1,), "", {}, False)
    import tifffile

    with tifffile.TiffFile(file) as tiff:
        tags = tiff_tags(tiff)
        layout = Layout.of(tags)
        kind = "imagej" if tiff.is_imagej else "ome" if tiff.is_ome else ""
        scale = _scale(tiff)
        numbers = main_pages(file)
        check_size(size * tiff.pages.first.imagelength * tiff.pages.first.imagewidth)
        known = tiff.pages.first.compression in tifffile.TIFF.DECOMPRESSORS
        if not is_plain(tags) or (layout.for_pillow and not known):
            axes, shape, images = "Q", (size,), None
        else:
            axes, values = _series(tiff)
            shape = values.shape[: len(axes)]
            flat = values.reshape(-1, *values.shape[len(axes) :])
            icc = icc_profile(tags)
            images = [_in_srgb(finished(page, tags), icc) for page in flat]
    if images is None:
        images = _by_pillow(file, numbers)
    if len({(image.shape, image.dtype) for image in images}) > 1:
        raise UnfitContentError("has pages of different sizes or types")
    return Stack(images, axes, shape, kind, scale, layout.alpha and images[0].ndim == 3)


def decode_page(file: BinaryIO, page: int) -> NDArray[Any]:
    """Decode one page, from 1, of a file that may have several."""
    images = decode_stack(file).images
    if page > len(images):
        raise UnfitContentError(f"has {len(images)} page{'s' * (len(images) > 1)}, and no page {page}")
    return np.ascontiguousarray(images[page - 1])


def _series(tiff: tifffile.TiffFile) -> tuple[str, NDArray[Any]]:
    """Return the axes of the pages, and all pages as one array (..., H, W) or (..., H, W, C)."""
    series = [one for one in tiff.series if not is_subordinate(one.keyframe)]
    arrays = []
    for one in series:
        values, axes = one.asarray(maxworkers=n_threads()), one.axes
        if "S" in axes:
            values, axes = np.moveaxis(values, axes.index("S"), -1), axes.replace("S", "") + "S"
        if not axes.removesuffix("S").endswith("YX"):
            raise UnfitContentError(f"has the axes {axes}, which do not end in YX")
        arrays.append((axes.removesuffix("S").removesuffix("YX"), values))
    if len(arrays) == 1 and arrays[0][0]:
        return arrays[0]
    sides = [len(axes) for axes, _ in arrays]
    flat = [values.reshape(-1, *values.shape[n:]) for n, (_, values) in zip(sides, arrays, strict=True)]
    if len({(one.shape[1:], one.dtype) for one in flat}) > 1:
        raise UnfitContentError("has pages of different sizes or types")
    return "Q", np.concatenate(flat)


def _in_srgb(values: NDArray[Any], icc: bytes | None) -> NDArray[Any]:
    """Convert 8-bit gray and color with a profile to sRGB; deeper samples are converted elsewhere."""
    if not icc or values.dtype != np.uint8 or values.shape[2:] not in ((), (3,), (4,)):
        return values
    image = Image.fromarray(values)
    image.info["icc_profile"] = icc
    return np.array(to_srgb(image))


def _by_pillow(file: BinaryIO, numbers: Sequence[int]) -> list[NDArray[Any]]:
    """Read pages whose samples need conversion: palettes, CMYK, fewer than 8 bits."""
    file.seek(0)
    images = []
    with open_picture(file) as image:
        for number in numbers:
            image.seek(number)
            images.append(decode_opened(image))
    return images


def _scale(tiff: tifffile.TiffFile) -> dict[str, Any]:
    """Collect the physical sizes that the file states."""
    tags = tiff.pages.first.aspage().tags
    scale: dict[str, Any] = {}
    across, down = tags.valueof(_X_RESOLUTION), tags.valueof(_Y_RESOLUTION)
    if across and down and across[1] and down[1]:
        scale["resolution"] = (across[0] / across[1], down[0] / down[1])
        scale["resolutionunit"] = int(tags.valueof(_RESOLUTION_UNIT, 1))
    if tiff.is_imagej:
        given = tiff.imagej_metadata or {}
        scale |= {name: given[name] for name in _OF_IMAGEJ if name in given}
    elif tiff.is_ome:
        scale |= _ome_scale(tiff.ome_metadata or "")
    return scale


def _ome_scale(description: str) -> dict[str, Any]:
    from xml.etree import ElementTree

    scale: dict[str, Any] = {}
    with suppress(ElementTree.ParseError, ValueError):
        for element in ElementTree.fromstring(description).iter():
            if element.tag.rpartition("}")[2] != "Pixels":
                continue
            for name in _OF_OME:
                if name in element.attrib:
                    scale[name] = float(element.attrib[name])
                if f"{name}Unit" in element.attrib:
                    scale[f"{name}Unit"] = element.attrib[f"{name}Unit"]
            break
    return scale


def encode_stack(file: BinaryIO, stack: Stack, palette: NDArray[np.uint8] | None) -> None:
    """Write pages, following the conventions of ImageJ or OME if `stack.kind` says so."""
    import tifffile

    kind, images = stack.kind, stack.images
    if palette is not None and kind:
        images, palette = [palette[image] for image in images], None
    first = images[0]
    n_channels = first.shape[2] if first.ndim == 3 else 1
    if kind == "imagej" and first.dtype.type not in _IMAGEJ_TYPES.get(n_channels, ()):
        kind = ""
    axes, shape, order = stack.axes, stack.shape, np.arange(len(images))
    if kind == "imagej":
        axes, shape, order = _imagej_order(axes, shape)
    scale = dict(stack.scale)
    resolution, unit = scale.pop("resolution", None), scale.pop("resolutionunit", None)
    values = np.stack([images[number] for number in order.tolist()]).reshape(*shape, *first.shape)
    described = {"axes": axes + "YX" + "S" * (first.ndim == 3), **(scale if kind else {})}
    samples = sample_options(first.shape, stack.has_alpha and n_channels in (2, 4))
    colormap = None
    if palette is not None:
        colormap = np.zeros((3, 256), np.uint16)
        colormap[:, : len(palette)] = palette[:, :3].T.astype(np.uint16) * 257
        values, samples["photometric"] = values.astype(np.uint8), "palette"
    tifffile.imwrite(
        file,
        values,
        imagej=kind == "imagej",
        ome=kind == "ome",
        bigtiff=values.nbytes > 1 << 31 and kind != "imagej",
        **samples,
        colormap=colormap,
        compression=None if kind == "imagej" else "adobe_deflate",
        resolution=resolution,
        resolutionunit=unit,
        metadata=described,
        software=False,
        maxworkers=n_threads(),
    )


def _imagej_order(axes: str, shape: tuple[int, ...]) -> tuple[str, tuple[int, ...], NDArray[np.int64]]:
    """Reorder pages to ImageJ's order of axes; axes unknown to ImageJ count as depth."""
    known = "".join(axis if axis in _ORDER_OF_IMAGEJ else "Z" for axis in axes)
    if len(set(known)) < len(known):
        return "Z", (math.prod(shape),), np.arange(math.prod(shape))
    order = sorted(range(len(known)), key=lambda at: _ORDER_OF_IMAGEJ.index(known[at]))
    numbers = np.arange(math.prod(shape)).reshape(shape).transpose(order)
    return "".join(known[at] for at in order), numbers.shape, numbers.ravel()

"""Read and write multi-page TIFF files, as those of ImageJ, OME and scanners, with their axes and physical sizes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from cvtimg._shared.checks import check_choice, check_that
from cvtimg._shared.choices import Arguments, Options
from cvtimg._shared.pixels import says_alpha, with_mark
from cvtimg._shared.threads import n_threads
from cvtimg._shared.types import Array, Bytes, Ints64
from cvtimg.files.whole import StrPath
from cvtimg.pictures.formats.decoding import decode, decode_opened, to_srgb
from cvtimg.pictures.formats.encoding import check_indexed
from cvtimg.pictures.formats.opening import (
    Source,
    UnfitContentError,
    check_size,
    named,
    open_picture,
    reading,
    selected,
    selecting,
    writing,
)
from cvtimg.pictures.formats.pixel_size import PixelSize
from cvtimg.pictures.formats.stored import Arrangement, StoredStack, is_stored, npy_stack, open_stored
from cvtimg.pictures.formats.tiff import (
    TIFF_MAGICS,
    Layout,
    count_pages,
    decode_tiff,
    finished,
    first_page,
    icc_profile,
    is_plain,
    main_pages,
    main_series,
    scale_of,
    stack_of,
    tiff_tags,
    write_tiff,
)
from cvtimg.pictures.frames import decode_frames
from cvtimg.pictures.showing import composed, usual_tints

if TYPE_CHECKING:
    import tifffile

#: Suffixes of files that can hold several pages.
PAGE_SUFFIXES = (".tif", ".tiff")
#: Sample types that ImageJ supports, by the number of channels.
_IMAGEJ_TYPES = {1: (np.uint8, np.uint16, np.float32), 3: (np.uint8,)}
_ORDEROF_IMAGEJ = "TZC"
#: Pixels for each byte of a file: pages that claim more may together not exceed the limit for an image.
_PIXELS_PER_BYTE = 8


@dataclass(frozen=True, slots=True, eq=False)
class Pages:
    """The pages of a file, and how they are arranged.

    Attributes
    ----------
    images : tuple of (H, W) or (H, W, C) arrays
        Pages of the same shape and type, in file order: the last of `axes` varies fastest.
    axes : str
        One letter for each axis of the stack: Z for depth, T for time, C for channels, other letters (such as Q) for
        unknown axes.
    shape : tuple of int
        Number of pages along each axis.
    kind : {"", "imagej", "ome"}
        Convention that the file follows; "" for a plain TIFF.
    scale : mapping of str
        Physical sizes under the names that tifffile uses, such as ``{"spacing": 0.5, "unit": "um"}`` or
        ``{"PhysicalSizeX": 0.1}``; "resolution" and "resolutionunit" are the TIFF tags.
    has_alpha : bool
        Whether the last channel is transparency.
    channels : tuple of str
        Names of the channels along the axis C, or of the bands of each page, where the file names them.
    is_joined : bool
        Whether the bands of each page are channels that `joined` made of pages; they are written as pages again.
    """

    images: tuple[Array, ...]
    axes: str = "Q"
    shape: tuple[int, ...] = ()
    kind: str = ""
    scale: Options = field(default_factory=dict)
    has_alpha: bool = False
    channels: tuple[str, ...] = ()
    is_joined: bool = False

    def __post_init__(self) -> None:
        check_that("images", len(self.images) > 0, "contain at least one page")
        forms = {(image.shape, image.dtype) for image in self.images}
        shapes = sorted(shape for shape, _ in forms)
        check_that(f"images of shapes {shapes}", len(forms) == 1, "have one shape and type")
        if not self.shape:
            object.__setattr__(self, "shape", (len(self.images),))
        fits = len(self.shape) == len(self.axes) and math.prod(self.shape) == len(self.images)
        check_that(f"axes={self.axes!r} of shape {self.shape}", fits, f"hold {len(self.images)} images")
        for image in self.images:
            image.flags.writeable = False

    @property
    def pixel_size(self) -> PixelSize | None:
        """Physical size of a pixel, if it is known."""
        return PixelSize.of(self.scale)

    @property
    def places(self) -> list[dict[str, int]]:
        """Where each page is, from 1: by "t", "z" and so on, or by "page" along an axis that is not known."""
        names = ["page" if axis == "Q" else axis.lower() for axis in self.axes]
        return [dict(zip(names, (at + 1 for at in place), strict=True)) for place in np.ndindex(*self.shape)]

    def joined(self) -> Pages:
        """Return pages of all channels: the axis C becomes the last axis of each page."""
        if "C" not in self.axes or self.images[0].ndim == 3:
            return self
        pages, groups = self.grouped("C")
        images = tuple(np.ascontiguousarray(np.stack(group, axis=-1)) for group in groups)
        return replace(pages, images=images, is_joined=True)

    def composite(self, tints: Sequence[str] = ()) -> Pages:
        """Return pages on which all channels are one image (H, W, 3), each in a color; see `read_pages`."""
        pages = self.joined()
        shape = pages.images[0].shape
        n_channels = shape[2] if len(shape) == 3 else 1
        if len(tints := tints or usual_tints(n_channels)) != n_channels:
            raise UnfitContentError(f"has {n_channels} channels, and there are {len(tints)} colors for them")
        images = tuple(composed(image.reshape(*shape[:2], n_channels), tints) for image in pages.images)
        return replace(pages, images=images, has_alpha=False, channels=(), is_joined=False)

    def parted(self) -> Pages:
        """Return pages of a channel each, where they were joined: C becomes the last axis of the stack."""
        if not self.is_joined or self.images[0].ndim == 2:
            return self
        images = tuple(np.ascontiguousarray(page[:, :, band]) for page in self.images for band in range(page.shape[2]))
        axes, shape = ("", ()) if len(self.images) == 1 else (self.axes, self.shape)
        shape = (*shape, len(images) // len(self.images))
        return replace(self, images=images, axes=f"{axes}C", shape=shape, is_joined=False)

    def grouped(self, along: str) -> tuple[Pages, list[tuple[Array, ...]]]:
        """Return a stack without some axes, of the first pages along these, and all of them for each of its pages."""
        inner = [at for at, axis in enumerate(self.axes) if axis in along]
        outer = [at for at in range(len(self.axes)) if at not in inner]
        shape = tuple(self.shape[at] for at in outer)
        numbers = np.arange(len(self.images)).reshape(self.shape).transpose(outer + inner)
        groups = [tuple(self.images[at] for at in group) for group in numbers.reshape(math.prod(shape), -1).tolist()]
        axes = "".join(self.axes[at] for at in outer)
        firsts = tuple(group[0] for group in groups)
        return replace(self, images=firsts, axes=axes or "Q", shape=shape or (1,)), groups

    def __repr__(self) -> str:
        first = self.images[0]
        return f"<Pages {self.axes} {self.shape} of {first.shape} {first.dtype}>"


def read_pages(path: Source, *, channel: str | int | None = None, composite: Sequence[str] | None = None) -> Pages:
    """Read all pages of a file, each in the form in which `read_image` returns an image; they must have one size.

    Parameters
    ----------
    path : str or path-like
        A multi-page TIFF: plain, ImageJ or OME; an OME-Zarr image; a .czi or .nd2 file of one scene; or a FITS cube,
        whose planes are pages. Any other image is read as one page.
    channel : str or int, optional
        The only channel to read, by its name or its number from 1: along the axis C, or a band of each page.
    composite : sequence of str, optional
        Read all channels as one uint8 image (H, W, 3), each in one of these colors in the notation of CSS, such as
        ``["green", "magenta"]``, and stretched to the range that it fills on the page. An empty sequence stands for
        green and magenta, or for more channels for red, green, blue, white, cyan, magenta, yellow.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg.pictures import read_pages, write_pages
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_pages(f"{folder}/a.tif", np.zeros((3, 4, 5), np.uint8))
    ...     read_pages(f"{folder}/a.tif")
    <Pages Q (3,) of (4, 5) uint8>
    """
    if channel is not None or composite is not None:
        tints = None if composite is None else tuple(composite)
        with selecting(replace(selected(), channel=None if channel is None else str(channel), composite=tints)):
            return read_pages(path)
    if is_stored(path):
        with named(path):
            return _chosen(open_stored(path))
    with reading(path) as file:
        # One of the frames of an animation is a page.
        if selected().page is not None and (frames := decode_frames(file)) is not None:
            images = frames.images
            return _chosen(_Decoded(images, Arrangement("Q", (len(images),)), alpha=images[0].shape[2:] == (4,)))
        return _chosen(npy_stack(file) or _decode_all(file))


@dataclass(frozen=True, slots=True, eq=False)
class _Decoded:
    """All pages of a file, beside which a `StoredStack` reads those that are chosen."""

    images: Sequence[Array]
    stack: Arrangement
    kind: str = ""
    scale: Options = field(default_factory=dict)
    alpha: bool = False
    is_chosen: bool = False  # Whether the only image is the page that is chosen

    def pages(self, numbers: Sequence[int]) -> list[Array]:
        return [self.images[number] for number in numbers]


def _chosen(source: _Decoded | StoredStack) -> Pages:
    chosen, alpha = selected(), isinstance(source, _Decoded) and source.alpha
    stack, numbers = source.stack.chosen(chosen)
    images = source.pages(numbers.tolist())
    n_bands = images[0].shape[2] if images[0].ndim == 3 else 1
    names = "RGBA"[:n_bands] if n_bands in (3, 4) else [f"B{band}" for band in range(1, n_bands + 1)]
    if (band := source.stack.band(chosen, tuple(names))) is not None:
        images = [np.ascontiguousarray(image.reshape(*image.shape[:2], -1)[:, :, band]) for image in images]
        stack, alpha = stack._replace(channels=stack.channels[band : band + 1]), False
    kind = source.kind or ("imagej" if chosen.pixel_size else "")
    scale = chosen.pixel_size.scale(kind) if chosen.pixel_size else source.scale
    pages = Pages(tuple(images), stack.axes or "Q", stack.shape or (1,), kind, scale, alpha, stack.channels)
    if chosen.composite is not None:
        pages = pages.composite(chosen.composite)
    is_chosen = isinstance(source, _Decoded) and source.is_chosen
    if chosen.page is None or is_chosen or chosen.page == len(pages.images) == 1:
        return pages
    return replace(pages, images=(one_page(pages, chosen.page).view(np.ndarray),), axes="Q", shape=(1,), channels=())


def write_pages(
    path: StrPath, pages: Pages | ArrayLike, *, palette: Bytes | None = None, overwrite: bool = False
) -> None:
    """Write a multi-page TIFF atomically; axes and physical sizes are preserved.

    Parameters
    ----------
    path : str or path-like
        Ends in .tif or .tiff.
    pages : Pages, or (P, H, W) or (P, H, W, C) array
        Integers, float32 or float64.
    palette : (K, 3) uint8 array, 1 <= K <= 256, optional
        Palette that the pages index. ImageJ and OME files store the colors instead of indices.
    overwrite : bool
        As in `write_image`, and so are errors.
    """
    check_choice(f"{path}: suffix", Path(path).suffix.lower(), PAGE_SUFFIXES)
    given = pages.parted() if isinstance(pages, Pages) else Pages(tuple(np.array(page) for page in np.asarray(pages)))
    if palette is not None:
        for image in given.images:
            check_indexed(image, palette)
    with writing(path, overwrite=overwrite) as file:
        encode_pages(file, given, palette)


def _decode_all(file: BinaryIO) -> _Decoded:
    """Read all pages; files of other formats than TIFF are read as one."""
    import tifffile

    magic = file.read(4)
    size = count_pages(file)
    if size == 1 and not selected().series:
        file.seek(0)
        image = decode(file)
        decoded = _Decoded([np.ascontiguousarray(image)], Arrangement("", ()), alpha=says_alpha(image))
        if magic.startswith(TIFF_MAGICS):
            file.seek(0)
            # Pillow reads damaged files that tifffile does not.
            with suppress(Exception), tifffile.TiffFile(file) as tiff:
                stack = Arrangement("", (), stack_of(tiff, 1).channels)
                return replace(decoded, kind=_kind_of(tiff), scale=scale_of(tiff), stack=stack)
        return decoded
    with tifffile.TiffFile(file) as tiff:
        first, numbers = first_page(tiff), main_pages(file)
        tags, page = tiff_tags(first), None if selected().in_stack else selected().page
        if page and len({(tiff.pages[at].shape, tiff.pages[at].dtype) for at in numbers}) > 1:
            return _page_alone(file, numbers, page, tiff)
        layout, kind = Layout.of(tags), _kind_of(tiff)
        scale, stack = scale_of(tiff), stack_of(tiff, size)
        n_pixels = first.imagelength * first.imagewidth
        # A file that holds about as much as it claims is large, and no trap.
        check_size(n_pixels * (size if size * n_pixels > _PIXELS_PER_BYTE * tiff.filehandle.size else 1))
        known = first.compression in tifffile.TIFF.DECOMPRESSORS
        images = []
        if is_plain(tags) and (known or not layout.for_pillow):
            images = [finished(page, tags) for page in _values_of_pages(tiff)]
            if (icc := icc_profile(tags)) and images[0].dtype == np.uint8 and images[0].shape[2:] in ((), (3,), (4,)):
                images = [np.array(to_srgb(Image.fromarray(page), icc=icc)) for page in images]
    images = images or _by_pillow(file, numbers)
    if len({(image.shape, image.dtype) for image in images}) > 1:
        raise UnfitContentError("has pages of different sizes or types")
    if math.prod(stack.shape) != len(images):
        stack = Arrangement("Q", (len(images),))
    whole = [np.ascontiguousarray(image) for image in images]
    return _Decoded(whole, stack, kind, scale, layout.alpha and whole[0].ndim == 3)


def _page_alone(file: BinaryIO, numbers: Sequence[int], page: int, tiff: tifffile.TiffFile) -> _Decoded:
    """Read the page that is chosen of pages of several sizes or types."""
    if page > len(numbers):
        raise UnfitContentError(f"has {len(numbers)} pages, and no page {page}")
    number = numbers[page - 1]
    by_pillow = Layout.of(tiff_tags(tiff.pages[number].aspage())).for_pillow
    image = _by_pillow(file, [number])[0] if by_pillow else decode_tiff(file, number=number)
    return _Decoded(
        [np.ascontiguousarray(image)], Arrangement("", ()), _kind_of(tiff), scale_of(tiff), says_alpha(image), True
    )


def _kind_of(tiff: tifffile.TiffFile) -> str:
    return "imagej" if tiff.is_imagej else "ome" if tiff.is_ome else ""


def one_page(pages: Pages, page: int | None) -> Array:
    """Return one page, from 1, or the only one."""
    n_pages = len(pages.images)
    if page is None and n_pages > 1:
        lengths = " x ".join(map(str, pages.shape))
        raise UnfitContentError(f"has {lengths} pages along {pages.axes}, where one image is expected")
    if (page or 1) > n_pages:
        raise UnfitContentError(f"has {n_pages} page{'s' * (n_pages > 1)}, and no page {page}")
    image = pages.images[(page or 1) - 1].copy()
    return with_mark(image, pages.has_alpha and image.shape[2:] == (4,))


def _values_of_pages(tiff: tifffile.TiffFile) -> Array:
    flat = []
    for part in main_series(tiff):
        values, axes = part.asarray(maxworkers=n_threads()), part.axes
        if "S" in axes:
            values, axes = np.moveaxis(values, axes.index("S"), -1), axes.replace("S", "") + "S"
        if not axes.removesuffix("S").endswith("YX"):
            raise UnfitContentError(f"has the axes {axes}, which do not end in YX")
        flat.append(values.reshape(-1, *values.shape[len(axes.removesuffix("S")) - 2 :]))
    if len({(values.shape[1:], values.dtype) for values in flat}) > 1:
        raise UnfitContentError("has pages of different sizes or types")
    return flat[0] if len(flat) == 1 else np.concatenate(flat)


def _by_pillow(file: BinaryIO, numbers: Sequence[int]) -> list[Array]:
    """Read pages whose samples need conversion: palettes, CMYK, fewer than 8 bits."""
    file.seek(0)
    images = []
    with open_picture(file) as image:
        for number in numbers:
            image.seek(number)
            images.append(decode_opened(image))
    return images


def encode_pages(file: BinaryIO, pages: Pages, palette: Bytes | None) -> None:
    """Write pages, following the conventions of ImageJ or OME if `pages.kind` says so."""
    kind, images = pages.kind, pages.images
    if palette is not None and kind:
        images, palette = tuple(palette[image] for image in images), None
    first = images[0]
    n_channels = first.shape[2] if first.ndim == 3 else 1
    if kind == "imagej" and first.dtype.type not in _IMAGEJ_TYPES.get(n_channels, ()):
        kind = ""
    axes, shape, order = pages.axes, pages.shape, np.arange(len(images))
    if kind == "imagej":
        axes, shape, order = _imagej_order(axes, shape)
    scale = dict(pages.scale)
    resolution, unit = scale.pop("resolution", None), scale.pop("resolutionunit", None)
    if pages.kind == "imagej" and not kind and "unit" in scale:  # whose name only ImageJ's description holds
        resolution = pages.pixel_size.dpi if pages.pixel_size else None
        unit = 2 if resolution else None
    described = {"axes": axes + "YX" + "S" * (first.ndim == 3), **(scale if kind else {})}
    if kind and "C" in axes and len(pages.channels) == shape[at := axes.index("C")]:
        labels = [pages.channels[place[at]] for place in np.ndindex(*shape)]
        described |= {"Channel": {"Name": list(pages.channels)}} if kind == "ome" else {"Labels": labels}
    dtype = first.dtype if palette is None else np.dtype(np.uint8)
    values = (images[number].astype(dtype, copy=False) for number in order.tolist())
    told: Arguments = {"resolution": resolution, "resolutionunit": unit, "metadata": described, "palette": palette}
    told |= {"bigtiff": False, "compression": None, "imagej": True} if kind == "imagej" else {"ome": kind == "ome"}
    has_alpha = pages.has_alpha and n_channels in (2, 4)
    write_tiff(file, values, first.shape, dtype, before=shape, alpha=has_alpha, **told)


def _imagej_order(axes: str, shape: tuple[int, ...]) -> tuple[str, tuple[int, ...], Ints64]:
    """Reorder pages to ImageJ's order of axes; axes unknown to ImageJ count as depth."""
    known = "".join(axis if axis in _ORDEROF_IMAGEJ else "Z" for axis in axes)
    if len(set(known)) < len(known):
        return "Z", (math.prod(shape),), np.arange(math.prod(shape))
    order = sorted(range(len(known)), key=lambda at: _ORDEROF_IMAGEJ.index(known[at]))
    numbers = np.arange(math.prod(shape)).reshape(shape).transpose(order)
    return "".join(known[at] for at in order), numbers.shape, numbers.ravel()

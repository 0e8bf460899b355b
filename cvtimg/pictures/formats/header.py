"""Read the headers of image files without decoding pixels."""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import BinaryIO, Literal

import numpy as np
from PIL import ImageFile, UnidentifiedImageError

from cvtimg._shared.choices import Arguments
from cvtimg.pictures.formats.arrays import NPY_MAGIC, npy_header
from cvtimg.pictures.formats.decoding import depth
from cvtimg.pictures.formats.geotiff import Place
from cvtimg.pictures.formats.opening import ANIMATED, open_picture, orientation, selected
from cvtimg.pictures.formats.pixel_size import PixelSize
from cvtimg.pictures.formats.stored import Arrangement, StoredStack, npy_stack
from cvtimg.pictures.formats.tiff import (
    TIFF_MAGICS,
    Layout,
    count_pages,
    describes_pages,
    first_page,
    holds_values,
    icc_profile,
    is_turned,
    scale_of,
    stack_of,
    tags_of,
    tiff_tags,
)
from cvtimg.pictures.profiles import profile_name

#: What several images of a file are, by its format.
_KINDS: dict[str, Literal["frames", "pages"]] = {
    **dict.fromkeys(ANIMATED, "frames"),
    **dict.fromkeys(("TIFF", "NPY", "Zarr", "OME-Zarr", "CZI", "ND2"), "pages"),
}


@dataclass(frozen=True, slots=True)
class ImageInfo:
    """Information from the header of an image file.

    Attributes
    ----------
    width, height : int
        Size in pixels of the upright image, as `read_image` returns it.
    format, mode : str
        Pillow's names, such as ``"PNG"`` and ``"RGB"``. For arrays and for bands that are not colors, the mode is the
        sample type, such as ``"float32"``.
    bands : tuple of str
        Names of the bands, such as ``("R", "G", "B")``; ``("B1", "B2", ...)`` for bands that are not colors.
    bits : int
        Bits per band in the file, or per index in an indexed image.
    frames : int
        Number of frames or pages, excluding masks and reduced-size copies.
    has_alpha : bool
        Whether the image has transparency of any kind.
    icc : str or None
        Description of the embedded color profile; ``"unreadable"`` if it is damaged.
    geo_transform : tuple of float (a, b, c, d, e, f) or None
        Affine transform of a GeoTIFF from pixel to map coordinates: ``x = a * column + b * row + c`` and ``y = d *
        column + e * row + f``, where (0, 0) is the upper left corner of the first pixel and (0.5, 0.5) its center.
    epsg : int or None
        EPSG code of the coordinate reference system.
    nodata : float or None
        Value that marks missing pixels in a GeoTIFF.
    axes : str
        Letters of the axes: T for time, C for channels, Z for depth, others for unknown ones, and YX.
    shape : tuple of int
        Number of pages along each of the axes before YX.
    channels : tuple of str
        Names of the channels along the axis C, or of the bands, where the file has them.
    pixel_size : PixelSize or None
        Physical size of a pixel, where the file states it as ImageJ or OME do.
    """

    width: int
    height: int
    format: str
    mode: str
    bands: tuple[str, ...]
    bits: int
    frames: int = 1
    has_alpha: bool = False
    icc: str | None = None
    geo_transform: tuple[float, float, float, float, float, float] | None = None
    epsg: int | None = None
    nodata: float | None = None
    axes: str = "YX"
    shape: tuple[int, ...] = ()
    channels: tuple[str, ...] = ()
    pixel_size: PixelSize | None = None

    @property
    def kind(self) -> Literal["image", "frames", "pages"]:
        """What the file holds: an image, the frames of an animation, or pages; of other formats, the first frame."""
        return _KINDS.get(self.format, "image") if self.frames > 1 else "image"


def read_header(file: BinaryIO) -> ImageInfo:
    """Read the header of an open file, as `image_info` does; a page that is chosen is alone."""
    stored = npy_stack(file)
    return _chosen(_read(file)) if stored is None else read_stored(stored)


def read_stored(image: StoredStack) -> ImageInfo:
    """Describe what is chosen of a stack on disk."""
    header = replace(_of_array(image.array.shape[-2:], 1, np.dtype(image.array.dtype)), format=image.form)
    stack = image.stack
    about: Arguments = {"shape": stack.shape, "channels": stack.channels, "frames": math.prod(stack.shape)}
    return _chosen(replace(header, axes=image.letters, pixel_size=image.pixel_size, **about))


def _chosen(header: ImageInfo) -> ImageInfo:
    chosen, is_composed = selected(), selected().composite is not None
    if is_composed:  # as a channel, in colors
        chosen = replace(chosen, channel="1")
    known = Arrangement(header.axes[:-2], header.shape, header.channels)
    if (at := known.band(chosen, header.bands)) is not None:
        header = replace(header, bands=header.bands[at : at + 1], has_alpha=False)
        known = known._replace(channels=known.channels[at : at + 1])
    stack, numbers = known.chosen(chosen)
    if is_composed:
        stack = stack._replace(channels=())
        header = replace(header, mode="RGB", bands=("R", "G", "B"), bits=8, has_alpha=False, nodata=None)
    frames = 1 if chosen.page is not None else len(numbers) if header.shape else header.frames
    stack, pixel_size = stack._replace(axes=f"{stack.axes}YX"), chosen.pixel_size or header.pixel_size
    return replace(header, frames=frames, pixel_size=pixel_size, **stack._asdict())


def _read(file: BinaryIO) -> ImageInfo:
    magic = file.read(8)
    file.seek(0)
    if magic.startswith(NPY_MAGIC):
        shape, dtype = npy_header(file)
        return _of_array(shape, shape[2] if len(shape) == 3 else 1, dtype)
    try:
        image = open_picture(file)
    except UnidentifiedImageError:
        if not magic.startswith(TIFF_MAGICS):
            raise
        return _of_tiff(file)
    with image:
        layout = Layout.of(tags_of(image))
        bands = layout.n_samples > layout.n_colors + layout.alpha
        values = not layout.for_pillow and (bands or holds_values(tags_of(image)))
        if image.format == "TIFF" and (values or selected().series):
            return _of_tiff(file)
        return _of_picture(image, file)


def _of_pages(file: BinaryIO, said: bool = True) -> Arguments:
    """Describe the pages of a TIFF and the size of their pixels, of which one page tells where something is `said`."""
    n_pages = count_pages(file)
    columns: Arguments = {"frames": n_pages, "axes": "QYX", "shape": (n_pages,)} if n_pages > 1 else {"frames": 1}
    if n_pages == 1 and not said:
        return columns
    import tifffile

    with suppress(Exception), tifffile.TiffFile(file) as tiff:  # Pillow reads damaged files that tifffile does not
        stack = stack_of(tiff, n_pages)
        if n_pages > 1:
            columns |= {"axes": f"{stack.axes}YX", "shape": stack.shape}
        columns |= {"channels": stack.channels, "pixel_size": PixelSize.of(scale_of(tiff))}
    return columns


def _of_picture(image: ImageFile.ImageFile, file: BinaryIO) -> ImageInfo:
    width, height = image.size
    # Pillow reports the upright size of a TIFF. Finding EXIF after the pixels of a PNG would require decoding it.
    known = image.format != "TIFF" and (image.format != "PNG" or "exif" in image.info)
    if known and orientation(image) >= 5:
        width, height = height, width
    tags = tags_of(image)
    is_tiff = image.format == "TIFF"
    pages = _of_pages(file, describes_pages(tags)) if is_tiff else {"frames": getattr(image, "n_frames", 1)}
    icc = profile_name(image.info.get("icc_profile"))
    about: Arguments = {"has_alpha": image.has_transparency_data, "icc": icc, **pages, **Place.of(tags)._asdict()}
    return ImageInfo(width, height, image.format or "", image.mode, image.getbands(), depth(image), **about)


def _of_tiff(file: BinaryIO) -> ImageInfo:
    import tifffile

    pages = _of_pages(file)
    file.seek(0)
    with tifffile.TiffFile(file) as tiff:
        page = first_page(tiff)
        tags = tiff_tags(page)
        size = (page.imagelength, page.imagewidth)[:: -1 if is_turned(tags) else 1]
        header, layout = _of_array(size, page.samplesperpixel, np.dtype(page.dtype)), Layout.of(tags)
        about: Arguments = {"bits": layout.bits, "has_alpha": layout.alpha, "icc": profile_name(icc_profile(tags))}
        return replace(header, format="TIFF", **about, **Place.of(tags)._asdict(), **pages)


def _of_array(size: tuple[int, ...], n_bands: int, dtype: np.dtype[np.generic]) -> ImageInfo:
    bands, bits = tuple(f"B{band}" for band in range(1, n_bands + 1)), 8 * dtype.itemsize
    return ImageInfo(size[1], size[0], "NPY", dtype.name, bands, 1 if dtype.kind == "b" else bits)

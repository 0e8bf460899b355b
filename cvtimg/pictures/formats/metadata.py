"""Metadata of image files, reduced to what remains valid for the image that is written."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, BinaryIO

from PIL import Image, ImageFile, UnidentifiedImageError
from PIL.ExifTags import IFD, Base

from cvtimg._shared.choices import Arguments, Options
from cvtimg.pictures.formats.geotiff import GeoTag, GeoTags, Place, Tags, geo_tags
from cvtimg.pictures.formats.opening import open_picture
from cvtimg.pictures.formats.pixel_size import PixelSize
from cvtimg.pictures.formats.tiff import OF_IMAGEJ, TIFF_MAGICS, describes_pages, scale_of, tags_of, tiff_tags
from cvtimg.pictures.profiles import kept_profile, profile_space

if TYPE_CHECKING:
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

#: Tags of the main EXIF directory that describe the image, not its file: description, make and model, software, date,
#: artist, copyright, and the title, comment, author, keywords and subject of Windows.
_ABOUT_THE_PICTURE = (
    *(Base.ImageDescription, Base.Make, Base.Model, Base.Software, Base.DateTime, Base.Artist, Base.Copyright),
    *range(Base.XPTitle, Base.XPSubject + 1),
    *(IFD.Exif, IFD.GPSInfo),
)
_SIZE = (Base.ExifImageWidth, Base.ExifImageHeight)
#: How descriptions begin by which programs describe the file: its pages, axes and sizes, which are others in a new one.
_OF_THE_FILE = ("ImageJ=", "SCIFIO=", "<?xml", "<OME", '{"shape"', '{"axes"')


@dataclass(frozen=True, slots=True)
class Metadata:
    """Metadata of an image file that can be written with a processed image.

    Attributes
    ----------
    icc : bytes or None
        Color profile of the pixels that `read_image` returns: that of the file if they were not converted, else sRGB.
        None if the file has no usable profile.
    dpi : tuple of float or None
        Horizontal and vertical resolution of the upright image, in pixels per inch.
    exif : bytes or None
        EXIF without orientation, size and thumbnail, which may not apply to the image that is written.
    geo : mapping of int
        Georeferencing tags of a GeoTIFF; stored only in .tif files.
    nodata : float or None
        Value that marks missing pixels in a GeoTIFF; stored only in .tif files.
    scale : mapping of str
        Pixels per unit, unit and spacing of an ImageJ or OME file, as ImageJ has them in `Pages`; stored only in .tif
        files of gray or RGB.
        Others have the same size of a pixel by `dpi`.
    """

    icc: bytes | None = None
    dpi: tuple[float, float] | None = None
    exif: bytes | None = None
    geo: GeoTags = field(default_factory=dict)
    nodata: float | None = None
    scale: Options = field(default_factory=dict)

    @classmethod
    def of_size(cls, size: PixelSize | None) -> Metadata | None:
        """Return the size of pixels for files that can tell it; None without one."""
        return cls(dpi=size.dpi, scale=size.scale()) if size else None

    def options(self, form: str, mode: str, kept: tuple[str, ...]) -> Arguments:
        """Return the options of Pillow's `save` for the metadata that a format stores with images of a mode."""
        space = "GRAY" if mode in ("1", "L", "I;16") else "RGB"
        icc = self.icc if self.icc and profile_space(self.icc) == space else None
        values: Arguments = {"icc_profile": icc, "dpi": self.dpi, "exif": self.exif}
        if form == "JPEG" and self.dpi and max(self.dpi) >= 1 << 16:
            values["dpi"] = None
        given = {name: values[name] for name in kept if values[name]}
        if form == "TIFF":
            given["tiffinfo"] = self._tiff_tags(given.pop("exif", None))
            if self.scale:
                given.pop("dpi", None)
        return given

    def _tiff_tags(self, exif: bytes | None) -> ImageFileDirectory_v2:
        """Return georeferencing and the main EXIF directory; with more EXIF, Pillow does not compress a TIFF."""
        from PIL.TiffImagePlugin import ImageFileDirectory_v2

        tags = ImageFileDirectory_v2()
        for code, value in self.geo.items():
            tags[code] = value
        if self.nodata is not None:
            tags[GeoTag.NODATA] = f"{self.nodata:.17g}"
        about = Image.Exif()
        about.load(exif or b"")
        for code in about:
            if code not in (IFD.Exif, IFD.GPSInfo):
                tags[code] = about[code]
        if self.scale:
            tags[Base.XResolution], tags[Base.YResolution] = self.scale["resolution"]
            tags[Base.ResolutionUnit] = 1  # that of the description
            named = [f"{name}={value}" for name, value in self.scale.items() if name in OF_IMAGEJ]
            tags[Base.ImageDescription] = "\n".join(["ImageJ=1.11a", *named, ""]).replace("\u00b5", "\\u00B5")
        return tags


def decode_metadata(file: BinaryIO, *, keep_profile: bool = False) -> Metadata:
    """Read the metadata of an open file, as `read_metadata` does."""
    try:
        image = open_picture(file)
    except UnidentifiedImageError:  # an array, or a TIFF of many bands
        return _of_tiff(file)
    with image:
        icc = image.info.get("icc_profile")
        exif, tags = image.getexif(), tags_of(image)
        dpi = _dpi(image)
        if dpi and exif.get(Base.Orientation, 1) >= 5:
            dpi = dpi[::-1]
        if icc:
            as_it_is = keep_profile and profile_space(icc) == "RGB" and image.mode not in ("1", "L", "LA", "CMYK")
            icc = icc if as_it_is else kept_profile(icc, image.mode)
        scale = _scale_of(file, tags)
        size = PixelSize.of(scale)
        dpi = (size.dpi if size else None) or dpi
        return Metadata(icc or None, dpi, _about_the_picture(exif), geo_tags(tags), Place.of(tags).nodata, scale)


def _of_tiff(file: BinaryIO) -> Metadata:
    file.seek(0)
    if not file.read(4).startswith(TIFF_MAGICS):
        return Metadata()
    import tifffile

    file.seek(0)
    with tifffile.TiffFile(file) as tiff:
        tags = tiff_tags(tiff.pages.first)
        return Metadata(geo=geo_tags(tags), nodata=Place.of(tags).nodata)


def _dpi(image: ImageFile.ImageFile) -> tuple[float, float] | None:
    with suppress(KeyError, TypeError, ValueError, ZeroDivisionError):
        across, down = (float(value) for value in image.info["dpi"])
        if 0 < across < 1e6 and 0 < down < 1e6:
            return across, down
    return None


def _scale_of(file: BinaryIO, tags: Tags) -> Arguments:
    """Return the pixels per unit of an ImageJ or OME file with what names the unit; empty without either."""
    if not describes_pages(tags):
        return {}
    import tifffile

    file.seek(0)
    with suppress(Exception), tifffile.TiffFile(file) as tiff:  # Pillow reads damaged files that tifffile does not
        scale = scale_of(tiff)
        if size := PixelSize.of(scale):
            return scale if tiff.is_imagej else size.scale()
    return {}


def _about_the_picture(exif: Image.Exif) -> bytes | None:
    kept = Image.Exif()
    for tag in _ABOUT_THE_PICTURE:
        if tag in (IFD.Exif, IFD.GPSInfo):
            part = {name: value for name, value in exif.get_ifd(tag).items() if name not in _SIZE}
            if part:
                kept[tag] = part
        elif tag in exif and not (tag == Base.ImageDescription and str(exif[tag]).lstrip().startswith(_OF_THE_FILE)):
            kept[tag] = exif[tag]
    return kept.tobytes() if len(kept) else None

"""What a picture file says beside its pixels, and what of it stays true of the picture that is written."""

from __future__ import annotations

import zlib
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, BinaryIO

from PIL import Image, ImageFile, UnidentifiedImageError

from cvtimg.images.opening import open_picture
from cvtimg.images.png import chunk
from cvtimg.profiles import kept_profile, profile_space

__all__ = ["Metadata", "decode_metadata"]

_EXIF_PART, _GPS_PART = 0x8769, 0x8825
#: Of EXIF's first part, what is about the picture and not about its file: description, make and model, software, date,
#: artist, copyright, and Windows' title, comment, author, keywords and subject.
_ABOUT_THE_PICTURE = (270, 271, 272, 305, 306, 315, 33432, *range(0x9C9B, 0x9CA0), _EXIF_PART, _GPS_PART)
_SIZE = (0xA002, 0xA003)
_INCHES_A_METER = 39.3701


@dataclass(frozen=True, slots=True)
class Metadata:
    """What can be kept of a picture file beside the pixels.

    Attributes
    ----------
    icc : bytes or None
        Color profile that the pixels have after `read_image`: the file's own where that left them as they are, else
        sRGB. None where the file has none that serves.
    dpi : tuple of float or None
        Pixels an inch, across and down the upright picture.
    exif : bytes or None
        EXIF without orientation, size and thumbnail, which may not be true of the picture that is written.
    """

    icc: bytes | None = None
    dpi: tuple[float, float] | None = None
    exif: bytes | None = None

    def options(self, form: str, mode: str, kept: tuple[str, ...]) -> dict[str, Any]:
        """Name what a format keeps as Pillow's `save` does, for a picture of a mode."""
        grey = mode in ("1", "L", "I;16")
        fits = self.icc and profile_space(self.icc) == ("GRAY" if grey else "RGB")
        values: dict[str, Any] = {"icc_profile": self.icc if fits else None, "dpi": self.dpi, "exif": self.exif}
        given = {name: values[name] for name in kept if values[name]}
        if "exif" in given and form == "TIFF":
            given["exif"] = _first_part(given["exif"])
        return given

    def png_chunks(self, mode: str) -> bytes:
        """Give what goes between header and pixels of a PNG."""
        given = self.options("PNG", mode, ("icc_profile", "dpi", "exif"))
        chunks = b""
        if "icc_profile" in given:
            chunks += chunk(b"iCCP", b"icc\0\0" + zlib.compress(given["icc_profile"]))
        if "dpi" in given:
            per_meter = [round(value * _INCHES_A_METER).to_bytes(4, "big") for value in given["dpi"]]
            chunks += chunk(b"pHYs", b"".join(per_meter) + b"\1")
        if "exif" in given:
            chunks += chunk(b"eXIf", given["exif"].removeprefix(b"Exif\0\0"))
        return chunks


def decode_metadata(file: BinaryIO) -> Metadata:
    """Tell what can be kept of a file, as `read_metadata` does."""
    try:
        image = open_picture(file)
    except UnidentifiedImageError:  # an array, or a TIFF of many bands
        return Metadata()
    with image:
        icc = image.info.get("icc_profile")
        exif = image.getexif()
        dpi = _dpi(image)
        if dpi and exif.get(0x0112, 1) >= 5:
            dpi = dpi[::-1]
        return Metadata(kept_profile(icc, image.mode) if icc else None, dpi, _about_the_picture(exif))


def _dpi(image: ImageFile.ImageFile) -> tuple[float, float] | None:
    with suppress(KeyError, TypeError, ValueError, ZeroDivisionError):
        across, down = (float(value) for value in image.info["dpi"])
        if 0 < across < 1e6 and 0 < down < 1e6:
            return across, down
    return None


def _about_the_picture(exif: Image.Exif) -> bytes | None:
    kept = Image.Exif()
    for tag in _ABOUT_THE_PICTURE:
        if tag in (_EXIF_PART, _GPS_PART):
            part = {name: value for name, value in exif.get_ifd(tag).items() if name not in _SIZE}
            if part:
                kept[tag] = part
        elif tag in exif:
            kept[tag] = exif[tag]
    return kept.tobytes() if len(kept) else None


def _first_part(content: bytes) -> bytes:
    """Leave out the camera's settings and the place, which Pillow cannot write into a compressed TIFF."""
    exif = Image.Exif()
    exif.load(content)
    for tag in (_EXIF_PART, _GPS_PART):
        exif.pop(tag, None)
    return exif.tobytes()

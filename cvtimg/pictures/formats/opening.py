"""Open image files without library warnings, and report any error in one line."""

import errno
import logging
import math
import os
import shlex
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO, TypeAlias

from PIL import Image, ImageFile, UnidentifiedImageError
from PIL.ExifTags import Base

from cvtimg._shared.extras import needs
from cvtimg._shared.messages import one_line
from cvtimg._shared.records import UnprovenError
from cvtimg.files.finding import NOT_RASTER
from cvtimg.files.remote import check_name, local_copy, url_of
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.pictures.formats.converted import AS_TIFF, RAW_SUFFIXES, developed
from cvtimg.pictures.formats.pixel_size import PixelSize
from cvtimg.pictures.formats.png_chunks import PNG_MAGIC, read_more, without_damage

#: Formats with frames; those of other formats are pages.
ANIMATED = ("GIF", "PNG", "WEBP")
#: What is said of files that are no images, by suffix.
_OTHER_FILES = {
    ".csv .tsv .parquet .feather .arrow .xlsx": "is a table and not an image; cvtimg cluster {0} -k auto reads it",
    ".geojson .json .wkt .wkb": "is no image; if it has outlines, cvtimg mesh {0} -o mesh.vtu reads it",
    ".nc .h5 .hdf": "has arrays by name and is no image; save one of them as .npy or .tif. If it is a grid of the "
    "globe, cvtimg sphere takes it as --parent",
    ".stl .obj .ply .off": "is a surface and not an image; cvtimg surface {0} -n 1000 -o points.ply reads it",
    ".gpl .hex .act .ase .pal": "is a palette and not an image; cvtimg palette {0} shows it",
}
#: First bytes of textures, whose files Pillow closes.
_CLOSED_BY_PILLOW = b"FTEX"

# Both also log some of the errors that they raise; without a handler these would appear on stderr.
for _library in ("PIL", "tifffile"):
    logging.getLogger(_library).addHandler(logging.NullHandler())


class _Quiet:
    """Suppress warnings of Pillow and astropy while at least one image is open.

    Overlapping `warnings.catch_warnings` in two threads restore each other's filters and can leave a filter behind
    permanently. Here the first thread to enter sets the filter and the last to leave removes it, so decoders need not
    wait for one another. Only warnings raised inside these libraries are suppressed.
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
                warnings.filterwarnings("ignore", module=r"(PIL|astropy)\.")
            self._depth += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth == 0:
                self._saved.__exit__(None, None, None)


_QUIET = _Quiet()


class UnfitContentError(ValueError):
    """Content of a file that cannot be used; the message tells the user why."""


#: Source of an image: a path, the bytes of a file, or a binary file open for reading.
Source: TypeAlias = StrPath | bytes | bytearray | memoryview | BinaryIO


@contextmanager
def reading(source: Source) -> Iterator[BinaryIO]:
    """Open a source for reading an image; any error in the block becomes an `OSError` that names the source."""
    if not isinstance(source, (str, os.PathLike, bytes, bytearray, memoryview)) and not hasattr(source, "read"):
        raise TypeError(f"source of type {type(source).__name__} must be a path, bytes or a binary file")
    with named(source), _QUIET, _opened(source) as file:
        yield file


@contextmanager
def named(source: Source) -> Iterator[None]:
    """Name a source in errors: any in the block becomes an `OSError`."""
    path = str(getattr(source, "name", "stream"))
    if isinstance(source, (str, os.PathLike)):
        check_name(source)
        path = url_of(source)
    elif isinstance(source, (bytes, bytearray, memoryview)):
        path = "bytes"
    try:
        yield
    # For damaged files Pillow and tifffile raise many kinds of errors: SyntaxError, struct.error,
    # EOFError, zlib.error, DecompressionBombError, MemoryError, IndexError, ...
    except Exception as error:
        known = isinstance(error, OSError) and error.errno is not None
        raise (type(error) if known else OSError)(f"{path}: {_why_unread(error, path)}") from error


@contextmanager
def writing(path: StrPath, *, overwrite: bool, through: type[Exception] = ModuleNotFoundError) -> Iterator[BinaryIO]:
    """Open a file for encoders, of whose many kinds of errors only those of one kind get `through` as they are."""
    with whole_file(path, overwrite=overwrite) as file:
        try:
            yield file
        except (through, UnprovenError):
            raise
        except Exception as error:
            why = error
            try:  # again what the system said, which encoders hide
                file.write(bytes(1 << 16))
                file.flush()
            except OSError as system:
                why = system
            raise OSError(f"{path}: cannot be written ({one_line(why)})") from error


@contextmanager
def _opened(source: Source) -> Iterator[BinaryIO]:
    """Open a path, a URL or bytes as a seekable file; a file that is already open stays open."""
    if isinstance(source, (str, os.PathLike)):
        with local_copy(source) as path:
            if path.is_dir():  # Windows would report "permission denied"
                raise IsADirectoryError(errno.EISDIR, "is a directory, not a file")
            with developed(path, check_size) if path.suffix.lower() in RAW_SUFFIXES else path.open("rb") as file:
                # Some decoders need to seek, which pipes do not support.
                yield _plain(file if file.seekable() else BytesIO(_all_of(file)))
    elif isinstance(source, (bytes, bytearray, memoryview)):
        yield _plain(BytesIO(source))
    else:
        yield _plain(BytesIO(_all_of(source)))


def _plain(file: BinaryIO) -> BinaryIO:
    """Return a file that is read as it is, or as the TIFF that it becomes first."""
    magic = file.read(len(PNG_MAGIC))
    file.seek(0)
    if not magic:
        raise UnfitContentError("is empty")
    if magic == PNG_MAGIC:
        return without_damage(file)
    convert = next((convert for start, convert in AS_TIFF.items() if magic.startswith(start)), None)
    if convert is None:
        return file
    if (tiff := convert(file, check_size)) is None:
        raise UnfitContentError("holds no image")
    return tiff


def _all_of(file: BinaryIO, bytes_per_pixel: int = 16) -> bytes:
    """Read a binary stream to its end, up to a number of bytes for each pixel that an image may have."""
    most = _most_pixels() * bytes_per_pixel
    content = file.read(int(min(most, sys.maxsize - 1)) + 1)
    if not isinstance(content, bytes):
        raise UnfitContentError("must be open for reading bytes, mode 'rb'")
    if len(content) > most:
        raise Image.DecompressionBombError
    return content


def open_picture(file: BinaryIO) -> ImageFile.ImageFile:
    """Open an image with Pillow, without decoding its pixels."""
    magic = file.read(len(PNG_MAGIC))
    if magic == PNG_MAGIC:  # Image.open would first import other formats
        from PIL.PngImagePlugin import PngImageFile

        file.seek(0)
        png = PngImageFile(file)
        at = file.tell()
        read_more(file, png)
        file.seek(at)
        check_size(png.width * png.height)
        return png
    file.seek(0)
    image = Image.open(BytesIO(file.read()) if magic.startswith(_CLOSED_BY_PILLOW) else file)
    if image.format in NOT_RASTER:
        raise UnidentifiedImageError
    return image


def orientation(image: Image.Image) -> int:
    """Return the EXIF orientation, 1..8; 1 is upright."""
    try:
        return int(image.getexif().get(Base.Orientation, 1))
    except Exception:  # damaged metadata, for which Pillow raises many kinds of errors, does not affect the pixels
        return 1


@dataclass(frozen=True, slots=True)
class Selection:
    """A choice within files."""

    # Page to read from files of several pages or planes, from 1; None to refuse such files as images.
    page: int | None = None
    # Axis of the bands in .npy arrays of three axes; None for the last, unless that is doubtful.
    channel_axis: int | None = None
    # Letters of the axes of a stack in place of those of the file, such as "TZYX".
    axes: str | None = None
    # Places along the axes C, T and Z, from 1; a channel also by its name.
    channel: str | None = None
    t: int | None = None
    z: int | None = None
    pixel_size: PixelSize | None = None  # In place of that of the file
    series: int | None = None  # Image of a TIFF that holds several, each perhaps a stack, from 1
    composite: tuple[str, ...] | None = None  # Colors in which all channels are one image; () for usual ones

    @property
    def in_stack(self) -> bool:
        """Whether something is said of the axes of a stack."""
        said = (self.axes, self.channel, self.t, self.z, self.series, self.composite)
        return any(choice is not None for choice in said)


_SELECTED: ContextVar[Selection] = ContextVar("cvtimg_selection", default=Selection())  # noqa: B039, immutable


def selected() -> Selection:
    """Return the choice in force."""
    return _SELECTED.get()


@contextmanager
def selecting(selection: Selection) -> Iterator[None]:
    """Read files by another choice within a block."""
    token = _SELECTED.set(selection)
    try:
        yield
    finally:
        _SELECTED.reset(token)


def check_size(n_pixels: int) -> None:
    """Reject what Pillow rejects: small files that claim enough pixels to fill the memory."""
    if n_pixels > _most_pixels():
        raise Image.DecompressionBombError


@contextmanager
def pixels_limited(n: int | None) -> Iterator[None]:
    """Set the maximum number of pixels of an image within a block; None keeps the limit, by default 179 million."""
    before = Image.MAX_IMAGE_PIXELS
    if n is not None:
        Image.MAX_IMAGE_PIXELS = n / 2  # type: ignore[assignment]  # Pillow rejects more than twice this number
    try:
        yield
    finally:
        Image.MAX_IMAGE_PIXELS = before


def _most_pixels() -> float:
    return 2 * Image.MAX_IMAGE_PIXELS if Image.MAX_IMAGE_PIXELS is not None else math.inf


def _why_unread(error: Exception, path: str) -> str:
    if isinstance(error, FileNotFoundError):
        return "no such file"
    if isinstance(error, UnidentifiedImageError):
        suffix = "." + path.rpartition(".")[2].lower()
        known = (use.format(shlex.quote(path)) for suffixes, use in _OTHER_FILES.items() if suffix in suffixes.split())
        return next(known, "cannot be read: unknown image format")
    is_said = isinstance(error, (UnfitContentError, ImportError, MemoryError))
    if is_said or (isinstance(error, OSError) and error.errno is not None):
        return one_line(error)
    if isinstance(error, Image.DecompressionBombError):
        return f"has over {_most_pixels():.0f} pixels, the limit for safety; --max-pixels raises it"
    if "'imagecodecs' package" in str(error):  # how tifffile says it
        return f"is compressed in a way that needs {needs('imagecodecs', 'codecs')}"
    return f"is truncated or damaged ({one_line(error)})"

"""Picture files opened in silence, and whatever is wrong with one said in one line."""

from __future__ import annotations

import errno
import logging
import math
import os
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, TypeAlias

from PIL import Image, ImageFile, UnidentifiedImageError

from cvtimg._shared.messages import one_line
from cvtimg.files.finding import NOT_RASTER
from cvtimg.files.whole import StrPath

__all__ = [
    "PNG_MAGIC",
    "Source",
    "UnfitContentError",
    "check_size",
    "limit_pixels",
    "name_of",
    "open_picture",
    "orientation",
    "pixels_limited",
    "reading",
]

#: A stream of more bytes for each pixel that an image may have is no image.
_BYTES_PER_PIXEL = 16
#: What every PNG begins with.
PNG_MAGIC = b"\x89PNG\r\n\x1a\n"

# Both log some of what they also raise; without a handler that goes to stderr a second time.
for _library in ("PIL", "tifffile"):
    logging.getLogger(_library).addHandler(logging.NullHandler())


class _Quiet:
    """Hold the warnings of Pillow and astropy back while at least one picture is open.

    Two `warnings.catch_warnings` that overlap in two threads restore each other's filters and can
    leave a filter behind for good. Here the first to enter sets it and the last to leave takes it
    away, without making the decoders wait for one another. Only warnings raised inside these are
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
                warnings.filterwarnings("ignore", module=r"(PIL|astropy)\.")
            self._depth += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth == 0:
                self._saved.__exit__(None, None, None)


_QUIET = _Quiet()


class UnfitContentError(ValueError):
    """A file is not what it should be; the message says what it is, for people."""


#: What an image is read from: a path, the bytes of a file, or a file that is open for reading bytes.
Source: TypeAlias = StrPath | bytes | bytearray | memoryview | BinaryIO


@contextmanager
def reading(source: Source) -> Iterator[BinaryIO]:
    """Open a source to read an image from it; whatever fails in the block is the source's fault and says so."""
    path = name_of(source)
    try:
        with _QUIET, _opened(source) as file:
            yield file
    # On damaged files Pillow and tifffile raise nearly every class there is: SyntaxError, struct.error,
    # EOFError, zlib.error, DecompressionBombError, MemoryError, IndexError, ...
    except Exception as error:
        known = isinstance(error, OSError) and error.errno is not None
        raise (type(error) if known else OSError)(f"{path}: {_why_unread(source, error)}") from error


def name_of(source: Source) -> str:
    """Name a source in messages."""
    if isinstance(source, (str, os.PathLike)):
        return os.fspath(source)
    return "bytes" if isinstance(source, (bytes, bytearray, memoryview)) else str(getattr(source, "name", "stream"))


@contextmanager
def _opened(source: Source) -> Iterator[BinaryIO]:
    """Open a path or bytes; a file that is open stays so. All can be sought in, as decoders do."""
    if isinstance(source, (str, os.PathLike)):
        if Path(source).is_dir():  # Windows would say "permission denied"
            raise IsADirectoryError(errno.EISDIR, "is a directory, not a file")
        with Path(source).open("rb") as file:
            # Some decoders seek, which a pipe cannot.
            yield file if file.seekable() else BytesIO(_all_of(file))
    elif isinstance(source, (bytes, bytearray, memoryview)):
        yield BytesIO(source)
    else:
        yield BytesIO(_all_of(source))


def _all_of(file: BinaryIO) -> bytes:
    """Read a stream to its end, if it holds bytes, and not more than an image can have."""
    most = _most_pixels() * _BYTES_PER_PIXEL
    content = file.read(int(min(most, sys.maxsize - 1)) + 1)
    if not isinstance(content, bytes):
        raise UnfitContentError("must be open for reading bytes, mode 'rb'")
    if len(content) > most:
        raise Image.DecompressionBombError
    return content


def open_picture(file: BinaryIO) -> ImageFile.ImageFile:
    """Open a picture with Pillow, which reads no pixels yet."""
    if file.read(len(PNG_MAGIC)) == PNG_MAGIC:  # Image.open would import other formats first
        from PIL.PngImagePlugin import PngImageFile

        file.seek(0)
        png = PngImageFile(file)
        check_size(png.width * png.height)
        return png
    file.seek(0)
    image = Image.open(file)
    if image.format in NOT_RASTER:
        raise UnidentifiedImageError
    return image


def orientation(image: Image.Image) -> int:
    """EXIF's number of the way that the picture lies, 1..8; 1 is upright."""
    try:
        return int(image.getexif().get(0x0112, 1))
    except Exception:  # damaged metadata, of which Pillow makes any error, spoils no pixel
        return 1


def check_size(n_pixels: int) -> None:
    """Refuse what Pillow would refuse: a small file that says it is large enough to fill the memory."""
    if n_pixels > _most_pixels():
        raise Image.DecompressionBombError


def limit_pixels(n: int) -> None:
    """Let pictures have so many pixels; without this they may have those that Pillow finds safe, some 179 million."""
    Image.MAX_IMAGE_PIXELS = n / 2  # type: ignore[assignment]  # beyond twice of which Pillow refuses them


@contextmanager
def pixels_limited(n: int | None) -> Iterator[None]:
    """Let pictures have so many pixels for a while."""
    before = Image.MAX_IMAGE_PIXELS
    if n is not None:
        limit_pixels(n)
    try:
        yield
    finally:
        Image.MAX_IMAGE_PIXELS = before


def _most_pixels() -> float:
    return 2 * Image.MAX_IMAGE_PIXELS if Image.MAX_IMAGE_PIXELS is not None else math.inf


def _is_empty(source: Source) -> bool:
    if isinstance(source, (str, os.PathLike)):
        return Path(source).is_file() and Path(source).stat().st_size == 0
    return isinstance(source, (bytes, bytearray, memoryview)) and len(source) == 0


def _why_unread(source: Source, error: Exception) -> str:
    if isinstance(error, FileNotFoundError):
        return "no such file"
    if isinstance(error, UnidentifiedImageError):
        return "is empty" if _is_empty(source) else "cannot be read: unknown image format"
    if isinstance(error, UnfitContentError) or (isinstance(error, OSError) and error.errno is not None):
        return one_line(error)
    if isinstance(error, Image.DecompressionBombError):
        return f"has over {_most_pixels():.0f} pixels, the limit for safety; --max-pixels raises it"
    if isinstance(error, MemoryError):
        return "needs more memory than there is"
    return f"is truncated or damaged ({one_line(error)})"

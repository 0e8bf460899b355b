"""Films, which PyAV decodes and encodes one frame after the other: few of them fit into memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.extras import optional
from cvtimg.files.remote import local_copy
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.pictures.formats.opening import UnfitContentError, check_size, named

#: Names of formats in PyAV, and encoders, by suffix.
_FORMATS = {
    ".avi": ("avi", "libx264"),
    ".mkv": ("matroska", "libx264"),
    ".mov": ("mov", "libx264"),
    ".mp4": ("mp4", "libx264"),
    ".webm": ("webm", "libvpx-vp9"),
}
FILM_SUFFIXES = frozenset(_FORMATS)
#: Quality of what is written, as constant rate factor: hardly any loss is seen.
_QUALITY = "14"


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """A film, decoded as its frames are asked for."""

    images: Iterator[NDArray[np.uint8]]  # (H, W, 3) each, upright, in sRGB
    rate: Fraction  # frames per second
    n_frames: int  # 0 where the file does not tell


def read_film(path: StrPath) -> Film:
    """Open a film; errors are those of `read_image`."""
    with _opened(path) as container:
        if not container.streams.video:
            raise UnfitContentError("holds no film")
        stream = container.streams.video[0]
        check_size(stream.width * stream.height)
        rate = Fraction(stream.average_rate or 25)
        microseconds = container.duration or 0
        return Film(_images(path), rate, stream.frames or round(rate * microseconds / 10**6))


@contextmanager
def _opened(path: StrPath) -> Iterator[Any]:
    with named(path), local_copy(path) as local, local.open("rb") as file, optional("av", "films").open(file) as film:
        yield film


def _images(path: StrPath) -> Iterator[NDArray[np.uint8]]:
    with _opened(path) as container:
        container.streams.video[0].thread_type = "AUTO"
        for frame in container.decode(video=0):
            yield np.rot90(frame.to_ndarray(format="rgb24"), frame.rotation // 90)


def write_film(path: StrPath, images: Iterable[NDArray[np.uint8]], rate: Fraction, *, overwrite: bool = False) -> None:
    """Write a film atomically, with so many frames per second, in the format of the suffix."""
    av, stream = optional("av", "films"), None
    form, codec = _FORMATS[Path(path).suffix.lower()]
    with whole_file(path, overwrite=overwrite) as file, av.open(file, "w", format=form) as container:
        for image in images:
            if stream is None:
                stream = container.add_stream(codec, rate=rate, options={"crf": _QUALITY})
                stream.height, stream.width = image.shape[:2]
                # Few players show color at full size, and at half size the sides must be even.
                stream.pix_fmt = "yuv444p" if stream.width % 2 or stream.height % 2 else "yuv420p"
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")))
        if stream is not None:
            container.mux(stream.encode())

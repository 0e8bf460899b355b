"""Read and write animations (GIF, APNG and WebP) with the duration of each frame."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np

from cvtimg._shared.checks import check_choice, check_in_range, check_that
from cvtimg._shared.types import Array, Bytes
from cvtimg.files.whole import StrPath
from cvtimg.pictures.formats.animated import FRAME_WRITERS, Cel, composed
from cvtimg.pictures.formats.arrays import upright
from cvtimg.pictures.formats.decoding import decode, to_srgb
from cvtimg.pictures.formats.encoding import check_indexed
from cvtimg.pictures.formats.header import read_header
from cvtimg.pictures.formats.metadata import Metadata
from cvtimg.pictures.formats.opening import ANIMATED, check_size, open_picture, orientation, reading, writing


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """The frames of an animation, each composited to the full image.

    Attributes
    ----------
    images : tuple of (H, W), (H, W, 3) or (H, W, 4) arrays
        Frames of the same shape and type, upright and in sRGB.
    durations : tuple of float
        Duration of each frame in milliseconds.
    plays : int
        Number of times the animation plays; 0 loops forever.
    """

    images: tuple[Array, ...]
    durations: tuple[float, ...]
    plays: int

    def __post_init__(self) -> None:
        counts = f"{len(self.images)} images and {len(self.durations)} durations"
        check_that(counts, 0 < len(self.images) == len(self.durations), "be equally many, at least one")
        shapes = {image.shape for image in self.images}
        check_that(f"images of shapes {sorted(shapes)}", len(shapes) == 1, "have the same shape")
        finite = all(0 <= duration < math.inf for duration in self.durations)
        check_in_range("durations", self.durations, finite, "finite milliseconds >= 0")
        check_in_range("plays", self.plays, self.plays >= 0, ">= 0")
        for image in self.images:
            image.flags.writeable = False


def is_animated(path: StrPath) -> bool:
    """Return whether a file has several frames, of which none is chosen. Pages of a document are no frames."""
    with reading(path) as file:
        return read_header(file).kind == "frames"


def read_frames(path: StrPath) -> Frames:
    """Read all frames of a GIF, APNG or WebP, each composited over the previous ones, as uint8 images.

    Any other image is read as one frame. The default image of an APNG is omitted if it is not part of the animation.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg.pictures import read_frames, write_frames
    >>> frames = Frames((np.zeros((2, 3), np.uint8), np.full((2, 3), 9, np.uint8)), (40, 60), 0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_frames(f"{folder}/a.png", frames)
    ...     again = read_frames(f"{folder}/a.png")
    >>> again.durations, int(again.images[1].max())
    ((40.0, 60.0), 9)
    """
    with reading(path) as file:
        if (frames := decode_frames(file)) is not None:
            return frames
        file.seek(0)
        return Frames((decode(file).view(np.ndarray),), (0.0,), 1)


def decode_frames(file: BinaryIO) -> Frames | None:
    """Read all frames of an open animation; None for files of one image or of pages."""
    try:
        image = open_picture(file)
    except OSError:  # a format that Pillow does not read
        return None
    with image:
        if image.format not in ANIMATED or not getattr(image, "is_animated", False):
            return None
        size = image.size
        check_size(image.width * image.height)
        plays = image.info.get("loop", 1)
        if image.format == "GIF" and "loop" in image.info:
            plays = plays + 1 if plays else 0  # GIF counts repetitions
        first = int(getattr(image, "default_image", False))
        images: list[Array] = []
        durations: list[float] = []
        turn = orientation(image)
        n_frames = getattr(image, "n_frames", 1)
        drawn: Iterator[Array | None] | None = composed(file) if image.format == "GIF" else None
        for number in range(first, n_frames):
            image.seek(number)
            if drawn is None:
                image.load()
            whole = next(drawn, None) if drawn else np.asarray(to_srgb(image))[: size[1], : size[0]]
            if whole is None:
                raise OSError("the last frame is cut off")
            images.append(upright(whole, turn))
            durations.append(float(image.info.get("duration", 0)))
        return Frames(tuple(alike(images)), tuple(durations), int(plays))


def write_frames(
    path: StrPath,
    frames: Frames,
    *,
    palettes: Bytes | Sequence[Bytes] | None = None,
    metadata: Metadata | None = None,
    overwrite: bool = False,
) -> None:
    """Write an animation atomically, in the format given by the suffix.

    Parameters
    ----------
    path : str or path-like
        Ends in .gif, .png (APNG) or .webp (lossless).
    frames : Frames
        With uint8 images, or (H, W) integer indices if there are palettes.
    palettes : (K, 3) or (K, 4) uint8 array, or one for each frame, 1 <= K <= 256, optional
        Required for .gif, with each color either opaque or fully transparent. A .png is indexed if all frames share one
        palette.
    metadata, overwrite
        As in `write_image`, and so are errors; a .gif stores no metadata.

    Notes
    -----
    Durations are rounded to 1/100 s in a .gif and to 1/1000 s in a .webp. Rounding errors do not accumulate: each frame
    starts within half a unit of its exact time. Longer durations are cut to the maximum of the format: 655 s in a
    .gif, 4.6 h in a .webp and 18 h in a .png.
    """
    suffix = check_choice(f"{path}: suffix", Path(path).suffix.lower(), FRAME_WRITERS)
    with writing(path, overwrite=overwrite, through=ValueError) as file:
        file.write(encode_frames(suffix, frames, palettes, metadata))


def encode_frames(
    suffix: str, frames: Frames, palettes: Bytes | Sequence[Bytes] | None = None, metadata: Metadata | None = None
) -> bytes:
    """Encode an animation as the bytes of the file that `write_frames` would write."""
    buffer = BytesIO()
    cels = _cels(frames.images, palettes, indexed_png=suffix == ".png")
    FRAME_WRITERS[suffix](buffer, cels, frames.durations, frames.plays, metadata or Metadata())
    return buffer.getvalue()


def alike(images: list[Array]) -> list[Array]:
    """Convert uint8 images to the same channels: three or four, opaque where there was no alpha, unless all are gray.

    Alpha is dropped if every pixel is opaque.
    """
    if all(image.ndim == 2 for image in images):
        return images
    colors = [np.dstack([image] * 3) if image.ndim == 2 else image for image in images]
    opaque = np.uint8(255)
    if all((image[..., 3:] == opaque).all() for image in colors):
        return [np.ascontiguousarray(image[..., :3]) for image in colors]
    full = (np.full((*image.shape[:2], 4 - image.shape[2]), opaque) for image in colors)
    return [np.concatenate([image, alpha], axis=2) for image, alpha in zip(colors, full, strict=True)]


def _cels(images: Sequence[Array], palettes: Bytes | Sequence[Bytes] | None, *, indexed_png: bool) -> list[Cel]:
    if palettes is None:
        eight = all(image.dtype == np.uint8 and image.shape[2:] in ((), (3,), (4,)) for image in images)
        check_that("images without palettes", eight, "be (H, W), (H, W, 3) or (H, W, 4) uint8")
        return [Cel(image, None) for image in images]
    shared = isinstance(palettes, np.ndarray)
    each = [palettes] if isinstance(palettes, np.ndarray) else list(palettes)
    if all(palette.ndim == 2 and palette.shape[1] in (3, 4) for palette in each):  # else `check_indexed` rejects them
        each = [palette[0] for palette in alike([palette[np.newaxis] for palette in each])]
    each *= len(images) if shared else 1  # the same object, which tells a writer that it is shared
    one_each = f"be one for each of the {len(images)} frames, or one array"
    check_that(f"{len(each)} palettes", len(each) == len(images), one_each)
    for image, palette in zip(images, each, strict=True):
        check_indexed(image, palette)
    colored = indexed_png and not shared  # a PNG holds only one palette
    pairs = zip(images, each, strict=True)
    return [Cel(palette[image], None) if colored else Cel(image, palette) for image, palette in pairs]

"""Quantize a file into another, in the way that suits it: an image, an animation, pages, or bands of a large image."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_choice
from cvtimg._shared.choices import Arguments
from cvtimg._shared.messages import warn
from cvtimg._shared.pixels import AlphaArray, are_shades, with_mark
from cvtimg.colors.spaces import to_depth
from cvtimg.files.whole import StrPath
from cvtimg.pictures.files import Metadata, read_metadata
from cvtimg.pictures.formats.animated import FRAME_WRITERS
from cvtimg.pictures.pages import PAGE_SUFFIXES
from cvtimg.pictures.stacks import Stack, open_stack
from cvtimg.pictures.tiles import TILED_SUFFIXES, needs_tiles
from cvtimg.quantization.dithering import blue_noise_mask
from cvtimg.quantization.driver import QuantizeOptions, quantized
from cvtimg.quantization.images import PictureSource, as_seen
from cvtimg.quantization.looks import MAX_ENTRIES
from cvtimg.quantization.series import QuantizedSeries, SeriesSource
from cvtimg.quantization.tiled import TiledSource

_OF_ONE_IMAGE = ("weights", "n_colors='auto'", "optimize")
_OF_PICTURES = ("max_bytes", *_OF_ONE_IMAGE, "depth")
#: Options that files of a kind cannot have, and why.
_UNFIT = {
    "image": ((), ""),
    "frames": ((*_OF_ONE_IMAGE, "depth='16'"), "is an animation, which {} cannot be used for"),
    "pages": (_OF_PICTURES, "has several pages, which {} cannot be used for"),
    "tiles": (
        ("psnr", *_OF_PICTURES, "ramp", "quality", "goal='eyes'", "dither", "keep_metadata"),
        "is read in tiles, and {} needs the whole image in memory",
    ),
}


class UnfitOptionError(ValueError):
    """A file is of a kind that an option, named `option`, is not for; `reason` says so with {} in its place."""

    def __init__(self, option: str, reason: str) -> None:
        super().__init__(reason.format(option))
        self.option, self.reason = option, reason


@dataclass(frozen=True, slots=True)
class Reading:
    """What of a file is quantized.

    Attributes
    ----------
    mask : path or None
        Image of the same size, whose black pixels are left out: they have no influence and keep their value, or become
        transparent in 8-bit gray and RGB. For several images it may have as many.
    nodata : float or None
        Pixels with this value in all bands are left out, as are those that are NaN or infinite; by default what the
        file declares. If it declares the same value, they keep it.
    depth : {"8", "16"} or None
        Bits per sample to work and write with; by default those of the image, and for eyes 8 instead of 16.
    alpha_threshold : float or "dither"
        Where the target is a .gif, pixels of less alpha, in 0..1, become transparent, and the others opaque; "dither"
        takes as many as the alpha tells, in a pattern.
    matte : three numbers or None
        Color, in 0..255, that half-transparent pixels that become opaque lie on; by default they get their own color.
    weights : (H, W) array or None
        As in `quantize`.
    tiles : bool or None
        Read in tiles; by default a Zarr array, or from TIFF to TIFF an image of more than 2^26 pixels.
    max_pixels : int or None
        Refuse images of more pixels.
    """

    mask: StrPath | None = None
    nodata: float | None = None
    depth: Literal["8", "16"] | None = None
    alpha_threshold: float | Literal["dither"] = 0.5
    matte: ArrayLike | None = None
    weights: ArrayLike | None = None
    tiles: bool | None = None
    max_pixels: int | None = None


@dataclass(frozen=True, slots=True)
class Writing:
    """How a quantized file is written.

    Attributes
    ----------
    save_palette : path or None
        Palette file to write too.
    keep_metadata : bool
        Keep the color profile, resolution, EXIF and georeference.
    optimize : bool
        Make PNG files smaller with oxipng.
    overwrite : bool
        Replace existing files.
    """

    save_palette: StrPath | None = None
    keep_metadata: bool = False
    optimize: bool = False
    overwrite: bool = False


_READING, _WRITING = Reading(), Writing()


def quantize_file(
    source: StrPath,
    target: StrPath,
    how: QuantizeOptions,
    *,
    reading: Reading = _READING,
    writing: Writing = _WRITING,
    on_stage: Callable[[str], None] | None = None,
) -> QuantizedSeries:
    """Quantize an image file: a single image, an animation, pages, or an image of any size.

    Animations stay animations in .gif, .png and .webp, and pages of TIFF stay pages, with one palette for all. Large
    images get the palette of the whole image, so there are no seams; memory does not grow with them: a few bands of
    about 2^23 pixels, or of one row of tiles if that is more, and at most 2^22 distinct colors,
    beyond which neighbors are merged: under 2 GiB for RGB.

    Parameters
    ----------
    source : path
        Any file that `read_image`, `read_frames`, `read_pages` or `open_bands` reads.
    target : path
        The suffix selects the format; of an image in tiles, .tif, .tiff or .zarr. Up to 256 colors of 8 bits are
        written indexed where the format allows. A TIFF keeps the georeference.
    how : QuantizeOptions
        What is wanted; if nothing is said, the goal "eyes" for shades as screens show them, and for measurements, such
        as heights, counts of few bits of 16 and what leaves 0..1, 256 colors of least error. Given colors of 8 or 16
        bits are brought to the depth of the image. An indexed image of at most `n_colors` colors keeps its palette.
        The bytes that count are those of the target.
    reading : Reading
        What of the file is quantized.
    writing : Writing
        How it is written.
    on_stage : callable, optional
        Called with "read", "cluster" and "write" after each of these, or with "all" for an image in tiles.

    Returns
    -------
    QuantizedSeries

    Raises
    ------
    UnfitOptionError
        If an option is not for files of this kind.
    OSError
        If a file cannot be read or written.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg import read_image, write_image
    >>> from cvtimg.quantization import QuantizeOptions, quantize_file
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.array([[[10, 12, 200], [11, 202, 201], [12, 12, 200]]], np.uint8))
    ...     result = quantize_file(f"{folder}/a.png", f"{folder}/b.png", QuantizeOptions(2))
    ...     read_image(f"{folder}/b.png").tolist(), result.energy
    ([[[11, 12, 200], [11, 202, 201], [11, 12, 200]]], 2.0)
    """
    target, lap = Path(target), on_stage or (lambda stage: None)
    smallest = how.n_colors is None and how.palette is None  # no index is asked for
    how = replace(how, suffix=target.suffix.lower())
    if how.has_aim:
        how = how.aimed()
        how.check(weights=reading.weights)
    in_tiles = needs_tiles(source, target) if reading.tiles is None else reading.tiles
    keep_profile = writing.keep_metadata and how.palette is None and how.locked is None  # given colors are in sRGB
    opened: Arguments = {"tiles": in_tiles, "keep_profile": keep_profile, "max_pixels": reading.max_pixels}
    stack = open_stack(source, reading.mask, reading.nodata, frames=how.suffix in FRAME_WRITERS, **opened)
    if not how.has_aim:
        how = replace(how, goal="eyes").aimed() if _for_screens(stack) else replace(how, n_colors=MAX_ENTRIES)
        if how.goal == "error":
            warn(f"measurements, not shades of a screen: {MAX_ENTRIES} colors of least error; see goal='eyes'")
    smallest = smallest and how.goal == "eyes"
    _check_fit(stack, target, how, reading, writing)
    if how.suffix == ".gif":
        stack = _without_half_transparency(stack, reading)
    elif reading.matte is not None or reading.alpha_threshold != _READING.alpha_threshold:
        warn("half transparency is kept: a threshold of alpha and a matte are for .gif files")
    if stack.kind == "tiles":
        how = _at_depth(how, stack.content.form.dtype)
        result = QuantizedSeries.of(quantized(TiledSource(stack, target, writing.overwrite), how), "tiles")
        _write_palette(writing, result)
        lap("all")
        return result
    masks, metadata, kept = stack.masks, _metadata(source, target, stack, reading, writing, keep_profile), None
    work: Any
    if stack.kind == "image":
        depth = reading.depth
        if depth is None and how.goal == "eyes" and stack.content.dtype == np.uint16 and stack.nodata is None:
            depth = "8"
            warn("16 bits per channel become 8, which screens show; depth 16 keeps them")
        image = to_depth(stack.content, np.dtype(f"uint{depth}")) if depth else stack.content
        image = as_seen(image) if how.space != "rgb" else image
        how, mask = _at_depth(how, image.dtype), masks and masks[0]
        work = PictureSource(image, None, mask, reading.weights, how.suffix, metadata, smallest)
        if stack.header and stack.header.mode == "P" and how.palette is None:
            from cvtimg.palettes.files import read_palette

            kept = work.kept(read_palette(source), how)
    else:
        keeps_nodata = reading.nodata is None and stack.nodata is not None
        how = _at_depth(how, stack.content.images[0].dtype)
        work = SeriesSource(stack.content, how, None, masks, metadata, keeps_nodata=keeps_nodata)
        how = work.how
    lap("read")
    content = kept if kept is not None and how.goal == "error" else quantized(work, how)
    content = kept if kept is not None and not content.energy else content
    lap("cluster")
    stack.write(target, **work.stored(content), optimize=writing.optimize, overwrite=writing.overwrite)
    result = content if isinstance(content, QuantizedSeries) else QuantizedSeries.of(content, "image")
    _write_palette(writing, result)
    lap("write")
    return result


def _for_screens(stack: Stack) -> bool:
    """Whether the known samples of the first page are shades."""
    if stack.kind == "tiles":
        return bool(stack.content.form.dtype == np.uint8)
    image = stack.content if stack.kind == "image" else stack.content.images[0]
    colors = image[..., :-1] if isinstance(image, AlphaArray) else image
    if stack.masks and stack.masks[0] is not None:
        colors = colors[stack.masks[0]]
    return are_shades(colors)


def _check_fit(stack: Stack, target: Path, how: QuantizeOptions, reading: Reading, writing: Writing) -> None:
    """Refuse what files of a kind cannot have, and targets that cannot hold them."""
    records = how, reading, writing
    values = [(field.name, getattr(record, field.name)) for record in records for field in fields(record)]
    given = {name for name, value in values if value is not None and value is not False}
    given |= {f"{name}={value!r}" for name, value in values if isinstance(value, str)}
    options, reason = _UNFIT[stack.kind]
    for option in (option for option in options if option in given):
        raise UnfitOptionError(option, reason)
    if stack.kind == "tiles":
        check_choice(f"{target}: suffix", how.suffix, TILED_SUFFIXES)
    if stack.kind == "pages" and how.suffix not in PAGE_SUFFIXES:
        raise ValueError(f"has several pages: name an output that can hold them, -o FILE.tif, and not {target.name}")


def _without_half_transparency(stack: Stack, reading: Reading) -> Stack:
    """Return images or frames whose pixels are either transparent or opaque, as a GIF has them."""
    if stack.kind not in ("image", "frames"):
        return stack
    images = stack.content.images if stack.kind == "frames" else [stack.content]
    if images[0].dtype not in (np.uint8, np.uint16) or images[0].shape[2:] != (4,):
        return stack
    white = np.iinfo(images[0].dtype).max
    if not any(((image[..., 3] > 0) & (image[..., 3] < white)).any() for image in images):
        return stack
    told, limits = "by a pattern", (blue_noise_mask() + 0.5) / 16
    if reading.alpha_threshold != "dither":
        told, limits = f"below {reading.alpha_threshold:.0%} alpha", np.full((1, 1), reading.alpha_threshold)
    warn(f"half-transparent pixels become transparent {told}, else opaque")
    hard = []
    for image in images:
        share = image[..., 3:] / white
        matte = image[..., :3] if reading.matte is None else np.asarray(reading.matte) * (white / 255)
        colors = image[..., :3] * share + matte * (1 - share)
        wide = np.resize(np.arange(len(limits)), share.shape[0]), np.resize(np.arange(limits.shape[1]), share.shape[1])
        stays = (share > 0) & (share >= limits[np.ix_(*wide)][..., None])
        pixels = np.append(np.rint(colors), np.full_like(share, white), axis=2) * stays
        hard.append(with_mark(pixels.astype(image.dtype), True))
    return replace(stack, content=replace(stack.content, images=tuple(hard)) if stack.kind == "frames" else hard[0])


def _at_depth(how: QuantizeOptions, dtype: np.dtype[np.generic]) -> QuantizeOptions:
    """Return options with given colors of 8 or 16 bits brought to the depth of an image."""
    given = {"palette": how.palette, "locked": how.locked}
    deep = {name: some for name, some in given.items() if getattr(some, "dtype", None) in (np.uint8, np.uint16)}
    colors: dict[str, Any] = {name: to_depth(np.asarray(some), dtype) for name, some in deep.items()}
    return replace(how, **colors)


def _write_palette(writing: Writing, result: QuantizedSeries) -> None:
    """Write the palette, with the number of pixels of each color."""
    if writing.save_palette is not None:
        from cvtimg.palettes.files import write_palette

        indices = [image.indices.ravel() for image in result.results if image.indices is not None]
        density = np.bincount(np.concatenate(indices), minlength=len(result.palette)) if indices else None
        write_palette(writing.save_palette, result.palette, density=density, overwrite=writing.overwrite)


def _metadata(
    source: StrPath, target: Path, stack: Stack, reading: Reading, writing: Writing, keep_profile: bool
) -> Metadata | None:
    """Return what to keep of a file: in any case what tells where its pixels are, how large, and which are nodata."""
    if stack.kind != "image":
        return read_metadata(source) if writing.keep_metadata and stack.kind == "frames" else None
    of_file = stack.masks is not None and reading.nodata is None and not reading.depth
    tiffs = {Path(path).suffix.lower() for path in (source, target)} <= {".tif", ".tiff"}
    nodata = stack.nodata if of_file and tiffs else None
    if writing.keep_metadata:
        return replace(read_metadata(source, keep_profile=keep_profile), nodata=nodata)
    if not tiffs:
        return None
    whole = read_metadata(source)
    return replace(whole, icc=None, exif=None, nodata=nodata, dpi=whole.dpi if whole.scale else None)

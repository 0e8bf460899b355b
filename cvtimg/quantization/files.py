"""Quantize a file into another, in the way that suits it: an image, an animation, pages, or strips of a large image."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_keywords, check_one_of
from cvtimg._shared.choices import DitherName, GoalName, SpaceName
from cvtimg.colors.fidelity import Fidelity
from cvtimg.colors.spaces import to_depth
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.engine.tessellation import Tessellation
from cvtimg.files.whole import StrPath
from cvtimg.palettes.files import read_palette, write_palette
from cvtimg.pictures.files import ImageInfo, Metadata, image_info, read_image, read_metadata, write_image
from cvtimg.pictures.formats.animated import FRAME_WRITERS
from cvtimg.pictures.formats.encoding import as_stored, encode_image
from cvtimg.pictures.formats.opening import pixels_limited
from cvtimg.pictures.frames import ANIMATED, read_frames, write_frames
from cvtimg.pictures.known import known_in_all, known_pixels
from cvtimg.pictures.pages import PAGE_SUFFIXES, read_pages, write_pages
from cvtimg.pictures.tiles import TILED_SUFFIXES, needs_tiles
from cvtimg.quantization.animations import MOST_INDEXED, Film, QuantizedFrames
from cvtimg.quantization.driver import QuantizeOptions, for_eyes, quantized
from cvtimg.quantization.images import PictureSource, quantized_picture, to_size
from cvtimg.quantization.palette_search import EngineOptions
from cvtimg.quantization.remapping import Quantized
from cvtimg.quantization.tiled import Strips

__all__ = ["QuantizedFile", "UnfitOptionError", "quantize_file"]

#: Options that need a single image, and those that need all of it in memory.
_OF_ONE_IMAGE = ("weights", "n_colors='auto'", "optimize")
_OF_PICTURES = ("max_bytes", *_OF_ONE_IMAGE, "depth")
_IN_MEMORY = ("psnr", *_OF_PICTURES, "ramp", "quality", "goal='eyes'", "dither", "keep_metadata")


class UnfitOptionError(ValueError):
    """A file is of a kind that an option, named `option`, is not for; `reason` says so with {} in its place."""

    def __init__(self, option: str, reason: str) -> None:
        super().__init__(reason.format(option))
        self.option, self.reason = option, reason


@dataclass(frozen=True, slots=True, eq=False)
class QuantizedFile(Fidelity):
    """What is known of a file that was quantized.

    Attributes
    ----------
    kind : {"image", "frames", "pages", "tiles"}
        What the file holds, or that it was read in tiles.
    n_images : int
        Number of frames or pages, or 1.
    shape : tuple of int
        Shape of the (first) image: (H, W) or (H, W, C).
    palette : (K, C) array
        The palette, or that of the first image if each has its own.
    n_colors : int
        Size of the largest palette.
    energy : float
        As in `Quantized`, over all images; exact even if `exact` is false.
    n_values : int
        Number of samples that count: pixels times channels without alpha.
    n_left_out : int
        Number of pixels that do not count.
    n_distinct : int
        Number of distinct colors of the original; as in `QuantizedFrames` if each image has its own palette, and if
        `exact` is false, the largest number held at a time.
    exact : bool
        Whether the palette was found from all distinct colors. Beyond 2^22, neighboring colors were merged first.
    tessellations : tuple of Tessellation
        Of each palette that was found for more colors than it has.
    curve : EnergyCurve or None
        As in `Quantized`.
    alpha : bool
        Whether the last channel is alpha.
    quality : float or None
        As in `Quantized`, or the mean of the frames or pages.
    """

    kind: str
    n_images: int
    shape: tuple[int, ...]
    palette: NDArray[Any]
    n_colors: int
    energy: float
    n_values: int
    n_left_out: int
    n_distinct: int
    exact: bool
    tessellations: tuple[Tessellation, ...]
    curve: EnergyCurve | None
    alpha: bool
    quality: float | None = None

    def __repr__(self) -> str:
        """Tell size, colors and error in one line."""
        shape = " x ".join(map(str, self.shape))
        several = f"{self.n_images} {self.kind} of " if self.n_images > 1 else ""
        return f"QuantizedFile({several}{shape}, {self.n_colors} of {self.n_distinct} colors, PSNR {self.psnr:.2f} dB)"

    @property
    def tessellation(self) -> Tessellation | None:
        """The (first) tessellation; None if there is none."""
        return next(iter(self.tessellations), None)

    @classmethod
    def of(cls, kind: str, results: Sequence[Any], *, shape: tuple[int, ...], n_left_out: int, **given: Any) -> Any:
        """Sum up the results of images."""
        first = results[0]
        values: dict[str, Any] = {
            "energy": sum(one.energy for one in results),
            "n_values": sum(one.n_values for one in results),
            "n_distinct": first.n_distinct,
            "exact": True,
            "curve": getattr(first, "curve", None),
            "quality": getattr(first, "quality", None),
        }
        tessellations = tuple(one.tessellation for one in results if one.tessellation)
        return cls(
            kind=kind,
            n_images=len(results),
            shape=shape,
            palette=first.palette,
            n_colors=max(len(one.palette) for one in results),
            n_left_out=n_left_out,
            tessellations=tessellations,
            alpha=first.alpha,
            **{**values, **given},
        )


def quantize_file(
    source: StrPath,
    target: StrPath,
    n_colors: int | Literal["auto"] | None = None,
    *,
    psnr: float | None = None,
    max_bytes: int | None = None,
    palette: ArrayLike | None = None,
    ramp: bool = False,
    locked: ArrayLike | None = None,
    color_bits: int | Sequence[int] | None = None,
    space: SpaceName = "rgb",
    dither: DitherName | None = None,
    dither_strength: float | None = None,
    weights: ArrayLike | None = None,
    mask: StrPath | None = None,
    nodata: float | None = None,
    depth: Literal["8", "16"] | None = None,
    goal: GoalName = "error",
    quality: float | None = None,
    per_frame: bool = False,
    tiles: bool | None = None,
    save_palette: StrPath | None = None,
    keep_metadata: bool = False,
    optimize: bool = False,
    max_pixels: int | None = None,
    overwrite: bool = False,
    on_stage: Callable[[str], None] | None = None,
    **engine: Unpack[EngineOptions],
) -> QuantizedFile:
    """Quantize an image file: a single image, an animation, pages, or an image of any size.

    Animations stay animations in .gif, .png and .webp, and pages of TIFF stay pages, with one palette for all. Large
    images get the palette of the whole image, so there are no seams; memory does not grow with them: a few strips of
    about 2^23 pixels (`cvtimg.pictures.tiles.BAND_PIXELS`), or of one row of tiles if that is more, and at most 2^22
    distinct colors, beyond which neighbors are merged: under 2 GiB for RGB.

    Parameters
    ----------
    source : path
        Any file that `read_image`, `read_frames`, `read_pages` or `open_bands` reads.
    target : path
        The suffix selects the format; of an image in tiles, .tif, .tiff or .zarr. Up to 256 colors of 8 bits are
        written indexed where the format allows. A TIFF keeps the georeference.
    n_colors, psnr, palette, ramp, locked, color_bits, space, dither, dither_strength, weights, goal, quality
        As in `quantize`; given colors of 8 or 16 bits are brought to the depth of the image. An indexed image of at
        most `n_colors` colors keeps its palette. For eyes, the bytes that count are those of the target, PNG or GIF.
    max_bytes : int, optional
        Use as many colors, up to `n_colors` or 256, as fit into a file of this size. With ``goal="eyes"`` the colors
        stay, as far as bits can be saved in other ways; `quality` is then the most that is aimed at.
    mask : path, optional
        Image of the same size, whose black pixels are left out: they have no influence and keep their value, or become
        transparent in 8-bit gray and RGB. For several images it may have as many.
    nodata : float, optional
        Pixels with this value in all bands are left out, as are those that are NaN or infinite; by default what the
        file declares. If it declares the same value, they keep it.
    depth : {"8", "16"}, optional
        Bits per sample to work and write with; by default those of the image.
    per_frame : bool
        Find a palette for each frame or page.
    tiles : bool, optional
        Read in tiles; by default a Zarr array, or from TIFF to TIFF an image of more than 2^26 pixels.
    save_palette : path, optional
        Palette file to write too.
    keep_metadata : bool
        Keep the color profile, resolution, EXIF and georeference.
    optimize : bool
        Make PNG files smaller with oxipng.
    max_pixels : int, optional
        Refuse images of more pixels.
    overwrite : bool
        Replace existing files.
    on_stage : callable, optional
        Called with "read", "cluster" and "write" after each of these, or with "all" for an image in tiles.
    method, init, effort, volume_power, rng, callback
        As in `quantize`.

    Returns
    -------
    QuantizedFile

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or not for files of this kind; the message names it, its value and what is allowed.
    OSError
        If a file cannot be read or written.

    See Also
    --------
    quantize : An image in memory.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from cvtimg import read_image, write_image
    >>> from cvtimg.quantization import quantize_file
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/a.png", np.array([[[10, 12, 200], [11, 202, 201], [12, 12, 200]]], np.uint8))
    ...     result = quantize_file(f"{folder}/a.png", f"{folder}/b.png", 2)
    ...     read_image(f"{folder}/b.png").tolist(), result.energy
    ([[[11, 12, 200], [11, 202, 201], [11, 12, 200]]], 2.0)
    """
    check_keywords(quantize_file, engine, EngineOptions.__annotations__)
    how = QuantizeOptions(
        n_colors, psnr, palette, locked, color_bits, ramp, space, dither, dither_strength, engine, goal, quality
    ).aimed()
    how = replace(how, coder="lzw" if Path(target).suffix.lower() == ".gif" else "deflate")
    job = _Job(
        Path(source), Path(target), how, max_bytes, weights, mask, nodata, depth, per_frame, save_palette,
        keep_metadata, optimize, max_pixels, overwrite, on_stage or (lambda stage: None),
    )  # fmt: skip
    if max_bytes is None:
        how.check(weights=weights)
    else:
        check_one_of(psnr=psnr, max_bytes=max_bytes, palette=palette)
    if needs_tiles(source, target) if tiles is None else tiles:
        return _in_tiles(job)
    with nullcontext() if max_pixels is None else pixels_limited(max_pixels):
        header = image_info(source)
        if job.target.suffix.lower() in FRAME_WRITERS and header.format in ANIMATED and header.frames > 1:
            return _frames(job, header)
        if header.has_pages:
            return _pages(job, header)
        return _picture(job, header)


@dataclass(frozen=True, slots=True)
class _Job:
    """The arguments of `quantize_file`, by its names."""

    source: Path
    target: Path
    how: QuantizeOptions
    max_bytes: int | None
    weights: ArrayLike | None
    mask: StrPath | None
    nodata: float | None
    depth: Literal["8", "16"] | None
    per_frame: bool
    save_palette: StrPath | None
    keep_metadata: bool
    optimize: bool
    max_pixels: int | None
    overwrite: bool
    lap: Callable[[str], None]

    def refuse(self, options: Sequence[str], reason: str) -> None:
        """Refuse options that are given, but not for files of a kind."""
        given = {
            "psnr": self.how.psnr is not None,
            "max_bytes": self.max_bytes is not None,
            "weights": self.weights is not None,
            "n_colors='auto'": self.how.n_colors == "auto",
            "quality": self.how.quality is not None,
            "goal='eyes'": self.how.goal == "eyes",
            "dither": self.how.dither is not None,
            "ramp": self.how.ramp,
            "depth": self.depth is not None,
            "depth='16'": self.depth == "16",
            "keep_metadata": self.keep_metadata,
            "optimize": self.optimize,
        }
        for option in options:
            if given[option]:
                raise UnfitOptionError(option, reason)

    def at_depth(self, dtype: np.dtype[Any]) -> QuantizeOptions:
        """Return the options with given colors brought to the depth of an image."""
        given = {"palette": self.how.palette, "locked": self.how.locked}
        colors: dict[str, Any] = {name: _at_depth(some, dtype) for name, some in given.items() if some is not None}
        return replace(self.how, **colors)

    def write_palette(self, palette: NDArray[Any], results: Sequence[Quantized]) -> None:
        """Write the palette, with the number of pixels of each color."""
        if self.save_palette is not None:
            counts: Any = sum(np.bincount(one.indices.ravel(), minlength=len(palette)) for one in results)
            density = counts if results else None
            write_palette(self.save_palette, palette, density=density, overwrite=self.overwrite)


def _at_depth(colors: ArrayLike, dtype: np.dtype[Any]) -> ArrayLike:
    has_depth = isinstance(colors, np.ndarray) and colors.dtype in (np.uint8, np.uint16)
    return to_depth(np.asarray(colors), dtype) if has_depth else colors


# --- images larger than memory


def _in_tiles(job: _Job) -> QuantizedFile:
    check_choice(f"{job.target}: suffix", job.target.suffix.lower(), TILED_SUFFIXES)
    job.refuse(_IN_MEMORY, "is read in tiles, and {} needs the whole image in memory")
    strips = Strips(job.source, job.target, job.mask, job.nodata, job.max_pixels, job.overwrite)
    result = quantized(strips, job.at_depth(strips.bands.form.dtype))
    job.write_palette(result.palette, [])
    job.lap("all")
    shape, n_left_out = strips.bands.form.shape, result.n_left_out
    return QuantizedFile.of("tiles", [result], shape=shape, n_left_out=n_left_out, exact=result.exact)


# --- pictures


def _picture(job: _Job, header: ImageInfo) -> QuantizedFile:
    how = job.how
    given_colors = how.palette is not None or how.locked is not None
    keep_profile = job.keep_metadata and not given_colors  # colors that are given are in sRGB
    image = read_image(job.source, keep_profile=keep_profile)
    known = known_pixels(image, header, job.mask, job.nodata)
    mask = None if known.all() else known
    nodata = None if mask is None or job.nodata is not None or job.depth else header.nodata
    file = {"metadata": _metadata(job, keep_profile, nodata), "optimize": job.optimize}
    job.lap("read")
    if job.depth:
        image = to_depth(image, np.dtype(f"uint{job.depth}"))
    hint = read_palette(job.source) if header.mode == "P" and not given_colors else None
    how = job.at_depth(image.dtype)
    source = PictureSource(image, None, mask, None, job.weights)

    def size(result: Quantized) -> int:
        pixels, how_stored = _content(result, file)
        return len(encode_image(job.target.suffix, as_stored(pixels, job.target.suffix)[0], **how_stored))

    if job.max_bytes is None:
        result = quantized_picture(source, how, hint)
    else:
        most: Any = how.n_colors or MOST_INDEXED
        result = to_size(source, how, job.max_bytes, size, most)
    job.lap("cluster")
    pixels, how_stored = _content(result, file)
    n_colors = len(result.palette) + (result.inside is not None)
    if job.target.suffix.lower() == ".gif" and n_colors > MOST_INDEXED:
        raise ValueError(f".gif holds images of at most {MOST_INDEXED} colors, and this one has {n_colors}")
    stored, notes = as_stored(pixels, job.target.suffix)
    for note in notes:
        warnings.warn(note, UserWarning, stacklevel=3)
    write_image(job.target, stored, **how_stored, overwrite=job.overwrite)
    job.write_palette(result.palette, [result])
    job.lap("write")
    n_left_out = 0 if mask is None else int((~mask).sum())
    return QuantizedFile.of("image", [result], shape=image.shape, n_left_out=n_left_out)


def _metadata(job: _Job, keep_profile: bool, nodata: float | None) -> Metadata | None:
    """Return what to keep of a file: in any case what tells where its pixels are, how large, and which are nodata."""
    tiffs = {path.suffix.lower() for path in (job.source, job.target)} <= {".tif", ".tiff"}
    if job.keep_metadata:
        return replace(read_metadata(job.source, keep_profile=keep_profile), nodata=nodata if tiffs else None)
    if not tiffs:
        return None
    found = read_metadata(job.source)
    return Metadata(geo=found.geo, nodata=nodata, dpi=found.dpi if found.scale else None, scale=found.scale)


def _content(result: Quantized, file: Mapping[str, Any]) -> tuple[NDArray[Any], dict[str, Any]]:
    """Return the pixels of a file, and how they are stored; where nodata is kept, they are not indexed."""
    pixels, palette = result.content
    metadata: Metadata | None = file["metadata"]
    if metadata and metadata.nodata is not None:
        if (result.palette == metadata.nodata).all(axis=1).any():  # a color would become nodata
            metadata = replace(metadata, nodata=None)
        else:
            n_channels = result.palette.shape[1]
            pixels, palette = result.image, None
            pixels = pixels[..., 0] if pixels.ndim == 3 and n_channels == 1 else pixels
    alpha = result.alpha if palette is None and pixels.ndim == 3 else None
    return pixels, {**file, "metadata": metadata, "palette": palette, "alpha": alpha}


# --- frames of animations


def _frames(job: _Job, header: ImageInfo) -> QuantizedFile:
    job.refuse((*_OF_ONE_IMAGE, "depth='16'"), "is an animation, which {} cannot be used for")
    frames = read_frames(job.source)
    metadata = read_metadata(job.source) if job.keep_metadata else None
    known = known_in_all(frames.images, header, job.mask, job.nodata, "frame")
    how, masks = job.at_depth(frames.images[0].dtype), None if all(one.all() for one in known) else known
    aims = how.psnr is not None or job.max_bytes is not None
    if how.palette is None and (how.n_colors is not None or aims):
        n_colors: Any = how.n_colors or MOST_INDEXED
        # One more is transparent: pixels that are left out, or that stay as they were.
        needs_clear = masks is not None or how.goal == "eyes"
        how = replace(how, n_colors=min(n_colors, MOST_INDEXED - 1) if needs_clear else n_colors)
    film = Film(frames, job.per_frame, None, masks)
    job.lap("read")

    def write(path: Path, result: QuantizedFrames, overwrite: bool) -> None:
        shown, palettes = result.content
        write_frames(path, shown, palettes=palettes, metadata=metadata, overwrite=overwrite)

    with TemporaryDirectory(prefix="cvtimg-") if job.max_bytes is not None else nullcontext("") as folder:

        def size(result: QuantizedFrames) -> int:
            trial = Path(folder, f"trial{job.target.suffix}")
            write(trial, result, True)
            return trial.stat().st_size

        largest: Any = how.n_colors
        if job.max_bytes is None:
            result = for_eyes(film, how) if how.goal == "eyes" else quantized(film, how)
        else:
            result = to_size(film, how, job.max_bytes, size, largest)
    job.lap("cluster")
    write(job.target, result, job.overwrite)
    job.write_palette(result.palette, result.results)
    job.lap("write")
    return _of_several("frames", result, frames.images[0].shape, known)


def _of_several(
    kind: str, result: QuantizedFrames, shape: tuple[int, ...], known: Sequence[NDArray[np.bool_]]
) -> QuantizedFile:
    n_left_out = sum(int((~one).sum()) for one in known)
    of_all: dict[str, Any] = {"n_distinct": result.n_distinct, "quality": result.quality}
    return QuantizedFile.of(kind, result.results, shape=shape, n_left_out=n_left_out, **of_all)


# --- pages


def _pages(job: _Job, header: ImageInfo) -> QuantizedFile:
    job.refuse(_OF_PICTURES, "has several pages, which {} cannot be used for")
    if job.target.suffix.lower() not in PAGE_SUFFIXES:
        name = job.target.name
        raise ValueError(f"has several pages: name an output that can hold them, -o FILE.tif, and not {name}")
    pages = read_pages(job.source).joined()
    known = known_in_all(pages.images, header, job.mask, job.nodata, "page")
    job.lap("read")
    masks = None if all(one.all() for one in known) else known
    film, how = Film(pages, job.per_frame, None, masks), job.at_depth(pages.images[0].dtype)
    if how.psnr is not None and how.n_colors is None:
        how = replace(how, n_colors=MOST_INDEXED)
    result = for_eyes(film, how) if how.goal == "eyes" else quantized(film, how)
    job.lap("cluster")
    stored, palette = result.stored(pages, keeps_nodata=job.nodata is None and header.nodata is not None)
    write_pages(job.target, stored, palette=palette, overwrite=job.overwrite)
    job.write_palette(result.palette, result.results)
    job.lap("write")
    return _of_several("pages", result, pages.images[0].shape, known)

"""Animations, pages and files in few colors, with one palette for all images or one for each."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_keywords
from cvtimg._shared.choices import DitherName, GoalName, Row, SpaceName
from cvtimg._shared.types import Array, Bools, Bytes
from cvtimg.colors.samples import color_samples, merge_samples
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.engine.tessellation import Tessellation
from cvtimg.files.whole import StrPath
from cvtimg.pictures.formats.metadata import Metadata
from cvtimg.pictures.frames import Frames, encode_frames, write_frames
from cvtimg.pictures.pages import Pages, encode_pages, write_pages
from cvtimg.quantization.driver import QuantizeOptions, Source, quantized
from cvtimg.quantization.looks import MAX_ENTRIES, Below
from cvtimg.quantization.palette_search import EngineOptions, Palette
from cvtimg.quantization.remapping import Fidelity, Quantized, Storing, keep_outside, map_samples


@dataclass(frozen=True, slots=True, eq=False)
class QuantizedSeries(Fidelity):
    """The images of a file in few colors.

    Attributes
    ----------
    results : tuple of Quantized
        Each image.
    kind : {"image", "frames", "pages", "tiles"}
        What they are: an image, frames of an animation, pages, or an image that was read in tiles.
    n_distinct : int
        Number of distinct colors of all images; if each has its own palette, of the image with the most.
    quality, content_quality : float or None
        The mean `cvtimg.visual_quality` and `cvtimg.content_quality` of the images, where these were asked for.
    original : Frames, Pages or None
        The frames or pages as they were.
    """

    results: tuple[Quantized, ...]
    kind: str
    n_distinct: int
    quality: float | None = None
    content_quality: float | None = None
    original: Frames | Pages | None = None

    @classmethod
    def of(cls, result: Quantized, kind: str) -> QuantizedSeries:
        """Return the series of a single image."""
        return cls((result,), kind, result.n_distinct, result.quality, result.content_quality)

    def __repr__(self) -> str:
        """Tell sizes, colors and error in one line."""
        shape = " x ".join(map(str, self.results[0].shape))
        several = f"{len(self.results)} {self.kind} of " if len(self.results) > 1 else ""
        colors = f"{self.n_colors} of {self.n_distinct} colors"
        return f"QuantizedSeries({several}{shape}, {colors}, PSNR {self.psnr:.2f} dB)"

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the animation or the pages, as `cvtimg.pictures.write_frames` and `write_pages` do, or the image."""
        if isinstance(self.original, Pages):
            images, palette, alpha = self.stored(self.original)
            pages = replace(self.original, images=images, has_alpha=alpha)
            write_pages(path, pages, palette=palette, overwrite=overwrite)
        elif self.original is None:
            self.results[0].save(path, overwrite=overwrite)
        else:
            frames, palettes = self.content
            write_frames(path, frames, palettes=palettes, overwrite=overwrite)

    def stored(self, pages: Pages, *, keeps_nodata: bool = False) -> tuple[tuple[Array, ...], Bytes | None, bool]:
        """Return pages as they are written: indices and their palette, or colors; and whether they have alpha."""
        left_out, first = any(one.inside is not None for one in self.results), self.palette
        shared = all(np.array_equal(one.palette, first) for one in self.results)
        keeps, indexed = keeps_nodata or pages.is_joined, shared and not pages.is_joined
        storing = Storing.of(first, left_out=left_out, keeps_nodata=keeps, indexed=indexed)
        images = tuple(one.stored(storing) for one in self.results)
        return images, first if storing.indexed else None, storing.clears or (pages.has_alpha and not storing.indexed)

    @property
    def content(self) -> tuple[Frames, Bytes | Sequence[Bytes] | None]:
        """What `write_frames` takes: frames of indices and their palettes, or frames of colors and None."""
        contents = [result.content for result in self.results]
        frames = self.original if isinstance(self.original, Frames) else Frames((contents[0][0],), (0.0,), 1)
        palettes = [palette for _, palette in contents if palette is not None]
        if len(palettes) < len(contents):
            pictures = tuple(pixels if palette is None else palette[pixels] for pixels, palette in contents)
            return replace(frames, images=pictures), None
        shared = all(np.array_equal(palette, palettes[0]) for palette in palettes)
        return replace(frames, images=tuple(pixels for pixels, _ in contents)), palettes[0] if shared else palettes

    @property
    def energy(self) -> float:
        """Sum of the energies of the images."""
        return sum(result.energy for result in self.results)

    @property
    def n_values(self) -> int:
        """Number of samples that count, of all images."""
        return sum(result.n_values for result in self.results)

    @property
    def palette(self) -> Array:
        """The palette of the first image, and of all if they share it."""
        return self.results[0].palette

    @property
    def n_colors(self) -> int:
        """Size of the largest palette."""
        return max(len(one.palette) for one in self.results)

    @property
    def tessellations(self) -> tuple[Tessellation, ...]:
        """Those of each palette that was found for more colors than it has."""
        return tuple(one.tessellation for one in self.results if one.tessellation)

    @property
    def curve(self) -> EnergyCurve | None:
        """As in `Quantized`."""
        return self.results[0].curve

    def summary(self) -> Row:
        """Return the figures that commands and reports show."""
        first = self.results[0]
        return {
            "width": first.shape[1],
            "height": first.shape[0],
            "channels": first.palette.shape[1],
            **({self.kind: len(self.results)} if self.kind in ("frames", "pages") else {}),
            "left_out": sum(one.n_left_out for one in self.results),
            "distinct_colors": self.n_distinct,
            **({"exact": first.exact} if self.kind == "tiles" else {}),
            "k": self.n_colors,
            **({} if self.kind == "tiles" else {"elbow": self.curve.elbows() if self.curve else None}),
            "energy": self.energy,
            "mse": self.mse,
            "psnr": self.psnr if math.isfinite(self.psnr) else None,  # JSON has no infinity
            **({} if self.quality is None else {"goal": "eyes", "quality": self.quality}),
            **({} if self.content_quality is None else {"content_quality": self.content_quality}),
            "n_iter": max((one.n_iter for one in self.tessellations), default=0),
            "converged": all(one.converged for one in self.tessellations),
        }


def quantize_frames(
    frames: Frames | Pages,
    n_colors: int | None = None,
    *,
    psnr: float | None = None,
    max_bytes: int | None = None,
    per_frame: bool = False,
    alpha: bool | None = None,
    masks: Sequence[ArrayLike | None] | None = None,
    space: SpaceName = "rgb",
    palette: ArrayLike | None = None,
    ramp: bool = False,
    locked: ArrayLike | None = None,
    color_bits: int | Sequence[int] | None = None,
    dither: DitherName | None = None,
    dither_strength: float | None = None,
    goal: GoalName = "error",
    quality: float | tuple[float, float] | None = None,
    **engine: Unpack[EngineOptions],
) -> QuantizedSeries:
    """Find the palette that represents all frames of an animation with the least error, or one for each frame.

    Pages of a file, as of a TIFF, count as frames; the result is saved as pages again.

    A palette for all frames is that of an image with the frames side by side: the densities of their colors add.

    Parameters
    ----------
    frames : Frames or Pages
        From `read_frames` or `read_pages`.
    n_colors : int
        Size of a palette, in 1..65536; a .gif holds up to 256. With `psnr` and `max_bytes`, optional and the maximum
        size, by default 256. Not allowed with `palette`.
    psnr : float, optional
        Use the fewest colors that reach this quality in dB, over all frames.
    max_bytes : int, optional
        Use the most colors whose .gif has at most this size.
    per_frame : bool
        Find a palette for each frame. This lowers the error, but colors that stand still may change between frames.
    alpha : bool, optional
        Whether the last channel is alpha; by default if there are four channels, or if the pages say so.
    masks : sequence of (H, W) array or None, optional
        For each frame, the pixels to quantize: those where the mask is not 0. The others have no influence, keep their
        value, and become transparent in indexed files.
    space, palette, ramp, locked, color_bits, dither, dither_strength, method, init, effort, volume_power, rng, callback
        As in `quantize`. Error diffusion flickers where the frames stand still; ordered dithering does not.
    goal, quality
        As in `quantize`, for the bytes of a .gif; the quality is the mean of the frames, and without one bits have a
        fixed price. An animation then has at most 255 colors; one more can stand for what stays from the frame before.

    Returns
    -------
    QuantizedSeries

    Examples
    --------
    >>> from cvtimg import quantize_frames
    >>> from cvtimg.pictures import Frames
    >>> frames = Frames(tuple(np.full((2, 3), level, np.uint8) for level in (10, 12, 200)), (40, 40, 40), 0)
    >>> result = quantize_frames(frames, 2)
    >>> [int(one.image[0, 0]) for one in result.results]
    [11, 11, 200]
    """
    check_keywords(quantize_frames, engine, EngineOptions.__annotations__)
    how = QuantizeOptions(
        n_colors, psnr=psnr, max_bytes=max_bytes, palette=palette, locked=locked, color_bits=color_bits, ramp=ramp,
        space=space, dither=dither, dither_strength=dither_strength, goal=goal, quality=quality, per_frame=per_frame,
        engine=engine, suffix=".gif",
    ).aimed()  # fmt: skip
    how.check()
    source = SeriesSource(frames, how, alpha, masks)
    found: QuantizedSeries = quantized(source, source.how)
    return found


class SeriesSource(Source):
    """The frames of an animation, or pages: a `Source` of their palettes; of a file, also what to keep of that."""

    def __init__(
        self,
        frames: Frames | Pages,
        how: QuantizeOptions,
        alpha: bool | None = None,
        masks: Sequence[ArrayLike | None] | None = None,
        metadata: Metadata | None = None,
        *,
        keeps_nodata: bool = False,
    ) -> None:
        if how.palette is None:
            # One is transparent: pixels that are left out, or that stay as they were.
            has_clear = isinstance(frames, Frames) and (masks is not None or how.goal == "eyes")
            n_colors: Any = how.n_colors or MAX_ENTRIES
            how = replace(how, n_colors=min(n_colors, MAX_ENTRIES - 1) if has_clear else n_colors)
        self.how, self._keeps_nodata = how, keeps_nodata
        n_frames = len(frames.images)
        masks = [None] * n_frames if masks is None else list(masks)
        if len(masks) != n_frames:
            raise ValueError(f"masks must be {n_frames}, one for each frame, not {len(masks)}")
        usual = frames.has_alpha if isinstance(frames, Pages) else frames.images[0].shape[2:] == (4,)
        has_alpha = usual if alpha is None else alpha
        self._frames, self._metadata, self._suffix = frames, metadata, how.suffix
        pairs = zip(frames.images, masks, strict=True)
        self._samples = [color_samples(image, alpha=has_alpha, mask=mask) for image, mask in pairs]
        self.counted = self._samples if how.per_frame else [merge_samples(self._samples)]
        self.images, self.n_pixels = frames.images, sum(samples.inverse.size for samples in self._samples)

    def size(self, result: QuantizedSeries) -> int:
        """Return the bytes of its animation, or of its pages."""
        if isinstance(self._frames, Pages):
            content = io.BytesIO()
            images, palette, alpha = self.stored(result).values()
            encode_pages(content, replace(self._frames, images=tuple(images), has_alpha=bool(alpha)).parted(), palette)
            return content.tell()
        frames, palettes = result.content
        return len(encode_frames(self._suffix, frames, palettes, self._metadata))

    def stored(self, result: QuantizedSeries) -> dict[str, Any]:
        """Return what a file of them holds."""
        if isinstance(self._frames, Pages):
            images, palette, alpha = result.stored(self._frames, keeps_nodata=self._keeps_nodata)
            return {"images": images, "palette": palette, "alpha": alpha}
        frames, palettes = result.content
        return {"images": frames.images, "palette": palettes, "metadata": self._metadata}

    def mapped(self, palettes: Sequence[Palette], how: QuantizeOptions) -> QuantizedSeries:
        """Map each frame to its palette, or to the one of all."""
        # A given palette may need a transparent color, the same in all.
        if how.palette is not None and not how.ramp and self.counted[0].alpha:
            palettes = [Palette(map_samples(self.counted[0], palettes[0].colors, how.space, None, 1.0).palette, None)]
        frames, results = self._frames, list[Quantized]()
        of_frames = palettes if len(palettes) == len(self._samples) else list(palettes) * len(self._samples)
        for image, samples, found in zip(frames.images, self._samples, of_frames, strict=True):
            below = None
            if results and len(palettes) == 1 and samples.inside is None:
                below = Below(results[-1].indices, _still(frames.images[len(results) - 1], image))
            result = map_samples(
                samples, found.colors, how.space, how.dither, how.strength, how.rate, found.tones, below
            )
            results.append(keep_outside(replace(result, tessellation=found.tessellation), image))
        kind = "pages" if isinstance(frames, Pages) else "frames"
        n_distinct = max(samples.n_colors for samples in self.counted)
        return QuantizedSeries(tuple(results), kind, n_distinct, original=frames)


def _still(before: Array, image: Array) -> Bools:
    """Return (H, W) whether a pixel is in a square of 3 x 3 that are all as before: others may be so by chance."""
    from scipy.ndimage import binary_opening  # which takes long to import

    equal = (image == before).reshape(*image.shape[:2], -1).all(axis=2)
    still: Bools = binary_opening(equal, np.ones((3, 3)))
    return still

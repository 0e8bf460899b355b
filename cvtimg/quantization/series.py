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
        Number of distinct colors of all images.
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
        colors = f"{len(self.palette)} of {self.n_distinct} colors"
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
            frames, palette = self.content
            write_frames(path, frames, palette=palette, overwrite=overwrite)

    def stored(self, pages: Pages, *, keeps_nodata: bool = False) -> tuple[tuple[Array, ...], Bytes | None, bool]:
        """Return pages as they are written: indices and their palette, or colors; and whether they have alpha."""
        left_out, palette = any(page.inside is not None for page in self.results), self.palette
        keeps = keeps_nodata or pages.is_joined
        storing = Storing.of(palette, left_out=left_out, keeps_nodata=keeps, indexed=not pages.is_joined)
        images = tuple(page.stored(storing) for page in self.results)
        return images, palette if storing.indexed else None, storing.clears or (pages.has_alpha and not storing.indexed)

    @property
    def content(self) -> tuple[Frames, Bytes | None]:
        """What `write_frames` takes: frames of indices and their palette, or frames of colors and None."""
        contents = [result.content for result in self.results]
        frames = self.original if isinstance(self.original, Frames) else Frames((contents[0][0],), (0.0,), 1)
        # Where pixels are left out in some frames only, these alone have a color for them.
        last = max((palette for _, palette in contents if palette is not None), key=len, default=None)
        if any(palette is None for _, palette in contents):
            last = None
        pictures = tuple(
            palette[pixels] if last is None and palette is not None else pixels for pixels, palette in contents
        )
        return replace(frames, images=pictures), last

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
        """The palette of all images."""
        return self.results[0].palette

    @property
    def tessellation(self) -> Tessellation | None:
        """As in `Quantized`."""
        return self.results[0].tessellation

    @property
    def curve(self) -> EnergyCurve | None:
        """As in `Quantized`."""
        return self.results[0].curve

    def summary(self) -> Row:
        """Return the figures that commands and reports show."""
        first, elbows = self.results[0], {}
        if self.kind != "tiles":
            elbows = {"elbow": self.curve.elbows() if self.curve else None}
        return {
            "width": first.shape[1],
            "height": first.shape[0],
            "channels": first.palette.shape[1],
            **({self.kind: len(self.results)} if self.kind in ("frames", "pages") else {}),
            "left_out": sum(frame.n_left_out for frame in self.results),
            "distinct_colors": self.n_distinct,
            **({"exact": first.exact} if self.kind == "tiles" else {}),
            "k": len(self.palette),
            **elbows,
            "energy": self.energy,
            "mse": self.mse,
            "psnr": self.psnr if math.isfinite(self.psnr) else None,  # JSON has no infinity
            **({} if self.quality is None else {"goal": "eyes", "quality": self.quality}),
            **({} if self.content_quality is None else {"content_quality": self.content_quality}),
            "n_iter": self.tessellation.n_iter if self.tessellation else 0,
            "converged": self.tessellation is None or self.tessellation.converged,
        }


def quantize_frames(
    frames: Frames | Pages,
    n_colors: int | None = None,
    *,
    psnr: float | None = None,
    max_bytes: int | None = None,
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
    """Find the palette that represents all frames of an animation with the least error.

    It is that of an image with the frames side by side: the densities of their colors add. Pages of a file, as of a
    TIFF, count as frames; the result is saved as pages again.

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
        space=space, dither=dither, dither_strength=dither_strength, goal=goal, quality=quality, engine=engine,
        suffix=".gif",
    ).aimed()  # fmt: skip
    how.check()
    source = SeriesSource(frames, how, alpha, masks)
    result: QuantizedSeries = quantized(source, source.how)
    return result


class SeriesSource(Source):
    """The frames of an animation, or pages: a `Source` of their palette; of a file, also what to keep of that."""

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
        self.counted = merge_samples(self._samples)
        self.images, self.n_pixels = frames.images, sum(samples.inverse.size for samples in self._samples)

    def size(self, result: QuantizedSeries) -> int:
        """Return the bytes of its animation, or of its pages."""
        if isinstance(self._frames, Pages):
            content = io.BytesIO()
            images, palette, alpha = self.stored(result).values()
            encode_pages(content, replace(self._frames, images=tuple(images), has_alpha=bool(alpha)).parted(), palette)
            return content.tell()
        return len(encode_frames(self._suffix, *result.content, self._metadata))

    def stored(self, result: QuantizedSeries) -> dict[str, Any]:
        """Return what a file of them holds."""
        if isinstance(self._frames, Pages):
            images, palette, alpha = result.stored(self._frames, keeps_nodata=self._keeps_nodata)
            return {"images": images, "palette": palette, "alpha": alpha}
        frames, palette = result.content
        return {"images": frames.images, "palette": palette, "metadata": self._metadata}

    def mapped(self, palette: Palette, how: QuantizeOptions) -> QuantizedSeries:
        """Map each frame to the palette."""
        # A given palette may need a transparent color, the same in all.
        if how.palette is not None and not how.ramp and self.counted.alpha:
            palette = Palette(map_samples(self.counted, palette.colors, how.space, None, 1.0).palette, None)
        frames, results = self._frames, list[Quantized]()
        for image, samples in zip(frames.images, self._samples, strict=True):
            below = None
            if results and samples.inside is None:
                below = Below(results[-1].indices, _still(frames.images[len(results) - 1], image))
            result = map_samples(
                samples, palette.colors, how.space, how.dither, how.strength, how.rate, palette.tones, below
            )
            results.append(keep_outside(replace(result, tessellation=palette.tessellation), image))
        kind = "pages" if isinstance(frames, Pages) else "frames"
        return QuantizedSeries(tuple(results), kind, self.counted.n_colors, original=frames)


def _still(before: Array, image: Array) -> Bools:
    """Return (H, W) whether a pixel is in a square of 3 x 3 that are all as before: others may be so by chance."""
    from scipy.ndimage import binary_opening  # which takes long to import

    equal = (image == before).reshape(*image.shape[:2], -1).all(axis=2)
    still: Bools = binary_opening(equal, np.ones((3, 3)))
    return still

"""Animations and files of pages in few colors, with one palette for all frames or one for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_keywords
from cvtimg._shared.choices import DitherName, GoalName, SpaceName
from cvtimg.colors.fidelity import Fidelity
from cvtimg.colors.samples import color_samples, merge_samples
from cvtimg.files.whole import StrPath
from cvtimg.looks.similarity import visual_quality
from cvtimg.pictures.frames import Frames, write_frames
from cvtimg.pictures.pages import Pages, write_pages
from cvtimg.quantization.driver import QuantizeOptions, for_eyes, quantized
from cvtimg.quantization.looks import Below
from cvtimg.quantization.palette_search import EngineOptions, Palette
from cvtimg.quantization.remapping import Quantized, keep_outside, map_samples

__all__ = ["MOST_INDEXED", "Film", "QuantizedFrames", "quantize_frames"]

#: Largest palette of a .gif or .png.
MOST_INDEXED = 256


@dataclass(frozen=True, slots=True, eq=False)
class QuantizedFrames(Fidelity):
    """An animation, or the pages of a file, in few colors.

    Attributes
    ----------
    results : tuple of Quantized
        Each frame.
    durations, plays
        As in `Frames`.
    n_distinct : int
        Number of distinct colors of all frames; if each frame has its own palette, of the frame with the most.
    quality : float or None
        The mean `cvtimg.visual_quality` of the frames, where it was asked for.
    pages : Pages or None
        What the frames were, if they are pages of a file.
    """

    results: tuple[Quantized, ...]
    durations: tuple[float, ...]
    plays: int
    n_distinct: int
    quality: float | None = None
    pages: Pages | None = None

    def __repr__(self) -> str:
        """Tell the number of frames and colors in one line."""
        n_colors = max(len(result.palette) for result in self.results)
        return f"QuantizedFrames({len(self.results)} frames, up to {n_colors} of {self.n_distinct} colors)"

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the animation, as `cvtimg.pictures.write_frames` does, or the pages, as `write_pages` does."""
        if self.pages is not None:
            pages, palette = self.stored(self.pages)
            write_pages(path, pages, palette=palette, overwrite=overwrite)
            return
        frames, palettes = self.content
        write_frames(path, frames, palettes=palettes, overwrite=overwrite)

    def stored(self, pages: Pages, *, keeps_nodata: bool = False) -> tuple[Pages, NDArray[np.uint8] | None]:
        """Return pages as they are written: indices and their palette, or colors."""
        # Pixels that are left out become transparent, but in types without transparency, and where they are nodata.
        first = self.palette
        left_out = any(one.inside is not None for one in self.results)
        eight_bit = first.dtype == np.uint8 and first.shape[1] in (1, 3)
        shared = all(np.array_equal(one.palette, first) for one in self.results)
        indexed = shared and eight_bit and first.shape[1] == 3 and len(first) <= MOST_INDEXED
        if indexed and not left_out and not pages.is_joined:
            return replace(pages, images=tuple(one.indices for one in self.results), has_alpha=False), first
        if not left_out or keeps_nodata or not eight_bit or pages.is_joined:
            return replace(pages, images=tuple(one.image for one in self.results)), None
        images = []
        for one in self.results:
            inside = np.ones(one.indices.shape, np.bool_) if one.inside is None else one.inside
            colors = np.broadcast_to(one.palette, (len(one.palette), 3))[one.indices]
            images.append(np.concatenate([colors * inside[..., None], inside[..., None] * np.uint8(255)], axis=2))
        return replace(pages, images=tuple(images), has_alpha=True), None

    @property
    def energy(self) -> float:
        """Sum of the energies of the frames."""
        return sum(result.energy for result in self.results)

    @property
    def n_values(self) -> int:
        """Number of samples that count, of all frames."""
        return sum(result.n_values for result in self.results)

    @property
    def palette(self) -> NDArray[Any]:
        """The palette of the first frame, and of all if they share it."""
        return self.results[0].palette

    @property
    def content(self) -> tuple[Frames, NDArray[np.uint8] | Sequence[NDArray[np.uint8]] | None]:
        """What `write_frames` takes: frames of indices and their palettes, or frames of colors and None."""
        contents = [result.content for result in self.results]
        palettes = [palette for _, palette in contents if palette is not None]
        if len(palettes) < len(contents):
            pictures = tuple(pixels if palette is None else palette[pixels] for pixels, palette in contents)
            return Frames(pictures, self.durations, self.plays), None
        shared = all(np.array_equal(palette, palettes[0]) for palette in palettes)
        frames = Frames(tuple(pixels for pixels, _ in contents), self.durations, self.plays)
        return frames, palettes[0] if shared else palettes


def quantize_frames(
    frames: Frames | Pages,
    n_colors: int | None = None,
    *,
    psnr: float | None = None,
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
    quality: float | None = None,
    **engine: Unpack[EngineOptions],
) -> QuantizedFrames:
    """Find the palette that represents all frames of an animation with the least error, or one for each frame.

    Pages of a file, as of a TIFF, count as frames; the result is saved as pages again.

    A palette for all frames is that of an image with the frames side by side: the densities of their colors add.

    Parameters
    ----------
    frames : Frames or Pages
        From `read_frames` or `read_pages`.
    n_colors : int
        Size of a palette, in 1..65536; a .gif holds up to 256. With `psnr`, optional and the maximum size, by default
        256. Not allowed with `palette`.
    psnr : float, optional
        Use the fewest colors that reach this quality in dB, over all frames.
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
        As in `quantize`, for the bytes of a .gif; the quality is the mean of the frames. With at most 255 colors, the
        default, one more can stand for what stays from the frame before.

    Returns
    -------
    QuantizedFrames

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it, its value and what is allowed.

    See Also
    --------
    quantize : A single image.
    cvtimg.pictures.read_frames, cvtimg.pictures.read_pages : Where frames come from.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import quantize_frames
    >>> from cvtimg.pictures import Frames
    >>> frames = Frames(tuple(np.full((2, 3), level, np.uint8) for level in (10, 12, 200)), (40, 40, 40), 0)
    >>> result = quantize_frames(frames, 2)
    >>> [int(one.image[0, 0]) for one in result.results]
    [11, 11, 200]
    """
    check_keywords(quantize_frames, engine, EngineOptions.__annotations__)
    seen = goal == "eyes" or quality is not None
    if n_colors is None and palette is None and (seen or psnr is not None):
        n_colors = MOST_INDEXED - seen
    how = QuantizeOptions(
        n_colors, psnr, palette, locked, color_bits, ramp, space, dither, dither_strength, engine, goal, quality,
        coder="lzw",
    ).aimed()  # fmt: skip
    how.check(per_frame=per_frame or None)
    film = Film(frames, per_frame, alpha, masks)
    return for_eyes(film, how) if how.goal == "eyes" else quantized(film, how)


class Film:
    """The frames of an animation: the `Source` of `quantize_frames`."""

    def __init__(
        self, frames: Frames | Pages, per_frame: bool, alpha: bool | None, masks: Sequence[ArrayLike | None] | None
    ) -> None:
        n_frames = len(frames.images)
        masks = [None] * n_frames if masks is None else list(masks)
        if len(masks) != n_frames:
            raise ValueError(f"masks must be {n_frames}, one for each frame, not {len(masks)}")
        usual = frames.has_alpha if isinstance(frames, Pages) else frames.images[0].shape[2:] == (4,)
        has_alpha = usual if alpha is None else alpha
        self._frames, self._samples = (
            frames,
            [
                color_samples(image, alpha=has_alpha, mask=mask)
                for image, mask in zip(frames.images, masks, strict=True)
            ],
        )
        self.counted = self._samples if per_frame else [merge_samples(self._samples)]
        self.n_pixels = sum(samples.inverse.size for samples in self._samples)

    def quality(self, result: QuantizedFrames) -> float:
        """Return the mean visual quality of the frames of a result."""
        pairs = zip(self._frames.images, result.results, strict=True)
        return float(np.mean([visual_quality(image, one.image) for image, one in pairs]))

    def mapped(self, palettes: Sequence[Palette], how: QuantizeOptions) -> QuantizedFrames:
        """Map each frame to its palette, or to the one of all."""
        if (
            how.palette is not None and not how.ramp and self.counted[0].alpha
        ):  # which may need a transparent color, the same in all
            palettes = [Palette(map_samples(self.counted[0], palettes[0].colors, how.space, None, 1.0).palette, None)]
        frames = self._frames
        results: list[Quantized] = []
        of_frames = palettes if len(palettes) == len(self._samples) else list(palettes) * len(self._samples)
        for image, samples, found in zip(frames.images, self._samples, of_frames, strict=True):
            below = None
            if results and len(palettes) == 1 and samples.inside is None:
                before, still = results[-1], image == frames.images[len(results) - 1]
                below = Below(before.indices, still.reshape(*before.indices.shape, -1).all(axis=2))
            result = map_samples(
                samples, found.colors, how.space, how.dither, how.strength, how.rate, found.tones, below
            )
            results.append(keep_outside(replace(result, tessellation=found.tessellation), image))
        n_distinct = max(samples.n_colors for samples in self.counted)
        if isinstance(frames, Pages):
            return QuantizedFrames(tuple(results), (0.0,) * len(results), 1, n_distinct, pages=frames)
        return QuantizedFrames(tuple(results), frames.durations, frames.plays, n_distinct)

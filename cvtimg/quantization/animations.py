"""Animations in few colors, with one palette for all frames or one for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_alone, check_given, check_that
from cvtimg._shared.choices import DitherName, SpaceName
from cvtimg._shared.pixels import peak
from cvtimg.colors.fidelity import psnr
from cvtimg.colors.samples import color_samples, merge_samples
from cvtimg.files.whole import StrPath
from cvtimg.pictures.frames import Frames, write_frames
from cvtimg.quantization.dithering import STRENGTH
from cvtimg.quantization.palette_search import EngineOptions, Palette, find_palette
from cvtimg.quantization.remapping import Quantized, keep_outside, map_to_palette

__all__ = ["QuantizedFrames", "quantize_frames"]


@dataclass(frozen=True, slots=True, eq=False)
class QuantizedFrames:
    """An animation in few colors.

    Attributes
    ----------
    results : tuple of Quantized
        Each frame.
    durations, plays
        As in `Frames`.
    n_distinct : int
        Number of distinct colors of all frames; if each frame has its own palette, of the frame with the most.
    """

    results: tuple[Quantized, ...]
    durations: tuple[float, ...]
    plays: int
    n_distinct: int

    def __repr__(self) -> str:
        """Tell the number of frames and colors in one line."""
        n_colors = max(len(result.palette) for result in self.results)
        return f"QuantizedFrames({len(self.results)} frames, up to {n_colors} of {self.n_distinct} colors)"

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the animation, as `cvtimg.pictures.write_frames` does."""
        frames, palettes = self.content
        write_frames(path, frames, palettes=palettes, overwrite=overwrite)

    @property
    def energy(self) -> float:
        """Sum of the energies of the frames."""
        return sum(result.energy for result in self.results)

    @property
    def mse(self) -> float:
        """Mean squared error per sample over all frames."""
        counts = [one.indices.size if one.inside is None else int(np.count_nonzero(one.inside)) for one in self.results]
        return float(np.average([result.mse for result in self.results], weights=counts))

    @property
    def psnr(self) -> float:
        """Peak signal-to-noise ratio in dB over all frames, infinite if exact."""
        return float(psnr(self.mse, peak(self.results[0].palette.dtype)))

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
    frames: Frames,
    n_colors: int | None = None,
    *,
    per_frame: bool = False,
    alpha: bool | None = None,
    masks: Sequence[ArrayLike | None] | None = None,
    space: SpaceName = "rgb",
    palette: ArrayLike | None = None,
    locked: ArrayLike | None = None,
    dither: DitherName | None = None,
    dither_strength: float | None = None,
    **engine: Unpack[EngineOptions],
) -> QuantizedFrames:
    """Find the palette that represents all frames of an animation with the least error, or one for each frame.

    A palette for all frames is that of an image with the frames side by side: the densities of their colors add.

    Parameters
    ----------
    frames : Frames
        From `read_frames`.
    n_colors : int
        Size of a palette, in 1..65536; a .gif holds up to 256. Not allowed with `palette`.
    per_frame : bool
        Find a palette for each frame. This lowers the error, but colors that stand still may change between frames.
    alpha : bool, optional
        Whether the last channel is alpha; by default if there are four channels.
    masks : sequence of (H, W) array or None, optional
        For each frame, the pixels to quantize: those where the mask is not 0. The others have no influence, keep their
        value, and become transparent in indexed files.
    space, palette, locked, dither, dither_strength, method, init, effort, volume_power, rng, callback
        As in `quantize`. Error diffusion flickers where the frames stand still; ordered dithering does not.

    Returns
    -------
    QuantizedFrames

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it, its value and what is allowed.

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
    n_frames = len(frames.images)
    given_masks = [None] * n_frames if masks is None else list(masks)
    check_that("masks", len(given_masks) == n_frames, f"be {n_frames}, one for each frame, not {len(given_masks)}")
    has_alpha = frames.images[0].shape[2:] == (4,) if alpha is None else alpha
    several = [
        color_samples(image, alpha=has_alpha, mask=mask) for image, mask in zip(frames.images, given_masks, strict=True)
    ]
    wholes = several if per_frame else [merge_samples(several)]
    n_distinct = max(samples.n_colors for samples in wholes)
    if palette is not None:
        others = {"n_colors": n_colors, "per_frame": per_frame or None, "locked": locked, **engine}
        check_alone("palette", [name for name, value in others.items() if value is not None])
        given = np.array(palette)
        found = [Palette(given, None, given.shape[1:] == (4,))]
    else:
        n_colors = check_given("n_colors or palette", n_colors)
        found = [find_palette(whole, n_colors, space=space, locked=locked, **engine) for whole in wholes]
    if dither_strength is None:
        dither_strength = STRENGTH if palette is None else 1.0
    results = []
    for image, samples, one in zip(frames.images, several, found if per_frame else found * n_frames, strict=True):
        result = map_to_palette(samples, one.colors, space=space, dither=dither, dither_strength=dither_strength)
        results.append(keep_outside(replace(result, tessellation=one.tessellation), image))
    return QuantizedFrames(tuple(results), frames.durations, frames.plays, n_distinct)

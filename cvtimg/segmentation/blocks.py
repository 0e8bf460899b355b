"""Segmentation of images in blocks: the cells of all colors, carried to the pixels wherever the blocks are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_count
from cvtimg._shared.choices import EffortName, SpaceName
from cvtimg._shared.pixels import peak
from cvtimg.blocks.images import PixelBlocks
from cvtimg.colors.counting import count_blocks
from cvtimg.colors.samples import color_samples
from cvtimg.colors.spaces import SPACES, to_space
from cvtimg.engine.points import Frame, assign, pack
from cvtimg.engine.tessellation import tessellate
from cvtimg.segmentation.result import Segmentation, from_tessellation
from cvtimg.segmentation.values import EvenLevels, dark_to_bright, picture_values, to_levels, unit_of

__all__ = ["segment_blocks"]


def segment_blocks(
    image: Any,
    n_segments: int,
    *,
    nodata: float | None = None,
    space: SpaceName = "rgb",
    volume_power: float = 0,
    effort: EffortName = "balanced",
    rng: int | np.random.Generator = 0,
) -> Segmentation:
    """Divide an image in blocks into segments of similar color; `segment` takes such images too.

    Parameters
    ----------
    image : dask.array.Array or xarray.DataArray
        (H, W), (H, W, C) or a stack (T, ..., H, W, C), or a DataArray with any dimensions, of which one named "band" or
        "channel" holds the bands. A stack, such as a time series, gets one set of segments.
    n_segments : int
        K; an image with fewer distinct colors has one segment per color.
    nodata : float, optional
        Pixels with this value in all bands get label 0 and have no influence; by default what the attributes of a
        DataArray say. So do pixels that are not finite.
    space, volume_power, effort, rng
        As in `segment`.

    Returns
    -------
    Segmentation
        Its labels are computed when they are needed: a Dask array, or a DataArray with the dimensions and coordinates
        of the image. Beyond 2^22 distinct colors, near ones are merged before they are tessellated.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it.

    See Also
    --------
    segment_file : Files, also with an edge weight.

    Examples
    --------
    >>> import dask.array as da
    >>> import numpy as np
    >>> from cvtimg.segmentation import segment_blocks
    >>> stack = da.from_array(np.array([[[10, 12, 200]], [[11, 0, 201]]], np.uint8)[..., None], chunks=(1, 1, 3, 1))
    >>> segment_blocks(stack, 2, nodata=0).labels.compute().tolist()
    [[[1, 1, 2]], [[1, 0, 2]]]
    """
    check_choice("space", space, SPACES)
    check_count("n_segments", n_segments, 1 << 16, "the largest number of segment colors")
    blocks = PixelBlocks.of(image, nodata)
    counted = count_blocks(blocks).of_some()
    # The distinct colors are an image of one row, whose pixels weigh as many as they are.
    colors = counted.colors[None]
    values = picture_values(colors, space, None)
    values = replace(values, samples=values.samples.weighted(counted.density[None]))
    samples = values.samples
    n_segments = min(n_segments, samples.n_colors)
    cells = tessellate(samples, n_segments, effort=effort, volume_power=volume_power, rng=rng)
    found = from_tessellation(values, cells)
    frame = pack(samples.rows, samples.density).frame
    generators = values.to_picture(cells.generators * values.scale)
    label = _Label(
        replace(to_levels(colors), levels=samples.rows[:0]),
        space,
        frame,
        frame.inward(cells.generators),
        dark_to_bright(generators, cells.masses),
    )
    return replace(found, labels=blocks.mapped(label, np.int32))


@dataclass(frozen=True, slots=True, eq=False)
class _Label:
    """From (n, C) pixels to their (n,) labels, where blocks are worked on."""

    levels: EvenLevels
    space: SpaceName
    frame: Frame
    generators: NDArray[np.float64]
    new_label: NDArray[np.int32]

    def __call__(self, pixels: NDArray[Any]) -> NDArray[np.int32]:
        counted = color_samples(pixels[None])
        rows = counted.colors
        if self.space == "rgb":
            steps = (rows.astype(np.float64) - self.levels.offset) / self.levels.step
            whole = self.levels.levels.dtype.kind == "u"
            rows = (np.rint(steps) if whole else steps).astype(self.levels.levels.dtype)
        else:
            rows = to_space(rows / peak(rows.dtype), self.space) * unit_of(self.space, rows.dtype)
        points = pack(rows, np.ones(len(rows)), frame=self.frame)
        labels: NDArray[np.int32] = self.new_label[assign(points, self.generators)[: len(rows)]]
        return labels[counted.inverse[0]]

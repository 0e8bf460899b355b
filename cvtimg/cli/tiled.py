"""Images larger than memory: whether to process them in tiles, and their rows in the report."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cvtimg.batch import Row, Stopwatch, Task

__all__ = ["check_fit", "segment_in_tiles"]


def check_fit(source: Path, unfit: Mapping[str, Any], max_pixels: int | None) -> None:
    """Refuse options that need the whole image in memory, and more pixels than --max-pixels allows.

    There is no limit by default, as memory is bounded.
    """
    from cvtimg.pictures.tiles import open_bands

    for option, value in unfit.items():
        if value is not None and value is not False:
            raise ValueError(f"is read in tiles, and {option} needs the whole picture in memory")
    if max_pixels is not None and open_bands(source).form.n_pixels > max_pixels:
        raise ValueError(f"has over {max_pixels} pixels, the limit that --max-pixels sets")


def segment_in_tiles(
    task: Task, stopwatch: Stopwatch, number: int, nodata: float | None, options: Mapping[str, Any]
) -> Row:
    """Segment an image in tiles."""
    from cvtimg.pictures import image_info
    from cvtimg.pictures.formats.opening import pixels_limited
    from cvtimg.segmentation import segment_file

    known: dict[str, Any] = {"nodata": nodata}
    if task.source.suffix.lower() != ".zarr":
        with pixels_limited(sys.maxsize):  # a header is safe to read whatever size it declares
            header = image_info(task.source)
        known = {"nodata": header.nodata if nodata is None else nodata, "has_alpha": header.has_alpha}
    result = segment_file(task.source, task.output, number, **known, **options)
    stopwatch.lap("all")
    return {
        "width": result.shape[1],
        "height": result.shape[0],
        "channels": result.generators.shape[1],
        "left_out": result.shape[0] * result.shape[1] - int(result.masses.sum()),
        "exact": result.exact,
        "k": result.n_segments,
        "edge_weight": result.edge_weight,
        "energy": result.energy,
        "n_iter": len(result.energies) - 1,
        "converged": result.converged,
    }

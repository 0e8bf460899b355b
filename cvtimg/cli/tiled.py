"""Images larger than memory: whether to process them in tiles, and their rows in the report."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cvtimg.batch import Row, Stopwatch, Task

__all__ = ["check_fit", "needs_tiles", "quantize_in_tiles", "segment_in_tiles"]

#: Images of more pixels are read in tiles, if the formats of input and output allow it.
_LARGE = 1 << 26


def needs_tiles(source: Path, target: Path) -> bool:
    """Return whether to process an image in tiles: if it is large or a Zarr array."""
    suffixes = {source.suffix.lower(), target.suffix.lower()}
    if ".zarr" in suffixes:
        return True
    if not suffixes <= {".tif", ".tiff"}:
        return False
    from cvtimg.pictures.tiles import open_bands

    try:
        return open_bands(source).form.n_pixels > _LARGE
    except OSError:  # the usual reader opens it or reports the error
        return False


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


def quantize_in_tiles(task: Task, stopwatch: Stopwatch, options: Mapping[str, Any], *, overwrite: bool) -> Row:
    """Quantize an image in tiles."""
    from cvtimg import write_palette
    from cvtimg.quantization import quantize_file

    result = quantize_file(task.source, task.output, overwrite=overwrite, **options)
    if "--save-palette" in task.outputs:
        write_palette(task.outputs["--save-palette"], result.palette, overwrite=overwrite)
    stopwatch.lap("all")
    tessellation = result.tessellation
    return {
        "width": result.shape[1],
        "height": result.shape[0],
        "channels": result.palette.shape[1],
        "left_out": result.n_left_out,
        "distinct_colors": result.n_distinct,
        "exact": result.exact,
        "k": len(result.palette),
        "energy": result.energy,
        "mse": result.mse,
        "psnr": result.psnr if math.isfinite(result.psnr) else None,  # JSON has no infinity
        "n_iter": tessellation.n_iter if tessellation else 0,
        "converged": tessellation.converged if tessellation else True,
    }


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

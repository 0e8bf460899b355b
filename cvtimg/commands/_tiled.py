"""Pictures too large for memory, by tiles: which they are, and their row in the report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

from cvtimg.batch import Row, Task

__all__ = ["by_tiles", "goes_by_tiles"]

#: Pixels beyond which a picture is read by tiles, if its file and its output can be.
_LARGE = 1 << 26


def goes_by_tiles(source: Path, target: Path) -> bool:
    """Whether a picture is to be read and written by tiles: if it is large, or a Zarr array."""
    suffixes = {source.suffix.lower(), target.suffix.lower()}
    if ".zarr" in suffixes:
        return True
    if not suffixes <= {".tif", ".tiff"}:
        return False
    from cvtimg.tiles import open_bands

    try:
        return open_bands(source).form.n_pixels > _LARGE
    except OSError:  # the usual way will say why, or read it
        return False


def by_tiles(task: Task, options: Mapping[str, Any], unfit: list[str], *, overwrite: bool) -> Row:
    """Quantize a picture by tiles; `unfit` are options that were given and need the whole picture."""
    from cvtimg import quantize_file, write_palette

    if unfit:
        raise ValueError(f"is read by tiles, and {unfit[0]} needs the whole picture in memory")
    start = perf_counter()
    result = quantize_file(task.source, task.outputs["picture"], overwrite=overwrite, **options)
    if "palette" in task.outputs:
        write_palette(task.outputs["palette"], result.palette, overwrite=overwrite)
    tessellation = result.tessellation
    return {
        "input": str(task.source),
        "output": str(task.outputs["picture"]),
        "width": result.shape[1],
        "height": result.shape[0],
        "channels": result.palette.shape[1],
        "distinct_colors": result.n_distinct,
        "k": len(result.palette),
        "energy": result.energy,
        "mse": result.mse,
        "psnr": result.psnr if math.isfinite(result.psnr) else None,  # JSON has no infinity
        "n_iter": tessellation.n_iter if tessellation else 0,
        "converged": tessellation.converged if tessellation else True,
        "seconds": {"all": perf_counter() - start},
    }

"""``cvtimg quantize`` for an image of several frames."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from cvtimg.batch import Row, Stopwatch, Task


def stays_animated(task: Task) -> bool:
    """Tell whether input and output both have frames; else the first frame is an image like others."""
    from cvtimg.pictures.formats.animated import FRAME_WRITERS
    from cvtimg.pictures.frames import is_animated

    return task.output.suffix.lower() in FRAME_WRITERS and is_animated(task.source)


def quantize_animation(
    task: Task,
    stopwatch: Stopwatch,
    given: Mapping[str, Any],
    *,
    per_frame: bool,
    keep_metadata: bool,
    overwrite: bool,
) -> Row:
    """Quantize all frames of an animation; `given` are options of `quantize_frames`."""
    from cvtimg import quantize_frames
    from cvtimg.pictures import read_frames, read_metadata, write_frames

    frames = read_frames(task.source)
    metadata = read_metadata(task.source) if keep_metadata else None
    stopwatch.lap("read")
    result = quantize_frames(frames, per_frame=per_frame, **given)
    stopwatch.lap("cluster")
    shown, palettes = result.content
    write_frames(task.output, shown, palettes=palettes, metadata=metadata, overwrite=overwrite)
    if "--save-palette" in task.outputs:
        _write_palette(task, result.results, overwrite)
    stopwatch.lap("write")
    tessellations = [one.tessellation for one in result.results if one.tessellation]
    return {
        "width": frames.images[0].shape[1],
        "height": frames.images[0].shape[0],
        "channels": max(one.palette.shape[1] for one in result.results),
        "frames": len(frames.images),
        "distinct_colors": result.n_distinct,
        "k": max(len(one.palette) for one in result.results),
        "elbow": None,
        "energy": result.energy,
        "mse": result.mse,
        "psnr": result.psnr if math.isfinite(result.psnr) else None,  # JSON has no infinity
        "n_iter": max((one.n_iter for one in tessellations), default=0),
        "converged": all(one.converged for one in tessellations),
    }


def _write_palette(task: Task, results: Any, overwrite: bool) -> None:
    import numpy as np

    from cvtimg import write_palette

    palette = results[0].palette
    n_pixels = sum(np.bincount(one.indices.ravel(), minlength=len(palette)) for one in results)
    write_palette(task.outputs["--save-palette"], palette, density=n_pixels, overwrite=overwrite)

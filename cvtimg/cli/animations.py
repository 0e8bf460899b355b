"""``cvtimg quantize`` for an image of several frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Row, Stopwatch, Task
from cvtimg.cli.known_pixels import known_in_all
from cvtimg.cli.quantize_options import QuantizeOptions

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cvtimg.pictures import ImageInfo
    from cvtimg.quantization import QuantizedFrames

#: Largest palette of a .gif or .png, and the number of colors at which a search begins.
_MOST_COLORS = 256
_FIRST_TRIAL = 32
#: What twice as many colors bring at least.
_DECIBEL = 2.0


def stays_animated(task: Task, header: ImageInfo) -> bool:
    """Return whether input and output both have frames; otherwise only the first frame is used."""
    from cvtimg.pictures.formats.animated import FRAME_WRITERS
    from cvtimg.pictures.frames import ANIMATED

    return task.output.suffix.lower() in FRAME_WRITERS and header.format in ANIMATED and header.frames > 1


def quantize_animation(
    task: Task,
    stopwatch: Stopwatch,
    header: ImageInfo,
    how: QuantizeOptions,
    *,
    overwrite: bool,
) -> Row:
    """Quantize all frames of an animation."""
    from cvtimg import quantize_frames
    from cvtimg.pictures import read_frames, read_metadata, write_frames

    frames = read_frames(task.source)
    metadata = read_metadata(task.source) if how.keep_metadata else None
    known = known_in_all(frames.images, header, how.mask, how.nodata, "frame")
    given = {**how.search, **how.mapping, **how.colors, "per_frame": how.per_frame}
    most: int | None = given.get("n_colors")
    if not all(one.all() for one in known):
        given["masks"] = known
        most = min(most or _MOST_COLORS, _MOST_COLORS - 1)  # one more is transparent
    stopwatch.lap("read")

    def write(path: Path, result: QuantizedFrames, overwrite: bool) -> None:
        shown, palettes = result.content
        write_frames(path, shown, palettes=palettes, metadata=metadata, overwrite=overwrite)

    def quantized(**size: int) -> QuantizedFrames:
        return quantize_frames(frames, **{**given, **size})

    psnr = how.target.get("psnr")
    if psnr is not None:
        result = _fewest_colors(quantized, psnr, most)
    elif how.max_bytes is not None:
        result = _most_colors(quantized, how.max_bytes, most, task.output.suffix, write)
    else:
        result = quantized(**({"n_colors": most} if most and "n_colors" in given else {}))
    stopwatch.lap("cluster")
    write(task.output, result, overwrite)
    if "--save-palette" in task.outputs:
        _write_palette(task, result.results, overwrite)
    stopwatch.lap("write")
    return {
        "width": frames.images[0].shape[1],
        "height": frames.images[0].shape[0],
        "channels": max(one.palette.shape[1] for one in result.results),
        "frames": len(frames.images),
        **figures_of(result, known),
    }


def figures_of(result: QuantizedFrames, known: Sequence[NDArray[np.bool_]]) -> Row:
    """Return what a row says of all frames or pages together."""
    tessellations = [one.tessellation for one in result.results if one.tessellation]
    return {
        "left_out": sum(int((~one).sum()) for one in known),
        "distinct_colors": result.n_distinct,
        "k": max(len(one.palette) for one in result.results),
        "elbow": None,
        "energy": result.energy,
        "mse": result.mse,
        "psnr": result.psnr if math.isfinite(result.psnr) else None,  # JSON has no infinity
        "n_iter": max((one.n_iter for one in tessellations), default=0),
        "converged": all(one.converged for one in tessellations),
    }


def _fewest_colors(quantized: Callable[..., QuantizedFrames], psnr: float, most: int | None) -> QuantizedFrames:
    """Find the fewest colors that reach a quality."""
    from cvtimg.quantization.targets import first_reaching

    tried: dict[int, QuantizedFrames] = {}

    def quality(n_colors: int) -> float:
        tried[n_colors] = quantized(n_colors=n_colors)
        return tried[n_colors].psnr

    limit = most or _MOST_COLORS
    n_colors = first_reaching(quality, psnr, 1, limit, first=_FIRST_TRIAL, per_octave=_DECIBEL)
    if n_colors > limit:
        raise ValueError(f"--psnr {psnr:g} is not reached by {limit} colors, only {tried[limit].psnr:.2f} dB")
    return tried[n_colors]


def _most_colors(
    quantized: Callable[..., QuantizedFrames],
    max_bytes: int,
    most: int | None,
    suffix: str,
    write: Callable[[Path, QuantizedFrames, bool], None],
) -> QuantizedFrames:
    """Find the most colors whose file is small enough."""
    from tempfile import TemporaryDirectory

    from cvtimg.quantization.targets import first_reaching

    tried: dict[int, QuantizedFrames] = {}
    sizes: dict[int, int] = {}
    with TemporaryDirectory(prefix="cvtimg-") as folder:
        trial = Path(folder, f"trial{suffix}")

        def size(n_colors: int) -> float:
            tried[n_colors] = quantized(n_colors=n_colors)
            write(trial, tried[n_colors], True)
            sizes[n_colors] = trial.stat().st_size
            return sizes[n_colors]

        limit = most or _MOST_COLORS
        too_many = first_reaching(size, max_bytes + 1, 1, limit, first=_FIRST_TRIAL, per_octave=max_bytes / 4)
    if too_many == 1:
        raise ValueError(f"--max-bytes {max_bytes} is not reached: a single color takes {sizes[1]} bytes")
    return tried[too_many - 1]


def _write_palette(task: Task, results: Any, overwrite: bool) -> None:
    import numpy as np

    from cvtimg import write_palette

    palette = results[0].palette
    n_pixels = sum(np.bincount(one.indices.ravel(), minlength=len(palette)) for one in results)
    write_palette(task.outputs["--save-palette"], palette, density=n_pixels, overwrite=overwrite)

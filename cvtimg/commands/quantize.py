"""``cvtimg quantize``: pictures to few colors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from cvtimg.batch import Report, Row, Task, check_choice, check_outputs, find, run
from cvtimg.commands import _options as options

if TYPE_CHECKING:
    from cvtimg.remapping import Quantized

EXAMPLES = """Examples:

\b
  cvtimg quantize photo.jpg -k 16 -o small.png
  cvtimg quantize photos/ 'scans/*.tif' -k 256 --out-dir small
  cvtimg quantize logo.png -k 8 --effort best --save-palette logo.gpl
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "distinct_colors", "k", "energy", "psnr", "seconds", "output")

_COUNT = options.whole_number(1, options.MAX_COLORS)
Colors = Annotated[int, Option("--colors", "-k", metavar="N", parser=_COUNT, help="Colors to keep, at most 65536.")]
SavePalette = Annotated[Path | None, Option(metavar="FILE", help="Write the colors, .json or .gpl; for one input.")]


def quantize(
    inputs: options.Pictures,
    colors: Colors,
    output: options.Output = None,
    out_dir: options.OutDir = None,
    effort: options.Effort = "balanced",
    method: options.Method = None,
    volume_power: options.VolumePower = 0,
    init: options.Init = "split",
    seed: options.Seed = 0,
    save_palette: SavePalette = None,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Reduce pictures to the N colors that stand best for them.

    Without -o and --out-dir, one input gives NAME-quantized.png beside it. Up to 256 colors make an indexed PNG
    of the fewest bits. A picture that has no more than N colors comes back exactly. The output of -o can also end in
    .tif, .webp, .gif, .bmp, .ppm or .pgm. The same seed gives the same file.
    """
    from cvtimg import find_images
    from cvtimg.io import lossless_suffixes
    from cvtimg.palette import PALETTE_WRITERS

    engine = options.engine(effort=effort, method=method, init=init, volume_power=volume_power, seed=seed)
    report = Report(COLUMNS, as_json=as_json, quiet=quiet)
    sources, missing = find(inputs, find_images, out_dir)
    check_outputs(len(sources) + len(missing), out_dir, {"-o": output, "--save-palette": save_palette})
    if output:
        check_choice("-o", output.suffix.lower(), lossless_suffixes())
    if save_palette:
        check_choice("--save-palette", save_palette.suffix.lower(), PALETTE_WRITERS)
    extra = {"palette": save_palette} if save_palette else {}
    tasks = [Task(source, {"picture": output or _name_output(source, out_dir), **extra}) for source in sources]
    how = {"n_colors": colors, **engine}

    def work(task: Task) -> Row:
        return _quantize(task, overwrite, how)

    raise typer.Exit(run(tasks, missing, work, report, out_dir=out_dir, overwrite=overwrite))


def _name_output(source: Path, out_dir: Path | None) -> Path:
    return out_dir / f"{source.stem}.png" if out_dir else source.with_name(f"{source.stem}-quantized.png")


def _quantize(task: Task, overwrite: bool, how: Mapping[str, Any]) -> Row:
    from cvtimg import quantize, read_image

    start = perf_counter()
    image = read_image(task.source)
    if image.dtype.kind == "f":
        raise ValueError("has floating point samples, which no output format holds; convert it to 16-bit grey")
    read = perf_counter()
    result = quantize(image, **how)
    clustered = perf_counter()
    _write(task.outputs, result, overwrite)
    written = perf_counter()
    tessellation = result.tessellation  # None: the picture had no more colors than asked for
    return {
        "input": str(task.source),
        "output": str(task.outputs["picture"]),
        "width": image.shape[1],
        "height": image.shape[0],
        "channels": result.palette.shape[1],
        "distinct_colors": result.n_distinct,
        "k": len(result.palette),
        "energy": result.energy,
        "mse": result.mse,
        "psnr": result.psnr if math.isfinite(result.psnr) else None,  # JSON has no infinity
        "n_iter": tessellation.n_iter if tessellation else 0,
        "converged": tessellation.converged if tessellation else True,
        "seconds": {"read": read - start, "cluster": clustered - read, "write": written - clustered},
    }


def _write(outputs: Mapping[str, Path], result: Quantized, overwrite: bool) -> None:
    from cvtimg import write_image
    from cvtimg.palette import write_palette

    palette = result.palette
    if len(palette) > 256 or palette.itemsize > 1:  # more than a PNG's palette holds
        write_image(outputs["picture"], result.image, overwrite=overwrite)
    else:
        colors = palette.repeat(3, axis=1) if palette.shape[1] == 1 else palette
        write_image(outputs["picture"], result.indices, palette=colors, overwrite=overwrite)
    if "palette" in outputs:
        import numpy as np

        n_pixels = np.bincount(result.indices.ravel(), minlength=len(palette))
        write_palette(outputs["palette"], palette, density=n_pixels, overwrite=overwrite)

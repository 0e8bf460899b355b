"""``cvtimg mosaic``: images as convex tiles of one color each."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, Literal

from typer import Option

from cvtimg.batch import Row, Stopwatch, Task, check_suffix, plan_each
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan

EXAMPLES = """Examples:

\b
  cvtimg mosaic photo.jpg -n 1000 -o photo.svg
  cvtimg mosaic photo.jpg -n 2000 --shape triangles -o lowpoly.png
  cvtimg mosaic photo.jpg -n 500 -k 8 --outline 1.5 -o window.svg
  cvtimg mosaic photos/ -n 1500 --out-dir mosaics
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "n", "energy", "psnr", "seconds", "output")

Number = Annotated[
    int, Option("--tiles", "-n", metavar="N", parser=options.whole_number(1, 1 << 28), help="Number of tiles.")
]
Shape = Annotated[Literal["cells", "triangles"], Option(help="Voronoi cells, or triangles (low poly).")]
Palette = Annotated[
    int | None,
    Option(
        "--colors", "-k", metavar="N", parser=options.whole_number(1, options.MAX_COLORS), help="Use only N colors."
    ),
]
Outline = Annotated[
    float,
    Option(metavar="W", parser=options.number(0), help="Width of dark lines between tiles, in pixels; 0 for none."),
]
Scale = Annotated[
    float, Option(metavar="S", parser=options.number(above=0), help="Enlarge .png and other images by this factor.")
]


def mosaic(
    inputs: options.Images,
    tiles: Number,
    output: options.Output = None,
    out_dir: options.OutDir = None,
    shape: Shape = "cells",
    colors: Palette = None,
    space: options.Space = "rgb",
    effort: options.Effort = "balanced",
    outline: Outline = 0,
    scale: Scale = 1,
    skip_existing: options.SkipExisting = False,
    max_pixels: options.MaxPixels = None,
    *,
    reading: options.InputOptions,
    common: options.BatchOptions,
) -> int:
    """Turn images into mosaics of N convex, single-colored tiles.

    Tiles move until the mosaic matches the image as closely as possible, so their borders follow its edges.

    The suffix of -o picks the format: .svg, .geojson with a polygon for each tile, or .png and other images. Without
    -o and --out-dir, one input gives NAME-mosaic.png beside it; with --out-dir each gives NAME.png.
    """
    from cvtimg import find_images
    from cvtimg.artwork.mosaic_files import suffixes

    check_suffix("-o", output, suffixes())
    plan = plan_each(inputs, find_images, {"-o": output or ("{}.png" if out_dir else "{}-mosaic.png")}, out_dir=out_dir)
    making = {"n_cells": tiles, "shape": shape, "space": space, "palette": colors, "effort": effort}
    work = partial(_mosaic, making=making, drawing={"outline": outline, "scale": scale, "overwrite": common.overwrite})
    return run_plan(plan, reading.chosen(work), COLUMNS, common, skip_existing=skip_existing, max_pixels=max_pixels)


def _mosaic(task: Task, stopwatch: Stopwatch, *, making: Mapping[str, Any], drawing: Mapping[str, Any]) -> Row:
    import cvtimg

    image = cvtimg.read_image(task.source)
    stopwatch.lap("read")
    result = cvtimg.mosaic(image, **making)
    stopwatch.lap("mosaic")
    result.save(task.output, **drawing)
    stopwatch.lap("write")
    return {
        "width": image.shape[1],
        "height": image.shape[0],
        "shape": making["shape"],
        "n": len(result.colors),
        "energy": result.energy,
        "psnr": result.psnr if result.psnr < float("inf") else None,
        "n_iter": len(result.energies) - 1,
    }

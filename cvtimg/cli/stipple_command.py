"""``cvtimg stipple``: images as dots for pen plotters, laser cutters and print."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer import Option

from cvtimg.batch import Row, Stopwatch, Task, WrongUsageError, check_suffix, plan_each
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan

EXAMPLES = """Examples:

\b
  cvtimg stipple portrait.jpg -n 20000 -o portrait.svg
  cvtimg stipple photo.jpg -n 30000 --dots equal-mass --marks lines -o a.svg
  cvtimg stipple photo.jpg -n 8000 --dots sized --radius-range 0.5 4 -o a.png
  cvtimg stipple photo.jpg -n 60000 --layers cmyk -o pens.svg
  cvtimg stipple logo.png -n 3000 --invert --cells cells.geojson -o dots.csv
  cvtimg stipple photos/ -n 20000 --out-dir plots
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "n", "radius", "max_ink", "energy", "seconds", "output")

_PER_MM = {"mm": 1.0, "cm": 10.0, "in": 25.4, "": 1.0}


def _length(text: str | float) -> float:
    """Read a length such as 200mm, 20cm or 8in, in millimeters by default."""
    plain = str(text).strip()
    unit = next(unit for unit in _PER_MM if plain.endswith(unit))
    try:
        return options.number(above=0)(plain.removesuffix(unit)) * _PER_MM[unit]
    except typer.BadParameter as error:
        raise typer.BadParameter(f"{plain!r} must be a length > 0 such as 200mm, 20cm or 8in") from error


def _layers(text: str) -> str | int:
    if text == "cmyk":
        return text
    try:
        return options.whole_number(1, 64)(text)
    except typer.BadParameter as error:
        raise typer.BadParameter(f"{text!r} must be cmyk or a number of colors in 1..64") from error


Number = Annotated[
    int, Option("--dot-count", "-n", metavar="N", parser=options.whole_number(1, 1 << 28), help="Number of dots.")
]
Dots = Annotated[
    Literal["equal", "equal-mass", "sized"],
    Option(help="One size; one size and exactly the same ink for each dot; or each as large as its ink."),
]
MaxInk = Annotated[
    float,
    Option(metavar="F", parser=options.number(0, 1, above=0), help="Share of the paper that black covers, up to 1."),
]
WhiteCutoff = Annotated[
    float, Option(metavar="F", parser=options.number(0, 1), help="Leave tones of up to this coverage white.")
]
RadiusRange = Annotated[
    tuple[float, float] | None,
    Option(metavar="A B", help="Least and greatest radius in pixels of the image, with --dots sized."),
]
Layers = Annotated[
    Any, Option(metavar="cmyk|K", parser=_layers, help="Draw in color: process colors, or K colors of the image.")
]
Invert = Annotated[bool, Option("--invert", help="Draw light dots on dark paper.")]
Width = Annotated[
    float, Option(metavar="LENGTH", parser=_length, help="Width of the drawing: 200mm, 20cm or 8in; for .svg, .png.")
]
Marks = Annotated[
    Literal["disks", "circles", "points", "lines"],
    Option(help="What a dot is in .svg: a filled disk, its outline, or a tiny loop or line that a pen dots."),
]
PenWidth = Annotated[
    float | None,
    Option(metavar="MM", parser=_length, help="Width of the pen's line in .svg; by default what suits the dots."),
]
Order = Annotated[Literal["tour", "none"], Option(help="Order of dots in files: a short tour of the pen, or none.")]
Cells = Annotated[
    Path | None, Option(metavar="FILE", help="Write the cell of each dot, .svg or .geojson; for one input.")
]


@dataclass(frozen=True, slots=True)
class StippleOptions:
    """What is done to each image: options of `stipple` and of `Stipples.save`."""

    stippling: Mapping[str, Any]
    drawing: Mapping[str, Any]
    overwrite: bool


def stipple(
    inputs: options.Images,
    dot_count: Number,
    output: options.Output = None,
    out_dir: options.OutDir = None,
    dots: Dots = "equal",
    max_ink: MaxInk = 0.9,
    white_cutoff: WhiteCutoff = 0,
    radius_range: RadiusRange = None,
    layers: Layers = None,
    invert: Invert = False,
    width: Width = 200,
    marks: Marks = "disks",
    pen_width: PenWidth = None,
    order: Order = "tour",
    cells: Cells = None,
    skip_existing: options.SkipExisting = False,
    max_pixels: options.MaxPixels = None,
    *,
    reading: options.InputOptions,
    common: options.BatchOptions,
) -> int:
    """Reproduce the tones of images by N dots.

    Coverage is computed in linear light, so that the drawing is as bright as the image, scaled by --max-ink.
    Transparent pixels are paper, and no dot lies in white.

    The suffix of -o picks the format: .svg in millimeters with a layer for each pen, .png and other images, .csv, .npy
    or .npz. Without -o and --out-dir, one input gives NAME-stippled.svg beside it; with --out-dir each gives NAME.svg.
    """
    from cvtimg import find_images
    from cvtimg.artwork.stipple_files import suffixes

    check_suffix("-o", output, suffixes())
    check_suffix("--cells", cells, [".svg", ".geojson"])
    if radius_range and dots != "sized":
        raise WrongUsageError("--radius-range needs --dots sized")
    if radius_range and not 0 < radius_range[0] <= radius_range[1]:
        raise WrongUsageError("--radius-range: A and B must be > 0, the least first")
    if layers is not None and invert:
        raise WrongUsageError("--layers and --invert exclude each other")
    plan = plan_each(
        inputs,
        find_images,
        {"-o": output or ("{}.svg" if out_dir else "{}-stippled.svg"), "--cells": cells},
        out_dir=out_dir,
    )
    stippling = {"dots": dots, "max_ink": max_ink, "white_cutoff": white_cutoff, "radius_range": radius_range}
    stippling |= {"n_dots": dot_count, "layers": layers, "invert": invert}
    drawing = {"width": width, "marks": marks, "pen_width": pen_width, "tour": order == "tour"}
    work = partial(_stipple, how=StippleOptions(stippling, drawing, common.overwrite))
    return run_plan(plan, reading.chosen(work), COLUMNS, common, skip_existing=skip_existing, max_pixels=max_pixels)


def _stipple(task: Task, stopwatch: Stopwatch, *, how: StippleOptions) -> Row:
    import cvtimg

    image = cvtimg.read_image(task.source)
    stopwatch.lap("read")
    result = cvtimg.stipple(image, **how.stippling)
    stopwatch.lap("stipple")
    result.save(task.output, **how.drawing, overwrite=how.overwrite)
    if "--cells" in task.outputs:
        result.save_cells(task.outputs["--cells"], width=how.drawing["width"], overwrite=how.overwrite)
    stopwatch.lap("write")
    return {
        "width": image.shape[1],
        "height": image.shape[0],
        "n": len(result),
        "layers": list(result.names),
        "radius": float(result.radii.mean()) if len(result) else None,
        "radius_mm": float(result.radii.mean() * how.drawing["width"] / image.shape[1]) if len(result) else None,
        "max_ink": result.max_ink,
        "ink": result.ink,
        "energy": result.energy,
    }

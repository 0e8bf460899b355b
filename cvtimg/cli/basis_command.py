"""``cvtimg basis``: few modes for many frames or fields."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Option

from cvtimg.batch import Row, Stopwatch, Task, check_suffix, plan_one
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan
from cvtimg.cli.snapshots import Frames, Passes, as_given

if TYPE_CHECKING:
    from cvtimg.bases import Basis
    from cvtimg.plotting.sheets import Panel

EXAMPLES = """Examples:

\b
  cvtimg basis film.gif -n 8 -o film.npz --sheet modes.png
  cvtimg basis runs.npy -n auto -o runs.npz --plot energies.png
  cvtimg basis frames/ -n 4 --kind cvod --cells 12 -o frames.npz
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("snapshots", "kind", "n", "cells", "explained", "energy", "seconds", "output")
#: Modes of a sheet, in rows of so many.
_MOST_SHOWN, _IN_A_ROW = 23, 6

Number = Annotated[
    Any,
    Option(
        "-n",
        metavar="N|auto",
        parser=options.or_auto(options.whole_number(1, 1 << 16)),
        help="Number of modes, of each cell for cvod; auto picks it at the elbow of the energy.",
    ),
]
Output = Annotated[Path, Option("--output", "-o", metavar="FILE", help="Write the basis, .npz.")]
Kind = Annotated[
    Literal["pod", "cvt", "cvod"],
    Option(help="Principal components, generators of a tessellation, or principal components of each of its cells."),
]
Cells = Annotated[
    int, Option(metavar="C", parser=options.whole_number(1, 1 << 16), help="Number of cells of --kind cvod.")
]
Sheet = Annotated[Path | None, Option(metavar="FILE", help="Draw the mean and the modes as images.")]
Plot = Annotated[Path | None, Option(metavar="FILE", help="Plot what the modes leave unexplained, .png or .svg.")]


def basis(
    frames: Frames,
    number: Number,
    output: Output,
    kind: Kind = "pod",
    cells: Cells = 8,
    sheet: Sheet = None,
    plot: Plot = None,
    passes: Passes = 4,
    seed: options.Seed = 0,
    max_pixels: options.MaxPixels = None,
    *,
    common: options.CommonOptions,
) -> int:
    """Find N modes that nearly contain all frames of a film, or all rows of an array.

    The file has the arrays of cvtimg.bases.Basis; cvtimg.bases.read_basis reads it. Arrays may be larger than memory.
    """
    from cvtimg import find_images
    from cvtimg.pictures.files import lossless_suffixes
    from cvtimg.plotting.charts import PLOT_SUFFIXES

    check_suffix("-o", output, (".npz",))
    check_suffix("--sheet", sheet, lossless_suffixes())
    check_suffix("--plot", plot, PLOT_SUFFIXES)
    plan = plan_one(frames, find_images, {"-o": output, "--sheet": sheet, "--plot": plot})
    how = {"n_modes": number, "kind": kind, "n_cells": cells, "passes": passes, "rng": seed}
    work = partial(_basis, how=how, overwrite=common.overwrite)
    return run_plan(plan, work, COLUMNS, common, max_pixels=max_pixels)


def _basis(task: Task, stopwatch: Stopwatch, *, how: dict[str, Any], overwrite: bool) -> Row:
    from cvtimg import reduced_basis, write_image
    from cvtimg.files.whole import write_whole

    snapshots = as_given(task.sources)
    stopwatch.lap("read")
    found = reduced_basis(snapshots, **how)
    stopwatch.lap("reduce")
    found.save(task.outputs["-o"], overwrite=overwrite)
    if "--sheet" in task.outputs:
        from cvtimg.plotting.sheets import contact_sheet

        write_image(task.outputs["--sheet"], contact_sheet(_panels(found), panel_width=200), overwrite=overwrite)
    if "--plot" in task.outputs:
        from cvtimg.plotting.charts import draw_spectrum

        path = task.outputs["--plot"]
        write_whole(path, draw_spectrum(found.energies, found.variance, path.suffix.lower()), overwrite=overwrite)
    stopwatch.lap("write")
    return {
        "snapshots": len(found.labels),
        "shape": list(found.shape),
        "kind": found.kind,
        "n": found.n_modes,
        "cells": found.n_cells,
        "explained": found.explained,
        "energy": found.energy,
        "energies": found.energies.tolist(),
        "medoids": found.medoids.tolist(),
    }


def _panels(found: Basis) -> list[list[Panel]]:
    """Show centers as they are, and modes about grey: a mode has no sign and no scale."""
    import numpy as np

    from cvtimg.plotting.sheets import Panel

    if len(found.shape) not in (2, 3) or found.shape[2:] not in ((), (1,), (3,)):
        raise ValueError(f"--sheet needs frames that are grey or RGB images, not snapshots of shape {found.shape}")
    panels = []
    for cell, (center, modes) in enumerate(zip(found.centers, found.modes, strict=True)):
        name = "mean" if found.n_cells == 1 else f"cell {cell}: {np.count_nonzero(found.labels == cell)} frames"
        panels.append(Panel(np.clip(np.rint(center), 0, 255).astype(np.uint8).reshape(found.shape), (name,)))
        for number, mode in enumerate(modes):
            about_grey = np.rint(127.5 + 127.5 * mode / max(np.abs(mode).max(), 1e-30)).astype(np.uint8)
            panels.append(Panel(about_grey.reshape(found.shape), (f"mode {number + 1}",)))
    shown = panels[: _MOST_SHOWN + 1]
    return [shown[start : start + _IN_A_ROW] for start in range(0, len(shown), _IN_A_ROW)]

"""``cvtimg basis``: few modes for many frames or fields."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cvtimg.cli.running import Given, Row, Stopwatch, Task, Todo, WrongUsageError, plan_of, planned, plot

if TYPE_CHECKING:
    from cvtimg._shared.types import Array
    from cvtimg.bases import Basis

EXAMPLES = """\
  cvtimg basis film.gif -n 8 -o film.npz --sheet modes.png
  cvtimg basis runs.npy -n auto -o runs.npz --plot energies.png
  cvtimg basis frames/ -n 4 --kind cvod --cells 12 -o frames.npz
"""
COLUMNS = ("snapshots", "kind", "n", "cells", "explained", "energy", "seconds", "output")
#: Images in a row of a sheet, which has four rows at most: with more, they are too small to be told apart.
_IN_A_ROW = 6


def basis(given: Given) -> Todo:
    """Find N modes that nearly contain all frames of an animation, or all rows of an array.

    The file has the arrays of cvtimg.bases.Basis; cvtimg.bases.read_basis reads it. Arrays may be larger than memory.
    """
    return planned(plan_of(given, together=True), _basis, COLUMNS, given)


def _basis(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from cvtimg import reduced_basis
    from cvtimg.bases import as_snapshots

    if not task.sources:
        raise WrongUsageError("there are no frames")
    snapshots = as_snapshots(list(task.sources) if len(task.sources) > 1 else task.sources[0])
    stopwatch.lap("read")
    result = reduced_basis(snapshots, **given.arguments, centered=not given.uncentered)
    stopwatch.lap("reduce")
    result.save(task.outputs["-o"], overwrite=given.overwrite)
    if "--sheet" in task.outputs:
        plot(task.outputs["--sheet"], given, "draw_sheet", _panels(result))
    plot(task.outputs.get("--plot"), given, "draw_spectrum", result.energies, result.variance)
    stopwatch.lap("write")
    return result.summary()


def _panels(basis: Basis) -> list[list[tuple[Array, str]]]:
    """Show centers as they are, and modes about gray: a mode has no sign and no scale."""
    import numpy as np

    if len(basis.shape) not in (2, 3) or basis.shape[2:] not in ((), (1,), (3,)):
        raise ValueError(f"--sheet needs frames that are gray or RGB images, not snapshots of shape {basis.shape}")
    panels = []
    for cell, (center, modes) in enumerate(zip(basis.centers, basis.modes, strict=True)):
        name = "mean" if basis.n_cells == 1 else f"cell {cell}: {np.count_nonzero(basis.labels == cell)} frames"
        panels.append((np.clip(np.rint(center), 0, 255).astype(np.uint8).reshape(basis.shape), name))
        for number, mode in enumerate(modes):
            about_grey = np.rint(127.5 + 127.5 * mode / max(np.abs(mode).max(), 1e-30)).astype(np.uint8)
            panels.append((about_grey.reshape(basis.shape), f"mode {number + 1}"))
    shown = panels[: 4 * _IN_A_ROW]
    return [shown[start : start + _IN_A_ROW] for start in range(0, len(shown), _IN_A_ROW)]

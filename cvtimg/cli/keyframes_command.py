"""``cvtimg keyframes``: the frames of an animation that represent the others."""

from __future__ import annotations

from cvtimg.batch import Row, Stopwatch, Task, plan_one
from cvtimg.cli.basis_command import as_given
from cvtimg.cli.frames_command import check_out_dir, write_to_out_dir
from cvtimg.cli.running import run_plan
from cvtimg.options.record import Given

EXAMPLES = """\
  cvtimg keyframes film.gif -n 6 --sheet key.png
  cvtimg keyframes frames/ -n auto --out-dir key
  cvtimg keyframes film.webp -n 4 --by scenes --json
"""
COLUMNS = ("frames", "n", "indices", "seconds", "output")
_IN_A_ROW = 4


def keyframes(given: Given) -> int:
    """Choose the N frames of an animation that represent all others.

    Frames count from 0. Each key frame is the frame nearest to the mean of those that it represents.
    """
    check_out_dir(given)
    plan = plan_one(given.inputs, {"--sheet": given.sheet})
    return run_plan(plan, _key_frames, COLUMNS, given)


def _key_frames(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    import numpy as np

    from cvtimg import key_frames, write_image
    from cvtimg.plotting.sheets import Panel, contact_sheet

    film = as_given(task.sources)
    stopwatch.lap("read")
    found = key_frames(film, **given.arguments)
    stopwatch.lap("reduce")
    chosen = [int(index) for index in found.indices]
    images = [np.asarray(film.read(index, index + 1))[0] for index in chosen]
    write_to_out_dir(given, zip(chosen, images, strict=True), film.n_snapshots)
    if "--sheet" in task.outputs:
        panels = [
            Panel(image, (f"frame {index}, represents {mass}",))
            for image, index, mass in zip(images, chosen, found.masses, strict=True)
        ]
        rows = [panels[start : start + _IN_A_ROW] for start in range(0, len(panels), _IN_A_ROW)]
        write_image(task.outputs["--sheet"], contact_sheet(rows), overwrite=given.overwrite)
    stopwatch.lap("write")
    return {
        "frames": film.n_snapshots,
        "n": len(chosen),
        "indices": chosen,
        "masses": found.masses.tolist(),
        "labels": found.labels.tolist(),
        "output": str(given.out_dir) if given.out_dir else None,
    }

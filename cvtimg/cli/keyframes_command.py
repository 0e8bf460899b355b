"""``cvtimg keyframes``: the frames of a film that represent the others."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

from typer import Option

from cvtimg.batch import Row, Stopwatch, Task, WrongUsageError, check_suffix, plan_one
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan
from cvtimg.cli.snapshots import Frames, Passes, as_given

EXAMPLES = """Examples:

\b
  cvtimg keyframes film.gif -n 6 --sheet key.png
  cvtimg keyframes frames/ -n auto --out-dir key
  cvtimg keyframes film.webp -n 4 --json
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("frames", "n", "indices", "seconds", "output")
_IN_A_ROW = 4

Number = Annotated[
    Any,
    Option(
        "-n",
        metavar="N|auto",
        parser=options.or_auto(options.whole_number(1, 1 << 16)),
        help="Number of key frames; auto picks it at the elbow of the energy.",
    ),
]
OutDir = Annotated[Path | None, Option(metavar="DIR", help="Write the key frames as frame-INDEX.png into this folder.")]
Sheet = Annotated[Path | None, Option(metavar="FILE", help="Draw the key frames side by side.")]


def keyframes(
    frames: Frames,
    number: Number,
    out_dir: OutDir = None,
    sheet: Sheet = None,
    passes: Passes = 4,
    seed: options.Seed = 0,
    max_pixels: options.MaxPixels = None,
    *,
    common: options.CommonOptions,
) -> int:
    """Choose the N frames of a film that represent all others: medoids of a tessellation of the frames.

    Frames count from 0. Each key frame is the frame nearest to the mean of those that it represents.
    """
    from cvtimg import find_images
    from cvtimg.pictures.files import lossless_suffixes

    check_suffix("--sheet", sheet, lossless_suffixes())
    if out_dir and out_dir.exists() and not out_dir.is_dir():
        raise WrongUsageError(f"--out-dir: {out_dir} is not a folder")
    plan = plan_one(frames, find_images, {"--sheet": sheet})
    how = {"n_frames": number, "passes": passes, "rng": seed}
    work = partial(_key_frames, out_dir=out_dir, how=how, overwrite=common.overwrite)
    return run_plan(plan, work, COLUMNS, common, max_pixels=max_pixels)


def _key_frames(task: Task, stopwatch: Stopwatch, *, out_dir: Path | None, how: dict[str, Any], overwrite: bool) -> Row:
    import numpy as np

    from cvtimg import key_frames, write_image
    from cvtimg.plotting.sheets import Panel, contact_sheet

    film = as_given(task.sources)
    stopwatch.lap("read")
    found = key_frames(film, **how)
    stopwatch.lap("reduce")
    chosen = [int(index) for index in found.indices]
    images = [np.asarray(film.read(index, index + 1))[0] for index in chosen]
    digits = len(str(film.n_snapshots - 1))
    if out_dir:
        out_dir.mkdir(parents=True, exist_ok=True)
        for index, image in zip(chosen, images, strict=True):
            write_image(out_dir / f"frame-{index:0{digits}}.png", image, overwrite=overwrite)
    if "--sheet" in task.outputs:
        panels = [
            Panel(image, (f"frame {index}, represents {mass}",))
            for image, index, mass in zip(images, chosen, found.masses, strict=True)
        ]
        rows = [panels[start : start + _IN_A_ROW] for start in range(0, len(panels), _IN_A_ROW)]
        write_image(task.outputs["--sheet"], contact_sheet(rows), overwrite=overwrite)
    stopwatch.lap("write")
    return {
        "frames": film.n_snapshots,
        "n": len(chosen),
        "indices": chosen,
        "masses": found.masses.tolist(),
        "labels": found.labels.tolist(),
        "output": str(out_dir) if out_dir else None,
    }

"""``cvtimg frames``: animations, sprite sheets and single frames, each from the others."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Row, Stopwatch, Task, WrongUsageError, plan_one
from cvtimg.cli.running import run_plan
from cvtimg.options.record import Given

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cvtimg.pictures import Frames

EXAMPLES = """\
  cvtimg frames walk.gif --sheet walk.png --data walk.json
  cvtimg frames walk.png --cell 32x32 -o walk.gif --duration 80
  cvtimg frames walk.json -o walk.webp
  cvtimg frames walk*.png -o walk.gif --duration 80
  cvtimg frames walk.gif --out-dir walk
"""
COLUMNS = ("frames", "width", "height", "milliseconds", "seconds", "output")


def frames(given: Given) -> int:
    """Turn an animation, a sprite sheet or single images into any of these.

    Sizes, colors and transparency are kept; a .gif of more than 256 colors gets those that represent them best. Names
    that differ by numbers are put in the order of these: walk2.png before walk10.png. To reduce all frames to one
    palette, run cvtimg quantize on the animation or on the sheet, whose cells keep their places.
    """
    if not (given.output or given.sheet or given.out_dir):
        raise WrongUsageError("one of -o, --sheet and --out-dir must be given")
    check_out_dir(given)
    plan = plan_one(given.inputs, {"-o": given.output, "--sheet": given.sheet, "--data": given.data})
    return run_plan(plan, _frames, COLUMNS, given)


def _frames(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from cvtimg.pictures.sheets import write_sheet

    film = _read(in_order(task.sources), given)
    if given.duration:
        film = replace(film, durations=(given.duration,) * len(film.images))
    stopwatch.lap("read")
    if "-o" in task.outputs:
        write_animation(task.outputs["-o"], film, given.overwrite)
    if "--sheet" in task.outputs:
        gaps = {} if given.cell else given.only("margin", "spacing")
        data, columns = task.outputs.get("--data"), given.sheet_columns
        write_sheet(task.outputs["--sheet"], film, data=data, columns=columns, **gaps, overwrite=given.overwrite)
    write_to_out_dir(given, enumerate(film.images), len(film.images))
    stopwatch.lap("write")
    height, width = film.images[0].shape[:2]
    return {
        "frames": len(film.images),
        "width": width,
        "height": height,
        "milliseconds": sum(film.durations),
        "durations": list(film.durations),
        **({} if task.outputs else {"output": str(given.out_dir)}),
    }


def check_out_dir(given: Given) -> None:
    """Refuse an --out-dir that is a file."""
    if given.out_dir and given.out_dir.exists() and not given.out_dir.is_dir():
        raise WrongUsageError(f"--out-dir: {given.out_dir} is not a folder")


def write_to_out_dir(given: Given, images: Iterable[tuple[int, NDArray[Any]]], n_frames: int) -> None:
    """Write some of so many frames, with their numbers, into the folder of --out-dir, if it is given."""
    from cvtimg.pictures import write_image
    from cvtimg.pictures.frames import frame_name

    if given.out_dir is None:
        return
    given.out_dir.mkdir(parents=True, exist_ok=True)
    for number, image in images:
        write_image(given.out_dir / frame_name(number, n_frames), image, overwrite=given.overwrite)


def in_order(sources: Sequence[Path]) -> list[Path]:
    """Put names that are in the order of text into that of their numbers; others are in an order that was given."""
    if list(sources) != sorted(sources):
        return list(sources)

    def key(path: Path) -> list[tuple[int, str]]:
        return [(int(part), "") if part.isdecimal() else (0, part) for part in re.split(r"(\d+)", str(path))]

    return sorted(sources, key=key)


def _read(sources: Sequence[Path], given: Given) -> Frames:
    from cvtimg.pictures import Frames, read_frames, read_image
    from cvtimg.pictures.frames import alike
    from cvtimg.pictures.sheets import DURATION, cut_sheet, read_sheet

    if given.cell:
        if len(sources) > 1:
            raise ValueError(f"--cell cuts one sheet, and there are {len(sources)} inputs")
        return cut_sheet(read_image(sources[0]), given.cell, **given.only("margin", "spacing"))
    parts = [read_sheet(path) if path.suffix.lower() == ".json" else read_frames(path) for path in sources]
    images = alike([image for part in parts for image in part.images])
    durations = tuple(lasting or DURATION for part in parts for lasting in part.durations)
    return Frames(tuple(images), durations, parts[0].plays if len(parts[0].images) > 1 else 0)


def write_animation(path: Path, film: Frames, overwrite: bool) -> None:
    """Write an animation; a .gif needs a palette."""
    from cvtimg import quantize_frames
    from cvtimg.pictures import write_frames

    if path.suffix.lower() == ".gif":
        quantize_frames(film, 256).save(path, overwrite=overwrite)
    else:
        write_frames(path, film, overwrite=overwrite)

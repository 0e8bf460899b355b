"""``cvtimg quantize``: images reduced to few colors."""

from __future__ import annotations

import os
import sys
from dataclasses import fields
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cvtimg._shared.choices import Options
from cvtimg._shared.extras import needs
from cvtimg.batch.pipes import is_pipe
from cvtimg.batch.plans import Plan, check_suffix, searched
from cvtimg.batch.report import Report, complain
from cvtimg.batch.runner import check_plan, fold
from cvtimg.batch.tasks import Row, Stopwatch, Task, WrongUsageError
from cvtimg.cli.running import Todo, only, plan_of, planned, running_of, selected
from cvtimg.options.record import Given

if TYPE_CHECKING:
    from cvtimg._shared.types import Array
    from cvtimg.colors.samples import ColorSamples

EXAMPLES = """\
  cvtimg quantize photo.jpg
  cvtimg quantize photo.jpg -k 16 -o small.png
  cvtimg quantize photos/ 'scans/*.tif' -k 256 --out-dir small
  cvtimg quantize logo.png -k 8 --lock '#ffffff' --lock '#e4002b'
  cvtimg quantize photo.jpg --quality 80
  cvtimg quantize photo.jpg --psnr 38
  cvtimg quantize drawing.png -k auto
  cvtimg quantize frames/ -k 32 --shared-palette --out-dir small
  cvtimg quantize sprite.png --palette game.gpl --dither blue-noise
  cvtimg quantize film.gif -k 64 -o smaller.gif
  cvtimg quantize icons/*.png --psnr 40 --in-place --skip-if-larger
  curl -s example.org/photo.jpg | cvtimg quantize - -k 32 > small.png
"""
#: Arguments of a search, for which there is none where the palette is known.
_FINDING = ("n_colors", "locked", "color_bits", "effort", "method", "init", "volume_power", "rng")
COLUMNS = ("input", "distinct_colors", "k", "energy", "psnr", "input_bytes", "output_bytes", "seconds", "output")

#: Said where nothing tells what is wanted.
_CHOSEN = "goal: eyes, a small file that looks the same; -k N gives the least squared error"

_DEEP = "written with 16 bits per channel; --depth 8 gives an indexed file, a fraction of the size"
_LARGER = "larger than the input; --skip-if-larger leaves such files out"

#: Formats in which a number of colors makes no form of its own, and those in which it does.
_WITHOUT_PALETTE, _OTHERS = (".webp",), (".png", ".gif", ".bmp", ".tif", ".tiff", ".ppm", ".pgm", ".npy")

#: Points of quality by which all and the content may differ, or both are told.
_APART = 2.0


def quantize(given: Given) -> Todo:
    """Reduce images to the N colors that represent them with the least error.

    Give the number of colors by -k, or let it follow from --psnr or --max-bytes (-k is then the largest number), or
    take the colors of --palette, or with -k the best of them. With --quality or --goal eyes, and if nothing is given,
    images get up to 256 colors, and files are made smaller in ways that the eye does not notice.

    Without -o and --out-dir, the output of one input is NAME-quantized.png beside it, or .gif or .tif where the input
    may move or has samples that .png cannot hold. Images of up to 256 colors
    become indexed PNG files of the fewest bits. Images with at most N colors are reproduced exactly. The name after
    -o can also end in .tif, .webp, .gif, .bmp, .ppm, .pgm or .npy. The same seed gives the same file.

    TIFF files of over 2^26 pixels with -o FILE.tif, and Zarr arrays, are read in tiles: memory stays bounded.
    Animations stay animations in .gif, .png and .webp, with one palette for all frames; so do TIFF files of several
    pages, with -o FILE.tif.
    """
    _check(given)
    aims = (given.palette, given.number, given.psnr, given.max_bytes, given.goal, given.quality)
    chosen = all(aim is None for aim in aims)
    for_eyes = chosen or given.goal == "eyes" or given.quality is not None
    joined = ("--save-palette",) if given.shared_palette else ()
    beside = given.in_place or given.ext is not None
    plan = plan_of(given, partial(_name, given=given), joined=joined, beside=beside)
    if given.in_place and not _may_replace(plan, given):
        return lambda: 1
    how = given.arguments | {"overwrite": given.overwrite, "goal": "eyes" if for_eyes and not chosen else "error"}
    palette = how.pop("palette", None)
    if given.shared_palette and not given.dry_run:
        palette = _shared_palette(plan, given, {name: how[name] for name in (*_FINDING, "space") if name in how})
    if palette is not None:
        known = _FINDING if given.shared_palette else _FINDING[1:]
        how = {"palette": palette, **{name: value for name, value in how.items() if name not in known}}
    columns: tuple[str, ...] = (*COLUMNS[:3], "elbow", *COLUMNS[3:]) if given.number == "auto" else COLUMNS
    if for_eyes:
        columns = tuple("quality" if name == "energy" else name for name in columns)
    report = Report(columns, as_json=given.as_json, quiet=given.quiet, note=_CHOSEN if chosen else "")
    late = ("cvtimg.quantization.files", "deflate")
    return planned(plan, partial(_quantize, options=how), report, given, late=late, keep_smaller=_smaller_of(given))


def _check(given: Given) -> None:
    """Refuse what no option can tell by itself."""
    aims = (given.palette, given.number, given.psnr, given.max_bytes, given.quality)
    if given.goal == "error" and all(aim is None for aim in (*aims, given.quality)):
        raise WrongUsageError("one of -k, --quality, --psnr, --max-bytes and --palette must be given with --goal error")
    if given.optimize:
        if given.output and given.output.suffix.lower() != ".png":
            raise WrongUsageError(f"--optimize is for .png, and not for {given.output}")
        if find_spec("oxipng") is None:
            raise WrongUsageError(f"--optimize needs {needs('oxipng', 'oxipng')}")
    if given.ext is not None:
        from cvtimg.pictures.files import lossless_suffixes

        check_suffix("--ext", Path(f"NAME{given.ext}"), lossless_suffixes())
        if os.sep in given.ext or "{" in given.ext or "}" in given.ext:
            raise WrongUsageError(f"--ext: {given.ext!r} must be the end of a file name")


def _smaller_of(given: Given) -> tuple[str, ...]:
    """Return the suffixes of outputs that are to be smaller than their inputs: of all, unless a form is asked for."""
    if any(getattr(given, name) is not None for name in ("mask", "lock", "color_bits", "depth")):
        return ()
    aims = (given.number, given.psnr, given.palette, given.weight_map)
    return _WITHOUT_PALETTE if any(aim is not None for aim in aims) else (*_WITHOUT_PALETTE, *_OTHERS)


def _may_replace(plan: Plan, given: Given) -> bool:
    """Ask whether all images of a folder may be replaced, unless an option allows it; without a terminal it must."""
    if given.yes or given.overwrite or given.dry_run or not (folders := searched(plan)):
        return True
    what = f"{len(plan.tasks)} images in {', '.join(folders)}"
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise WrongUsageError(f"--in-place would replace {what}: --yes allows it, and --dry-run lists them")
    if not typer.confirm(f"Replace {what}?", err=True):
        complain("nothing was replaced")
        return False
    return True


def _quantize(task: Task, stopwatch: Stopwatch, given: Given, *, options: Options) -> Row:
    from cvtimg.quantization import QuantizeOptions, Reading, Writing, quantize_file

    records = (QuantizeOptions, Reading, Writing)
    how, reading, writing = (only(options, [field.name for field in fields(record)]) for record in records)
    engine: Any = {name: value for name, value in options.items() if name not in {**how, **reading, **writing}}
    reads, writes = Reading(**reading), Writing(**writing, save_palette=task.outputs.get("--save-palette"))
    wanted, lap = QuantizeOptions(**how, engine=engine), stopwatch.lap
    result = quantize_file(task.source, task.output, wanted, reading=reads, writing=writes, on_stage=lap)
    hint, row = "", result.summary()
    content = row.get("content_quality")
    if content is not None and abs(content - row["quality"]) > _APART:
        hint = f"quality {content:.1f} where there is content, {row['quality']:.1f} over the whole canvas"
    suffix = task.output.suffix.lower()
    if suffix == ".png" and result.n_colors <= 256 and result.results[0].palette.itemsize == 2:
        hint = _DEEP  # palettes have 8 bits only
    elif suffix in _smaller_of(given):  # which the runner sees to
        pass
    elif task.source.is_file() and task.source.stat().st_size < task.output.stat().st_size:
        hint = _LARGER + ("; -k 256 has an index, more have none" if result.n_colors > 256 else "")
    return row | ({"warning": hint} if hint else {})


def _name(source: Path, *, given: Given) -> str:
    if given.in_place:
        return f"{{}}{source.suffix}"
    from cvtimg.pictures.files import suffix_for

    return f"{{}}{given.ext or ('' if given.out_dir else '-quantized') + suffix_for(source)}"


def _shared_palette(plan: Plan, given: Given, options: dict[str, Any]) -> Array | None:
    """Find the palette of all images together, or None; inputs that cannot be read move to the missing of the plan."""
    from cvtimg import find_palette, write_palette
    from cvtimg.colors.counting import add_samples
    from cvtimg.colors.spaces import to_depth

    running, palette = running_of(given), None
    check_plan(plan, running)
    if any(is_pipe(task.source) for task in plan.tasks):
        raise WrongUsageError("--shared-palette reads each input twice: standard input and pipes cannot be used")
    try:
        total, failed = fold(plan.tasks, partial(_count_known, given=given), add_samples, running)
        if total is not None:
            if "locked" in options:
                options = {**options, "locked": to_depth(options["locked"], total.colors.dtype)}
            palette = find_palette(total, **options).colors
    except ValueError as error:
        raise WrongUsageError(f"--shared-palette: {error}") from error
    plan.missing += [(str(task.source), OSError(failed[task.source])) for task in plan.tasks if task.source in failed]
    plan.tasks = [task for task in plan.tasks if task.source not in failed]
    if given.save_palette and palette is not None:
        write_palette(given.save_palette, palette, overwrite=running.overwrite or given.skip_existing)
        plan.joint = {}
    return palette


def _count_known(task: Task, *, given: Given) -> ColorSamples:
    from cvtimg import read_image
    from cvtimg.colors.counting import count_picture
    from cvtimg.pictures import image_info
    from cvtimg.pictures.stacks import known_in_all

    with selected(given):
        image = read_image(task.source)
        (known,) = known_in_all([image], image_info(task.source), given.mask, given.nodata)
    return count_picture(image, given.depth, mask=None if known.all() else known)

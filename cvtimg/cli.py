"""The command line: parse, call, write; nothing else.

Every command goes one way: plan inputs and outputs, run each input and catch what fails, report. Whatever is heavy
is imported where it is used, so that ``cvtimg --help`` and wrong usage answer at once.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import asdict, dataclass, field
from io import StringIO
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

if TYPE_CHECKING:
    from cvtimg.quantization import Quantized

__all__ = ["app", "main"]

Row = dict[str, Any]
Missing = list[tuple[str, OSError]]

MAX_COLORS = 1 << 16  # as in quantization.py, which would import NumPy for --help


class WrongUsageError(typer.TyperException):
    """What was asked for makes no sense, whatever is in the pictures."""

    exit_code = 2


@dataclass(frozen=True, slots=True)
class Task:
    """One input, and the files that shall come of it, by kind."""

    source: Path
    outputs: Mapping[str, Path] = field(default_factory=dict)


def _whole_number(low: int, high: int) -> Callable[[str | int], int]:
    """Make a parser for an option: Typer's own says neither what was given nor all that is allowed."""

    def parse(text: str | int) -> int:
        with suppress(ValueError):
            if low <= int(text) <= high:
                return int(text)
        raise typer.BadParameter(f"{str(text)!r} must be a whole number in {low}..{high}")

    return parse


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"cvtimg {version('cvtimg')}", flush=True)
        raise typer.Exit


_COUNT, _SEED = _whole_number(1, MAX_COLORS), _whole_number(0, 2**63 - 1)
Inputs = Annotated[list[str], typer.Argument(metavar="INPUT", help="Pictures, folders, or patterns like 'a/*.tif'.")]
Colors = Annotated[int, Option("--colors", "-k", metavar="N", parser=_COUNT, help="Colors to keep, at most 65536.")]
Output = Annotated[Path | None, Option("--output", "-o", metavar="FILE", help="Output, for one input.")]
OutDir = Annotated[Path | None, Option(metavar="DIR", help="Folder for outputs NAME.png; made if it is missing.")]
# The names stand here as text, for the registries would import NumPy; a test holds them together.
Effort = Annotated[str, Option(metavar="NAME", help="Time to take: fast, balanced or best.")]
Init = Annotated[str, Option(metavar="NAME", help="Colors to begin with: split, k-means++, maximin or random.")]
Seed = Annotated[int, Option("--seed", metavar="N", parser=_SEED, help="Seed for --init k-means++ and random.")]
SavePalette = Annotated[Path | None, Option(metavar="FILE", help="Write the colors, .json or .gpl; for one input.")]
Overwrite = Annotated[bool, Option("--overwrite", help="Replace outputs that exist. Inputs are never replaced.")]
AsJson = Annotated[bool, Option("--json", help="Print a JSON object a line for each input, not a table.")]
Quiet = Annotated[bool, Option("--quiet", help="Print nothing but errors.")]
Version = Annotated[bool, Option("--version", callback=_show_version, is_eager=True, help="Print the version.")]

# Typer's boxed help takes 0.1 s more, and breaks lines that people would copy.
app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog="Exit status: 0 all done; 1 some input failed, the others are done; 2 wrong usage.",
)


@app.callback()
def _cvtimg(version: Version = False) -> None:
    """Find the few colors that stand best for a picture: each is the mean of the pixels nearest to it."""


#: Columns of tables, in the words of --json; both fit into 80 characters.
QUANTIZE_COLUMNS = ("input", "distinct_colors", "k", "energy", "psnr", "seconds", "output")
INFO_COLUMNS = ("input", "width", "height", "mode", "bands", "bits", "alpha", "distinct_colors", "icc")
TEXT_COLUMNS = ("input", "output", "mode", "bands", "icc")
QUANTIZE_EXAMPLES = """Examples:

\b
  cvtimg quantize photo.jpg -k 16 -o small.png
  cvtimg quantize photos/ 'scans/*.tif' -k 256 --out-dir small
  cvtimg quantize logo.png -k 8 --effort best --save-palette logo.gpl
"""


@app.command(epilog=QUANTIZE_EXAMPLES)
def quantize(
    inputs: Inputs,
    colors: Colors,
    output: Output = None,
    out_dir: OutDir = None,
    effort: Effort = "balanced",
    init: Init = "split",
    seed: Seed = 0,
    save_palette: SavePalette = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Reduce pictures to the N colors that stand best for them.

    Without -o and --out-dir, one input gives NAME-quantized.png beside it. Up to 256 colors make an indexed PNG
    of the fewest bits. A picture that has no more than N colors comes back exactly. The output of -o can also end in
    .tif, .webp, .gif, .bmp, .ppm or .pgm. The same seed gives the same file.
    """
    from cvtimg import EFFORTS, SEEDINGS
    from cvtimg.palette import PALETTE_WRITERS

    _check_choice("--effort", effort, EFFORTS)
    _check_choice("--init", init, SEEDINGS)
    if as_json and quiet:
        raise WrongUsageError("--json and --quiet exclude each other")
    sources, missing = _find(inputs, out_dir)
    _check_outputs(len(sources) + len(missing), out_dir, {"-o": output, "--save-palette": save_palette})
    extra = {"palette": save_palette} if save_palette else {}
    if save_palette:
        _check_choice("--save-palette", save_palette.suffix.lower(), PALETTE_WRITERS)
    tasks = [Task(source, {"picture": output or _name_output(source, out_dir), **extra}) for source in sources]
    _check_no_clash(tasks)

    def work(task: Task) -> Row:
        return _quantize(task, overwrite, {"n_colors": colors, "effort": effort, "init": init, "rng": seed})

    report = _Report(QUANTIZE_COLUMNS, as_json=as_json, quiet=quiet)
    with _folder(out_dir) if out_dir else nullcontext():
        _run(tasks, missing, work, report)


@app.command(epilog="Example:  cvtimg info photos/ --json")
def info(inputs: Inputs, as_json: AsJson = False) -> None:
    """Tell size, format, bands, depth and number of distinct colors of pictures."""
    sources, missing = _find(inputs)
    _run([Task(source) for source in sources], missing, _info, _Report(INFO_COLUMNS, as_json=as_json))


def _quantize(task: Task, overwrite: bool, options: Mapping[str, Any]) -> Row:
    from cvtimg import quantize, read_image

    for path in task.outputs.values():
        _check_can_be_written(path, overwrite)
    start = perf_counter()
    image = read_image(task.source)
    if image.dtype.kind == "f":
        raise ValueError("has floating point samples, which no output format holds; convert it to 16-bit grey")
    read = perf_counter()
    result = quantize(image, **options)
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


def _info(task: Task) -> Row:
    from cvtimg import color_samples, image_info, read_image

    header = asdict(image_info(task.source))
    header["alpha"] = header.pop("has_alpha")
    n_colors = color_samples(read_image(task.source)).n_colors
    return {"input": str(task.source), **header, "distinct_colors": n_colors}


def _find(inputs: Iterable[str], out_dir: Path | None = None) -> tuple[list[Path], Missing]:
    """Pictures that the arguments name, each once, and the arguments that name none.

    What lies in an output folder inside an input folder came from an earlier run, and is no input.
    """
    from cvtimg import find_images

    sources: dict[Path, None] = {}
    missing: Missing = []
    outside = out_dir.resolve() if out_dir else None
    for text in inputs:
        try:
            found = find_images(text)
        except OSError as error:
            missing.append((text, error))
            continue
        if outside and Path(text).resolve() in outside.parents:
            found = [path for path in found if outside not in path.resolve().parents]
        sources.update(dict.fromkeys(found))
    return list(sources), missing


def _check_choice(option: str, value: str, allowed: Iterable[str]) -> None:
    if value not in (names := list(allowed)):
        raise WrongUsageError(f"{option}: {value!r} must be one of {', '.join(names)}")


def _check_outputs(n_inputs: int, out_dir: Path | None, files: Mapping[str, Path | None]) -> None:
    """Refuse combinations that cannot be; `files` are the options that name one file, the picture under ``-o``."""
    from cvtimg.io import _FORMATS

    output = files["-o"]
    if output and out_dir:
        raise WrongUsageError("-o and --out-dir exclude each other")
    given = [option for option, file in files.items() if file]
    if n_inputs > 1 and given:
        raise WrongUsageError(f"{given[0]} is for one input, and these are {n_inputs}")
    if n_inputs > 1 and not out_dir:
        raise WrongUsageError(f"{n_inputs} inputs need --out-dir DIR")
    if output:
        _check_choice("-o", output.suffix.lower(), [suffix for suffix, form in _FORMATS.items() if form.lossless])


def _name_output(source: Path, out_dir: Path | None) -> Path:
    return out_dir / f"{source.stem}.png" if out_dir else source.with_name(f"{source.stem}-quantized.png")


def _check_no_clash(tasks: Sequence[Task]) -> None:
    """Refuse outputs that would replace an input or each other, before any work."""
    inputs = {_identity(task.source) for task in tasks}
    owners: dict[str, Path] = {}
    for task in tasks:
        for path in task.outputs.values():
            if path.exists() and _identity(path) in inputs:
                raise WrongUsageError(f"{path} is an input, which is never replaced; choose another output")
            place = os.path.normcase(path.resolve())
            if place in owners:
                raise WrongUsageError(f"{owners[place]} and {task.source} would both become {path}")
            owners[place] = task.source


def _identity(path: Path) -> tuple[int, int]:
    """Tell files apart whatever links and names lead to them."""
    status = path.stat()
    return status.st_dev, status.st_ino


def _check_can_be_written(path: Path, overwrite: bool) -> None:
    """Fail now rather than after the work: begin to write, and do not go through with it."""
    from cvtimg.files import whole_file

    class EndOfTrialError(Exception):
        pass

    with suppress(EndOfTrialError), whole_file(path, overwrite=overwrite):
        raise EndOfTrialError


@contextmanager
def _folder(path: Path) -> Iterator[None]:
    """Make a folder for outputs, and take it away again if nothing came into it."""
    made = not path.exists()
    path.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        if made:
            with suppress(OSError):  # not empty
                path.rmdir()


def _run(tasks: Sequence[Task], missing: Missing, work: Callable[[Task], Row], report: _Report) -> None:
    """Do all that can be done, name what fails, and leave with the right status."""
    for text, error in missing:
        report.failed(text, error)
    with _progress(tasks, report) as steps:
        for task in steps:
            try:
                row = work(task)
            except Exception as error:  # one bad picture, whatever is wrong with it, must not stop the others
                report.failed(task.source, error)
            else:
                report.done(row)
    report.close()


@contextmanager
def _progress(tasks: Sequence[Task], report: _Report) -> Iterator[Iterable[Task]]:
    """Show a bar on stderr where a person watches it, and where it does not mix with JSON on the same terminal."""
    if len(tasks) < 2 or report.quiet or not sys.stderr.isatty() or (report.as_json and sys.stdout.isatty()):
        yield tasks
        return
    from rich.console import Console
    from rich.progress import Progress

    # Rich would send what is printed meanwhile to its own console, but JSON must go to stdout.
    with Progress(console=Console(stderr=True), transient=True, redirect_stdout=False) as bar:
        yield bar.track(tasks, description="cvtimg")


class _Report:
    """What people and programs read: a JSON object a line as it comes, or a table at the end; errors on stderr."""

    def __init__(self, columns: Sequence[str], *, as_json: bool, quiet: bool = False) -> None:
        self.as_json, self.quiet = as_json, quiet
        self._columns = columns
        self._rows: list[Row] = []
        self._n_failed = 0

    def done(self, row: Row) -> None:
        """Tell of an input that is done."""
        if self.as_json:
            print(json.dumps(row, allow_nan=False), flush=True)
        elif not self.quiet:
            self._rows.append(row)

    def failed(self, path: str | Path, error: Exception) -> None:
        """Name an input that failed, and why."""
        self._n_failed += 1
        reason = _reason(path, error)
        _complain(f"{path}: {reason}")
        if self.as_json:
            print(json.dumps({"input": str(path), "error": reason}), flush=True)

    def close(self) -> None:
        """Print the table; leave with 1 if an input failed."""
        if self._rows:
            self._print_table()
        if self._n_failed:
            raise typer.Exit(1)

    def _print_table(self) -> None:
        from rich.console import Console
        from rich.table import Table

        # A pipe is as wide as need be. Markup is off, for names of files may have brackets in them.
        narrow = sys.stdout.isatty()
        console = Console(markup=False, highlight=False, emoji=False, width=None if narrow else 10_000)
        table = Table(box=None, pad_edge=False)
        for column in self._columns:
            is_text = column in TEXT_COLUMNS
            head = column.removeprefix("distinct_")
            table.add_column(head, justify="left" if is_text else "right", overflow="fold", no_wrap=not is_text)
        for row in self._rows:
            shown = {**row, "input": Path(row["input"]).name} if narrow else row
            table.add_row(*(_cell(column, shown[column]) for column in self._columns))
        console.print(table)


def _cell(column: str, value: Any) -> str:
    """Word a value of a row for people."""
    if column == "psnr":
        return "exact" if value is None else f"{value:.2f}"
    if column == "seconds":
        return f"{sum(value.values()):.2f}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return ",".join(value)
    text = "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
    return text.encode(errors="replace").decode()  # names of files need not be text


def _reason(path: str | Path, error: Exception) -> str:
    """Say why in one line, without the path; what is worded for users goes without the name of its type."""
    from cvtimg.files import one_line

    if isinstance(error, MemoryError):
        return "needs more memory than there is"
    text = one_line(error).removeprefix(f"{path}: ")
    name = type(error).__name__
    return text if isinstance(error, (OSError, ValueError)) or text in ("", name) else f"{name}: {text}"


def _complain(text: str) -> None:
    print(f"cvtimg: {' '.join(text.splitlines())}", file=sys.stderr, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, ``sys.argv`` by default, and return the exit status; the console script ``cvtimg``."""
    given = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    sys.stdout, sys.stderr = sys.stdout or StringIO(), sys.stderr or StringIO()  # None where nobody listens
    try:
        command = typer.main.get_command(app)
        code = int(command.main(args=given, prog_name="cvtimg", standalone_mode=False) or 0)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except typer.TyperException as error:
        command_line = getattr(getattr(error, "ctx", None), "command_path", f"cvtimg {given[0]}")
        _complain(f"{error.format_message().rstrip('.')} (see {command_line} --help)")
        return error.exit_code
    except Exception as error:  # no traceback reaches a user
        path = error.filename if isinstance(error, OSError) and error.filename else "unexpected"
        _complain(f"{path}: {_reason(path, error)}")
        return 1
    if code == 130:
        _complain("interrupted")
    return code


if __name__ == "__main__":
    sys.exit(main())

"""``cvtimg elbow``: energy curves of pictures and tables, and the number of generators that they suggest."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from functools import partial
from io import StringIO
from itertools import combinations
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from cvtimg.batch import Report, Row, Running, Task, WrongUsageError, check_choice, find, run
from cvtimg.cli import options
from cvtimg.cli.batch_options import with_running

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cvtimg.elbow.curves import EnergyCurve
    from cvtimg.plotting.energy_curves import Plotted

EXAMPLES = """Examples:

\b
  cvtimg elbow photo.jpg
  cvtimg elbow photos/ --k-max 32 --csv curves.csv --plot curves.png
  cvtimg elbow photo.jpg --rule psnr --target 35 --space lab
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "k", "energy", "explained", "seconds", "elbow")
TABLE_SUFFIXES = (".csv", ".tsv", ".npy")  # as in tables.py

Inputs = Annotated[
    list[str], typer.Argument(metavar="INPUT", help="Pictures, tables (.csv, .tsv, .npy), folders or patterns.")
]
KMax = Annotated[
    int, Option("--k-max", metavar="N", parser=options.whole_number(1, 4096), help="Greatest number, 64 by default.")
]
RuleName = Annotated[
    str, Option("--rule", metavar="NAME", help="What picks k: chord, chord-linear, kneedle, variance or psnr.")
]
Target = Annotated[
    float | None,
    Option(metavar="X", parser=options.number(0), help="Share to explain, 0.95, of variance; dB, 30, of psnr."),
]
Space = Annotated[str, Option(metavar="NAME", help="Where distances are measured: rgb, linear, lab or oklab.")]
AveragingName = Annotated[
    str, Option("--averaging", metavar="NAME", help="As cvtimg segment will average: none, before or after.")
]
EdgeWeight = Annotated[
    float | None,
    Option("--edge-weight", metavar="L", parser=options.number(0), help="As cvtimg segment will weigh edges, >= 0."),
]
Effort = Annotated[
    str, Option(metavar="NAME", help="fast: all k in one pass. balanced, best: each k is searched by itself too.")
]
CsvFile = Annotated[Path | None, Option("--csv", metavar="FILE", help="Write all curves, a line for each k.")]
PlotFile = Annotated[Path | None, Option("--plot", metavar="FILE", help="Draw all curves, .png or .svg.")]
Seed = Annotated[int, Option("--seed", metavar="N", parser=options.SEED, help="Seed of what is drawn for tables.")]


@with_running("jobs", "report_file", "max_pixels", "dask")
def elbow(
    inputs: Inputs,
    k_max: KMax = 64,
    rule: RuleName = "chord",
    target: Target = None,
    space: Space = "rgb",
    volume_power: options.VolumePower = 0,
    averaging: AveragingName = "none",
    edge_weight: EdgeWeight = None,
    effort: Effort = "fast",
    csv_file: CsvFile = None,
    plot: PlotFile = None,
    seed: Seed = 0,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
    *,
    running: Running,
) -> None:
    """Suggest how many generators pictures and tables need, by the elbow of their energy.

    The energy falls with each generator; up to the number of colors that a picture really has it falls fast. Each
    input has a line with the number that the rule picks, and what the other rules would. One input has its whole
    curve below. All columns of a table are taken, as cvtimg cluster -k auto does when it is not told which.
    """
    from cvtimg.colors.spaces import SPACES
    from cvtimg.elbow.rules import RULES, TARGETED
    from cvtimg.engine import EFFORTS
    from cvtimg.plotting.energy_curves import PLOT_SUFFIXES

    check_choice("--rule", rule, RULES)
    check_choice("--space", space, SPACES)
    check_choice("--effort", effort, EFFORTS)
    check_choice("--averaging", averaging, ("none", "before", "after"))
    if target is not None and rule not in TARGETED:
        raise WrongUsageError(f"--target is for --rule {' and '.join(TARGETED)}, not {rule}")
    if plot:
        check_choice("--plot", plot.suffix.lower(), PLOT_SUFFIXES)
    report = _Curves(COLUMNS, as_json=as_json, quiet=quiet)
    sources, missing = find(inputs, _find)
    outputs = {"--csv": csv_file, "--plot": plot, "--report": running.file}
    _check_outputs({option: path for option, path in outputs.items() if path}, list(sources), overwrite)
    how: dict[str, Any] = {"n_max": k_max, "space": space, "volume_power": volume_power, "rng": seed}
    segments: dict[str, Any] = {"averaging": averaging} if averaging != "none" else {}
    if edge_weight:
        segments["edge_weight"] = edge_weight
    if segments and effort != "fast":
        raise WrongUsageError(
            "--effort is not for --averaging and --edge-weight, where each k has a descent of its own"
        )
    if not segments:
        how["effort"] = effort
    work = partial(_measure, how=how, segments=segments, rule=rule, target=target, keep=plot is not None)
    status = run([Task(source) for source in sources], missing, work, report, overwrite=overwrite, running=running)
    done = report.plotted
    if len(done) == 1 and not (as_json or quiet):
        _print_curve(done[0].curve, {**done[0].curve.elbows(), rule: done[0].k})
    if done:
        _write(csv_file, plot, done, rule, overwrite)
    raise typer.Exit(status)


class _Curves(Report):
    """Keeps what is drawn of each input, which comes with its row."""

    def __init__(self, columns: Sequence[str], *, as_json: bool, quiet: bool) -> None:
        super().__init__(columns, as_json=as_json, quiet=quiet)
        self.plotted: list[Plotted] = []

    def done(self, row: Row) -> None:
        """Tell of an input that is done."""
        self.plotted.append(row.pop("plotted"))
        super().done(row)


def _find(text: str) -> list[Path]:
    from cvtimg import find_images

    return find_images(text)


def _check_outputs(outputs: Mapping[str, Path], sources: list[Path], overwrite: bool) -> None:
    """Refuse, before any work, files that would replace an input, each other, or what exists."""
    from cvtimg.batch import check_can_be_written

    for (one, path), (other, same) in combinations(outputs.items(), 2):
        if path.resolve() == same.resolve():
            raise WrongUsageError(f"{one} and {other} would both become {path}")
    for path in outputs.values():
        if path.exists() and any(path.samefile(source) for source in sources):
            raise WrongUsageError(f"{path} is an input, which is never replaced; choose another output")
        check_can_be_written(path, overwrite)


def _measure(
    task: Task, *, how: Mapping[str, Any], segments: Mapping[str, Any], rule: str, target: float | None, keep: bool
) -> Row:
    from cvtimg import energy_curve
    from cvtimg.plotting.energy_curves import Plotted
    from cvtimg.segmentation import segment_curve

    source = task.source
    start = perf_counter()
    samples, image = _read(source, how["space"])
    read = perf_counter()
    if segments and image is None:
        raise ValueError("--averaging and --edge-weight are for pictures, not for tables")
    curve = segment_curve(image, **how, **segments) if segments else energy_curve(samples, **how)
    k = curve.elbow(rule, target)
    measured = perf_counter()
    psnr = None if curve.psnr is None else [value if math.isfinite(value) else None for value in curve.psnr.tolist()]
    return {
        "input": str(source),
        "k": k,
        "rule": rule,
        "energy": float(curve.energies[k - 1]),
        "explained": float(curve.explained[k - 1]),
        "psnr": psnr[k - 1] if psnr else None,
        "elbow": curve.elbows(),
        "n_max": curve.n_max,
        "energies": curve.energies.tolist(),
        "seconds": {"read": read - start, "cluster": measured - read},
        "plotted": Plotted(source.stem, curve, k, image if keep and not segments else None, how["space"]),
    }


def _read(source: Path, space: str) -> tuple[NDArray[Any], NDArray[Any] | None]:
    """Read the samples, and the picture if it is one."""
    from cvtimg import read_image
    from cvtimg.tables.files import read_table

    if source.suffix.lower() not in TABLE_SUFFIXES:
        image = read_image(source)
        return image, image
    if space != "rgb":
        raise ValueError(f"--space {space} is for pictures; a table has no color space")
    return read_table(source).rows, None


def _print_curve(curve: EnergyCurve, picks: Mapping[str, int]) -> None:
    """Print a line for each k, and which rules pick it."""
    psnr = curve.psnr
    print(f"\n{'k':>5}  {'energy':>11}  {'explained':>9}  {'psnr':>6}  picked by")
    for k, (energy, share) in enumerate(zip(curve.energies, curve.explained, strict=True), 1):
        decibels = "" if psnr is None else f"{psnr[k - 1]:.2f}" if math.isfinite(psnr[k - 1]) else "exact"
        by = ", ".join(name for name, pick in picks.items() if pick == k)
        print(f"{k:>5}  {energy:>11.5g}  {share:>9.2%}  {decibels:>6}  {by}".rstrip())


def _write(csv_file: Path | None, plot: Path | None, done: list[Plotted], rule: str, overwrite: bool) -> None:
    from cvtimg.files.whole import whole_file

    if csv_file:
        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["input", "k", "energy", "explained", "chosen"])
        for one in done:
            curve = one.curve
            for k, (energy, share) in enumerate(zip(curve.energies.tolist(), curve.explained.tolist(), strict=True), 1):
                writer.writerow([one.name, k, energy, share, int(k == one.k)])
        with whole_file(csv_file, overwrite=overwrite) as file:
            file.write(text.getvalue().encode())
    if plot:
        from cvtimg.plotting.energy_curves import draw_curves

        drawn = draw_curves(done, plot.suffix.lower(), rule)
        with whole_file(plot, overwrite=overwrite) as file:
            file.write(drawn)

"""``cvtimg elbow``: energy curves of images and tables, and the number of generators that they suggest."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer import Option

from cvtimg._shared.choices import EffortName
from cvtimg.batch import Report, Row, Stopwatch, Task, WrongUsageError, check_suffix, plan_each
from cvtimg.batch.runner import INTERRUPTED
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan
from cvtimg.cli.pages import read_whole

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cvtimg.elbow.curves import EnergyCurve
    from cvtimg.plotting.energy_curves import Plotted

EXAMPLES = """Examples:

\b
  cvtimg elbow photo.jpg
  cvtimg elbow photos/ --k-max 32 --csv curves.csv --plot curves.png
  cvtimg elbow photo.jpg --rule psnr --target 35
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "k", "energy", "explained", "seconds", "elbow")
TABLE_SUFFIXES = (".csv", ".tsv", ".npy")  # as in tables.py

Inputs = Annotated[
    list[str],
    typer.Argument(metavar="INPUT...", help="Images, tables (.csv, .tsv, .npy), folders or patterns like 'a/*.png'."),
]
KMax = Annotated[
    int, Option(metavar="N", parser=options.whole_number(1, 4096), help="Largest number of generators to try.")
]
RuleName = Annotated[
    Literal["chord", "chord-linear", "kneedle", "variance", "psnr"],
    Option("--rule", help="Rule that picks the number of generators."),
]
Target = Annotated[
    float | None,
    Option(
        metavar="X",
        parser=options.number(0),
        help="Target of --rule variance (share explained, 0.95 by default) or psnr (decibels, 30 by default).",
    ),
]
Averaging = Annotated[options.AveragingChoice, Option(help="Measure segments made with this --averaging.")]
EdgeWeight = Annotated[
    float | None, Option(metavar="L", parser=options.number(0), help="Measure segments made with this --edge-weight.")
]
Effort = Annotated[
    EffortName, Option(help="fast: all numbers in one pass; balanced, best: also search each by itself.")
]
CsvFile = Annotated[Path | None, Option("--csv", metavar="FILE", help="Write all curves, one line for each k.")]
PlotFile = Annotated[Path | None, Option("--plot", metavar="FILE", help="Plot all curves, .png or .svg.")]


def elbow(
    inputs: Inputs,
    k_max: KMax = 64,
    rule: RuleName = "chord",
    target: Target = None,
    space: options.Space = "rgb",
    volume_power: options.VolumePower = 0,
    averaging: Averaging = "none",
    edge_weight: EdgeWeight = None,
    effort: Effort = "fast",
    missing: options.Missing = "error",
    csv_file: CsvFile = None,
    plot: PlotFile = None,
    seed: options.Seed = 0,
    max_pixels: options.MaxPixels = None,
    *,
    common: options.BatchOptions,
) -> int:
    """Suggest how many colors or clusters images and tables need, by the elbow of the energy.

    The energy falls with each generator: fast up to the number of colors that an image really has, slowly beyond it.
    Each input has a line with the number that the rule picks, and those of the other rules. One input is followed by
    its whole curve. All columns of a table are used, as by cvtimg cluster -k auto without --columns.
    """
    from cvtimg import find_images
    from cvtimg.elbow.rules import TARGETED
    from cvtimg.plotting.charts import PLOT_SUFFIXES

    if target is not None and rule not in TARGETED:
        raise WrongUsageError(f"--target is for --rule {' and '.join(TARGETED)}, not {rule}")
    if rule == "psnr" and space != "rgb":
        raise WrongUsageError(f"--rule psnr needs --space rgb: distances in {space} have no peak")
    check_suffix("--plot", plot, PLOT_SUFFIXES)
    report = _Curves(COLUMNS, as_json=common.as_json, quiet=common.quiet)
    plan = plan_each(inputs, find_images, joint={"--csv": csv_file, "--plot": plot})
    curve: dict[str, Any] = {"n_max": k_max, "space": space, "volume_power": volume_power, "rng": seed}
    segments: dict[str, Any] = {"averaging": averaging} if averaging != "none" else {}
    if edge_weight:
        segments["edge_weight"] = edge_weight
    if segments and effort != "fast":
        raise WrongUsageError("--effort cannot be used with --averaging or --edge-weight, which search each k anyway")
    if not segments:
        curve["effort"] = effort
    work = partial(
        _measure, curve=curve, segments=segments, rule=rule, target=target, missing=missing, keep=plot is not None
    )
    status = run_plan(plan, work, report, common, max_pixels=max_pixels)
    done = report.plotted
    if len(done) == 1 and not (common.as_json or common.quiet):
        _print_curve(done[0].curve, {**done[0].curve.elbows(), rule: done[0].k})
    if done and status != INTERRUPTED:
        _write(csv_file, plot, done, rule, common.overwrite)
    return status


class _Curves(Report):
    """Keeps the drawing of each input, which comes with its row."""

    def __init__(self, columns: Sequence[str], *, as_json: bool, quiet: bool) -> None:
        super().__init__(columns, as_json=as_json, quiet=quiet)
        self.plotted: list[Plotted] = []

    def done(self, row: Row) -> None:
        """Record a completed input."""
        self.plotted.append(row.pop("plotted"))
        super().done(row)


def _measure(
    task: Task,
    stopwatch: Stopwatch,
    *,
    curve: Mapping[str, Any],
    segments: Mapping[str, Any],
    rule: str,
    target: float | None,
    missing: str,
    keep: bool,
) -> Row:
    from cvtimg import energy_curve
    from cvtimg.plotting.energy_curves import Plotted
    from cvtimg.segmentation import segment_curve

    samples, image = _read(task.source, curve["space"], missing)
    stopwatch.lap("read")
    if segments and image is None:
        raise ValueError("--averaging and --edge-weight are for images, not for tables")
    result = segment_curve(image, **curve, **segments) if segments else energy_curve(samples, **curve)
    k = result.elbow(rule, target)
    stopwatch.lap("cluster")
    psnr = None if result.psnr is None else [value if math.isfinite(value) else None for value in result.psnr.tolist()]
    return {
        "k": k,
        "rule": rule,
        "energy": float(result.energies[k - 1]),
        "explained": float(result.explained[k - 1]),
        "psnr": psnr[k - 1] if psnr else None,
        "elbow": result.elbows(),
        "n_max": result.n_max,
        "energies": result.energies.tolist(),
        "plotted": Plotted(task.source.stem, result, k, image if keep and not segments else None, curve["space"]),
    }


def _read(source: Path, space: str, missing: str) -> tuple[NDArray[Any], NDArray[Any] | None]:
    """Read the samples, and the image if the file is one."""
    from cvtimg.tables.files import read_table

    if source.suffix.lower() not in TABLE_SUFFIXES:
        image = read_whole(source)
        return image, image
    if space != "rgb":
        raise ValueError(f"--space {space} is for images; a table has no color space")
    return read_table(source, missing=missing).rows, None


def _print_curve(curve: EnergyCurve, picks: Mapping[str, int]) -> None:
    """Print a line for each k with the rules that pick it."""
    psnr = curve.psnr
    print(f"\n{'k':>5}  {'energy':>11}  {'explained':>9}  {'psnr':>6}  picked by")
    for k, (energy, share) in enumerate(zip(curve.energies, curve.explained, strict=True), 1):
        decibels = "" if psnr is None else f"{psnr[k - 1]:.2f}" if math.isfinite(psnr[k - 1]) else "exact"
        by = ", ".join(name for name, pick in picks.items() if pick == k)
        print(f"{k:>5}  {energy:>11.5g}  {share:>9.2%}  {decibels:>6}  {by}".rstrip())


def _write(csv_file: Path | None, plot: Path | None, done: list[Plotted], rule: str, overwrite: bool) -> None:
    from cvtimg.files.text_tables import write_csv
    from cvtimg.files.whole import write_whole

    if csv_file:
        lines = [
            (one.name, k, energy, share, int(k == one.k))
            for one in done
            for k, energy, share in zip(
                itertools.count(1), one.curve.energies.tolist(), one.curve.explained.tolist(), strict=False
            )
        ]
        write_csv(csv_file, ("input", "k", "energy", "explained", "chosen"), lines, overwrite=overwrite)
    if plot:
        from cvtimg.plotting.energy_curves import draw_curves

        write_whole(plot, draw_curves(done, plot.suffix.lower(), rule), overwrite=overwrite)

"""``cvtimg design``: points for experiments."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

from typer import Option

from cvtimg.batch import Report, Row, Stopwatch, Task, WrongUsageError, check_suffix, plan_one
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan

EXAMPLES = """Examples:

\b
  cvtimg design -n 20 -d 3
  cvtimg design -n 50 --bounds bounds.csv -o runs.csv --plot runs.png --measures
  cvtimg design -n 30 --bounds bounds.csv --existing runs.csv -o more.csv
  cvtimg design -n 256 -d 2 --no-latin --effort best -o points.npy
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("n", "dimensions", "energy", "latin", "seconds", "output")
MEASURES = ("discrepancy", "h", "chi", "tau", "d")
_TABLES = (".csv", ".tsv", ".npy")

Number = Annotated[
    int, Option("-n", metavar="N", parser=options.whole_number(1, 1 << 16), help="Number of new points.")
]
Dimensions = Annotated[
    int | None,
    Option("-d", metavar="D", parser=options.whole_number(1, 64), help="Number of axes, each from 0 to 1."),
]
BoundsFile = Annotated[
    Path | None, Option("--bounds", metavar="FILE", help="Axes: a .csv file with the columns name, low and high.")
]
Existing = Annotated[
    Path | None, Option(metavar="FILE", help="Points that exist, .csv or .npy: new points keep away from them.")
]
Output = Annotated[
    Path | None, Option("--output", "-o", metavar="FILE", help="Write the points, .csv or .npy; by default print them.")
]
Latin = Annotated[bool, Option("--latin/--no-latin", help="Give each of N slices along each axis exactly one point.")]
Periodic = Annotated[bool, Option("--periodic", help="Let opposite ends of each axis meet.")]
Measures = Annotated[
    bool, Option("--measures", help="Report the star discrepancy and the evenness of the Voronoi cells.")
]
Plot = Annotated[Path | None, Option(metavar="FILE", help="Plot the points in each pair of axes, .png or .svg.")]


def design(
    number: Number,
    dimensions: Dimensions = None,
    bounds: BoundsFile = None,
    existing: Existing = None,
    output: Output = None,
    latin: Latin = True,
    periodic: Periodic = False,
    measures: Measures = False,
    plot: Plot = None,
    effort: options.Effort = "balanced",
    seed: options.Seed = 0,
    *,
    common: options.CommonOptions,
) -> int:
    """Place N points for experiments, as evenly as the cells of a centroidal Voronoi tessellation.

    Points fill the box of -d or --bounds. By default they are Latin as well: each of N slices along each axis has one
    point. The energy is the mean squared distance from the box, scaled to the unit cube, to the nearest point.
    """
    from cvtimg.plotting.charts import PLOT_SUFFIXES

    axes = bounds if dimensions is None else dimensions
    if axes is None or None not in (dimensions, bounds):
        raise WrongUsageError("give either -d or --bounds")
    check_suffix("-o", output, (".csv", ".npy"))
    check_suffix("--bounds", bounds, (".csv",))
    check_suffix("--existing", existing, _TABLES)
    check_suffix("--plot", plot, PLOT_SUFFIXES)
    plan = plan_one((), _no_inputs, {"-o": output, "--plot": plot}, also_read=[bounds, existing])
    report = Report((*COLUMNS, *MEASURES) if measures else COLUMNS, as_json=common.as_json, quiet=common.quiet)
    report.quiet = report.quiet or (output is None and not common.as_json)  # then the points are printed
    options = {"latin": latin, "periodic": periodic, "effort": effort, "rng": seed}
    work = partial(_design, number=number, axes=axes, existing=existing, options=options, measures=measures)
    return run_plan(plan, partial(work, overwrite=common.overwrite, printed=not common.as_json), report, common)


def _no_inputs(name: str) -> list[Path]:
    return [Path(name)]


def _design(
    task: Task,
    stopwatch: Stopwatch,
    *,
    number: int,
    axes: int | Path,
    existing: Path | None,
    options: dict[str, Any],
    measures: bool,
    overwrite: bool,
    printed: bool,
) -> Row:
    from dataclasses import asdict

    import cvtimg
    from cvtimg.designs.bounds import read_bounds
    from cvtimg.files.text_tables import csv_text
    from cvtimg.files.whole import write_whole
    from cvtimg.tables.files import read_table

    names, bounds = read_bounds(axes) if isinstance(axes, Path) else (None, axes)
    old = read_table(existing).rows if existing else None
    stopwatch.lap("read")
    found = cvtimg.design(number, bounds, existing=old, **options)
    stopwatch.lap("place")
    figures = asdict(found.measures()) if measures else {}
    labels = names or [f"x{axis + 1}" for axis in range(found.points.shape[1])]
    if "-o" in task.outputs:
        found.save(task.outputs["-o"], names=labels, overwrite=overwrite)
    elif printed:
        print(csv_text(labels, found.points.tolist()), end="")
    if "--plot" in task.outputs:
        from cvtimg.plotting.charts import draw_pairs

        path = task.outputs["--plot"]
        write_whole(path, draw_pairs(found.points, labels, path.suffix.lower(), old), overwrite=overwrite)
    stopwatch.lap("write")
    return {
        "n": number,
        "dimensions": found.points.shape[1],
        "names": labels,
        "existing": len(found.existing),
        "latin": found.latin,
        "periodic": found.periodic,
        "energy": found.energy,
        **{name: value for name, value in figures.items() if name != "energy"},
        "points": None if "-o" in task.outputs else found.points.tolist(),
    }

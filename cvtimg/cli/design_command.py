"""``cvtimg design``: points for experiments."""

from __future__ import annotations

from cvtimg.batch import Report, Row, Stopwatch, Task, WrongUsageError
from cvtimg.cli.running import plan_alone, read_beside, run_plan
from cvtimg.options.record import Given

EXAMPLES = """\
  cvtimg design -n 20 -d 3
  cvtimg design -n 50 --bounds bounds.csv -o runs.csv --plot runs.png --measures
  cvtimg design -n 30 --bounds bounds.csv --existing runs.csv -o more.csv
  cvtimg design -n 256 -d 2 --no-latin --effort best -o points.npy
"""
COLUMNS = ("n", "dimensions", "energy", "latin", "seconds", "output")
MEASURES = ("discrepancy", "h", "chi", "tau", "d")


def design(given: Given) -> int:
    """Place N points for experiments, as evenly as the cells of a centroidal Voronoi tessellation.

    Points fill the box of -d or --bounds. By default they are Latin as well: each of N slices along each axis has one
    point. The energy is the mean squared distance from the box, scaled to the unit cube, to the nearest point.
    """
    if (given.dimensions is None) == (given.bounds is None):
        raise WrongUsageError("give either -d or --bounds")
    plan = plan_alone({"-o": given.output, "--plot": given.plot}, also_read=[given.bounds, given.existing])
    columns = (*COLUMNS, *MEASURES) if given.measures else COLUMNS
    given.prints = given.output is None and not given.as_json
    return run_plan(plan, _design, Report(columns, as_json=given.as_json, quiet=given.quiet or given.prints), given)


def _design(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from dataclasses import asdict

    import cvtimg
    from cvtimg.designs.points import read_bounds
    from cvtimg.files.text_tables import csv_text
    from cvtimg.tables.files import read_table

    names, bounds = read_beside(given.bounds, read_bounds) if given.bounds else (None, given.dimensions)
    old = read_beside(given.existing, read_table).rows if given.existing else None
    stopwatch.lap("read")
    found = cvtimg.design(given.number, bounds, existing=old, **given.arguments)
    stopwatch.lap("place")
    figures = asdict(found.measures()) if given.measures else {}
    labels = names or [f"x{axis + 1}" for axis in range(found.points.shape[1])]
    if "-o" in task.outputs:
        found.save(task.outputs["-o"], names=labels, overwrite=given.overwrite)
    elif given.prints:
        print(csv_text(labels, found.points.tolist()), end="")
    if "--plot" in task.outputs:
        from cvtimg.plotting import draw_pairs, save_plot

        save_plot(task.outputs["--plot"], draw_pairs, found.points, labels, existing=old, overwrite=given.overwrite)
    stopwatch.lap("write")
    return {
        "n": given.number,
        "dimensions": found.points.shape[1],
        "names": labels,
        "existing": len(found.existing),
        "latin": found.latin,
        "periodic": found.periodic,
        "energy": found.energy,
        **{name: value for name, value in figures.items() if name != "energy"},
        "points": None if "-o" in task.outputs else found.points.tolist(),
    }

"""``cvtimg design``: points for experiments."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from cvtimg._shared.extras import optional
from cvtimg.batch.report import Report
from cvtimg.cli.running import Given, Row, Stopwatch, Task, Todo, WrongUsageError, plan_of, planned, plot, read_beside

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from cvtimg._shared.types import Array, Floats
    from cvtimg.designs.factors import Factor

EXAMPLES = """\
  cvtimg design -n 20 -d 3
  cvtimg design -n 50 --bounds bounds.csv -o runs.csv --plot runs.png --measures
  cvtimg design -n 30 --bounds bounds.csv --existing runs.csv -o more.csv
  cvtimg design -n 24 --bounds bounds.csv --shuffle 1
  cvtimg design -n 24 --axis speed,0,30 --axis 'alloy,A|B|C' --axis 'day,Mon|Tue' -o runs.csv
  cvtimg design -n 50 -d 5 --criterion maximin -o runs.csv
  cvtimg design -n 30 -d 2 --feasible 'x1 + x2 < 1'
  cvtimg design -n 256 -d 2 --no-latin --effort best -o points.npy
"""
COLUMNS = ("n", "dimensions", "energy", "latin", "seconds", "output")
MEASURES = ("discrepancy", "h", "chi", "tau", "d")


def design(given: Given) -> Todo:
    """Place N points for experiments, as evenly as the cells of a centroidal Voronoi tessellation.

    Points fill the box of -d or --bounds. By default they are Latin as well: each of N slices along each axis has one
    point. The energy is the mean squared distance from the box, scaled to the unit cube, to the nearest point.
    """
    if sum((given.dimensions is not None, given.bounds is not None, bool(given.axis))) != 1:
        raise WrongUsageError("give one of -d, --bounds and --axis")
    plan = plan_of(given, together=True)
    columns = (*COLUMNS, *MEASURES) if given.measures else COLUMNS
    prints = given.output is None and not given.as_json
    return planned(plan, _design, Report(() if prints else columns, as_json=given.as_json, quiet=given.quiet), given)


def _design(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    import cvtimg
    from cvtimg.designs.factors import read_runs
    from cvtimg.files.whole import csv_text

    factors = _factors(given)
    old = None if given.existing is None else read_beside(given.existing, lambda path: read_runs(path, factors))
    stopwatch.lap("read")
    names = [factor.name for factor in factors if not factor.is_category]
    arguments = given.arguments
    for option in ("feasible", "density"):
        if (text := getattr(given, option)) is not None:
            arguments[option] = _computed(f"--{option}", text, names)
    if given.latin:  # the default, as far as it can be
        arguments["latin"] = None
    result = cvtimg.design(given.number, factors, existing=old, **arguments)
    stopwatch.lap("place")
    figures = asdict(result.measures()) | {"energy": result.energy} if given.measures else {}
    if given.shuffle is not None:
        result = result.shuffled(given.shuffle)
    header, table = result.table()
    if "-o" in task.outputs:
        result.save(task.outputs["-o"], overwrite=given.overwrite)
    labels = [factor.header for factor in factors]
    shown = {"existing": old, "levels": [factor.levels for factor in factors]}
    plot(task.outputs.get("--plot"), given, "draw_pairs", result.points, labels, **shown)
    stopwatch.lap("write")
    printed = {} if "-o" in task.outputs else {"_text": csv_text(header, table).rstrip("\n")}
    return {**result.summary(), **figures, "points": table if printed else None, **printed}


def _factors(given: Given) -> list[Factor]:
    from cvtimg.designs.factors import Factor, read_factors

    if given.dimensions is not None:
        return [Factor(f"x{axis + 1}") for axis in range(given.dimensions)]
    return read_beside(given.bounds, read_factors) if given.bounds else list(given.axis)


def _computed(name: str, expression: str, axes: Sequence[str]) -> Callable[[Floats], Array]:
    """Return the function from (m, d) points to (m,) values that an expression of the names of axes stands for.

    Axes are also called x1, x2 and so on, for names with spaces. Errors name the expression by `name`.
    """
    import numpy as np

    numexpr = optional("numexpr", "designs")

    def function(points: Floats) -> Array:
        columns = {f"x{axis}": column for axis, column in enumerate(points.T, 1)}
        columns |= dict(zip(axes, points.T, strict=True))
        return np.broadcast_to(numexpr.evaluate(expression, columns, {}), len(points))

    try:
        function(np.full((1, len(axes)), 0.5))
    except KeyError as error:
        raise ValueError(f"{name} {expression!r} has no axis {error}; there are {', '.join(axes)}") from None
    except Exception as error:
        raise ValueError(f"{name} {expression!r} cannot be computed: {error}") from None
    return function

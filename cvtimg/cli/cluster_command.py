"""``cvtimg cluster``: rows of tables to labels and generators."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer
from typer import Option

from cvtimg.batch import Report, Row, Running, Task, WrongUsageError, check_choice, check_outputs, find, run
from cvtimg.cli import options
from cvtimg.cli.batch_options import for_many

EXAMPLES = """Examples:

\b
  cvtimg cluster trees.csv -k 5
  cvtimg cluster trees.csv -k auto
  cvtimg cluster trees.csv -k 5 --columns height,girth --generators means.csv
  cvtimg cluster trees.csv -k 5 --weight count --standardize -o labels.npy
  cvtimg cluster 'runs/*.npy' -k 12 --out-dir labels --missing drop
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "rows", "k", "energy", "explained", "seconds", "output")

Tables = Annotated[list[str], typer.Argument(metavar="TABLE", help="Tables, folders, or patterns like 'a/*.csv'.")]
_COUNT = options.count_or_auto(1, 2**31 - 1)
Number = Annotated[
    Any, Option("-k", metavar="N|auto", parser=_COUNT, help="Number of generators; auto: the elbow of the energy.")
]
Labels = Annotated[Path | None, Option("--output", "-o", metavar="FILE", help="Labels, .csv or .npy; for one table.")]
OutDir = Annotated[Path | None, Option(metavar="DIR", help="Folder for NAME-labels.csv; made if it is missing.")]
Generators = Annotated[
    Path | None, Option(metavar="FILE", help="Write the generators and the mass of each cell, .csv; for one table.")
]
Columns = Annotated[str | None, Option(metavar="A,B,C", help="Columns to take; all but the weight by default.")]
Weight = Annotated[str | None, Option(metavar="COLUMN", help="Column that tells how much a row counts.")]
Standardize = Annotated[bool, Option("--standardize", help="Let every column have mean 0 and variance 1.")]
Missing = Annotated[str, Option(metavar="NAME", help="Rows without a value: error, or drop to leave them out.")]
Init = Annotated[str, Option(metavar="NAME", help=f"Generators to begin with: {options.SEEDING_NAMES}.")]
Seed = Annotated[int, Option(metavar="N", parser=options.SEED, help="Seed of what is drawn.")]


@for_many
def cluster(
    inputs: Tables,
    number: Number,
    output: Labels = None,
    out_dir: OutDir = None,
    generators: Generators = None,
    columns: Columns = None,
    weight: Weight = None,
    standardize: Standardize = False,
    missing: Missing = "error",
    effort: options.Effort = "balanced",
    method: options.Method = None,
    volume_power: options.VolumePower = 0,
    init: Init = "split",
    seed: Seed = 0,
    overwrite: options.Overwrite = False,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
    *,
    running: Running,
) -> None:
    """Find the N generators that stand best for the rows of tables.

    A table is text with commas, semicolons or tabs (.csv) or a NumPy array (.npy). Its columns go by their names;
    where it has none, they are col0, col1 and so on. Without -o and --out-dir, one table gives NAME-labels.csv beside
    it: a line "label", then for each row the number of its generator, from 0. A row that is left out has "" there, or
    -1 in a .npy. Generators are in the units of the table, with --standardize too; the energy then is not.
    """
    from cvtimg.tables.files import LABEL_SUFFIXES, MISSING, find_tables

    engine = options.engine(effort=effort, method=method, init=init, volume_power=volume_power, seed=seed)
    check_choice("--missing", missing, MISSING)
    names = _split(columns) if columns is not None else None
    columns_shown = (*COLUMNS[:3], "elbow", *COLUMNS[3:]) if number == "auto" else COLUMNS
    report = Report(columns_shown, as_json=as_json, quiet=quiet)
    sources, absent = find(inputs, find_tables, out_dir)
    check_outputs(len(sources) + len(absent), out_dir, {"-o": output, "--generators": generators})
    if output:
        check_choice("-o", output.suffix.lower(), LABEL_SUFFIXES)
    if generators:
        check_choice("--generators", generators.suffix.lower(), [".csv"])
    extra = {"generators": generators} if generators else {}
    tasks = [
        Task(source, {"labels": output or folder / f"{source.stem}-labels.csv", **extra})
        for source, folder in sources.items()
    ]
    what = {"columns": names, "weight": weight, "missing": missing}
    how = {"n_generators": number, **engine}

    work = partial(_cluster, what=what, how=how, standardize=standardize, overwrite=overwrite)
    raise typer.Exit(run(tasks, absent, work, report, out_dir=out_dir, overwrite=overwrite, running=running))


def _split(columns: str) -> list[str]:
    """Read names as the first line of a CSV, for they may have commas in them."""
    names = [name.strip() for name in next(csv.reader([columns], skipinitialspace=True), [])]
    if not all(names) or not names:
        raise WrongUsageError(f"--columns: {columns!r} must be names with commas between them")
    return names


def _cluster(task: Task, *, what: Mapping[str, Any], how: Mapping[str, Any], standardize: bool, overwrite: bool) -> Row:
    from cvtimg import tessellate
    from cvtimg.elbow.curves import auto_count
    from cvtimg.tables.files import Scaling, read_table, spread, write_generators, write_labels

    start = perf_counter()
    table = read_table(task.source, **what)
    read = perf_counter()
    scaling = Scaling.of(table.rows, table.weights) if standardize else None
    rows = scaling.apply(table.rows) if scaling else table.rows
    n_generators, curve = how["n_generators"], None
    if n_generators == "auto":
        n_generators, curve = auto_count(rows, density=table.weights, volume_power=how["volume_power"], rng=how["rng"])
    result = tessellate(rows, density=table.weights, **{**how, "n_generators": n_generators})
    generators = scaling.undo(result.generators) if scaling else result.generators
    clustered = perf_counter()
    write_labels(task.outputs["labels"], result.labels, table.kept, overwrite=overwrite)
    if "generators" in task.outputs:
        write_generators(task.outputs["generators"], table.names, generators, result.masses, overwrite=overwrite)
    written = perf_counter()
    total = spread(rows, table.weights)
    return {
        "input": str(task.source),
        "output": str(task.outputs["labels"]),
        "rows": len(rows),
        "left_out": len(table.kept) - len(rows),
        "columns": table.names,
        "k": len(generators),
        "elbow": curve.elbows() if curve else None,
        "energy": result.energy,
        "explained": 1 - result.energy / total if total else 1.0,
        "n_iter": result.n_iter,
        "converged": result.converged,
        "seconds": {"read": read - start, "cluster": clustered - read, "write": written - clustered},
    }

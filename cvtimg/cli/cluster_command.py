"""``cvtimg cluster``: rows of tables to labels and generators."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Option

from cvtimg.batch import Row, Stopwatch, Task, WrongUsageError, check_suffix, plan_each
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan

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

Tables = Annotated[
    list[str],
    typer.Argument(
        metavar="TABLE...",
        help="Tables (.csv, .tsv, .npy), folders, patterns like 'a/*.csv', - for standard input, or @FILE for a list "
        "of names.",
    ),
]
Number = Annotated[
    Any,
    Option(
        "-k",
        metavar="N|auto",
        parser=options.or_auto(options.whole_number(1, 2**31 - 1)),
        help="Number of clusters; auto picks it at the elbow of the energy.",
    ),
]
Labels = Annotated[
    Path | None,
    Option(
        "--output",
        "-o",
        metavar="FILE",
        parser=options.output_file(".csv"),
        help="Write the labels, .csv or .npy; for one table; - for standard output.",
    ),
]
OutDir = Annotated[Path | None, Option(metavar="DIR", help="Folder for outputs NAME-labels.csv.")]
Generators = Annotated[
    Path | None, Option(metavar="FILE", help="Write the mean and the weight of each cluster, .csv; for one table.")
]
Columns = Annotated[str | None, Option(metavar="A,B,C", help="Columns to use; by default all but the weight.")]
Weight = Annotated[str | None, Option(metavar="COLUMN", help="Column with the weight of each row.")]
Standardize = Annotated[bool, Option("--standardize", help="Scale each column to mean 0 and variance 1.")]


def cluster(
    inputs: Tables,
    number: Number,
    output: Labels = None,
    out_dir: OutDir = None,
    generators: Generators = None,
    columns: Columns = None,
    weight: Weight = None,
    standardize: Standardize = False,
    missing: options.Missing = "error",
    skip_existing: options.SkipExisting = False,
    *,
    engine: options.EngineOptions,
    common: options.BatchOptions,
) -> int:
    """Cluster the rows of tables: find the N means that represent them with the least error.

    A table is text with commas, semicolons or tabs (.csv) or a NumPy array (.npy). Columns go by their names, or by
    col0, col1 and so on where the table has none. Without -o and --out-dir, the labels of one table go to
    NAME-labels.csv beside it: a line "label", then for each row the number of its cluster, from 0. A row that is
    dropped has an empty label, or -1 in a .npy file. Means are in the units of the table; the energy is in those of
    the standardized columns if --standardize is given.
    """
    from cvtimg.tables.files import LABEL_SUFFIXES, find_tables

    names = _split(columns) if columns is not None else None
    check_suffix("-o", output, LABEL_SUFFIXES)
    check_suffix("--generators", generators, [".csv"])
    outputs = {"-o": output or "{}-labels.csv", "--generators": generators}
    plan = plan_each(inputs, find_tables, outputs, out_dir=out_dir)
    shown = (*COLUMNS[:3], "elbow", *COLUMNS[3:]) if number == "auto" else COLUMNS
    read = {"columns": names, "weight": weight, "missing": missing}
    work = partial(
        _cluster, read=read, number=number, engine=engine, standardize=standardize, overwrite=common.overwrite
    )
    return run_plan(plan, work, shown, common, skip_existing=skip_existing)


def _split(columns: str) -> list[str]:
    """Parse names like a line of CSV, because they may contain commas."""
    names = [name.strip() for name in next(csv.reader([columns], skipinitialspace=True), [])]
    if not all(names) or not names:
        raise WrongUsageError(f"--columns: {columns!r} must be names with commas between them")
    return names


def _cluster(
    task: Task,
    stopwatch: Stopwatch,
    *,
    read: Mapping[str, Any],
    number: int | str,
    engine: options.EngineOptions,
    standardize: bool,
    overwrite: bool,
) -> Row:
    from cvtimg import tessellate
    from cvtimg.elbow.curves import auto_count
    from cvtimg.tables.files import Scaling, energy_about_mean, read_table, write_generators, write_row_labels

    table = read_table(task.source, **read)
    stopwatch.lap("read")
    scaling = Scaling.of(table.rows, table.weights) if standardize else None
    rows = scaling.apply(table.rows) if scaling else table.rows
    n_generators, curve = number, None
    if number == "auto":
        n_generators, curve = auto_count(rows, density=table.weights, volume_power=engine.volume_power, rng=engine.seed)
    result = tessellate(rows, int(n_generators), density=table.weights, **engine.keywords)
    generators = scaling.undo(result.generators) if scaling else result.generators
    stopwatch.lap("cluster")
    write_row_labels(task.output, result.labels, table.kept, overwrite=overwrite)
    if "--generators" in task.outputs:
        write_generators(task.outputs["--generators"], table.names, generators, result.masses, overwrite=overwrite)
    stopwatch.lap("write")
    total = energy_about_mean(rows, table.weights)
    return {
        "rows": len(rows),
        "left_out": len(table.kept) - len(rows),
        "columns": table.names,
        "k": len(generators),
        "elbow": curve.elbows() if curve else None,
        "energy": result.energy,
        "explained": 1 - result.energy / total if total else 1.0,
        "n_iter": result.n_iter,
        "converged": result.converged,
    }

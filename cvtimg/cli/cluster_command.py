"""``cvtimg cluster``: rows of tables to labels and generators."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from cvtimg.batch import Row, Stopwatch, Task, WrongUsageError, check_suffix, plan_each
from cvtimg.cli import options
from cvtimg.cli.frame import run_plan

if TYPE_CHECKING:
    from cvtimg.elbow import EnergyCurve
    from cvtimg.engine import Tessellation
    from cvtimg.tables import Scaling

EXAMPLES = """Examples:

\b
  cvtimg cluster trees.csv -k 5
  cvtimg cluster trees.csv -k auto
  cvtimg cluster trees.csv -k 5 --columns height,girth --generators means.csv
  cvtimg cluster trees.csv -k 5 --weight count --standardize -o labels.npy
  cvtimg cluster 'runs/*.npy' -k 12 --out-dir labels --missing drop
  cvtimg cluster rides.parquet -k 40 --columns lon,lat --dask local
  cvtimg cluster s3://bucket/pixels.zarr -k 64 -o labels.npy
"""
#: Columns of the table, in the words of --json; they fit into 80 characters.
COLUMNS = ("input", "rows", "k", "energy", "explained", "seconds", "output")

Tables = Annotated[
    list[str],
    typer.Argument(
        metavar="TABLE...",
        help="Tables (.csv, .tsv, .npy, .parquet, .zarr), URLs of them, folders, patterns like 'a/*.csv', - for "
        "standard input, or @FILE for a list of names.",
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
        help="Write the labels, .csv, .npy or .parquet; for one table; - for standard output.",
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
    dropped has an empty label, -1 in a .npy file, or null in a .parquet file. Means are in the units of the table; the
    energy is in those of the standardized columns if --standardize is given.

    Parquet files, Zarr arrays, and .npy files of more than 1 GiB may be larger than memory: they are read in blocks,
    with --dask by all workers of a cluster. A folder called NAME.parquet is one table. Labels go to
    NAME-labels.parquet, or to NAME-labels.npy for a Zarr array. -k auto then looks at a sample of a million rows.
    """
    from cvtimg.blocks.opening import BLOCK_SUFFIXES
    from cvtimg.tables.files import LABEL_SUFFIXES, TABLE_SUFFIXES, find_tables

    names = _split(columns) if columns is not None else None
    check_suffix("-o", output, LABEL_SUFFIXES)
    check_suffix("--generators", generators, [".csv"])
    outputs = {"-o": output or _labels_of, "--generators": generators}
    plan = plan_each(inputs, find_tables, outputs, out_dir=out_dir, suffixes=frozenset(TABLE_SUFFIXES))
    shown = (*COLUMNS[:3], "elbow", *COLUMNS[3:]) if number == "auto" else COLUMNS
    read = {"columns": names, "weight": weight, "missing": missing}
    how = _Clustering(read, number, engine, standardize, common.overwrite)
    work = partial(_cluster, how=how)
    # A .npy file may fit into memory, where it is read like a .csv.
    by_url = tuple(suffix for suffix in BLOCK_SUFFIXES if suffix != ".npy")
    return run_plan(plan, work, shown, common, skip_existing=skip_existing, by_url=by_url)


def _labels_of(source: Path) -> str:
    """Return the pattern for the labels of a table."""
    kinds = {".parquet": ".parquet", ".zarr": ".npy"}
    return "{}-labels" + kinds.get(source.suffix.lower(), ".csv")


def _split(columns: str) -> list[str]:
    """Parse names like a line of CSV, because they may contain commas."""
    names = [name.strip() for name in next(csv.reader([columns], skipinitialspace=True), [])]
    if not all(names) or not names:
        raise WrongUsageError(f"--columns: {columns!r} must be names with commas between them")
    return names


@dataclass(frozen=True, slots=True, eq=False)
class _Clustering:
    """How tables are clustered: what is read of them, and how many means are found in which way."""

    read: Mapping[str, Any]
    number: int | str
    engine: options.EngineOptions
    standardize: bool
    overwrite: bool


def _cluster(task: Task, stopwatch: Stopwatch, *, how: _Clustering) -> Row:
    from cvtimg.tables.blocked import is_large_table

    work = _cluster_in_blocks if is_large_table(task.source) else _cluster_in_memory
    found = work(task, stopwatch, how)
    stopwatch.lap("write")
    result, total = found.result, found.total
    return {
        "rows": len(result.labels),
        "left_out": found.n_rows - len(result.labels),
        "columns": found.names,
        "k": len(result.generators),
        "elbow": found.curve.elbows() if found.curve else None,
        "energy": result.energy,
        "explained": 1 - result.energy / total if total else 1.0,
        "n_iter": result.n_iter,
        "converged": result.converged,
    }


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """What was found in a table of `n_rows` rows; `total` is the energy about the mean."""

    result: Tessellation
    names: Sequence[str]
    n_rows: int
    total: float
    curve: EnergyCurve | None


def _cluster_in_memory(task: Task, stopwatch: Stopwatch, how: _Clustering) -> _Found:
    from cvtimg import tessellate
    from cvtimg.tables.files import Scaling, energy_about_mean, read_table, write_row_labels

    table = read_table(task.source, **how.read)
    stopwatch.lap("read")
    scaling = Scaling.of(table.rows, table.weights) if how.standardize else None
    rows = scaling.apply(table.rows) if scaling else table.rows
    n_generators, curve = _count(how, rows, table.weights)
    result = tessellate(rows, n_generators, density=table.weights, **how.engine.keywords)
    stopwatch.lap("cluster")
    write_row_labels(task.output, result.labels, table.kept, overwrite=how.overwrite)
    _write_means(task, table.names, result, scaling, how.overwrite)
    return _Found(result, table.names, len(table.kept), energy_about_mean(rows, table.weights), curve)


def _cluster_in_blocks(task: Task, stopwatch: Stopwatch, how: _Clustering) -> _Found:
    from cvtimg import tessellate
    from cvtimg.batch.on_dask import on_cluster_of_task
    from cvtimg.blocks import open_blocks
    from cvtimg.tables.blocked import sample_rows, spread_of, standardized, write_block_labels

    with on_cluster_of_task():
        given = open_blocks(task.source, **how.read)
        spread = spread_of(given)
        stopwatch.lap("read")
        scaling = spread.scaling if how.standardize else None
        blocks = standardized(given, scaling) if scaling else given
        rows, weights = sample_rows(blocks, how.engine.seed) if how.number == "auto" else (None, None)
        n_generators, curve = _count(how, rows, weights)
        result = tessellate(blocks, n_generators, **how.engine.keywords)
        stopwatch.lap("cluster")
        n_rows = write_block_labels(task.output, result.labels, blocks, overwrite=how.overwrite)
    _write_means(task, blocks.names, result, scaling, how.overwrite)
    total = spread.squares / scaling.deviations**2 if scaling else spread.squares
    return _Found(result, blocks.names, n_rows, float(total.sum()), curve)


def _count(how: _Clustering, rows: Any, weights: Any) -> tuple[int, EnergyCurve | None]:
    """Return the number of clusters, and with "auto" the curve from which it is read."""
    from cvtimg.elbow.curves import auto_count

    if how.number != "auto":
        return int(how.number), None
    return auto_count(rows, density=weights, volume_power=how.engine.volume_power, rng=how.engine.seed)


def _write_means(
    task: Task, names: Sequence[str], result: Tessellation, scaling: Scaling | None, overwrite: bool
) -> None:
    from cvtimg.tables.files import write_generators

    if "--generators" in task.outputs:
        generators = scaling.undo(result.generators) if scaling else result.generators
        write_generators(task.outputs["--generators"], names, generators, result.masses, overwrite=overwrite)

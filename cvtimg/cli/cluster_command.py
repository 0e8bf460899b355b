"""``cvtimg cluster``: rows of tables to labels and generators."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from cvtimg._shared.choices import Arguments
from cvtimg.cli.running import Given, Row, Stopwatch, Task, Todo, WrongUsageError, plan_of, planned, plot

if TYPE_CHECKING:
    from cvtimg.blocks import Blocks
    from cvtimg.engine import Tessellation
    from cvtimg.tables import Table

EXAMPLES = """\
  cvtimg cluster trees.csv -k 5
  cvtimg cluster trees.csv -k 5 --columns height,girth --generators means.csv
  cvtimg cluster trees.csv -k 5 --standardize --plot trees.png
  cvtimg cluster trees.csv -k 5 --weight count --standardize -o labels.npy
  cvtimg cluster 'runs/*.npy' -k 12 --out-dir labels --missing drop
  cvtimg cluster rides.parquet -k 40 --columns lon,lat --dask local
  cvtimg cluster s3://bucket/pixels.zarr -k 64 -o labels.npy
"""
#: Rows of a silhouette: it takes the distances of all pairs, 0.2 GB of these; with more it is hardly another.
_SILHOUETTE_ROWS = 5000
COLUMNS = ("input", "rows", "k", "energy", "explained", "seconds", "output")


def cluster(given: Given) -> Todo:
    """Cluster the rows of tables: find the N means that represent them with the least error.

    A table is text (.csv, .txt, .csv.gz and the like), a NumPy array (.npy), a file of Arrow (.feather, .arrow) or a
    sheet of Excel (.xlsx). Columns go by their names, or by col0, col1 and so on where the table has none. Columns that
    are not of numbers, or only number the rows, are left out and named; --columns chooses.

    Without -o and --out-dir, one table is written to NAME-clusters.csv beside it: all its columns as they are, and
    "cluster", the number of the cluster of each row, from 0; empty where the row is dropped. --labels-only writes
    NAME-labels.csv, a line "label" and a line for each row. A .npy or .parquet file holds labels alone, -1 or null in
    rows that are dropped. Means are in the units of the table; the energy is in those of the standardized columns if
    --standardize is given.

    Parquet files, Zarr arrays, and .npy files of more than 1 GiB may be larger than memory: they are read in blocks,
    with --dask by all workers of a cluster. A folder called NAME.parquet is one table. Labels, alone, go to
    NAME-labels.parquet, or to NAME-labels.npy for a Zarr array. -k auto and --plot look at a sample of a million rows.
    """
    from cvtimg.blocks.opening import BLOCK_SUFFIXES
    from cvtimg.tables.files import find_tables

    given.read = reading(given)
    ends = {".parquet": "-labels.parquet", ".zarr": "-labels.npy"}
    usual = "-labels.csv" if given.labels_only else "-clusters.csv"
    plan = plan_of(given, lambda source: "{}" + ends.get(source.suffix.lower(), usual), expand=find_tables)
    columns = (*COLUMNS[:3], "elbow", "verdict", *COLUMNS[3:]) if given.number == "auto" else COLUMNS
    columns = (*columns[:-2], "silhouette", *columns[-2:]) if given.silhouette else columns
    # A .npy file may fit into memory, where it is read like a .csv.
    by_url = tuple(suffix for suffix in BLOCK_SUFFIXES if suffix != ".npy")
    return planned(plan, _cluster, columns, given, by_url=by_url)


def reading(given: Given) -> Arguments:
    """Return the arguments of `read_table` and `open_blocks` that options give; `given.dialect` is that of text."""
    from cvtimg.tables import Dialect

    names = None
    if given.columns is not None:
        names = _parts(given.columns)
        if not all(names) or not names:
            raise WrongUsageError(f"--columns: {given.columns!r} must be names with commas between them")
    delimiter = {"tab": "\t", "\\t": "\t", "space": " "}.get(given.delimiter, given.delimiter)
    if delimiter is not None and len(delimiter) != 1:
        raise WrongUsageError(f"--delimiter: {delimiter!r} must be one letter, or tab or space")
    marks = _parts(given.missing_values or "")
    given.dialect = Dialect(delimiter, given.decimal, given.encoding, given.header, marks)
    return {"columns": names, "weight": given.weight, "missing": given.missing}


def _parts(text: str) -> list[str]:
    """Read texts with commas between them like a line of CSV, because names may contain commas."""
    return [part.strip() for part in next(csv.reader([text], skipinitialspace=True), [])]


def told_left_out(left_out: Mapping[str, str]) -> Arguments:
    """Return the columns of a row that tell which columns of a table were left out."""
    if not left_out:
        return {}
    names = ", ".join(f"{name} ({why})" for name, why in list(left_out.items())[:8])
    more = f" and {len(left_out) - 8} more" if len(left_out) > 8 else ""
    return {"columns_left_out": dict(left_out), "warning": f"left out: {names}{more}; --columns chooses"}


def _cluster(task: Task, stopwatch: Stopwatch, given: Given) -> Row:
    from cvtimg import tessellate
    from cvtimg.batch.executors import on_cluster_of_task
    from cvtimg.elbow.curves import auto_count
    from cvtimg.tables import files

    with on_cluster_of_task() if files.is_large_table(task.source) else nullcontext():
        table = files.open_table(task.source, given.dialect, **given.read)
        spread = files.spread_of(table)
        stopwatch.lap("read")
        scaling = spread.scaling if given.standardize else None
        scaled = files.standardized(table, scaling) if scaling else table
        is_sampled = given.number == "auto" or given.silhouette or "--plot" in task.outputs
        rows: Any
        rows, weights = files.sample_rows(scaled, given.seed) if is_sampled else (None, None)
        how, curve = given.arguments, None
        if given.number == "auto":
            power, seed = given.volume_power, given.seed
            how["n_generators"], curve = auto_count(rows, density=weights, volume_power=power, rng=seed)
        samples, density = (scaled.rows, scaled.weights) if isinstance(scaled, files.Table) else (scaled, None)
        result = tessellate(samples, density=density, **how)
        stopwatch.lap("cluster")
        n_rows = _write(task, result.labels, table, given)
        plot(task.outputs.get("--plot"), given, "draw_clusters", rows, result.generators)
    if path := task.outputs.get("--generators"):
        means = scaling.undo(result.generators) if scaling else result.generators
        files.write_generators(path, table.names, means, result.masses, overwrite=given.overwrite)
    total = spread.energy(scaling)
    row = {
        "rows": len(result.labels),
        "left_out": n_rows - len(result.labels),
        "columns": table.names,
        "k": len(result.generators),
        "elbow": curve.elbows() if curve else None,
        **({"verdict": curve.verdict} if curve else {}),
        "energy": result.energy,
        "explained": max(1 - result.energy / total, 0.0) if total else 1.0,
        "n_iter": result.n_iter,
        "converged": result.converged,
        **({"silhouette": _silhouette(rows, result, given, samples is rows)} if given.silhouette else {}),
        **told_left_out(table.left_out),
    }
    stopwatch.lap("write")
    return row


def _write(task: Task, labels: Any, table: Table | Blocks, given: Given) -> int:
    """Write the columns of a table with its clusters, or the labels alone; return the number of its rows."""
    from cvtimg.tables import files

    if not isinstance(table, files.Table) or given.labels_only or task.output.suffix.lower() != ".csv":
        return files.write_all_labels(task.output, labels, table, overwrite=given.overwrite)
    how = {"dialect": given.dialect, "overwrite": given.overwrite}
    files.write_clusters(task.output, task.source, labels, table.kept, **how)
    return len(table.kept)


def _silhouette(rows: Any, result: Tessellation, given: Given, are_known: bool) -> float | None:
    """Return scikit-learn's mean silhouette of some rows, None if they are of one cluster."""
    import numpy as np
    from scipy.spatial.distance import cdist

    from cvtimg._shared.extras import optional

    metrics = optional("sklearn.metrics", "sklearn", "--silhouette needs")
    drawn = np.random.default_rng(given.seed).permutation(len(rows))[:_SILHOUETTE_ROWS]
    some = rows[drawn]
    labeled = result.labels[drawn] if are_known else cdist(some, result.generators).argmin(axis=1)
    return float(metrics.silhouette_score(some, labeled)) if 1 < len(np.unique(labeled)) < len(some) else None

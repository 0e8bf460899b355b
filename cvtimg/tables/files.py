"""Tables of numbers on disk: rows and weights are read, labels and generators written.

A table is text with a delimiter, such as CSV, a NumPy array in a ``.npy`` file, a file of Arrow or a sheet of Excel.
Its columns have names.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_choice, check_shape, check_that
from cvtimg._shared.extras import optional
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.types import Array, Bools, Floats, Ints
from cvtimg.blocks.opening import BLOCK_SUFFIXES, open_blocks
from cvtimg.blocks.passes import Block, blocks_of, over_blocks
from cvtimg.blocks.rows import Blocks
from cvtimg.blocks.spread import Scaling, Spread
from cvtimg.engine.block_descent import survey
from cvtimg.files.finding import find_images, find_remote
from cvtimg.files.remote import is_remote, local_copy, url_of
from cvtimg.files.whole import StrPath, whole_file, write_csv
from cvtimg.tables.columns import Columns, Dialect, open_columns

#: Arrays of more bytes are opened in blocks.
_LARGE_BYTES = 1 << 30
#: Suffixes of packed text.
PACKED = (".gz", ".bz2", ".xz", ".zip")
#: What to do with rows that have missing values.
MISSING = ("error", "drop")
#: Suffixes of files of labels.
LABEL_SUFFIXES = (".csv", ".npy", ".parquet")
#: Suffixes of the tables in a folder; a file that is named is read whatever its suffix.
TABLE_SUFFIXES = (".csv", ".tsv", ".npy", ".parquet", ".zarr", ".feather", ".arrow", ".xlsx")
#: Suffixes of tables that are files; packed text ends in one of the last.
_NAMED = (*(suffix for suffix in TABLE_SUFFIXES if suffix != ".zarr"), ".txt", ".dat", ".ipc", ".xlsm", *PACKED)


@dataclass(frozen=True, slots=True, eq=False)
class Table(ReadOnly):
    """Rows of numbers.

    Attributes
    ----------
    names : tuple of str
        Names of the columns.
    rows : (N, D) float64 array
        Finite.
    weights : (N,) float64 array or None
        Finite and >= 0, if a column of weights was selected.
    kept : (M,) bool array
        Whether each row of the file is in `rows`; the others have missing values.
    left_out : dict of str
        Why columns were left out that nobody chose, such as ``{"name": "text"}``.
    """

    names: tuple[str, ...]
    rows: Floats
    weights: Floats | None
    kept: Bools
    left_out: Mapping[str, str] = field(default_factory=dict)

    def _claims(self) -> Claims:
        yield "rows are those kept", len(self.rows) == np.count_nonzero(self.kept)
        yield "columns have names", len(self.names) == self.rows.shape[1]
        yield "rows are finite", np.isfinite(self.rows)

    def __repr__(self) -> str:
        """Tell the size and the columns in one line."""
        names = ", ".join(self.names[:8]) + (", ..." if len(self.names) > 8 else "")
        weighted = "" if self.weights is None else ", weighted"
        return f"Table({len(self.rows)} of {len(self.kept)} rows{weighted}: {names})"


def read_table(
    path: StrPath,
    *,
    columns: Sequence[str] | None = None,
    weight: str | None = None,
    missing: str = "error",
    dialect: Dialect | None = None,
) -> Table:
    r"""Read a table of numbers.

    Parameters
    ----------
    path : path or URL
        A ``.npy`` file with an (N,), (N, D) or structured array; ``.feather``, ``.arrow`` or ``.parquet``, which need
        pyarrow; the first sheet of an ``.xlsx``, which needs openpyxl. Any other file is text, also packed as .gz,
        .bz2, .xz or .zip, with tabs, semicolons, bars, commas or spaces between values, which may be in double quotes.
        Empty lines, comments after ``#``, a line ``sep=;``, titles above the names, units below them and notes at the
        end are no rows.
    columns : sequence of str, optional
        Names of the columns to read, in this order. By default these are all columns of numbers but `weight`, without
        those that count rows from 0 or 1 and, if there are ten rows, identifiers: whole numbers in order, all
        different, in the first column or in one called id. `Table.left_out` tells which were left out. Columns without
        names are called col0, col1, ..., or 0, 1, ... for short; a name that occurs again gets a number, as in a.1.
    weight : str, optional
        Column of weights.
    missing : {"error", "drop"}
        What to do with rows in which a selected value is missing: empty, NaN, NA, null, none, ?, - or the like.
    dialect : cvtimg.tables.Dialect, optional
        How text is written, where it does not tell.

    Returns
    -------
    Table

    Notes
    -----
    The first line of text names the columns if none of its values is a number, or if in some column it has no number
    but the second line has one. Whole numbers in equal steps, such as years, are names if no number below them is
    whole, or if all of them are ten times smaller or larger. The encoding is that of the byte order mark, UTF-8, or
    else Windows-1252. The decimal sign is a comma if some number can be read with a comma alone, and a point otherwise;
    the other sign, spaces and apostrophes may be between groups of three digits.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from cvtimg.tables.files import read_table
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "trees.csv")
    ...     _ = file.write_text("site,height,girth\nA,11.5,0.8\nB,14,1.25\n")
    ...     table = read_table(file, columns=["girth", "height"])
    >>> table.names, table.rows.tolist()
    (('girth', 'height'), [[0.8, 11.5], [1.25, 14.0]])
    """
    check_choice("missing", missing, MISSING)
    with local_copy(path) as file:
        source = open_columns(file, dialect)
        chosen = _choose(source, columns, weight)
        values = source.values(chosen)
    names = [source.names[number] for number in chosen]
    absent = np.isnan(values)
    is_weight = np.arange(len(chosen)) == (-1 if weight is None else len(chosen) - 1)
    for faults, what in (
        (np.isinf(values), "is infinite"),
        ((values < 0) & is_weight, "is a weight and must be >= 0"),
        (absent & (missing == "error"), "is missing; leave such rows out with missing='drop'"),
    ):
        if faults.any():
            row, column = np.argwhere(faults)[0]
            raise ValueError(f"{path}: {source.place(int(row))}, column {names[column]!r}: the value {what}")
    kept = np.logical_not(absent.any(axis=1))
    values = values if kept.all() else values[kept]
    if not len(values):
        raise ValueError(f"{path}: has no rows" if not len(kept) else f"{path}: has no row without a missing value")
    left_out = {} if columns is not None else {n: why for n, why in source.reasons.items() if n != weight}
    if weight is None:
        return Table(tuple(names), values, None, kept, left_out)
    if not values[:, -1].any():
        raise ValueError(f"{path}: column {names[-1]!r}: the weights must not all be 0")
    return Table(tuple(names[:-1]), np.ascontiguousarray(values[:, :-1]), values[:, -1].copy(), kept, left_out)


def write_row_labels(path: StrPath, labels: Array, kept: Bools, *, overwrite: bool = False) -> None:
    """Write a label for each row of a table, whole or not at all.

    Parameters
    ----------
    path : str or path-like
        Ends in .csv, for a line ``label`` and then one line per row, in .npy, for an (M,) int32 array, or in .parquet,
        for an int32 column ``label``.
    labels : (N,) integer array
        Labels of the rows that were kept.
    kept : (M,) bool array
        Rows that were kept. The label of any other row is ``""`` in a .csv, which is no empty line, -1 in a .npy, and
        null in a .parquet.
    overwrite : bool
        Replace an existing file.
    """
    all_labels = np.full(len(kept), -1, np.int32)
    all_labels[kept] = labels
    write_label_parts(path, len(kept), [all_labels], overwrite=overwrite)


def write_clusters(
    path: StrPath,
    table: StrPath,
    labels: Array,
    kept: Bools,
    *,
    dialect: Dialect | None = None,
    overwrite: bool = False,
) -> None:
    """Write all columns of a table as a .csv, and one more, ``cluster``: labels as `write_row_labels` takes them."""
    clusters = np.full(len(kept), "", object)
    clusters[kept] = labels
    with local_copy(table) as file:
        source = open_columns(file, dialect)
        rows = ((*row, cluster) for row, cluster in zip(source.cells(), clusters.tolist(), strict=True))
        write_csv(path, _with_more(source.names, "cluster"), rows, overwrite=overwrite)


def _with_more(names: Sequence[str], *more: str) -> list[str]:
    """Add names to those of columns, one of which may be called the same."""
    return [*names, *(name if name not in names else f"cell_{name}" for name in more)]


def write_label_parts(path: StrPath, n_rows: int, parts: Iterable[Ints], *, overwrite: bool = False) -> None:
    """Write labels as `write_row_labels` does, part after part; those of rows that were left out are -1."""
    suffix = check_choice(f"{path}: suffix", Path(path).suffix.lower(), LABEL_SUFFIXES)
    with whole_file(path, overwrite=overwrite) as file:
        if suffix == ".parquet":
            pyarrow = optional("pyarrow", "parquet", "labels in .parquet need")
            from pyarrow import parquet

            with parquet.ParquetWriter(file, pyarrow.schema([("label", pyarrow.int32())])) as writer:
                for part in parts:
                    writer.write_table(pyarrow.table({"label": pyarrow.array(part, mask=part < 0)}))
        elif suffix == ".npy":
            header = {"descr": np.lib.format.dtype_to_descr(np.dtype(np.int32)), "fortran_order": False}
            np.lib.format.write_array_header_1_0(file, {**header, "shape": (n_rows,)})
            for part in parts:
                file.write(np.ascontiguousarray(part, np.int32).tobytes())
        else:
            file.write(b"label\n")
            for part in parts:
                lines = ('""' if label < 0 else str(label) for label in part.tolist())
                file.write("\n".join(chain(lines, [""])).encode())


def write_generators(
    path: StrPath, names: Sequence[str], generators: Floats, masses: Floats, *, overwrite: bool = False
) -> None:
    """Write (K, D) generators as a CSV, in the order of the labels, with two more columns, ``mass`` and ``share``."""
    rows = np.column_stack([generators, masses, masses / masses.sum()]).tolist()
    write_csv(path, _with_more(names, "mass", "share"), rows, overwrite=overwrite)


def read_weights(path: StrPath) -> Floats:
    """Read the (N,) numbers of a table with one column."""
    rows = read_table(path).rows
    check_shape("weights", rows.shape, rows.shape[1] == 1, "(N, 1), a number in each row")
    return rows[:, 0]


def is_table(path: Path) -> bool:
    """Whether a file is a table by its suffix, and no image."""
    return path.suffix.lower() in _NAMED


def find_tables(path: StrPath) -> list[Path]:
    """List the tables that a file, a folder, a pattern or a URL names, as `find_images` does for images."""
    if is_remote(path):
        return find_remote(url_of(path), frozenset(TABLE_SUFFIXES))
    folder = Path(path)
    if folder.is_dir() and folder.suffix.lower() in BLOCK_SUFFIXES:
        return [folder]
    if not folder.is_dir():
        return find_images(path)
    inside = (file.relative_to(folder) for file in folder.rglob("*") if file.suffix.lower() in TABLE_SUFFIXES)
    visible = {folder / file for file in inside if not any(part.startswith(".") for part in file.parts)}
    tables = {file for file in visible if file.is_file() or file.suffix.lower() in BLOCK_SUFFIXES}
    if not tables:
        raise FileNotFoundError(f"{path}: no table ({', '.join(TABLE_SUFFIXES)}) in this folder")
    # Files in a folder that is called like a table are parts of it.
    return sorted(file for file in tables if not tables & set(file.parents))


def _choose(source: Columns, columns: Sequence[str] | None, weight: str | None) -> list[int]:
    """Return the numbers of the columns to read, that of the weights last."""
    places = {name: number for number, name in enumerate(source.names)}
    if not source.named:
        places.update({str(number): number for number in range(len(source.names))})

    def place(name: str) -> int:
        if name not in places:
            shown = ", ".join(source.names[:20]) + (", ..." if len(source.names) > 20 else "")
            raise ValueError(f"{source.path}: column {name!r} must be one of {shown}")
        return places[name]

    last = [] if weight is None else [place(weight)]
    if columns is None:
        reasons = source.reasons
        chosen = [number for number, name in enumerate(source.names) if number not in last and name not in reasons]
    else:
        reasons, chosen = {}, list(map(place, columns))
    if not chosen:
        others = "; ".join(f"{name}: {why}" for name, why in reasons.items())
        raise ValueError(f"{source.path}: has no column of numbers" + (f" ({others})" if others else ""))
    for number, name in zip(chosen, columns or (), strict=False):
        if number in last:
            raise ValueError(f"{source.path}: column {name!r} is the weight, and cannot be read as a value too")
        if chosen.count(number) > 1:
            raise ValueError(f"{source.path}: column {name!r} is named more than once")
    return chosen + last


# Tables larger than memory


def is_large_table(path: Path) -> bool:
    """Whether a table is opened in blocks: Parquet and Zarr always, and .npy arrays of more than 1 GiB."""
    kind = path.suffix.lower()
    if kind == ".npy" and path.is_file() and path.stat().st_size > _LARGE_BYTES:
        return np.load(path, mmap_mode="r").dtype.names is None  # a structured array is no array of rows
    return kind in (".parquet", ".zarr")


def open_table(path: Path, dialect: Dialect | None, **reading: Any) -> Table | Blocks:
    """Read a table as `read_table` does, or open it in blocks if it is large."""
    return open_blocks(path, **reading) if is_large_table(path) else read_table(path, **reading, dialect=dialect)


def spread_of(table: Table | Blocks) -> Spread:
    """Measure all rows in one pass; at least one must have a positive weight."""
    if isinstance(table, Table):
        return Spread.of(table.rows, table.weights)
    spread = over_blocks(table, _spread_of_block, Spread.total)
    check_that("at least one row", spread.mass > 0, "be complete and of positive weight")
    return spread


def _spread_of_block(block: Block) -> Spread:
    nothing = np.zeros((0, block.rows.shape[1]))
    return Spread.total([Spread.of(*piece) for piece in block.pieces()] or [Spread.of(nothing, np.zeros(0))])


def standardized(table: Table | Blocks, scaling: Scaling) -> Table | Blocks:
    """Return rows that are scaled, those in blocks as they are read."""
    if isinstance(table, Table):
        return replace(table, rows=scaling.apply(table.rows))
    return replace(table, rows=table.rows.map_blocks(scaling.apply, dtype=np.float64))


def sample_rows(table: Table | Blocks, rng: int) -> tuple[Array, Floats | None]:
    """Return all rows of a table and their weights, or about a million of positive weight that are drawn of blocks."""
    if isinstance(table, Table):
        return table.rows, table.weights
    surveyed = survey(table, 1, np.random.default_rng(rng))
    return surveyed.rows, surveyed.weights


def write_all_labels(path: StrPath, labels: Any, table: Table | Blocks, *, overwrite: bool = False) -> int:
    """Write the labels of rows as `write_row_labels` does, and return the number of rows of the file."""
    if isinstance(table, Table):
        write_row_labels(path, labels, table.kept, overwrite=overwrite)
        return len(table.kept)
    n_rows = int((labels if table.kept is None else table.kept).shape[0])
    write_label_parts(path, n_rows, _parts(labels, table.kept), overwrite=overwrite)
    return n_rows


def _parts(labels: object, kept: object) -> Iterator[Ints]:
    if kept is None:
        yield from (part for (part,) in blocks_of(labels))
        return
    for part, inside in blocks_of(labels, kept):
        whole = np.full(len(inside), -1, np.int32)
        whole[inside] = part
        yield whole

"""One table of the segments of all inputs of a batch: it keeps the rows of an earlier run that goes on."""

from __future__ import annotations

import csv
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cvtimg.batch import Plan, Report, Row, WrongUsageError
from cvtimg.files.remote import exists, local_copy
from cvtimg.options.record import Given

if TYPE_CHECKING:
    from cvtimg._shared.types import Array

Table = Mapping[str, "Array"]


class JointTable(Report):
    """Collects the table of each input, which comes with its row, and writes all as one when the run ends."""

    def __init__(self, path: Path, plan: Plan, columns: Sequence[str], given: Given) -> None:
        super().__init__(columns, as_json=given.as_json, quiet=given.quiet)
        self._path, self._replaces = path, given.overwrite or given.skip_existing
        self._tables: dict[str, Table] = {}
        times = Counter(task.source.name for task in plan.tasks)
        #: The name of each input in the table: that of its file, or its path where files have the same name.
        self._names = {
            task.name: task.source.name if times[task.source.name] == 1 else task.name for task in plan.tasks
        }
        if given.skip_existing and not given.overwrite and exists(path):
            try:
                self._tables |= _by_image(_read(path))
            except (KeyError, ValueError) as error:
                raise WrongUsageError(f"--table: {path} has no rows of images to go on with; --overwrite") from error
            plan.known = [name for name, image in self._names.items() if image in self._tables]

    def done(self, row: Row) -> None:
        """Keep a table beside recording the input."""
        name = str(row["input"])
        self._tables[_text(self._names.get(name, name))] = row["_table"]
        super().done(row)

    def close(self) -> int:
        """Write the table, and end as without."""
        self._write()
        return super().close()

    def interrupted(self, n_inputs: int) -> None:
        """Write what is known."""
        self._write()
        super().interrupted(n_inputs)

    def _write(self) -> None:
        import numpy as np

        from cvtimg.labels import write_table

        places = {_text(name): place for place, name in enumerate(self._names.values())}
        order = sorted(self._tables, key=lambda name: places.get(name, -1))  # what only an earlier run had comes first
        tables = [{"image": np.full(_n_rows(self._tables[name]), name), **self._tables[name]} for name in order]
        if tables:
            columns = dict.fromkeys(column for table in tables for column in table)
            whole = {
                column: np.concatenate([table.get(column, np.full(_n_rows(table), np.nan)) for table in tables])
                for column in columns
            }
            write_table(self._path, whole, overwrite=self._replaces)


def _text(name: str) -> str:
    """Return a name of a file, which need not be valid text, as text."""
    return os.fsencode(name).decode(errors="replace")


def _n_rows(table: Table) -> int:
    return len(next(iter(table.values())))


def _read(path: Path) -> Table:
    """Read a table that was written here."""
    import numpy as np

    with local_copy(path) as copy:
        if path.suffix.lower() == ".parquet":
            from cvtimg._shared.extras import optional

            parquet = optional("pyarrow.parquet", "parquet", "tables in .parquet need")
            return {name: np.array(column) for name, column in parquet.read_table(copy).to_pydict().items()}
        with copy.open(newline="", encoding="utf-8") as file:
            names, *rows = csv.reader(file)
    columns = dict(zip(names, zip(*rows, strict=True), strict=False))
    return {name: np.array(column, None if name == "image" else float) for name, column in columns.items()}


def _by_image(table: Table) -> dict[str, Table]:
    """Divide a table by its column of images, which the parts do not have."""
    others = {name: column for name, column in table.items() if name != "image"}
    images = dict.fromkeys(table["image"].tolist()) if table else {}
    return {image: {name: column[table["image"] == image] for name, column in others.items()} for image in images}

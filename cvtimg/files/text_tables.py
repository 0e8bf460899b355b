"""Write tables as comma-separated values with a header line."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from io import StringIO
from typing import Any

from cvtimg.files.whole import StrPath, write_whole


def csv_text(names: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    r"""Format a table of named columns as comma-separated values; None gives an empty field.

    Examples
    --------
    >>> csv_text(["name", "area"], [["a, b", 12.5], ["c", None]])
    'name,area\n"a, b",12.5\nc,\n'
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return text.getvalue()


def write_csv(path: StrPath, names: Iterable[str], rows: Iterable[Iterable[Any]], *, overwrite: bool = False) -> None:
    """Write a table, as `csv_text` formats it, in UTF-8, atomically; `overwrite` allows to replace a file."""
    # A column may hold file names that are not valid text.
    write_whole(path, csv_text(names, rows).encode(errors="surrogateescape"), overwrite=overwrite)

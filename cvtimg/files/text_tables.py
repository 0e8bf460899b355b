"""Write tables as comma-separated values with a header line."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from io import StringIO
from typing import Any

from cvtimg.files.whole import StrPath, write_whole


def csv_text(names: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    r"""Format a table as comma-separated values.

    Parameters
    ----------
    names : iterable of str
        Column names.
    rows : iterable of iterables
        Values of each row; None gives an empty field.

    Returns
    -------
    str

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
    """Write a table as comma-separated values in UTF-8, atomically.

    Parameters
    ----------
    path : str or path-like
        File to write.
    names, rows
        As in `csv_text`.
    overwrite : bool
        Replace an existing file.
    """
    text = csv_text(names, rows)
    # A column may hold file names that are not valid text.
    write_whole(path, text.encode(errors="surrogateescape"), overwrite=overwrite)

"""Names and bounds of the axes of a design, as a text file."""

from __future__ import annotations

import csv

import numpy as np
from numpy.typing import NDArray

from cvtimg.files.remote import local_copy
from cvtimg.files.whole import StrPath


def read_bounds(path: StrPath) -> tuple[list[str], NDArray[np.float64]]:
    r"""Read the axes of a design: a line for each, after a first line ``name,low,high``.

    Parameters
    ----------
    path : str or path-like
        A .csv file.

    Returns
    -------
    list of str, (d, 2) float64 array
        Names, and least and greatest values.

    Raises
    ------
    OSError
        If the file cannot be read, has other columns or no axis, or a least value is not below the greatest.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(f"{folder}/a.csv").write_text("name,low,high\nspeed,0,30\nheat,20,90\n")
    ...     names, bounds = read_bounds(f"{folder}/a.csv")
    >>> names, bounds.tolist()
    (['speed', 'heat'], [[0.0, 30.0], [20.0, 90.0]])
    """
    try:
        with local_copy(path) as file:
            text = file.read_text(encoding="utf-8-sig")
        lines = list(csv.DictReader(text.splitlines(), skipinitialspace=True))
        bounds = np.array([[float(line["low"]), float(line["high"])] for line in lines]).reshape(-1, 2)
        names = [line["name"] for line in lines]
    except (KeyError, TypeError, ValueError) as error:
        raise OSError(f"{path}: must have the columns name, low and high, with a line for each axis") from error
    if not names:
        raise OSError(f"{path}: must have a line for each axis after the first")
    for name, (low, high) in zip(names, bounds.tolist(), strict=True):
        if not -np.inf < low < high < np.inf:
            raise OSError(f"{path}: {name} from {low:g} to {high:g} must be finite, the first below the second")
    return names, bounds

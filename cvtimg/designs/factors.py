"""Factors of experiments: ranges, whole numbers, and levels, read from a table."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_in_range
from cvtimg.files.remote import local_copy
from cvtimg.files.text_tables import write_csv
from cvtimg.files.whole import StrPath

#: Whole numbers in a range are levels; at most so many.
_MOST_LEVELS = 10_000
_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Factor:
    """An input of an experiment.

    Parameters
    ----------
    name : str
    low, high : float
        Its range, where it has no levels.
    levels : tuple of str
        The values that it may have, such as numbers or categories. They share the axis from 0 to 1 evenly, so that
        points that are Latin have each level equally often, but for one.
    unit : str
        For the header of a table.

    Examples
    --------
    >>> from cvtimg.designs.factors import Factor
    >>> Factor("alloy", levels=("A", "B", "C")).values([0.1, 0.5, 0.9])
    ['A', 'B', 'C']
    """

    name: str
    low: float = 0.0
    high: float = 1.0
    levels: tuple[str, ...] = ()
    unit: str = ""

    @classmethod
    def parse(cls, text: str) -> Factor:
        """Read a factor from a text: ``"speed,0,30"``, ``"pumps,1,4,integer"`` or ``"alloy,A|B|C"``.

        Raises
        ------
        ValueError
            If the text says something else.
        """
        name, *values = (part.strip() for part in text.split(","))
        if len(values) == 1 and "|" in values[0]:
            return _factor({"name": name, "levels": values[0]})
        if len(values) not in (2, 3) or not all(map(_is_number, values[:2])):
            raise ValueError(f"{text!r} must be NAME,LOW,HIGH, NAME,LOW,HIGH,integer or NAME,A|B|C")
        return _factor(dict(zip(("name", "low", "high", "kind"), (name, *values), strict=False)))

    @property
    def header(self) -> str:
        """The name, and the unit in brackets."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def values(self, places: ArrayLike) -> list[Any]:
        """Return the values at places (n,) of the axis: levels as texts."""
        column = np.asarray(places, np.float64)
        if not self.levels:
            return column.tolist()
        index = np.clip((column * len(self.levels)).astype(int), 0, len(self.levels) - 1)
        return [self.levels[i] for i in index]

    def places(self, values: Sequence[str]) -> NDArray[np.float64]:
        """Return where values (n,) are on the axis."""
        if not self.levels:
            return np.array([float(value) for value in values])
        for value in values:
            check_in_range(self.name, value, value in self.levels, f"one of its levels, {', '.join(self.levels)}")
        return (np.array([self.levels.index(value) for value in values]) + 0.5) / len(self.levels)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_factors(path: StrPath) -> list[Factor]:
    """Read the factors of a design: a line for each, after a line of names of columns.

    Columns are name, low and high, and may be kind (continuous or integer), levels (values with | between them, instead
    of low and high) and unit.

    Raises
    ------
    OSError
        If the file cannot be read, or a line is invalid.
    """
    return _each_line(path, _factor)


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
    >>> from cvtimg.designs import read_bounds
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(f"{folder}/a.csv").write_text("name,low,high\nspeed,0,30\nheat,20,90\n")
    ...     names, bounds = read_bounds(f"{folder}/a.csv")
    >>> names, bounds.tolist()
    (['speed', 'heat'], [[0.0, 30.0], [20.0, 90.0]])
    """
    ranges = _each_line(path, _range)
    return [name for name, _, _ in ranges], np.array([ends for _, *ends in ranges])


def _each_line(path: StrPath, read: Callable[[Mapping[str, str]], _T]) -> list[_T]:
    """Read each line of a file, given its fields by the names of their columns."""
    with local_copy(path) as file:
        text = file.read_text(encoding="utf-8-sig")
    lines = [
        {key: (value or "").strip() for key, value in line.items() if isinstance(value, str | None)}
        for line in csv.DictReader(text.splitlines(), skipinitialspace=True)
    ]
    if not lines:
        raise OSError(f"{path}: must have a line for each axis after the first")
    try:
        return [read(fields) for fields in lines]
    except ValueError as error:
        raise OSError(f"{path}: {error}") from error


def _range(fields: Mapping[str, str]) -> tuple[str, float, float]:
    """Return the name, low and high of an axis."""
    try:
        name, low, high = fields["name"], float(fields["low"]), float(fields["high"])
    except (KeyError, ValueError) as error:
        raise ValueError("must have the columns name, low and high, with a line for each axis") from error
    if not -np.inf < low < high < np.inf:
        raise ValueError(f"{name} from {low:g} to {high:g} must be finite, the first below the second")
    return name, low, high


def _factor(fields: Mapping[str, str]) -> Factor:
    name, unit = fields.get("name", ""), fields.get("unit", "")
    if levels := fields.get("levels"):
        values = tuple(level.strip() for level in levels.split("|"))
        if len(values) < 2 or len(set(values)) < len(values) or fields.get("low") or fields.get("high"):
            raise ValueError(f"{name} must have two or more levels, all different, and no low and high")
        return Factor(name, levels=values, unit=unit)
    name, low, high = _range(fields)
    if not name:
        raise ValueError("must have a name in each line")
    kind = fields.get("kind") or "continuous"
    if kind == "continuous":
        return Factor(name, low, high, unit=unit)
    if kind != "integer" or low % 1 or high % 1 or high - low >= _MOST_LEVELS:
        raise ValueError(f"{name} of kind {kind} must be continuous, or integer between whole numbers")
    return Factor(name, levels=tuple(map(str, range(int(low), int(high) + 1))), unit=unit)


def read_runs(path: StrPath, factors: Sequence[Factor]) -> NDArray[np.float64]:
    """Read runs from a table with a column for each factor, in their order, as places on their axes."""
    with local_copy(path) as file:
        rows = [row for row in csv.reader(file.read_text(encoding="utf-8-sig").splitlines()) if row][1:]
    if any(len(row) != len(factors) for row in rows):
        raise OSError(f"{path}: must have {len(factors)} columns, one for each factor")
    try:
        return np.stack([f.places([row[k].strip() for row in rows]) for k, f in enumerate(factors)], axis=1)
    except ValueError as error:
        raise OSError(f"{path}: {error}") from error


def write_runs(path: StrPath, factors: Sequence[Factor], points: ArrayLike, *, overwrite: bool = False) -> None:
    """Write the runs of an experiment as a .csv file: a column for each factor, a row for each of (N, D) points.

    Points are in the units of factors with ranges, and in 0..1 along those with levels. The file is whole or not there.

    Raises
    ------
    OSError
        If the file cannot be written, or exists and `overwrite` is false.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from cvtimg.designs import Factor, write_runs
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     factors = [Factor("heat", 20, 90, unit="C"), Factor("alloy", levels=("A", "B"))]
    ...     write_runs(f"{folder}/runs.csv", factors, [[20.5, 0.75]])
    ...     Path(f"{folder}/runs.csv").read_text().split()
    ['heat', '[C],alloy', '20.5,B']
    """
    columns = [factor.values(column) for factor, column in zip(factors, np.asarray(points).T, strict=True)]
    rows = [list(row) for row in zip(*columns, strict=True)]
    write_csv(path, [factor.header for factor in factors], rows, overwrite=overwrite)

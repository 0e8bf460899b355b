"""Factors of experiments: ranges, whole numbers, and levels, read from a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import MAX_COLORS, ROUNDING
from cvtimg._shared.checks import check_in_range
from cvtimg._shared.types import Floats, Indices
from cvtimg.files.remote import local_copy
from cvtimg.files.whole import StrPath
from cvtimg.tables.columns import Columns, Dialect, open_columns


@dataclass(frozen=True, slots=True)
class Factor:
    """An input of an experiment.

    Parameters
    ----------
    name : str
    low, high : float
        Its range, where it has no levels.
    levels : tuple of str
        The values that it may have. Numbers share an axis from 0 to 1 in their order, so that points that are Latin
        have each equally often, but for one. Others are categories, which have no order.
    unit : str
        For the header of a table.
    log : bool
        Whether equal ratios count as equal distances; the range is then above 0.

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
    log: bool = False

    @classmethod
    def parse(cls, text: str) -> Factor:
        """Read a factor from a text: ``"speed,0,30"``, with ``,log``, ``,integer`` or ``,0.5``, or ``"alloy,A|B"``."""
        name, *values = (part.strip() for part in text.split(","))
        if len(values) == 1 and "|" in values[0]:
            return _factor({"name": name, "levels": values[0]})
        if len(values) not in (2, 3) or not all(map(_is_number, values[:2])):
            raise ValueError(f"{text!r} must be NAME,LOW,HIGH, that with ,integer, ,log or a step, or NAME,A|B|C")
        return _factor(dict(zip(("name", "low", "high", "kind"), (name, *values), strict=False)))

    @property
    def header(self) -> str:
        """The name, and the unit in brackets."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    @property
    def is_category(self) -> bool:
        """Whether there are levels, and not all are numbers."""
        return not all(map(_is_number, self.levels))

    def levels_at(self, places: ArrayLike) -> Indices:
        """Return the index of the level at places (n,) of the axis."""
        index = np.asarray(places, np.float64) * len(self.levels)
        return np.clip(index.astype(np.intp), 0, len(self.levels) - 1)

    def values(self, places: ArrayLike) -> list[Any]:
        """Return the values at places (n,) of the axis: levels as texts."""
        if not self.levels:
            return np.asarray(places, np.float64).tolist()
        return [self.levels[i] for i in self.levels_at(places)]

    def at(self, units: ArrayLike) -> Floats:
        """Return the points of 0..1 along the axis in its units."""
        share, low, high = np.asarray(units, np.float64), float(self.low), float(self.high)
        if self.log:
            return np.clip(np.exp((1 - share) * np.log(low) + share * np.log(high)), low, high)
        return low + share * (high - low)

    def unit_of(self, points: ArrayLike) -> Floats:
        """Return where points of the axis are in 0..1; the inverse of `at`, NaN or beyond 0..1 outside of the range."""
        points, low, high = np.asarray(points, np.float64), float(self.low), float(self.high)
        if self.log:
            with np.errstate(invalid="ignore", divide="ignore"):
                return (np.log(points) - np.log(low)) / (np.log(high) - np.log(low))
        return (points - low) / (high - low)

    def numbers(self, places: Floats) -> Floats:
        """Return the numbers at places (n,) of an axis that is no category."""
        return np.array(self.levels, np.float64)[self.levels_at(places)] if self.levels else places

    def places(self, values: Sequence[str]) -> Floats:
        """Return where values (n,) are on the axis."""
        if not self.levels:
            return np.array([float(value) for value in values])
        if not self.is_category:  # however the numbers are written
            values = [f"{float(value):.12g}" if _is_number(value) else value for value in values]
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
    r"""Read the factors of a design: a line for each, after a line of names of columns.

    Columns are name, low and high, and may be kind (continuous, log, integer, or a step such as 0.5), levels (values
    with | between them, instead of low and high) and unit.

    Parameters
    ----------
    path : str or path-like
        A .csv file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from cvtimg.designs import read_factors
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(f"{folder}/a.csv").write_text("name,low,high,unit\nspeed,0,30,m/s\nheat,20,90,C\n")
    ...     factors = read_factors(f"{folder}/a.csv")
    >>> [factor.header for factor in factors]
    ['speed [m/s]', 'heat [C]']
    """
    try:
        source, lines = _read_rows(path, Dialect(header=True))
        if not lines:
            raise ValueError("must have a line for each axis after the first")
        factors = [_factor(dict(zip(source.names, line, strict=False))) for line in lines]
        check_names(factors)
        return factors
    except ValueError as error:
        raise OSError(f"{path}: {error}") from error


def check_names(factors: Sequence[Factor]) -> None:
    """Refuse factors of the same name."""
    names = [factor.name for factor in factors]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ValueError(f"there must be one axis named {twice[0]}, not {len(twice)}")


def _factor(fields: Mapping[str, str]) -> Factor:
    name, unit = fields.get("name", ""), fields.get("unit", "")
    if levels := fields.get("levels"):
        values = tuple(level.strip() for level in levels.split("|"))
        if len(values) < 2 or len(set(values)) < len(values) or fields.get("low") or fields.get("high"):
            raise ValueError(f"{name} must have two or more levels, all different, and no low and high")
        return Factor(name, levels=values, unit=unit)
    try:
        low, high = float(fields["low"]), float(fields["high"])
    except (KeyError, ValueError) as error:
        raise ValueError("must have the columns name, low and high, with a line for each axis") from error
    if not -np.inf < low < high < np.inf:
        raise ValueError(f"{name} from {low:g} to {high:g} must be finite, the first below the second")
    if not name:
        raise ValueError("must have a name in each line")
    kind = fields.get("kind") or "continuous"
    if kind == "continuous" or (kind == "log" and low > 0):
        return Factor(name, low, high, unit=unit, log=kind == "log")
    step = float(kind) if _is_number(kind) else 1.0 if kind == "integer" and low % 1 == high % 1 == 0 else 0.0
    if not (high - low) / MAX_COLORS < step <= high - low:
        allowed = "continuous, log above 0, integer between whole numbers, or a step that fits between them"
        raise ValueError(f"{name} of kind {kind} must be {allowed}")
    numbers = low + step * np.arange(int((high - low) / step * (1 + ROUNDING)) + 1)
    return Factor(name, levels=tuple(f"{level:.12g}" for level in numbers), unit=unit)


def read_runs(path: StrPath, factors: Sequence[Factor]) -> Floats:
    """Read runs from a table as places (L, D) on the axes of factors: columns by name, or all in order."""
    source, rows = _read_rows(path, Dialect())
    header = source.names if source.named else []
    headers = [next((name for name in (factor.header, factor.name) if name in header), None) for factor in factors]
    by_name = None not in headers
    columns = [header.index(str(name)) for name in headers] if by_name else range(len(factors))
    if not by_name and len(source.names) != len(factors):
        raise OSError(f"{path}: must have {len(factors)} columns, one for each factor, or their names")
    places = np.empty((len(rows), len(factors)))
    for axis, (column, factor) in enumerate(zip(columns, factors, strict=True)):
        for number, row in enumerate(rows):
            try:
                places[number, axis] = factor.places([row[column]])[0]
                place = places[number, axis].item()
                within = bool(0 <= factor.unit_of(place) <= 1)
                check_in_range(factor.name, place, within, f"within its bounds, {factor.low:g}..{factor.high:g}")
            except ValueError as error:
                raise OSError(f"{path}: {source.place(number)}: {error}") from error
    return places


def _read_rows(path: StrPath, dialect: Dialect) -> tuple[Columns, list[list[str]]]:
    """Read the rows of a table as texts, as `cvtimg.tables.read_table` does."""
    with local_copy(path) as file:
        source = open_columns(file, dialect)
        return source, [source.plain(row) for row in source.cells()]

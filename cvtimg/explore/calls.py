"""Calls of functions that are run, and shown as the lines of Python that do the same: one record for both."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from functools import reduce
from typing import Any, NamedTuple, TypeAlias

import numpy as np

import cvtimg

#: Values of variables by name.
Values: TypeAlias = Mapping[str, Any]


class Named(NamedTuple):
    """A value that is at hand, and that the lines of Python write as an expression."""

    text: str
    value: Any


@dataclass(frozen=True, slots=True)
class Name:
    """A variable, or an attribute of one, such as ``"result.labels"``."""

    text: str

    def run(self, values: Values) -> Any:
        first, *others = self.text.split(".")
        return reduce(getattr, others, values[first])


@dataclass(frozen=True, slots=True)
class Formula:
    """An expression of variables that is no call."""

    text: str
    run: Callable[[Values], Any]


@dataclass(frozen=True, slots=True, eq=False)
class Call:
    """A call of a function below `cvtimg`, such as ``"quantize"``, or of a method of the variable `of`."""

    function: str
    arguments: tuple[Any, ...] = ()
    keywords: Mapping[str, Any] = field(default_factory=dict)
    of: str = "cvtimg"

    def run(self, values: Values) -> Any:
        function = reduce(getattr, self.function.split("."), {"cvtimg": cvtimg, **values}[self.of])
        arguments = [_value(value, values) for value in self.arguments]
        return function(*arguments, **{name: _value(value, values) for name, value in self.keywords.items()})

    @property
    def text(self) -> str:
        words = [*map(literal, self.arguments), *(f"{name}={literal(value)}" for name, value in self.keywords.items())]
        return f"{self.of}.{self.function}({', '.join(words)})"


class Line(NamedTuple):
    """A line of Python: a value gets a name."""

    name: str
    value: Any


def run(lines: Iterable[Line], values: Values | None = None) -> dict[str, Any]:
    """Run lines one after the other, and return the values of all names."""
    named = dict(values or {})
    for name, value in lines:
        named[name] = _value(value, named)
    return named


def as_python(lines: Sequence[Line], last: Call) -> str:
    """Write lines in Python, and a call after them."""
    written = [*(f"{name} = {literal(value)}" for name, value in lines), last.text]
    imports = ["import cvtimg", *["import numpy"] * any("numpy." in line for line in written)]
    return "\n".join([*imports, "", *written])


def _value(value: Any, values: Values) -> Any:
    if isinstance(value, Named):
        return value.value
    return value.run(values) if isinstance(value, (Name, Formula, Call)) else value


def literal(value: Any) -> str:
    """Write a value in Python."""
    if isinstance(value, (Named, Name, Formula, Call)):
        return value.text
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, np.ndarray):
        return repr(value.tolist())
    if isinstance(value, list) and value and is_dataclass(value[0]):
        return f"[{', '.join(map(literal, value))}]"
    if is_dataclass(value):  # all that are passed have a public name in the package of their subject
        package = ".".join(type(value).__module__.split(".")[:2])
        return f"{package}.{value!r}".replace("'", '"')
    return repr(value)

"""Lines of Python that are run as the page shows them."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import is_dataclass
from typing import Any, NamedTuple

import numpy as np

import cvtimg
from cvtimg._shared.choices import Json, Options


class Code(str):
    """An expression of Python: lines write it as it is, and all other values as literals."""

    __slots__ = ()


class Line(NamedTuple):
    """A line of Python, an expression that gets a name; `value` is what it stands for where that is at hand."""

    name: str
    code: Code
    value: Any = None


def call(function: str, *arguments: Any, **keywords: Any) -> Code:
    """Write the call of a function, such as ``"cvtimg.quantize"``."""
    words = [*map(literal, arguments), *(f"{name}={literal(value)}" for name, value in keywords.items())]
    return Code(f"{function}({', '.join(words)})")


def run(lines: Iterable[Line], values: Options | None = None) -> Json:
    """Run lines one after the other, and return the values of all names."""
    named = dict(values or {})
    for line in lines:
        named[line.name] = evaluated(line.code, named) if line.value is None else line.value
    return named


def evaluated(code: Code, values: Options) -> Any:
    """Return what an expression stands for: tabs write it, and what a person chose is in it as literals alone."""
    return eval(code, {"cvtimg": cvtimg, "numpy": np, **values})


def as_python(lines: Sequence[Line], last: Code) -> str:
    """Write lines in Python, and a call after them."""
    written = [*(f"{line.name} = {line.code}" for line in lines), last]
    modules = [name for name in ("cvtimg", "numpy", "PIL.Image") if any(f"{name}." in line for line in written)]
    return "\n".join([*(f"import {name}" for name in modules), "", *written])


def literal(value: object) -> str:
    """Write a value in Python."""
    if isinstance(value, str):
        return value if isinstance(value, Code) else json.dumps(value, ensure_ascii=False)
    if isinstance(value, np.ndarray):
        return repr(value.tolist())
    if isinstance(value, list) and value and is_dataclass(value[0]):
        return f"[{', '.join(map(literal, value))}]"
    if is_dataclass(value):  # all that are passed have a public name in the package of their subject
        package = ".".join(type(value).__module__.split(".")[:2])
        return f"{package}.{value!r}".replace("'", '"')
    return repr(value)

"""Calls of functions of cvtimg that are run, and shown as the lines of Python that do the same."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, is_dataclass
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

import cvtimg

__all__ = ["Call", "Named", "literal"]


class Named(NamedTuple):
    """A value that the lines of Python write as an expression."""

    text: str
    value: Any


@dataclass(frozen=True, slots=True, eq=False)
class Call:
    """A call of a function on an image."""

    function: str  # Its name below `cvtimg`, such as ``"quantize"``
    arguments: tuple[Any, ...] = ()  # Those after the image
    keywords: Mapping[str, Any] = field(default_factory=dict)  # Keyword arguments

    def run(self, image: Any) -> Any:
        """Call the function."""
        function = reduce(getattr, self.function.split("."), cvtimg)
        keywords = {name: _value(value) for name, value in self.keywords.items()}
        return function(image, *map(_value, self.arguments), **keywords)  # type: ignore[operator]

    def text(self, image: str = "image") -> str:
        """Write the call in Python."""
        words = [*([image] if image else []), *map(literal, self.arguments)]
        words += [f"{name}={literal(value)}" for name, value in self.keywords.items()]
        return f"cvtimg.{self.function}({', '.join(words)})"


def _value(value: Any) -> Any:
    return value.value if isinstance(value, Named) else value


def literal(value: Any) -> str:
    """Write a value in Python."""
    if isinstance(value, Named):
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

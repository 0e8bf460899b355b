"""Values of options converted without pydantic.

Typer hands every value to a pydantic adapter. Importing pydantic and building an adapter for each option takes longer
than importing NumPy, which is half of what it takes to quantize a small image. The types that options have here need
none of it: what is not listed below is left to Typer.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import typer

__all__ = ["convert_plainly"]

#: By the annotation of an option.
_CONVERTERS: dict[Any, Callable[[Any], Any]] = {str: str, bool: bool, int: int, float: float, Path: Path}
_NAMES = {int: "a whole number", float: "a number"}


class _Plain:
    """Stands in for Typer's runtime parameter; it has the one method that Typer calls."""

    def __init__(self, convert: Callable[[Any], Any]) -> None:
        self._convert = convert

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """Convert the value, or the values, that the command line gave."""
        several = param.multiple or param.nargs == -1
        if value is None:
            return () if several else None
        return [self._convert(one) for one in value] if several else self._convert(value)


def convert_plainly(command: Any) -> Any:
    """Let the options of a command convert their values here wherever their type is a plain one."""
    for param in command.get_params(typer.Context(command, **command.context_settings)):  # with --help
        described = getattr(param, "type_descriptor", None)  # another version of Typer may have none
        if described is not None and (convert := _converter(described)):
            param._runtime_param = _Plain(convert)
    return command


def _converter(described: Any) -> Callable[[Any], Any] | None:
    annotation = described.annotation
    if described.parameter_info.parser:
        parser: Callable[[Any], Any] = described.parameter_info.parser
        return parser
    if get_origin(annotation) is list:
        (annotation,) = get_args(annotation)
    if get_origin(annotation) is Literal:
        return _choice(get_args(annotation))
    if annotation not in _CONVERTERS:
        return None
    return _worded(_CONVERTERS[annotation], _NAMES.get(annotation, ""))


def _worded(convert: Callable[[Any], Any], name: str) -> Callable[[Any], Any]:
    def converted(value: Any) -> Any:
        try:
            return convert(value)
        except ValueError:
            raise typer.BadParameter(f"{str(value)!r} must be {name}") from None

    return converted


def _choice(choices: tuple[Any, ...]) -> Callable[[Any], Any]:
    def chosen(value: Any) -> Any:
        if value not in choices:
            raise typer.BadParameter(f"{str(value)!r} must be one of {', '.join(map(str, choices))}")
        return value

    return chosen

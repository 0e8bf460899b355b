"""Optional dependencies, and how to install them."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Literal, TypeAlias

#: Extras of the package, as in pyproject.toml.
Extra: TypeAlias = Literal[
    "codecs", "dask", "designs", "excel", "explore", "fits", "globe", "mesh", "microscopes", "microscopy",
    "oxipng", "parquet", "plot", "raw", "regions", "remote", "sklearn", "surfaces", "zarr",
]  # fmt: skip


def needs(packages: str, extra: Extra) -> str:
    """Return the end of an error about missing packages, with the command that installs them."""
    return f"{packages}: pip install 'cvtimg[{extra}]'"


def optional(name: str, extra: Extra, said: str = "needs") -> Any:
    """Import a module of an extra; an error that begins with what is `said` tells how to install it."""
    try:
        return import_module(name)
    except ImportError as error:
        package = name.partition(".")[0]
        raise ModuleNotFoundError(f"{said} {needs(package, extra)}", name=package) from error


class Lazy:
    """A module of an extra, which is imported when something of it is asked for."""

    def __init__(self, name: str, extra: Extra) -> None:
        self._name, self._extra = name, extra

    def __getattr__(self, attribute: str) -> Any:
        return getattr(optional(self._name, self._extra), attribute)


shapely = Lazy("shapely", "regions")

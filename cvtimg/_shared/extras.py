"""Optional dependencies, and how to install them; and one that takes long to import."""

from importlib import import_module
from typing import Any, Literal, TypeAlias

#: Extras of the package, as in pyproject.toml.
Extra: TypeAlias = Literal[
    "codecs", "dask", "designs", "excel", "explore", "fits", "globe", "mesh", "microscopes", "microscopy",
    "oxipng", "parquet", "plot", "raw", "remote", "sklearn", "surfaces", "zarr",
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
    """A module that is imported when something of it is asked for."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(import_module(self._name), attribute)


shapely = Lazy("shapely")

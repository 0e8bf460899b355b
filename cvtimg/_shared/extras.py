"""Optional dependencies, and how to install them."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Literal, TypeAlias

#: Extras of the package, as in pyproject.toml.
Extra: TypeAlias = Literal[
    "codecs", "dask", "designs", "explore", "fits", "globe", "kneedle", "mesh", "microscopes", "microscopy",
    "oxipng", "parquet", "plot", "raw", "regions", "remote", "sklearn", "surfaces", "zarr",
]  # fmt: skip


def needs(packages: str, extra: Extra) -> str:
    """Return the end of an error about missing packages, with the command that installs them."""
    return f"{packages}: pip install 'cvtimg[{extra}]'"


def optional(name: str, extra: Extra) -> Any:
    """Import a package of an extra; ImportError says how to install it."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"needs {needs(name, extra)}") from error

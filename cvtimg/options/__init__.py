"""Options of all verbs, each declared once; from them the command line, the page and its copied commands are made.

`record.Option` says what an option is, ``common`` has those that several verbs share, and the other modules list those
of each verb under its name in capitals. ``--help`` imports this package, so nothing here imports NumPy at its top.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cvtimg.options.record import Option

__all__ = ["options_of"]

#: Where the options of each verb are.
_MODULES = {
    "quantize": "quantize_options",
    "palette": "quantize_options",
    "info": "quantize_options",
    "segment": "segment_options",
    "restore": "restore_options",
    "stipple": "artwork_options",
    "mosaic": "artwork_options",
    "mesh": "mesh_options",
    "surface": "mesh_options",
    "sphere": "mesh_options",
    "cluster": "sample_options",
    "elbow": "sample_options",
    "design": "sample_options",
    "basis": "film_options",
    "keyframes": "film_options",
    "explore": "common",
}


def options_of(verb: str) -> tuple[Option, ...]:
    """Return the options of a verb, in the order of ``--help``."""
    return getattr(import_module(f"cvtimg.options.{_MODULES[verb]}"), verb.upper())

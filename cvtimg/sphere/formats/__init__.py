"""Files of grids: a format is a function in a module of its own, and a line in `GRID_FORMATS`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cvtimg._shared.checks import check_choice
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.sphere.formats._content import GridContent
from cvtimg.sphere.formats.csv import csv

#: The registry of formats: suffix to the function that makes the content of the file.
GRID_FORMATS: dict[str, Callable[[GridContent], bytes]] = {".csv": csv}


__all__ = ["GRID_FORMATS", "GridContent", "write_grid"]


def write_grid(path: StrPath, grid: GridContent, *, overwrite: bool = False) -> None:
    """Write a grid in the format that the suffix picks."""
    suffix = Path(path).suffix.lower()
    check_choice("suffix", suffix, GRID_FORMATS)
    content = GRID_FORMATS[suffix](grid)
    with whole_file(path, overwrite=overwrite) as file:
        file.write(content)

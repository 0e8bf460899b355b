"""Files of grids of the sphere, a format a module."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from cvtimg._shared.checks import refuse
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.sphere.formats.geometry import GridContent
from cvtimg.sphere.formats.mpas import write_mpas
from cvtimg.sphere.formats.polygons import write_geojson, write_vtu
from cvtimg.sphere.formats.tables import write_graph, write_table
from cvtimg.sphere.formats.ugrid import write_scrip, write_ugrid

__all__ = ["GRID_FORMATS", "GridContent", "grid_format", "write_grid"]

#: The registry of formats: end of the file's name to the function that writes it; longer ends come first.
GRID_FORMATS: dict[str, Callable[[BinaryIO, GridContent], None]] = {
    ".ugrid.nc": write_ugrid,
    ".scrip.nc": write_scrip,
    ".graph.info": write_graph,
    ".nc": write_mpas,
    ".vtu": write_vtu,
    ".geojson": write_geojson,
    ".csv": write_table,
}


def grid_format(path: StrPath) -> str:
    """Return the end of a file's name that picks its format."""
    name = Path(path).name.lower()
    for end in GRID_FORMATS:
        if name.endswith(end):
            return end
    return refuse("path", str(path), f"a name that ends in {', '.join(GRID_FORMATS)}")


def write_grid(path: StrPath, grid: GridContent, *, overwrite: bool = False) -> None:
    """Write a grid, in the format that the end of the name picks, completely or not at all."""
    write = GRID_FORMATS[grid_format(path)]
    with whole_file(path, overwrite=overwrite) as file:
        write(file, grid)

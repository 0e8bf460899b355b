"""Files of grids of the sphere."""

from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import numpy as np

from cvtimg._shared.checks import refuse
from cvtimg.files.whole import StrPath, csv_text, whole_file
from cvtimg.sphere.formats.geometry import CulledContent, GridContent, latitudes_longitudes
from cvtimg.sphere.formats.netcdf import write_mpas, write_scrip, write_ugrid
from cvtimg.sphere.formats.polygons import write_geojson, write_vtu

__all__ = ["GRID_FORMATS", "CulledContent", "GridContent", "grid_format", "write_grid"]


def write_table(file: BinaryIO, grid: GridContent) -> None:
    """Write a row for each generator: longitude in -180..180 and latitude, place, area, neighbors and density."""
    areas = grid.geometry.cell_areas * grid.radius**2
    latitudes, longitudes = (np.degrees(angles) for angles in latitudes_longitudes(grid.points))
    columns = {
        "lon": (longitudes + 180) % 360 - 180,
        "lat": latitudes,
        **dict(zip("xyz", grid.points.T * grid.radius, strict=True)),
        "area": areas,
        "neighbors": grid.around.degrees,
        "density": grid.density,
        **grid.flags,
    }
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    file.write(csv_text(columns, rows).encode())


def write_graph(file: BinaryIO, grid: GridContent) -> None:
    """Write the graph of cells for METIS, which divides it among processes: neighbors of each, numbered from 1."""
    around = grid.around
    lines = [f"{len(grid.points)} {int((around.cells_on_edge >= 0).all(axis=1).sum())}"]
    lines += [" ".join(str(cell) for cell in row if cell) for row in (around.cells_on_cell + 1).tolist()]
    file.write(("\n".join(lines) + "\n").encode())


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

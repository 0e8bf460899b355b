"""Files of grids of the sphere."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import refuse
from cvtimg._shared.extras import optional
from cvtimg.files.text_tables import csv_text
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.sphere.formats.geometry import CulledContent, GridContent, Indices, Values, latitudes_longitudes
from cvtimg.sphere.formats.netcdf import write_mpas, write_scrip, write_ugrid
from cvtimg.sphere.formats.polygons import write_geojson, write_vtu

__all__ = ["GRID_FORMATS", "CulledContent", "GridContent", "grid_format", "write_grid", "write_parts"]


def write_table(file: BinaryIO, grid: GridContent) -> None:
    """Write a row for each generator: longitude in -180..180 and latitude, place, area, neighbors and density."""
    areas = grid.geometry.cell_areas * grid.radius**2
    longitudes, latitudes = _degrees(grid.points)
    columns = {
        "lon": longitudes,
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
    for row in (around.cells_on_cell + 1).tolist():
        lines.append(" ".join(str(cell) for cell in row if cell))
    file.write(("\n".join(lines) + "\n").encode())


def write_fesom_nodes(file: BinaryIO, grid: GridContent) -> None:
    """Write nod2d.out of FESOM, whose vertices are the generators: number, longitude, latitude, and 1 on the coast."""
    used, triangles = _fesom(grid)
    on_coast = np.bincount(triangles.ravel(), minlength=len(used)) < grid.around.degrees[used]
    columns = (*_degrees(grid.points[used]), on_coast.astype(int))
    rows = zip(*(column.tolist() for column in columns), strict=True)
    lines = (f"{k} {lon:.12f} {lat:.12f} {coast}\n" for k, (lon, lat, coast) in enumerate(rows, 1))
    file.write(f"{len(used)}\n{''.join(lines)}".encode())


def write_fesom_elements(file: BinaryIO, grid: GridContent) -> None:
    """Write elem2d.out of FESOM: the vertices of triangles, numbered from 1."""
    triangles = (_fesom(grid)[1] + 1).tolist()
    lines = (f"{a} {b} {c}\n" for a, b, c in triangles)
    file.write(f"{len(triangles)}\n{''.join(lines)}".encode())


def _fesom(grid: GridContent) -> tuple[Indices, NDArray[Any]]:
    """Return the generators that are corners of triangles, and the triangles by their numbers among these."""
    used, numbers = np.unique(grid.full_triangles, return_inverse=True)
    return used, numbers.reshape(-1, 3)


def _degrees(points: Values) -> tuple[Values, Values]:
    """Return longitudes in -180..180 and latitudes."""
    latitudes, longitudes = (np.degrees(angles) for angles in latitudes_longitudes(points))
    return (longitudes + 180) % 360 - 180, latitudes


def write_parts(path: StrPath, grid: GridContent, n_parts: int, *, overwrite: bool = False) -> None:
    """Divide cells among processes by METIS, and write the number of the part of each, from 0, on a line."""
    neighbors = [row[row >= 0] for row in grid.around.cells_on_cell]
    _, parts = optional("pymetis", "globe").part_graph(n_parts, adjacency=neighbors)
    with whole_file(path, overwrite=overwrite) as file:
        file.write(("\n".join(map(str, parts)) + "\n").encode())


#: The registry of formats: end of the file's name to the function that writes it; longer ends come first.
GRID_FORMATS: dict[str, Callable[[BinaryIO, GridContent], None]] = {
    ".ugrid.nc": write_ugrid,
    ".scrip.nc": write_scrip,
    ".graph.info": write_graph,
    ".nc": write_mpas,
    "nod2d.out": write_fesom_nodes,
    "elem2d.out": write_fesom_elements,
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

"""Text files of grids: a table of generators, and the graph of their neighbors."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from cvtimg.files.text_tables import csv_text
from cvtimg.sphere.formats.geometry import GridContent, latitudes_longitudes


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
    }
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    file.write(csv_text(columns, rows).encode())


def write_graph(file: BinaryIO, grid: GridContent) -> None:
    """Write the graph of cells for METIS, which divides it among processes: neighbors of each, numbered from 1."""
    around = grid.around
    lines = [f"{len(grid.points)} {len(around.halves)}"]
    for row, degree in zip((around.cells_on_cell + 1).tolist(), around.degrees.tolist(), strict=True):
        lines.append(" ".join(map(str, row[:degree])))
    file.write(("\n".join(lines) + "\n").encode())

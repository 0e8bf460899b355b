"""Grids as tables: a row per cell."""

from __future__ import annotations

import numpy as np

from cvtimg.sphere.formats._content import GridContent


def csv(grid: GridContent) -> bytes:
    """Return longitude and latitude in degrees, x, y, z, and the area of the cell on the unit sphere."""
    x, y, z = grid.points.T
    table = np.column_stack(
        [np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(np.clip(z, -1, 1))), grid.points, grid.areas]
    )
    form = ",".join(["%.17g"] * table.shape[1]) + "\n"
    return ("lon,lat,x,y,z,area\n" + (form * len(table)) % tuple(table.ravel().tolist())).encode()

"""Charts of grids of the sphere and of triangles in space: cells colored by size, on a globe or on a map."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cvtimg._shared.types import Floats, Ints
from cvtimg.plotting.charts import POOR, add_polygons, chart, figure_file, show_box

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure


#: Of coasts and other lines.
_LINE: Any = {"color": "0.05", "linewidth": 0.7, "zorder": 3}


@chart
def draw_globe(
    cells: Sequence[Floats],
    sizes: Floats,
    suffix: str,
    *,
    center: tuple[float, float] = (0.0, 20.0),
    lines: Sequence[Floats] = (),
    label: str = "cell size (degrees)",
    scale: Literal["log", "linear"] = "log",
) -> bytes:
    """Draw the cells of a grid of the sphere as they are seen from far away (orthographic projection).

    Parameters
    ----------
    cells : sequence of (C, 3) arrays
        The corners of each cell, unit vectors, as `cvtimg.sphere.SphereGrid.cells` returns them.
    sizes : (N,) array
        What cells are colored by: their sizes, or values of a field.
    center : (lon, lat)
        Place in the middle of the image, in degrees.
    lines : sequence of (M, 2) arrays
        Lines of longitudes and latitudes in degrees to draw on top, such as `cvtimg.sphere.earth_coasts()`.
    label : str
        What the sizes are.
    scale : {"log", "linear"}
        Of the colors; "log" for sizes > 0.
    """
    ends = np.cumsum([len(cell) for cell in cells])
    turned = np.concatenate(list(cells)) @ _axes_of_view(*center).T
    seen = np.minimum.reduceat(turned[:, 2], np.concatenate([[0], ends[:-1]])) > 0
    with figure_file(8.0, 7.2, suffix) as (figure, content):
        axes = figure.subplots()
        outlines = list(compress(np.split(turned[:, :2], ends[:-1]), seen))
        drawn = _add_polygons(figure, axes, outlines, sizes[seen], sizes, scale)
        for line in lines:
            x, y, toward = _axes_of_view(*center) @ _unit_vectors(line)
            axes.plot(np.where(toward > 0, x, np.nan), y, **_LINE)
        around = np.linspace(0, 2 * np.pi, 361)
        axes.plot(np.cos(around), np.sin(around), **_LINE)
        show_box(axes, np.array([-1, -1]), np.array([1, 1]))
        axes.set_axis_off()
        _add_scale(figure, axes, drawn, label)
    return content.getvalue()


@chart
def draw_map(
    rings: Sequence[Sequence[Any]],
    sizes: Floats,
    suffix: str,
    *,
    lines: Sequence[Floats] = (),
    label: str = "cell size (degrees)",
    scale: Literal["log", "linear"] = "log",
) -> bytes:
    """Draw the cells of a grid of the sphere on a map of longitudes and latitudes (equirectangular projection).

    Parameters
    ----------
    rings : sequence of sequences of (K, 2) arrays
        The polygons of each cell, in degrees, as `cvtimg.sphere.cell_polygons` yields them.
    sizes, lines, label, scale
        As in `draw_globe`.
    """
    pieces = [np.asarray(ring) for cell in rings for ring in cell]
    of_cell = np.repeat(np.arange(len(rings)), [len(cell) for cell in rings])
    with figure_file(10.0, 5.0, suffix) as (figure, content):
        axes = figure.subplots()
        drawn = _add_polygons(figure, axes, pieces, sizes[of_cell], sizes, scale)
        for line in lines:
            for turn in (-360, 0, 360):  # lines may go on beyond the antimeridian
                axes.plot(line[:, 0] + turn, line[:, 1], **_LINE)
        axes.set_xlim(-180, 180)
        axes.set_ylim(-90, 90)
        axes.set_aspect("equal")
        axes.set_xticks(range(-180, 181, 60))
        axes.set_yticks(range(-90, 91, 30))
        axes.tick_params(labelsize=8)
        _add_scale(figure, axes, drawn, label)
    return content.getvalue()


@chart
def draw_surface(
    points: Floats, triangles: Ints, qualities: Floats, suffix: str, *, center: tuple[float, float] = (-60.0, 30.0)
) -> bytes:
    """Draw triangles in space as they are seen from far away, colored by their quality.

    Parameters
    ----------
    points, triangles, qualities
        As in `draw_mesh`; the points are in space, and triangles counterclockwise from outside.
    center : (lon, lat)
        Direction to the viewer, in degrees; z points up.
    """
    with figure_file(9.0, 8.0, suffix) as (figure, content):
        axes: Any = figure.add_subplot(projection="3d", proj_type="ortho")
        look = {"cmap": "RdYlGn", "edgecolor": (0, 0, 0, 0.6), "linewidth": 0.3}
        drawn = axes.plot_trisurf(*points.T, triangles=triangles, **look)
        drawn.set(array=qualities, clim=(POOR, 1.0))
        axes.view_init(center[1], center[0])
        axes.set_aspect("equal")
        axes.set_axis_off()
        figure.colorbar(drawn, ax=axes, label="quality 2 r / R", shrink=0.6)
    return content.getvalue()


def _add_polygons(
    figure: Figure, axes: Axes, outlines: list[Any], values: Floats, every: Floats, scale: str
) -> PolyCollection:
    """Add polygons with colors on a scale of all values."""
    from matplotlib.colors import LogNorm, Normalize

    low, high = float(every.min()), float(every.max())
    norm = Normalize(low, high)
    if scale == "log":
        middle = (low * high) ** 0.5
        # Cells that are all alike get one color, not a scale of their rounding.
        norm = LogNorm(min(low, middle / 1.1), max(high, middle * 1.1))
    shares = np.clip(values / np.median(every), 0.25, 1) if scale == "log" else 1.0
    look = {"array": values, "cmap": "viridis", "norm": norm, "edgecolors": "0.1"}
    return add_polygons(figure, axes, outlines, thickest=0.8, shares=shares, **look)


def _add_scale(figure: Figure, axes: Axes, drawn: PolyCollection, label: str) -> None:
    """Add a color bar with plain numbers, few enough to be read."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import LogLocator, MaxNLocator

    low, high = drawn.get_clim()
    is_wide = isinstance(drawn.norm, LogNorm) and high > 10 * low
    ticks = LogLocator(subs=(1, 2, 5)) if is_wide else MaxNLocator(6)
    figure.colorbar(drawn, ax=axes, label=label, shrink=0.6, format="{x:g}", ticks=ticks).minorticks_off()


def _unit_vectors(places: Floats) -> Floats:
    """Return longitudes and latitudes (M, 2) in degrees as unit vectors (3, M)."""
    x, y = np.radians(places).T
    return np.stack([np.cos(y) * np.cos(x), np.cos(y) * np.sin(x), np.sin(y)])


def _axes_of_view(longitude: float, latitude: float) -> Floats:
    """Rows: the directions to the right, up and to the viewer, who is above a place given in degrees."""
    toward = _unit_vectors(np.array([[longitude, latitude]]))[:, 0]
    right = np.cross([0.0, 0.0, 1.0], toward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward])

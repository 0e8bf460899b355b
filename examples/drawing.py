"""What the examples draw with."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cvtimg.labels import Polygon

INK = "#1b2a41"


def panels(titles: list[str], side: float = 4.0) -> tuple[Figure, list[Axes]]:
    """Make a row of panels without axes, with equal scales."""
    mpl.rcParams["font.size"] = 10
    figure = Figure(figsize=(side * len(titles), 0.8 * side + 0.5), layout="constrained")
    axes = [figure.add_subplot(1, len(titles), number + 1) for number in range(len(titles))]
    for each, title in zip(axes, titles, strict=True):
        each.set_title(title)
        each.set_aspect("equal")
        each.axis("off")
    return figure, axes


def draw_cells(
    axes: Axes, cells: tuple[Polygon, ...], points: NDArray[np.float64], shades: NDArray[np.float64] | None = None
) -> None:
    """Draw cells, shaded by a number for each point if one is given, and the points in them."""
    labels = np.array([cell.label - 1 for cell in cells])
    drawn = PolyCollection([cell.rings[0] for cell in cells], edgecolor=INK, linewidth=0.7, cmap="YlOrBr", alpha=0.9)
    if shades is None:
        drawn.set_facecolor("none")
    else:
        drawn.set_array(shades[labels])
        drawn.set_clim(0, 1.1 * shades.max())
    axes.add_collection(drawn)
    axes.plot(*points.T, "o", color=INK, markersize=2.5)
    axes.autoscale_view()


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)

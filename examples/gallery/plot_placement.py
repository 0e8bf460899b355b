"""
Points in the plane
===================

Generators by density, on the boundary, around a periodic box, and by other metrics.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from cvtimg import place_generators
from cvtimg.engine import WeightedSamples
from cvtimg.placement import Box, Placement, PolygonRegion, SampleMoments

INK, PAPER = "#1b2a41", "#e0c9a6"
SIDE = 400
SQUARE = Box([0, 0], [1, 1])
FRAME = PolygonRegion([[[0, 0], [4, 0], [4, 2], [2.6, 4], [0, 4]], [[1, 1], [2.5, 1], [2.5, 2], [1, 2]]])


def draw_cells(axes: Axes, placement: Placement) -> None:
    """Draw polygons and points."""
    rings = [cell.rings[0] for cell in placement.cells()]
    axes.add_collection(PolyCollection(rings, facecolor="none", edgecolor=INK, linewidth=0.7))
    axes.plot(*placement.points.T, "o", color=INK, markersize=2.2)
    axes.autoscale_view()


def grid() -> WeightedSamples:
    """Return the centers of the pixels that labels are drawn with."""
    at = (np.arange(SIDE) + 0.5) / SIDE
    x, y = np.meshgrid(at, at)
    return WeightedSamples(np.stack([x.ravel(), y.ravel()], axis=1), np.ones(SIDE * SIDE), in_order=False)


def draw_labels(axes: Axes, labels: NDArray[Any]) -> None:
    """Draw the borders of labels."""
    square = labels.reshape(SIDE, SIDE)
    border = np.zeros(square.shape, bool)
    border[:, 1:] |= square[:, 1:] != square[:, :-1]
    border[1:] |= square[1:] != square[:-1]
    axes.imshow(~border, extent=(0, 1, 0, 1), origin="lower", cmap="gray", interpolation="antialiased")
    axes.add_patch(Rectangle((0, 0), 1, 1, fill=False, edgecolor=INK, linewidth=1.4))


# %%
# Each panel is one call of place_generators.

figure = Figure(figsize=(13, 6.9), layout="constrained")
panels = [figure.add_subplot(2, 4, number + 1) for number in range(8)]
for axes in panels:
    axes.set_aspect("equal")
    axes.axis("off")
for axes, title, placement in (
    (panels[0], "a polygon with a hole", place_generators(FRAME, 120)),
    (panels[1], "density x^4 + 0.02", place_generators(SQUARE, 150, density=lambda p: p[:, 0] ** 4 + 0.02)),
    (panels[2], 'on_boundary="auto"', place_generators(FRAME, 120, on_boundary="auto")),
    (panels[3], "a periodic box: opposite sides meet", place_generators(Box([0, 0], [1, 1], periodic=True), 60)),
):
    axes.set_title(title)
    draw_cells(axes, placement)
    if title.startswith("a periodic"):
        axes.add_patch(Rectangle((0, 0), 1, 1, fill=False, edgecolor="#c1121f", linewidth=1.4))
for axes, metric in zip(panels[4:], (1, 1.5, 4, 20), strict=True):
    axes.set_title(f"metric={metric}")
    placement = place_generators(SQUARE, 60, metric=metric)
    draw_labels(axes, SampleMoments(grid(), metric).labels(placement.points))
    axes.plot(*placement.points.T, "o", color=INK, markersize=2.2)

"""
A table in blocks
=================

The lights of Europe by night are a table: the places of pixels, weighted by their brightness. Divided into blocks, it
is clustered without ever being in one place, and the generators have the same bits for any number of workers. Cells are
small where there is much light.
"""

from pathlib import Path

import dask.array as da
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import Voronoi, voronoi_plot_2d

import cvtimg

image = cvtimg.read_image(Path("../../sample_images/europe_night.png"))
light = image.max(axis=2).astype(float)
height, width = light.shape

# %%
# Eight blocks of rows; each pass sends the generators to the blocks, and sums back.

weights = np.where(light > 45, light, 0).ravel()
y, x = np.divmod(np.arange(light.size), width)
rows = np.column_stack([x, y])[weights > 0].astype(float)
weights = weights[weights > 0]
size = -(-len(rows) // 8)
blocks = da.from_array(rows, chunks=(size, 2))
cells = cvtimg.tessellate(blocks, 60, density=da.from_array(weights, chunks=size))


def draw(axes: Axes, values: np.ndarray, title: str) -> None:
    """Draw the rows in the colors of values."""
    axes.scatter(*rows.T, c=values, s=0.8, cmap="tab20", linewidths=0)
    axes.set(xlim=(0, width), ylim=(height, 0), aspect="equal", xticks=[], yticks=[])
    axes.set_facecolor("#10141f")
    axes.set_title(title, fontsize=13)


figure = Figure(figsize=(13, 3.75), layout="constrained")
left, right = figure.subplots(1, 2)
draw(left, np.arange(len(rows)) // size, f"{len(rows):,} rows in 8 blocks")
draw(right, np.asarray(cells.labels) % 20, "60 cells, each with its generator")
voronoi_plot_2d(
    Voronoi(cells.generators), right, show_vertices=False, show_points=False, line_colors="0.6", line_width=0.7
)
right.plot(*cells.generators.T, "o", color="white", markersize=3.5)
right.set(xlim=(0, width), ylim=(height, 0))

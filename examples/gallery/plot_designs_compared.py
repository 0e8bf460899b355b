"""
Designs compared
================

A hundred points of the unit square by six methods, with their Voronoi cells, the star discrepancy D* and the largest
distance h from a place to the nearest point; smaller is better. The ticks below and at the left are the projections:
even ones belong to a Latin design.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from scipy.stats import qmc

import cvtimg
from cvtimg.placement import Box, voronoi_cells

N = 100

# %%
# Four methods of SciPy and NumPy, and two of cvtimg.

designs = {
    "Monte Carlo": np.random.default_rng(0).random((N, 2)),
    "Sobol": qmc.Sobol(2, rng=0).random(128)[:N],
    "Latin hypercube": qmc.LatinHypercube(2, rng=0).random(N),
    "Latin, random-cd": qmc.LatinHypercube(2, rng=0, optimization="random-cd").random(N),
    "CVT, latin=False": cvtimg.design(N, 2, latin=False).unit_points,
    "Latin CVT, the default": cvtimg.design(N, 2).unit_points,
}


def draw(axes: Axes, name: str) -> None:
    """Draw the points, their cells, and their projections on the axes."""
    points = designs[name]
    cells = [np.asarray(cell.exterior.coords) for cell in voronoi_cells(points, Box([0, 0], [1, 1]))]
    axes.add_collection(PolyCollection(cells, facecolor="#e6edf5", edgecolor="#8da3bd", linewidth=0.7))
    axes.plot(*points.T, "o", color="#1b2a41", markersize=3)
    below = [[(x, -0.06), (x, -0.02)] for x in points[:, 0]]
    at_left = [[(-0.06, y), (-0.02, y)] for y in points[:, 1]]
    axes.add_collection(LineCollection(below + at_left, color="#b02a30", linewidth=0.8))
    measures = cvtimg.point_measures(points)
    axes.set_title(f"{name}\nD* {measures.discrepancy:.3f}, h {measures.h:.3f}", fontsize=12, pad=4)
    axes.set(xlim=(-0.08, 1.01), ylim=(-0.08, 1.01), aspect="equal")
    axes.axis("off")


figure = Figure(figsize=(11, 8.1), layout="constrained")
for axes, name in zip(figure.subplots(2, 3).flat, designs, strict=True):
    draw(axes, name)

"""
Supports of meshless methods
============================

Disks around 128 points of a square, which cover it together. Disks of points that are spread evenly
overlap less, and so the matrix of the method has fewer entries.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from scipy.stats import qmc

from cvtimg import place_generators, support_radii
from cvtimg.placement import Box

SQUARE = Box([-1, -1], [1, 1])
N, COVER = 128, 1

# %%
# Random points, points of a Halton sequence, and generators of a tessellation.

random = np.random.default_rng(0).uniform(-1, 1, (N, 2))
halton = 2 * qmc.Halton(2, scramble=False).random(N + 1)[1:] - 1
points = {"random": random, "Halton": halton, "tessellation": place_generators(SQUARE, N).points}


def draw(axes: Axes, name: str) -> None:
    """Draw the supports of points, and say how full the matrix is."""
    supports = support_radii(points[name], SQUARE, COVER)
    widths = 2 * supports.radii
    disks = EllipseCollection(widths, widths, np.zeros(N), units="x", offsets=points[name], transOffset=axes.transData)
    disks.set(facecolor=(0.2, 0.45, 0.75, 0.06), edgecolor=(0.2, 0.35, 0.6, 0.45), linewidth=0.5)
    axes.add_collection(disks)
    axes.plot(*points[name].T, "o", color="#1b2a41", markersize=2.2)
    axes.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal", xticks=[], yticks=[])
    axes.set_title(f"{name}: {supports.overlap.nnz / N**2:.1%} of the matrix", fontsize=13)


figure = Figure(figsize=(13, 4.6), layout="constrained")
for axes, name in zip(figure.subplots(1, 3), points, strict=True):
    draw(axes, name)

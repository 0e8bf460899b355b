"""
Meshes
======

A mesh that is finer at a corner, a mesh of all segments of an image, and one whose triangles are longer along a layer.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

import cvtimg
from cvtimg.meshes import HuangMetric, Mesh, RecoveredHessian

SAMPLES = Path("../../sample_images")
PAPER, INK = "#e8eef5", "#22304a"
L_SHAPE = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]
SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]


def draw_mesh(axes: Axes, mesh: Mesh, title: str, colors: Any = PAPER) -> None:
    """Draw triangles in given colors."""
    axes.add_collection(PolyCollection(list(mesh.points[mesh.triangles]), fc=colors, ec=INK, linewidths=0.4))
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title(title, fontsize=13)


# %%
# Sizes are a function of places; labels are meshed at once; a metric comes from the function to resolve.

figure = Figure(figsize=(13, 4.6))
panels = figure.subplots(1, 3)
figure.subplots_adjust(left=0.01, right=0.99, top=0.93, bottom=0.01, wspace=0.03)
graded = cvtimg.mesh_region(L_SHAPE, n=900, size=lambda p: 0.02 + 0.2 * np.hypot(*(p - 1).T))
draw_mesh(panels[0], graded, "finer at a corner")

cat = cvtimg.read_image(SAMPLES / "chelsea.png")
segmented = cvtimg.segment(cat, 3, edge_weight=500, min_size=60)
mesh = cvtimg.mesh_labels(segmented.labels, n=3000)
draw_mesh(panels[1], mesh, "all segments of an image", segmented.generators[mesh.tags - 1] / 255)
panels[1].set(xlim=(40, 340), ylim=(300, 0))


def wave(p: Any) -> Any:
    return np.tanh(30 * (np.hypot(*p.T) - 0.7))


layered = cvtimg.mesh_region(SQUARE, n=700)
for _ in range(3):
    hessian = RecoveredHessian(layered.points, layered.triangles, wave(layered.points))
    layered = cvtimg.mesh_region(SQUARE, n=700, metric=HuangMetric(hessian, SQUARE))
draw_mesh(panels[2], layered, "longer along a layer")

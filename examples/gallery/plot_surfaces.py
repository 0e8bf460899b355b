"""
Points on surfaces
==================

Points on a torus by a density, and on a body, evenly and four times as fine on its head.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from cvtimg import surface_points
from cvtimg.surfaces import ImplicitSurface, SurfacePoints, torus

sys.path.insert(0, str(Path("..").resolve()))  # the other examples

from surfaces import Points, body, seen_from

TAN = np.array([0.98, 0.86, 0.62])


def draw_triangles(axes: Axes, found: SurfacePoints, view: Points, title: str) -> None:
    """Draw the triangles of a surface, those in front over those behind."""
    places = (found.points @ view.T)[found.triangles]
    normals = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    light = 0.55 + 0.45 * np.abs(normals @ [-0.35, 0.45, 0.82])
    order = np.argsort(places[:, :, 2].mean(axis=1))
    axes.add_collection(
        PolyCollection(
            list(places[order, :, :2]), facecolors=light[order, None] * TAN, edgecolors="#22304a", linewidths=0.4
        )
    )
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title(title, fontsize=13)


# %%
# The body is where a function is 0.

figure = Figure(figsize=(13, 4.6))
panels = figure.subplots(1, 3)
figure.subplots_adjust(left=0.01, right=0.99, top=0.92, bottom=0.01, wspace=0.03)
animal = ImplicitSurface(body, [-1.4, -1, -1.1], [1.4, 1, 1.5])
ring = surface_points(torus(), 1500, density=lambda p: np.exp(-5 * np.abs(p[:, 1])))
draw_triangles(panels[0], ring, seen_from(-65, 50), "1,500 points by a density")
draw_triangles(panels[1], surface_points(animal, 2500), seen_from(-55, 20), "2,500 points, evenly")
finer = surface_points(animal, 2500, density=lambda p: 1 + 250 * (p[:, 2] > 0.45))
draw_triangles(panels[2], finer, seen_from(-55, 20), "four times as fine on the head")

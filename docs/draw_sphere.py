"""Draw docs/sphere.webp: four grids of the globe, their cells in the colors of land and sea.

python docs/draw_sphere.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import figures
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

import cvtimg
from cvtimg.sphere import Cap, Refinement, SphereGrid, coastal_grid, nested_grid

DOCS = Path(__file__).parent
SAMPLES = DOCS.parent / "sample_images"
LAND = cvtimg.read_image(SAMPLES / "land.png") > 127
SEA_BLUE, LAND_GREEN, COAST_RED, NEW_BLUE, NEW_GREEN = "#c3dcec", "#d9e3b8", "#d1495b", "#7fb2d6", "#a9bf6a"


def is_land(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Look unit vectors up in the map."""
    height, width = LAND.shape[:2]
    column = np.degrees(np.arctan2(points[:, 1], points[:, 0])) / 360 + 0.5
    row = 0.5 - np.degrees(np.arcsin(np.clip(points[:, 2], -1, 1))) / 180
    at = np.minimum((row * height).astype(int), height - 1), np.minimum((column * width).astype(int), width - 1)
    return np.asarray(LAND[at]).reshape(len(points))


def draw_cells(axes: Axes, grid: SphereGrid, colors: list[Any], center: tuple[float, float]) -> None:
    """Draw the cells of the half of the globe around a place, as seen from far away."""
    lon, lat = np.radians(center)
    east = np.array([-np.sin(lon), np.cos(lon), 0])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    seen = grid.points @ up > 0
    turn = np.stack([east, np.cross(up, east)])
    cells = [cell @ turn.T for cell, shown in zip(grid.cells(), seen, strict=True) if shown]
    shades = [color for color, shown in zip(colors, seen, strict=True) if shown]
    axes.add_collection(PolyCollection(cells, facecolors=shades, edgecolors="#33415c", linewidths=0.3))
    axes.set(xlim=(-1.01, 1.01), ylim=(-1.01, 1.01), aspect="equal")
    axes.axis("off")


def by_land(grid: SphereGrid) -> NDArray[Any]:
    """Choose the color of each cell."""
    return np.where(is_land(grid.points), LAND_GREEN, SEA_BLUE)


def main() -> None:
    """Draw all panels."""
    mpl.rcParams["font.size"] = 11
    america, europe = (-96.0, 38.0), (15.0, 30.0)
    finer = Refinement(*america, radius=26.8, ratio=3)
    regional = cvtimg.sphere_grid(8000, density=finer)
    parent = cvtimg.sphere_grid(2562)
    nested = nested_grid(parent, 1800, within=Cap(*america, 40.0), density=Refinement(*america, radius=22, ratio=3))
    new = np.where(is_land(nested.points), NEW_GREEN, NEW_BLUE)
    coast = coastal_grid(6000, LAND)
    classes = np.where(coast.on_coast, COAST_RED, np.where(coast.on_land, LAND_GREEN, SEA_BLUE))
    figure = Figure(figsize=(13, 4.9), layout="constrained")
    panels = figure.subplots(1, 3)
    for axes, grid, colors, center, title in (
        (panels[0], regional, by_land(regional), america, "three times as fine in the United States"),
        (panels[1], nested, np.where(nested.fixed, by_land(nested), new), america, "a part of an even grid replaced"),
        (panels[2], coast, classes, europe, "points along the coasts"),
    ):
        draw_cells(axes, grid, list(colors), center)
        axes.set_title(title)
    panels[1].legend(
        handles=[Patch(color=NEW_GREEN), Patch(color=LAND_GREEN)], labels=["new", "kept"], loc="lower right"
    )
    named = [Patch(color=color) for color in (LAND_GREEN, SEA_BLUE, COAST_RED)]
    panels[2].legend(handles=named, labels=["land", "sea", "coast"], loc="lower right")
    figures.write("sphere", figure)


if __name__ == "__main__":
    main()

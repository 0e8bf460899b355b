"""Draw docs/hero.webp: what cvtimg does, in five panels.

python docs/draw_hero.py
"""

from __future__ import annotations

from typing import Any

import figures
import numpy as np
from draw_sphere import SAMPLES, by_land, draw_cells
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from skimage import data

import cvtimg
from cvtimg.labels import region_means
from cvtimg.pictures import encode_image
from cvtimg.plotting import draw_edges

SIDE = 400
DPI = 100


def show(axes: Axes, image: Any, caption: str) -> None:
    """Show a square image with a caption."""
    axes.imshow(image, interpolation="antialiased", cmap="gray", vmin=0, vmax=255)
    axes.axis("off")
    axes.set_title(caption, y=-0.13)


def reduced(axes: Axes) -> None:
    """Show a photograph, and on the right of a line the smallest file that is hard to tell from it."""
    image = cvtimg.read_image(SAMPLES / "coffee.png")
    result = cvtimg.quantize(image, quality=80)
    before = (SAMPLES / "coffee.png").stat().st_size
    after = len(encode_image(".png", result.indices, palette=result.palette))
    both = image[:, 100:500].copy()
    both[:, SIDE // 2 :] = result.image[:, 100 + SIDE // 2 : 500]
    show(axes, both, f"{before / 1000:.0f} kB | {after / 1000:.0f} kB, looks the same")
    axes.axvline(SIDE / 2, color="white", linewidth=1.5)


def segments(axes: Axes) -> None:
    """Show regions of a photograph in their mean colors."""
    image = cvtimg.read_image(SAMPLES / "chelsea.png")
    labels = cvtimg.segment_hierarchy(image).cut(60)
    means = region_means(labels, image)[labels].round().astype(np.uint8)
    drawn = draw_edges(means, labels, color=(255, 255, 255))
    show(axes, drawn[:, 40:340], "60 regions, no training")


def dots(axes: Axes) -> None:
    """Show a portrait in dots."""
    face = data.astronaut()[:250, 95:345]  # type: ignore[no-untyped-call]
    portrait = (1.3 * face).clip(0, 255).astype(np.uint8)
    drawn = cvtimg.stipple(portrait, 7000, dots="equal-mass", max_ink=0.8).draw(scale=4)
    show(axes, drawn, "7,000 dots for a plotter")


def mesh(axes: Axes) -> None:
    """Show a mesh of the segments of a drawing."""
    image = cvtimg.read_image(SAMPLES / "drawing.png")
    segmented = cvtimg.segment(image, 6)
    made = cvtimg.mesh_labels(segmented.labels, n=900)
    colors = segmented.generators[made.tags - 1] / 255
    triangles = list(made.points[made.triangles])
    axes.add_collection(PolyCollection(triangles, facecolors=colors, edgecolors="#22304a", linewidths=0.5))
    axes.set(xlim=(30, 222), ylim=(192, 0), aspect="equal")
    axes.axis("off")
    axes.set_title("a mesh of every segment", y=-0.13)


def globe(axes: Axes) -> None:
    """Show a grid of the globe that is finer in one part."""
    place = (10.0, 48.0)
    grid = cvtimg.sphere_grid(4500, density=cvtimg.sphere.Refinement(*place, radius=22, ratio=3))
    draw_cells(axes, grid, list(by_land(grid)), (15.0, 38.0))
    axes.set_title("a grid, finer over Europe", y=-0.13)


def main() -> None:
    """Draw all panels."""
    figure = Figure(figsize=(15, 3.35), dpi=DPI)
    panels = figure.subplots(1, 5)
    figure.subplots_adjust(left=0.005, right=0.995, top=0.985, bottom=0.115, wspace=0.04)
    for draw, axes in zip((reduced, segments, dots, mesh, globe), panels, strict=True):
        draw(axes)
    figures.write("hero", figure)


if __name__ == "__main__":
    main()

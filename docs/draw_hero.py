"""Draw docs/hero.webp: what cvtimg does, in six panels.

python docs/draw_hero.py
"""

from __future__ import annotations

from typing import Any

import figures
import numpy as np
from draw_sphere import SAMPLES, by_land, draw_cells
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from skimage import data

import cvtimg
from cvtimg.labels import region_means
from cvtimg.pictures import encode_image
from cvtimg.plotting import draw_edges

DPI = 100
rcParams["axes.titlesize"] = 18


def show(axes: Axes, image: Any, caption: str, *, divided: bool = False) -> None:
    """Show a square image with a caption, and a line down its middle if it is divided."""
    axes.imshow(image, interpolation="antialiased", cmap="gray", vmin=0, vmax=255)
    axes.axis("off")
    axes.set_title(caption, y=-0.1)
    if divided:
        axes.axvline(image.shape[1] / 2 - 0.5, color="white", linewidth=2)


def halves(left: Any, right: Any) -> Any:
    """Return the left half of one image beside the right half of another."""
    middle = left.shape[1] // 2
    return np.hstack([left[:, :middle], right[:, middle:]])


def reduced(axes: Axes) -> None:
    """Show a photograph, and on the right of a line the smallest file that is hard to tell from it."""
    image = cvtimg.read_image(SAMPLES / "coffee.png")
    result = cvtimg.quantize(image, quality=80)
    before = (SAMPLES / "coffee.png").stat().st_size
    after = len(encode_image(".png", result.indices, palette=result.palette))
    both = halves(image[:, 100:500], result.image[:, 100:500])
    show(axes, both, f"{before / 1000:.0f} kB | {after / 1000:.0f} kB, looks the same", divided=True)


def segments(axes: Axes) -> None:
    """Show a photograph, and on the right of a line its regions in their mean colors."""
    image = cvtimg.read_image(SAMPLES / "chelsea.png")
    labels = cvtimg.segment_hierarchy(image).cut(80)
    means = region_means(labels, image)[labels].round().astype(np.uint8)
    drawn = draw_edges(means, labels, color=(255, 255, 255))
    show(axes, halves(image[:, 76:376], drawn[:, 76:376]), "a photograph | its regions", divided=True)


def restored(axes: Axes) -> None:
    """Show one of three damaged versions of a drawing, and on the right of a line what they give together."""
    versions = [cvtimg.read_image(SAMPLES / f"drawing_{number}.png") for number in (1, 2, 3)]
    result = cvtimg.restore(versions, 6)
    damaged = np.where(versions[1][:, :, 3:] > 0, versions[1][:, :, :3], 235).astype(np.uint8)
    show(axes, halves(damaged[:, :192], result.image[:, :192]), "one of three shots | restored", divided=True)


def dots(axes: Axes) -> None:
    """Show a portrait in dots."""
    face = data.astronaut()[:250, 95:345]  # type: ignore[no-untyped-call]
    portrait = (1.3 * face).clip(0, 255).astype(np.uint8)
    drawn = cvtimg.stipple(portrait, 7000, max_ink=0.8).draw(scale=4)
    show(axes, drawn, "7,000 dots for a plotter")


def mesh(axes: Axes) -> None:
    """Show a mesh of the segments of a drawing."""
    image = cvtimg.read_image(SAMPLES / "drawing.png")
    segmented = cvtimg.segment(image, 6, edge_weight=0)
    made = cvtimg.mesh_labels(segmented.labels, n=900)
    colors = segmented.generators[made.tags - 1] / 255
    triangles = list(made.points[made.triangles])
    axes.add_collection(PolyCollection(triangles, facecolors=colors, edgecolors="#22304a", linewidths=0.5))
    axes.set(xlim=(30, 222), ylim=(192, 0), aspect="equal")
    axes.axis("off")
    axes.set_title("a mesh of every segment", y=-0.1)


def globe(axes: Axes) -> None:
    """Show a grid of the globe that is finer in one part."""
    place = (10.0, 48.0)
    grid = cvtimg.sphere_grid(4500, density=cvtimg.sphere.Refinement(*place, radius=22, ratio=3))
    draw_cells(axes, grid, list(by_land(grid)), (15.0, 38.0))
    axes.set_title("a grid, finer over Europe", y=-0.1)


def main() -> None:
    """Draw all panels."""
    figure = Figure(figsize=(13.5, 9.5), dpi=DPI)
    panels = figure.subplots(2, 3)
    figure.subplots_adjust(left=0.005, right=0.995, top=0.995, bottom=0.05, wspace=0.04, hspace=0.12)
    for draw, axes in zip((reduced, segments, restored, dots, mesh, globe), panels.flat, strict=True):
        draw(axes)
    figures.write("hero", figure)


if __name__ == "__main__":
    main()

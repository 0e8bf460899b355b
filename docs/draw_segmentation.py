"""Draw segments and edges of the sample pictures: ``python docs/draw_segmentation.py``."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import cvtimg
from cvtimg.plotting.sheets import Panel, contact_sheet, draw_edges

ROOT = Path(__file__).parent.parent


def main() -> None:
    """Write docs/segmentation.png."""
    night = cvtimg.read_image(ROOT / "sample_images" / "europe_night.png")
    bone = cvtimg.read_image(ROOT / "sample_images" / "bone_texture.png")
    coffee = cvtimg.read_image(ROOT / "sample_images" / "coffee.png")
    rows = [
        [Panel(bright(night), ("Europe by night (NASA)", "brightened to be seen"))]
        + [in_colors(night, n_segments) for n_segments in (2, 3, 4)],
        [
            Panel(bone, ("a drawn texture like bone",)),
            in_edges(bone, 2),
            in_edges(bone, 2, averaging="before"),
            in_edges(bone, 3, averaging="before"),
        ],
        [Panel(coffee, ("a cup of coffee",)), *posters(coffee)],
    ]
    sheet = cvtimg.quantize(contact_sheet(rows, panel_width=300), 256)
    cvtimg.write_image(ROOT / "docs" / "segmentation.png", sheet.indices, palette=sheet.palette, overwrite=True)


def bright(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Brighten a dark picture."""
    return np.rint(255 * np.sqrt(image / 134)).astype(np.uint8)  # the brightest lamp has 134


def in_colors(image: NDArray[np.uint8], n_segments: int) -> Panel:
    """Give segments their mean colors, brightened."""
    result = cvtimg.segment(image, n_segments)
    shares = result.masses / result.masses.sum()
    caption = f"{n_segments} segments", "shares: " + " ".join(f"{share:.0%}" for share in shares)
    return Panel(bright(result.generators[result.labels - 1]), caption)


def in_edges(image: NDArray[np.uint8], n_segments: int, **how: Any) -> Panel:
    """Draw the edges of segments over their picture."""
    labels = cvtimg.segment(image, n_segments, **how).labels
    caption = f"{n_segments} segments" + "".join(f", {name} {value}" for name, value in how.items())
    return Panel(draw_edges(image, labels), (caption, f"edge points: {cvtimg.find_edges(labels).mean():.1%}"))


def posters(image: NDArray[np.uint8]) -> list[Panel]:
    """Draw segments in their mean colors, their edges by themselves, and superpixels."""
    result = cvtimg.segment(image, 6, space="oklab", edge_weight="auto", min_size=40)
    means = np.rint(cvtimg.labels.region_means(result.labels, image)[1:]).astype(np.uint8)
    cells = cvtimg.superpixels(image, 400).labels
    return [
        Panel(means[result.labels - 1], ("6 segments in Oklab,", "pieces under 40 pixels absorbed")),
        Panel(~cvtimg.find_edges(result.labels), ("their edges",)),
        Panel(draw_edges(image, cells), (f"{cells.max()} superpixels",)),
    ]


if __name__ == "__main__":
    main()

"""
Segments and edges
==================

Europe by night in 2, 3 and 4 segments; a bone texture in segments of pixels and of averaged pixels; and a photograph in
segments, their edges, and superpixels.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import cvtimg
from cvtimg.labels import region_means
from cvtimg.plotting import draw_edges, draw_sheet

SAMPLES = Path("../../sample_images")

# %%
# Each segment in its mean color. The image is dark, so it is brightened for display only.


def bright(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Brighten the image, whose brightest lamp has 134 of 255 levels."""
    return np.rint(255 * np.sqrt(image / 134)).astype(np.uint8)


def in_colors(image: NDArray[np.uint8], n_segments: int) -> tuple[NDArray[Any], str]:
    """Show segments in their mean colors."""
    result = cvtimg.segment(image, n_segments, edge_weight=0)
    shares = result.masses / result.masses.sum()
    caption = f"{n_segments} segments", "shares: " + " ".join(f"{share:.0%}" for share in shares)
    return bright(result.generators[result.labels - 1]), "\n".join(caption)


night = cvtimg.read_image(SAMPLES / "europe_night.png")
first_row = [(bright(night), "Europe by night (NASA)\nbrightened")]
first_row += [in_colors(night, n_segments) for n_segments in (2, 3, 4)]

# %%
# Edges of segments, without and with averaging. Averaging removes the specks that noise makes.


def in_edges(image: NDArray[np.uint8], n_segments: int, **options: Any) -> tuple[NDArray[Any], str]:
    """Show the edges of segments over the image."""
    labels = cvtimg.segment(image, n_segments, edge_weight=0, **options).labels
    caption = f"{n_segments} segments" + "".join(f", {name}={value}" for name, value in options.items())
    return draw_edges(image, labels), "\n".join((caption, f"edge points: {cvtimg.find_edges(labels).mean():.1%}"))


bone = cvtimg.read_image(SAMPLES / "bone_texture.png")
second_row = [
    (bone, "a drawn texture like bone"),
    in_edges(bone, 2),
    in_edges(bone, 2, averaging=2),
    in_edges(bone, 3, averaging=2),
]

# %%
# Short edges, by default; and superpixels.

coffee = cvtimg.read_image(SAMPLES / "coffee.png")
result = cvtimg.segment(coffee, 6, space="oklab")
means = np.rint(region_means(result.labels, coffee)[1:]).astype(np.uint8)
cells = cvtimg.superpixels(coffee, 200, space="lab").labels
third_row = [
    (coffee, "a cup of coffee"),
    (means[result.labels - 1], "6 segments in Oklab"),
    (~cvtimg.find_edges(result.labels), "their edges"),
    (draw_edges(coffee, cells, color=(255, 255, 255)), f"{cells.max()} superpixels"),
]

# %%

figure = draw_sheet([first_row, second_row, third_row], ".png")

"""
Trees of regions
================

Photographs cut into 5, 20 and 50 regions and by default, and the strength of each border.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import cvtimg
from cvtimg.plotting import draw_edges, draw_sheet

SAMPLES = Path("../../sample_images")


def panels(image: NDArray[Any]) -> list[tuple[NDArray[Any], str]]:
    """Show cuts of an image, and its edges."""
    tree = cvtimg.segment_hierarchy(image)
    shown = [(draw_edges(image, tree.cut(n), thickness=2), f"{n} regions") for n in (5, 20, 50)]
    shown.append((draw_edges(image, tree.cut(), thickness=2), f"default cut: {tree.n_regions()} regions"))
    chances = np.rint(255 * (1 - tree.find_edges(strength=True))).astype(np.uint8)
    return [*shown, (chances, "how likely a person draws each edge")]


# %%
# Each image has one tree, of which every number of regions is a cut.

names = ("coffee.png", "chelsea.png", "rocket.jpg")
rows = [panels(cvtimg.read_image(SAMPLES / name)) for name in names]
figure = draw_sheet(rows, ".png")

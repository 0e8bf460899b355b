"""
Segments of pixels, and without small details
=============================================

A photograph in six segments: each pixel on its own, and by default, without details smaller than a pixel in radius.
"""

from pathlib import Path

import cvtimg
from cvtimg.plotting import draw_edges, draw_sheet

coffee = cvtimg.read_image(Path("../../sample_images") / "coffee.png")

# %%
# Both have the same six colors to start with. Only the second one looks at what is beside each pixel.

plain = cvtimg.segment(coffee, 6, edge_weight=0).labels
smooth = cvtimg.segment(coffee, 6).labels

# %%
# The edges of both, and how many of the pixels they take.

figure = draw_sheet(
    [
        [
            (draw_edges(coffee, labels), "\n".join((caption, f"edge points: {cvtimg.find_edges(labels).mean():.1%}")))
            for labels, caption in ((plain, "edge_weight=0"), (smooth, "the default"))
        ]
    ],
    ".png",
)

"""
Stippling and mosaics
=====================

A portrait in 4000 dots of one size, in 1500 dots as large as the ink of their cells, and as a mosaic of 800 cells. Dots
are the generators of a centroidal Voronoi tessellation of the plane, whose density is the darkness of the image.
"""

from pathlib import Path

import cvtimg
from cvtimg.plotting import Panel, contact_sheet

SAMPLES = Path("../../sample_images")

image = cvtimg.read_image(SAMPLES / "astronaut.png")

# %%
# Dots of one size suit a pen; sized dots suit print.

equal = cvtimg.stipple(image, 4000)
sized = cvtimg.stipple(image, 1500, dots="sized")

# %%
# The cells of a mosaic have one color each, and are moved until the error of the whole image is least.

mosaic = cvtimg.mosaic(image, 800)

# %%

sheet = contact_sheet(
    [
        [
            Panel(image, ("the image",)),
            Panel(equal.draw(scale=2), ("4000 dots of one size",)),
            Panel(sized.draw(scale=2), ("1500 sized dots",)),
            Panel(mosaic.draw(scale=2), ("800 cells",)),
        ]
    ],
    panel_width=256,
)

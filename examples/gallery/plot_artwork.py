"""
Stippling and mosaics
=====================

A portrait in dots of equal ink, the same in sized dots, a photograph in cyan, magenta, yellow and black dots, and
mosaics of cells and of triangles.
"""

from pathlib import Path

import cvtimg
from cvtimg.plotting.sheets import Panel, contact_sheet

SAMPLES = Path("../../sample_images")
portrait = cvtimg.read_image(SAMPLES / "astronaut.png")
cup = cvtimg.read_image(SAMPLES / "coffee.png")

# %%
# Dots reproduce the tones of the image in linear light.

equal = cvtimg.stipple(portrait, 8000, dots="equal-mass")
sized = cvtimg.stipple(portrait, 4000, dots="sized", radius_range=(0.4, 2))
color = cvtimg.stipple(cup, 20000, layers="cmyk", dots="sized")

# %%
# The tiles of a mosaic move until it is as like the image as possible.

cells = cvtimg.mosaic(cup, 800)
triangles = cvtimg.mosaic(cup, 800, shape="triangles")

sheet = contact_sheet(
    [
        [
            Panel(equal.draw(scale=4), ("8,000 dots of equal ink",)),
            Panel(sized.draw(scale=4), ("4,000 dots, radius 0.4 to 2",)),
            Panel(color.draw(scale=2), ("20,000 dots in four inks",)),
        ],
        [
            Panel(cells.draw(), ("800 cells",)),
            Panel(cells.draw(outline=1.2), ("with outlines",)),
            Panel(triangles.draw(), ("800 triangles",)),
        ],
    ]
)

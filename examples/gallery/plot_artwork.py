"""
Stippling and mosaics
=====================

A portrait in dots of equal ink, the same in sized dots, a photograph in cyan, magenta, yellow and black dots, and
mosaics of cells and of triangles.
"""

from pathlib import Path

import numpy as np
from skimage import data

import cvtimg
from cvtimg.plotting import draw_sheet

SAMPLES = Path("../../sample_images")
WIDTH = 480

# %%
# Light images make the best drawings: here the tones of a portrait (NASA) are stretched, for a background of paper.

face = data.astronaut()[0:250, 95:345].astype(np.float64)  # type: ignore[no-untyped-call]
portrait = (1.3 * face).clip(0, 255).astype(np.uint8)
cup = cvtimg.read_image(SAMPLES / "coffee.png")

# %%
# Dots reproduce the tones of the image in linear light.

equal = cvtimg.stipple(portrait, 9000, max_ink=0.8)
sized = cvtimg.stipple(portrait, 5000, dots="sized", radius_range=(0.4, 2), max_ink=0.8)
inks = cvtimg.stipple(portrait, 16000, layers="cmyk", dots="sized", max_ink=0.8)

# %%
# The tiles of a mosaic move until it is as like the image as possible.

outlined = cvtimg.mosaic(portrait, 1000)
cells = cvtimg.mosaic(cup, 1500)
triangles = cvtimg.mosaic(cup, 1500, shape="triangles")

figure = draw_sheet(
    [
        [
            (equal.draw(scale=WIDTH / 250), "9,000 dots of equal ink"),
            (sized.draw(scale=WIDTH / 250), "5,000 dots, sized by tone"),
        ],
        [
            (inks.draw(scale=WIDTH / 250), "16,000 dots in cyan, magenta, yellow and black"),
            (outlined.draw(scale=2, outline=0.3), "1,000 cells with outlines"),
        ],
        [(cells.draw(), "1,500 cells"), (triangles.draw(), "1,500 triangles")],
    ],
    ".png",
)

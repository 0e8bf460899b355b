"""
Stippling for a plotter
=======================

A portrait in the dots of a 0.7 mm pen on paper 120 mm wide, the path of the pen through them, and the same portrait in
four pens.
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import cvtimg
from cvtimg.artwork import ink_coverage
from cvtimg.plotting import Panel, contact_sheet

SAMPLES = Path("../../sample_images")
portrait = cvtimg.read_image(SAMPLES / "astronaut.png")

# %%
# As many dots as the pen needs for the ink of the image.

PEN, WIDTH, MAX_INK = 0.7, 120, 0.7  # mm, mm, and the share of the paper that black covers
ink = ink_coverage(portrait)
pixel = WIDTH / ink.shape[1]
n_dots = round(MAX_INK * ink.sum() * pixel**2 / (np.pi * (PEN / 2) ** 2))
dots = cvtimg.stipple(portrait, n_dots, dots="equal-mass", max_ink=MAX_INK)
pens = cvtimg.stipple(portrait, 12_000, layers="cmyk", max_ink=0.7)

# %%
# The pen visits dots on a short tour.

PANEL, SCALE = 380, 6
way = Image.new("L", tuple(SCALE * side for side in dots.size[::-1]), 255)
ImageDraw.Draw(way).line([tuple(point) for point in SCALE * dots.points[dots.order]], fill=0, width=2)
detail = np.s_[SCALE * 16 : SCALE * 80, SCALE * 84 : SCALE * 148]

sheet = contact_sheet(
    [
        [
            Panel(dots.draw(scale=PANEL / 256), (f"{n_dots:,} dots of 0.7 mm on 120 mm",)),
            Panel(dots.draw(scale=SCALE)[detail], ("a detail, 30 mm wide",)),
        ],
        [
            Panel(pens.draw(scale=PANEL / 256), ("12,000 dots of four pens",)),
            Panel(np.asarray(way)[detail], ("the way of the pen in the detail",)),
        ],
    ],
    panel_width=PANEL,
)

"""
Stippling for a plotter
=======================

A portrait in the dots of a 0.7 mm pen on paper 120 mm wide, the path of the pen through them, and the same portrait in
four pens.
"""

import numpy as np
from PIL import Image, ImageDraw
from skimage import data

import cvtimg
from cvtimg.plotting import draw_sheet

# %%
# A part of a portrait (NASA), with stretched tones, so that the background is paper.

face = data.astronaut()[:250, 95:345]  # type: ignore[no-untyped-call]
portrait = (1.3 * face).clip(0, 255).astype(np.uint8)

# %%
# As many dots as the pen needs for the ink of the image.

PEN, WIDTH, MAX_INK = 0.7, 120, 0.7  # mm, mm, and the share of the paper that black covers
diameter = PEN / WIDTH * portrait.shape[1]
dots = cvtimg.stipple(portrait, dot_diameter=diameter, max_ink=MAX_INK)
pens = cvtimg.stipple(portrait, 12_000, layers="cmyk", max_ink=MAX_INK)

# %%
# The pen visits dots on a short tour.

PANEL, SCALE = 480, 8
way = Image.new("L", tuple(SCALE * side for side in dots.size[::-1]), 255)
ImageDraw.Draw(way).line([tuple(point) for point in SCALE * dots.points[dots.order]], fill=0, width=3)
detail = np.s_[SCALE * 80 : SCALE * 140, SCALE * 82 : SCALE * 142]

figure = draw_sheet(
    [
        [
            (dots.draw(scale=PANEL / 250), f"{len(dots):,} dots of 0.7 mm on 120 mm"),
            (dots.draw(scale=SCALE)[detail], "a detail, 29 mm wide"),
        ],
        [
            (pens.draw(scale=PANEL / 250), "12,000 dots of four pens"),
            (np.asarray(way)[detail], "the path of the pen in the detail"),
        ],
    ],
    ".png",
)

"""
Main colors
===========

Six colors of least error, and the six that stand out, for photographs in which small vivid parts matter.
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageOps
from skimage import data

import cvtimg
from cvtimg.plotting import draw_sheet
from cvtimg.quantization import main_palette

SAMPLES = Path("../../sample_images")
SIZE = 240, 180

# %%
# Colors are found in the whole images; the panels are small.

names = ("astronaut.png", "coffee.png", "rocket.jpg", "chelsea.png")
images = [cvtimg.read_image(SAMPLES / name) for name in names]
images += [data.hubble_deep_field(), data.retina()]


def panel(image: np.ndarray, palette: np.ndarray, caption: str) -> tuple[np.ndarray, str]:
    """Show an image above some of its colors."""
    small = np.asarray(ImageOps.fit(Image.fromarray(image), SIZE))
    fields = palette[np.arange(SIZE[0]) * len(palette) // SIZE[0]]
    return np.concatenate([small, np.broadcast_to(fields, (30, *fields.shape))]), caption


# %%
# `main_palette` lets small vivid parts count, and shows colors of the image itself, not means.

least = [panel(image, cvtimg.find_palette(image, 6).colors, "least error") for image in images]
main = [panel(image, main_palette(image).colors, "main colors") for image in images]
figure = draw_sheet([least, main], ".png")

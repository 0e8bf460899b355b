"""
Color quantization
==================

Two photographs in few colors, plain and dithered, each above its palette. The panels show parts of the images, pixel by
pixel; sizes of files are those of the whole images.
"""

from pathlib import Path
from typing import Any

import numpy as np

import cvtimg
from cvtimg.pictures import encode_image
from cvtimg.plotting import draw_sheet

SAMPLES = Path("../../sample_images")
WIDTH, HEIGHT = 270, 230

# %%
# `quantize` returns the palette, the index of each pixel in it, and the image that they make.


def panels(name: str, top: int, left: int, *choices: dict[str, Any]) -> list[tuple[np.ndarray, str]]:
    """Show a part of an image beside its quantized versions."""
    image = cvtimg.read_image(SAMPLES / name)
    n_distinct = cvtimg.colors.color_samples(image).n_colors
    part = slice(top, top + HEIGHT), slice(left, left + WIDTH)
    shown = [(image[part], f"original\n{n_distinct:,} colors, {len(encode_image('.png', image)) // 1000} kB as PNG")]
    for how in choices:
        result = cvtimg.quantize(image, **how)
        file = encode_image(".png", result.indices, palette=result.palette)
        dithered = ", dithered" if "dither" in how else ""
        caption = f"{how['n_colors']} colors{dithered}", f"{result.psnr:.1f} dB, {len(file) // 1000} kB"
        shown.append((result.image[part], "\n".join(caption)))
    return shown


# %%
# A sheet of images.

plain = [{"n_colors": n_colors} for n_colors in (256, 64, 16)]
sky = [*plain[:1], {"n_colors": 16}, {"n_colors": 16, "dither": "floyd-steinberg"}]
figure = draw_sheet([panels("coffee.png", 70, 190, *plain), panels("rocket.jpg", 40, 150, *sky)], ".png")

"""
Pixel art with a fixed palette
==============================

A photograph reduced to 90 x 60 pixels, in 16 colors of its own, and in the colors of two game consoles.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import cvtimg
from cvtimg.plotting import draw_sheet

SAMPLES = Path("../../sample_images")

# %%
# The palette of PICO-8, in the text format of Lospec: one color per line.

PICO_8 = """000000 1d2b53 7e2553 008751 ab5236 5f574f c2c3c7 fff1e8
ff004d ffa300 ffec27 00e436 29adff 83769c ff77a8 ffccaa"""
colors = np.array([list(bytes.fromhex(color)) for color in PICO_8.split()], np.uint8)
greens = cvtimg.read_palette("game-boy")

# %%
# Reduce first and quantize afterwards: scaling a quantized image would mix its colors again. Oklab measures
# distances as people see them. Dithering mixes colors that a fixed palette lacks. Four greens show more of the image
# as tones, from dark to light, than as its nearest colors.

photograph = cvtimg.read_image(SAMPLES / "chelsea.png")
small = np.asarray(Image.fromarray(photograph).resize((90, 60), Image.Resampling.BOX))


def panel(caption: str, n_colors: int | None = None, **options: Any) -> tuple[NDArray[Any], str]:
    """Quantize the small image and enlarge it without smoothing."""
    result = cvtimg.quantize(small, n_colors, **options)
    return enlarged(result.image), caption


def enlarged(image: NDArray[Any]) -> NDArray[Any]:
    """Show each pixel as 4 x 4."""
    return image.repeat(4, axis=0).repeat(4, axis=1)


rows = [
    [
        (enlarged(small), "90 x 60 pixels"),
        panel("16 colors of its own", 16),
        panel("16 colors of its own, in Oklab", 16, space="oklab"),
    ],
    [
        panel("PICO-8, nearest in Oklab", palette=colors, space="oklab"),
        panel("Oklab, Floyd-Steinberg", palette=colors, space="oklab", dither="floyd-steinberg"),
        panel("Oklab, blue noise 0.6", palette=colors, space="oklab", dither="blue-noise", dither_strength=0.6),
    ],
    [
        panel("Game Boy, nearest in Oklab", palette=greens, space="oklab"),
        panel("Game Boy, as a ramp of tones", palette=greens, ramp=True),
        panel("Ramp, Bayer", palette=greens, ramp=True, dither="bayer"),
    ],
]

# %%

figure = draw_sheet(rows, ".png")

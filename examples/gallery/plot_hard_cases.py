"""
Dithering hard cases
====================

Images that are hard for a small palette, each with the nearest colors, with Floyd-Steinberg dithering, and with blue
noise: a sky, a soft shadow, pixel art, and a 16-bit gradient.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter

import cvtimg
from cvtimg.plotting import draw_sheet

SAMPLES = Path("../../sample_images")
WIDTH, HEIGHT = 270, 180
#: Shapes are drawn larger and then reduced, which smooths their edges.
LARGER = 4

# %%
# The images: crops of photographs, and drawings.


def sample(name: str, left: int, top: int) -> NDArray[Any]:
    """Crop a sample image."""
    image = cvtimg.read_image(SAMPLES / name)
    return image[top : top + HEIGHT, left : left + WIDTH]


def shadow() -> NDArray[Any]:
    """Draw a badge and its soft shadow on a transparent background."""
    shape = Image.new("L", (WIDTH * LARGER, HEIGHT * LARGER))
    ImageDraw.Draw(shape).rounded_rectangle((220, 110, 800, 500), 110, 255)
    dark = Image.new("RGBA", shape.size, (10, 10, 40, 255))
    dark.putalpha(shape.filter(ImageFilter.GaussianBlur(48)).point(lambda alpha: alpha * 3 // 4))
    picture = Image.new("RGBA", shape.size)
    picture.alpha_composite(dark, (60, 80))
    badge = Image.merge("RGB", [Image.linear_gradient("L").resize(shape.size).point(table) for table in BADGE])
    picture.paste(badge, (0, 0), shape)
    return reduced(picture)


def pixel_art() -> NDArray[Any]:
    """Draw a small landscape of flat colors and bands, enlarged five times."""
    row, column = np.mgrid[: HEIGHT // 5, : WIDTH // 5]
    bands = np.array([[40, 24, 96], [88, 40, 120], [160, 56, 120], [224, 96, 96], [248, 160, 88], [248, 216, 120]])
    art = bands[np.minimum(row // 3, 5)]
    art[(row - 9) ** 2 + (column - 28) ** 2 < 20] = [255, 244, 200]
    hills = 19 + np.rint(3 * np.sin(column[0] / 5)).astype(int)
    art[row >= hills] = [24, 88, 72]
    art[row >= hills + 2] = [16, 56, 56]
    art[(row >= hills - 3) & (row < hills) & (column % 9 == 4)] = [56, 32, 32]
    return art.astype(np.uint8).repeat(5, axis=0).repeat(5, axis=1)


def deep() -> NDArray[Any]:
    """Draw a 16-bit gradient that spans few 8-bit levels."""
    row, column = np.mgrid[:HEIGHT, :WIDTH] / [[[HEIGHT]], [[WIDTH]]]
    return np.rint(65535 * np.stack([0.2 + 0.5 * column, 0.35 + 0.3 * row, 0.75 - 0.3 * column * row], -1)).astype(
        np.uint16
    )


def reduced(picture: Image.Image) -> NDArray[Any]:
    """Reduce a drawing to the size of a panel."""
    return np.asarray(picture.reduce(LARGER))


#: A gradient from light to dark in red, green and blue.
BADGE = (lambda at: 255 - at // 8, lambda at: 190 - at // 2, lambda at: 40 + at // 8)
CASES: dict[str, tuple[Callable[[], NDArray[Any]], int]] = {
    "sky": (lambda: sample("rocket.jpg", 20, 60), 8),
    "soft shadow, transparent": (shadow, 16),
    "pixel art": (pixel_art, 8),
    "16 bits per channel": (deep, 16),
}


# %%
# Each image in three ways.

METHODS = {"nearest color": None, "floyd-steinberg": "floyd-steinberg", "blue-noise": "blue-noise"}


def panels(name: str, draw: Callable[[], NDArray[Any]], n_colors: int) -> list[tuple[NDArray[Any], str]]:
    """Show an image, and the same in few colors with each method."""
    image = draw()
    results = {
        how: cvtimg.quantize(image, n_colors, dither=method, alpha=image.shape[2:] == (4,))
        for how, method in METHODS.items()
    }
    shown = [(result.image, f"{n_colors} colors, {how}") for how, result in results.items()]
    return [(image, name), *shown]


figure = draw_sheet([panels(name, *case) for name, case in CASES.items()], ".png")

"""
Color quantization
==================

Two photographs in 4, 16, 64 and 256 colors, each above its palette.
"""

from pathlib import Path

import cvtimg
from cvtimg.plotting import Panel, contact_sheet

SAMPLES = Path("../../sample_images")

# %%
# `quantize` returns the palette, the index of each pixel in it, and the image that they make.


def panels(name: str) -> list[Panel]:
    """Show an image beside its quantized versions."""
    image = cvtimg.read_image(SAMPLES / name)
    n_distinct = cvtimg.colors.color_samples(image).n_colors
    results = {n_colors: cvtimg.quantize(image, n_colors) for n_colors in (4, 16, 64, 256)}
    return [
        Panel(image, ("original", f"{n_distinct:,} colors")),
        *(
            Panel(result.image, (f"{n} colors", f"{result.psnr:.1f} dB"), result.palette)
            for n, result in results.items()
        ),
    ]


# %%
# A contact sheet is an image like any other.

sheet = contact_sheet([panels("coffee.png"), panels("rocket.jpg")], panel_width=200)

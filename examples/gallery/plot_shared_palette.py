"""
One palette for many images
===========================

The colors of four photographs are counted together, and one palette of 32 colors serves them all, as a game or a set of
tiles needs it. It costs some quality compared with 32 colors for each image.
"""

from pathlib import Path

import numpy as np

import cvtimg
from cvtimg.plotting import draw_sheet
from cvtimg.quantization import map_to_palette, shared_palette

SAMPLES = Path("../../sample_images")

# %%
# ``cvtimg quantize FOLDER -k 32 --shared-palette --out-dir OUT`` does the same for a folder.

names = ("coffee.png", "chelsea.png", "rocket.jpg", "europe_day.png")
images = [cvtimg.read_image(SAMPLES / name)[:300, :450] for name in names]
shared = shared_palette(images, 32).colors


def psnr(image: np.ndarray, other: np.ndarray) -> float:
    """Return the peak signal-to-noise ratio in dB."""
    return float(10 * np.log10(255**2 / ((image.astype(float) - other) ** 2).mean()))


own, common = [], []
for image in images:
    alone = cvtimg.quantize(image, 32)
    mapped = map_to_palette(image, shared)
    own.append((alone.image, f"32 colors of its own\n{alone.psnr:.1f} dB"))
    common.append((mapped.image, f"32 colors for all\n{psnr(image, mapped.image):.1f} dB"))

figure = draw_sheet([own, common], ".png")

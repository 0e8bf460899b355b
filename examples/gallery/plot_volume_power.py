"""
Weighted cells
==============

With ``volume_power=p``, a cell counts by its share of the mass to the power p. Frequent colors gain generators from
rare ones, and the cells become more equal in size. The plain energy rises, while the weighted energy falls as far as
transfers of single colors can bring it. Here the lights and the white of the cup take in more pixels, and the largest
areas lose some.
"""

from pathlib import Path

import numpy as np

import cvtimg
from cvtimg.colors import ColorSamples
from cvtimg.plotting import draw_sheet

SAMPLES = Path("../../sample_images")


def panel(samples: ColorSamples, n_colors: int, power: int) -> tuple[np.ndarray, str]:
    """Show the generator of each pixel."""
    result = cvtimg.tessellate(samples, n_colors, volume_power=power, method="transfer", effort="best")
    palette = result.generators.round().astype(samples.colors.dtype)
    n_pixels = samples.inverse.size
    shares = result.masses / n_pixels
    caption = (
        f"p = {power}: largest cell {shares.max():.0%}, smallest {shares.min():.2%}",
        f"plain energy {result.energy / n_pixels:.4g} per pixel",
        f"weighted energy {result.weighted_energy / n_pixels:.4g} per pixel",
    )
    return palette[result.labels[samples.inverse]], "\n".join(caption)


# %%
# The engine takes the distinct colors of an image as weighted samples.

rows = []
for name, n_colors in (("rocket.jpg", 6), ("coffee.png", 5)):
    image = cvtimg.read_image(SAMPLES / name)
    samples = cvtimg.colors.color_samples(image)
    original = (image, f"original\n{samples.n_colors:,} colors")
    rows.append([original, *(panel(samples, n_colors, power) for power in (0, 1, 2))])

figure = draw_sheet(rows, ".png")

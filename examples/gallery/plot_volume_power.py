"""
Weighted cells
==============

With ``volume_power=p``, a cell counts by its share of the mass to the power p. Frequent colors gain generators from
rare ones, and the cells become more equal in size. The plain energy rises, while the weighted energy falls as far as
transfers of single colors can bring it. Here the lights and the white of the cup take in more pixels, and the largest
areas lose some.
"""

from pathlib import Path

import cvtimg
from cvtimg.colors import ColorSamples
from cvtimg.plotting import Panel, contact_sheet

SAMPLES = Path("../../sample_images")


def panel(samples: ColorSamples, n_colors: int, power: int) -> Panel:
    """Show the generator of each pixel, and the palette with the share of the pixels of each color."""
    result = cvtimg.tessellate(samples, n_colors, volume_power=power, method="transfer", effort="best")
    palette = result.generators.round().astype(samples.colors.dtype)
    order = result.generators.sum(axis=1).argsort()
    n_pixels = samples.inverse.size
    shares = result.masses / n_pixels
    caption = (
        f"p = {power}: largest cell {shares.max():.0%}, smallest {shares.min():.2%}",
        f"plain energy {result.energy / n_pixels:.4g} per pixel",
        f"weighted energy {result.weighted_energy / n_pixels:.4g} per pixel",
    )
    return Panel(palette[result.labels[samples.inverse]], caption, palette[order], shares[order])


# %%
# The engine takes the distinct colors of an image as weighted samples.

rows = []
for name, n_colors in (("rocket.jpg", 6), ("coffee.png", 5)):
    image = cvtimg.read_image(SAMPLES / name)
    samples = cvtimg.colors.color_samples(image)
    original = Panel(image, ("original", f"{samples.n_colors:,} colors"))
    rows.append([original, *(panel(samples, n_colors, power) for power in (0, 1, 2))])

sheet = contact_sheet(rows, panel_width=260)

"""
Before and after
================

A photograph, and the smallest indexed PNG file that is hard to tell from it: a seventh of the bytes.
"""

from pathlib import Path

import cvtimg
from cvtimg.plotting import draw_sheet

path = Path("../../sample_images/coffee.png")
image = cvtimg.read_image(path)
result = cvtimg.quantize(image, quality=80)

# %%
# A part of both, pixel for pixel.

n_bytes = len(cvtimg.pictures.encode_image(".png", result.indices, palette=result.palette))
before = f"{path.stat().st_size / 1000:.0f} kB, {len(cvtimg.colors.color_samples(image).colors):,} colors"
after = f"{n_bytes / 1000:.0f} kB, {len(result.palette)} colors"
figure = draw_sheet([[(image[40:360, 90:510], before), (result.image[40:360, 90:510], after)]], ".png")

"""
Merging exposures
=================

Three noisy, hand-held exposures of one scene, each shifted by a few pixels and turned a little. Their
mean is blurred; `restore` aligns them first and then removes the noise.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skimage.metrics import peak_signal_noise_ratio
from skimage.transform import rotate

import cvtimg
from cvtimg.plotting import draw_sheet

SAMPLES = Path("../../sample_images")

# %%
# The exposures: crops of a photograph at three places, turned by up to 0.7 degrees, with noise of 25 levels.

photograph = cvtimg.read_image(SAMPLES / "coffee.png")
rng = np.random.default_rng(0)


def crop(down: int, right: int, degrees: float) -> NDArray[np.float64]:
    """Return a part of the photograph, moved by some pixels and turned."""
    turned = rotate(photograph, degrees, center=(328, 196), order=3, preserve_range=True)
    return np.asarray(turned[100 + down : 292 + down, 200 + right : 456 + right])


def exposure(down: int, right: int, degrees: float) -> NDArray[np.uint8]:
    """Return a crop with noise."""
    return (crop(down, right, degrees) + rng.normal(0, 25, (192, 256, 3))).clip(0, 255).astype(np.uint8)


scene = crop(0, 0, 0).round().clip(0, 255).astype(np.uint8)
exposures = [exposure(0, 0, 0), exposure(3, -2, 0.7), exposure(-2, 4, -0.5)]

# %%
# ``denoise`` is for photographs, and ``align=True`` moves every exposure to the first.

merged = cvtimg.denoise(exposures, align=True)
mean = np.mean(exposures, axis=0).round().astype(np.uint8)


def panel(image: NDArray[Any], caption: str) -> tuple[NDArray[Any], str]:
    """Show an image with its quality."""
    return image, "\n".join((caption, f"{peak_signal_noise_ratio(scene, image):.1f} dB"))


row = [panel(exposures[0], "one of three exposures"), panel(mean, "their mean"), panel(merged.image, "merged")]

# %%

figure = draw_sheet([[*row, (scene, "the scene")]], ".png")

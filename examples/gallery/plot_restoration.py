"""
Restoration from several versions
=================================

Three damaged versions of each of three images, and the restored images: a drawing with holes and large gaps, a drawing
with parts painted over and no mask, and a photograph with holes and scratches.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import cvtimg
from cvtimg.plotting import draw_sheet

SAMPLES = Path("../../sample_images")
sys.path.append(str(SAMPLES))
from damage import Damage, damaged_versions


def levels(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Convert 0..1 to 8 bits."""
    return np.clip(np.rint(255 * image), 0, 255).astype(np.uint8)


# %%
# Missing pixels are marked by alpha 0.

versions = [cvtimg.read_image(SAMPLES / f"drawing_{number}.png") for number in (1, 2, 3)]
first_row = [(version, "holes, a large gap, noise") for version in versions]
first_row.append((cvtimg.restore(versions, 6).image, "restored: 6 segments"))

# %%
# Parts that are painted over need no mask, as long as the other versions show them.

clean = cvtimg.read_image(SAMPLES / "drawing.png")
versions, _ = damaged_versions(clean / 255, 3, Damage(noise=0.15, occlusions=4), seed=2)
second_row = [(levels(version), "parts painted over, no mask, noise") for version in versions]
second_row.append((levels(cvtimg.restore(versions, 6).image), "restored: 6 segments"))

# %%
# Photographs have no flat colors: ``denoise`` restores them from patches.

clean = cvtimg.read_image(SAMPLES / "chelsea.png")[20:212, 100:356]
versions, known = damaged_versions(clean / 255, 3, Damage(noise=0.1, holes=0.3, scratches=1), seed=0)
third_row = [
    (np.dstack([levels(version), np.uint8(255) * mask]), "30 % holes, a scratch, noise")
    for version, mask in zip(versions, known, strict=True)
]
restored = cvtimg.denoise(versions, masks=known)
third_row.append((levels(restored.image), "restored by denoise"))

# %%

figure = draw_sheet([first_row, second_row, third_row], ".png")

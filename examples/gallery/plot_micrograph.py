"""
A noisy micrograph
==================

A drawn texture like bone under noise, as in a short exposure, in two phases. The true mask is known, so errors can be
shown: wrongly labeled pixels are red.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

import cvtimg
from cvtimg.plotting import draw_sheet

SAMPLES = Path("../../sample_images")
sys.path.append(str(SAMPLES))
from draw import BONE_SEED, bone_struts

bone = cvtimg.read_image(SAMPLES / "bone_texture.png")
truth = bone_struts(np.random.default_rng(BONE_SEED))
noise = np.random.default_rng(0).normal(0, 40, bone.shape)
noisy = (bone + noise).clip(0, 255).astype(np.uint8)

# %%
# An edge weight makes borders short, and ``"auto"`` follows the noise of the image.


def panel(caption: str, **options: Any) -> tuple[np.ndarray, str]:
    """Show the bright segment in white, and errors in red."""
    found = cvtimg.segment(noisy, 2, **options).labels == 2
    shown = np.where(found[..., None], np.uint8(255), np.uint8(0)).repeat(3, axis=2)
    shown[found != truth] = (220, 40, 40)
    right = (found == truth).mean()
    return shown, "\n".join((caption, f"{found.mean():.1%} bone, {right:.1%} of the pixels right"))


row = [
    (noisy, f"the noisy image\ntruth: {truth.mean():.1%} bone"),
    panel("segment(noisy, 2, edge_weight=0)", edge_weight=0),
    panel("averaging=2", averaging=2),
    panel("segment(noisy, 2, min_size=40)", min_size=40),
]

# %%

figure = draw_sheet([row], ".png")

"""
Frames of an animation
======================

An animation of three scenes, and the frames that represent them: each is the one nearest to the mean of its scene.
"""

from pathlib import Path

import numpy as np
from PIL import Image

import cvtimg
from cvtimg.plotting import draw_sheet

SAMPLES = Path("../../sample_images")
N_FRAMES = 12  # of each scene

# %%
# Each scene is a photograph that moves to the left, under noise.

rng = np.random.default_rng(0)
frames = []
for name in ("coffee.png", "chelsea.png", "rocket.jpg"):
    photograph = Image.fromarray(cvtimg.read_image(SAMPLES / name)).resize((240, 160))
    still = np.asarray(photograph, np.float64)
    frames += [still[:, shift : shift + 216] + rng.normal(0, 8, (160, 216, 3)) for shift in range(0, 2 * N_FRAMES, 2)]
animation = np.clip(frames, 0, 255).astype(np.uint8)

# %%
# Of 36 frames, three are chosen.

found = cvtimg.reduced_basis(animation, 3, kind="cvt")
shown = [(animation[number], f"frame {number}") for number in range(0, len(animation), 6)]
chosen = [
    (animation[number], f"frame {number}\nrepresents {np.sum(found.labels == scene)} frames")
    for scene, number in sorted(enumerate(found.medoids), key=lambda pair: pair[1])
]
figure = draw_sheet([shown, chosen], ".png")

"""
Nuclei in a stack
=================

Balls in a stack of planes under noise and uneven light, counted in three dimensions; outlines of the objects in four of
the planes. Most of the balls touch another.
"""

import numpy as np

from cvtimg.plotting import draw_edges, draw_sheet
from cvtimg.segmentation import count_objects

rng = np.random.default_rng(4)
z, y, x = np.meshgrid(np.arange(22) * 1.5, np.arange(120) * 0.5, np.arange(160) * 0.5, indexing="ij")
balls: list[tuple[np.ndarray, float]] = []
while len(balls) < 40:
    center, radius = rng.uniform((4, 5, 5), (29, 55, 75)), rng.uniform(4, 6)
    if all(np.linalg.norm(center - other) > 0.85 * (radius + its) for other, its in balls):
        balls.append((center, radius))
away = [np.sqrt((z - c[0]) ** 2 + (y - c[1]) ** 2 + (x - c[2]) ** 2) / radius for c, radius in balls]
light = np.exp(-z / 60) * (1 + 0.3 * x / 80)
stack = (40 + 120 * (np.min(away, axis=0) < 1)) * light + rng.normal(0, 12, z.shape)
stack = stack.clip(0, 255).astype(np.uint8)

# %%
# The distances of planes and of pixels tell how objects touch.

found = count_objects(stack, spacing=(1.5, 0.5, 0.5))
planes = (4, 8, 12, 16)
row = [
    (
        draw_edges(stack[at].repeat(3, axis=0).repeat(3, axis=1), found.labels[at].repeat(3, axis=0).repeat(3, axis=1)),
        f"plane {at + 1} of {len(stack)}\n{len(np.unique(found.labels[at])) - 1} of {found.n_segments} objects",
    )
    for at in planes
]

# %%

figure = draw_sheet([row], ".png")

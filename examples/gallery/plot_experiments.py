"""
A design of experiments
=======================

Thirty runs of an experiment with three inputs, in pairs of axes, among twenty runs that were made before (crosses).
Each tenth of an axis has the same number of runs.
"""

import numpy as np

import cvtimg
from cvtimg.plotting.charts import draw_pairs

NAMES, BOUNDS = ["angle", "speed", "load"], [[0, 15], [10, 40], [1, 9]]
first = cvtimg.design(20, BOUNDS)

# %%
# New runs keep away from those that exist.

more = cvtimg.design(30, BOUNDS, existing=first.points)
assert np.linalg.norm(more.unit_points[:, None] - first.unit_points, axis=2).min() > 0.05

figure = draw_pairs(more.points, NAMES, ".png", first.points)

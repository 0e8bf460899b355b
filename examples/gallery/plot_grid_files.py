"""
Grids of the globe on charts
============================

A grid of 5,000 cells, four times as fine around Europe, with the coasts, seen from there and on a map.
"""

from io import BytesIO

import numpy as np
from PIL import Image

from cvtimg import sphere_grid
from cvtimg.plotting import draw_globe, draw_map
from cvtimg.sphere import Refinement, cell_polygons, earth_coasts

grid = sphere_grid(5000, density=Refinement(10, 50, radius=20, ratio=4))
cells, sizes = grid.cells(), np.degrees(np.sqrt(grid.areas))
globe = draw_globe(list(cells), sizes, ".png", center=(10, 50), lines=earth_coasts())
rings = list(cell_polygons(cells.vertices, cells.corners, cells.offsets))
on_map = draw_map(rings, sizes, ".png", lines=earth_coasts())

# %%
# Both charts color cells by size, over the coasts; the flat one is cut at 180 degrees.

charts = [Image.open(BytesIO(content)).convert("RGB") for content in (globe, on_map)]
height = 540
charts = [chart.resize((round(chart.width * height / chart.height), height)) for chart in charts]
both = Image.new("RGB", (sum(chart.width for chart in charts), height), "white")
both.paste(charts[0], (0, 0))
both.paste(charts[1], (charts[0].width, 0))
content = BytesIO()
both.save(content, format="PNG")
figure = content.getvalue()

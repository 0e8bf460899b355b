"""
A grid of the ocean
===================

Cells of 240 km, of 60 km in the North Atlantic, and none on land; how wide they are, and how even angles are.
"""

from io import BytesIO
from itertools import compress

from PIL import Image

from cvtimg import sphere_grid
from cvtimg.meshes import measure_triangles
from cvtimg.plotting import draw_globe, draw_histograms
from cvtimg.sphere import CellWidth, WidthCircle, cull_land, earth_coasts, earth_land

width = CellWidth(240, [WidthCircle(-40, 45, radius=2000, width=60)])
grid = sphere_grid(density=width)
sea = cull_land(grid, earth_land(), straits=[[(-10, 36), (3, 38)]])
print(sea)

# %%
# The sea, as it is seen from above the Atlantic:

widths = grid.widths()[sea.kept]
cells = list(compress(grid.cells(), sea.kept))
look = {"center": (-40, 35), "lines": earth_coasts(), "label": "cell width (km)"}
globe = Image.open(BytesIO(draw_globe(cells, widths, ".png", **look)))

# %%
# Most cells have the one width or the other; no triangle is obtuse:

angles = measure_triangles(grid.points, grid.triangles[sea.kept[grid.triangles].all(axis=1)]).angles
histograms = draw_histograms({"cell width (km)": widths, "angle of triangles (degrees)": angles}, ".png")
below = Image.open(BytesIO(histograms)).resize((globe.width, globe.width * 32 // 84))

sheet = Image.new("RGB", (globe.width, globe.height + below.height), "white")
sheet.paste(globe, (0, 0))
sheet.paste(below, (0, globe.height))
content = BytesIO()
sheet.save(content, format="PNG")
figure = content.getvalue()

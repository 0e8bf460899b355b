"""
A mesh of two phases
====================

A drawn texture like bone, segmented into struts and pores, and one mesh for both. Vertices on the border belong to both
phases, and each phase keeps its area.
"""

from pathlib import Path

from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

import cvtimg

bone = cvtimg.read_image(Path("../../sample_images/bone_texture.png"))
labels = cvtimg.segment(bone, 2, min_size=40).labels

# %%
# Both phases are meshed at once.

mesh = cvtimg.mesh_labels(labels, n=4000, tolerance=1)

# %%
# The border over the image, the mesh in the colors of its phases, and a quarter of it.

PORES, STRUTS, LINES = "#8c4a4a", "#f3ead7", "#22304a"
figure = Figure(figsize=(13, 4.6), layout="constrained")
with_border, whole, part = figure.subplots(1, 3)
with_border.imshow(bone, extent=(0, 256, 256, 0), cmap="gray")
with_border.add_collection(LineCollection(list(mesh.points[mesh.edges]), colors="#ffd21f", linewidths=1.2))
for axes, thickness in ((whole, 0.25), (part, 0.6)):
    colors = [STRUTS if tag == 2 else PORES for tag in mesh.tags]
    triangles = PolyCollection(list(mesh.points[mesh.triangles]), facecolors=colors, edgecolors=LINES)
    triangles.set_linewidth(thickness)
    axes.add_collection(triangles)
titles = ("the border of the phases", f"{len(mesh.points):,} vertices", "a part of the mesh")
for axes, title in zip((with_border, whole, part), titles, strict=True):
    axes.set(xlim=(0, 256), ylim=(256, 0), aspect="equal", title=title)
    axes.axis("off")
part.set(xlim=(0, 100), ylim=(190, 90))

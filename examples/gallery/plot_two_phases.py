"""
A mesh of two phases
====================

A drawn texture like bone, segmented into struts and pores, and one mesh for both. Triangles are colored by their
quality; vertices on the border belong to both phases.
"""

from pathlib import Path

import cvtimg
from cvtimg.plotting.meshes import draw_mesh

bone = cvtimg.read_image(Path("../../sample_images/bone_texture.png"))
labels = cvtimg.segment(bone, 2, edge_weight="auto", min_size=40).labels

# %%
# Both phases are meshed at once.

mesh = cvtimg.mesh_labels(labels, n=4000, tolerance=1)

figure = draw_mesh(mesh.points, mesh.triangles, mesh.qualities, mesh.edges, ".png", image=bone, y_down=True)

"""Polygons keep their areas: vertices move off curves by as much as makes up for what edges cut off."""

from __future__ import annotations

import numpy as np

from cvtimg.meshes.outlines import Outline, StraightParts
from cvtimg.meshes.triangulation import PlaneTriangulation

#: An edge whose middle is nearer to the outline, by its length, cuts nothing off.
_NOTHING = 1e-7
#: Vertices move so often: where triangles would turn over, they go a part of the way.
_ROUNDS = 3


def keep_areas(outline: Outline, mesh: PlaneTriangulation) -> None:
    """Move vertices along their normals, so that polygons lose nothing to edges that cut curves.

    Corners stay, and so do vertices on straight sides, unless one edge cuts off the turn from a side to the next.
    """
    assert outline.areas is not None
    parts, half_edges = StraightParts.of(outline.lines), mesh.half_edges_on_borders()
    edges = mesh.edges[half_edges]
    a, b = mesh.points[edges].transpose(1, 0, 2)
    is_cut = np.linalg.norm(parts.feet((a + b) / 2) - (a + b) / 2, axis=1) > _NOTHING * np.linalg.norm(b - a, axis=1)
    # An edge is on the line that those of its ends are nearest to which are no corners, and goes in its direction.
    inner = np.where(mesh.corners[edges[:, :1]], b, a)
    inner[mesh.corners[edges].all(axis=1)] = ((a + b) / 2)[mesh.corners[edges].all(axis=1)]
    of_line = parts.of_line[parts.nearest(inner)[0]]
    back = mesh.tags[half_edges // 3] != outline.sides[of_line, 0]
    edges[back] = edges[back, ::-1]
    free = ~mesh.corners
    free[edges[~is_cut]] = False
    alone = edges[is_cut & ~free[edges].any(axis=1)]
    free[alone] = ~mesh.corners[alone]
    for _ in range(_ROUNDS if free[edges].any() else 0):
        moved = outline.areas.kept(mesh.points, edges, of_line, np.empty(0, np.intp), np.flatnonzero(~free))
        mesh.move(moved - mesh.points, free)

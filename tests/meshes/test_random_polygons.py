"""Random polygons with holes have a mesh of the whole, or one clear error."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from cvtimg import mesh_region


@st.composite
def polygons(draw: st.DrawFn) -> shapely.Polygon:
    """Draw a star-shaped polygon, its corners up to very sharp, with up to three star-shaped holes."""

    def star(x: float, y: float, largest: float) -> shapely.Polygon:
        n = draw(st.integers(3, 12))
        radii = np.array(draw(st.lists(st.floats(0.15, 1), min_size=n, max_size=n))) * largest
        turns = 2 * np.pi * (np.arange(n) + np.array(draw(st.lists(st.floats(0, 0.8), min_size=n, max_size=n)))) / n
        return shapely.Polygon(np.stack([x + radii * np.cos(turns), y + radii * np.sin(turns)], axis=1))

    whole = star(0, 0, 1)
    for _ in range(draw(st.integers(0, 3))):
        hole = star(draw(st.floats(-0.4, 0.4)), draw(st.floats(-0.4, 0.4)), draw(st.floats(0.02, 0.2)))
        if hole.is_valid:
            whole = shapely.difference(whole, hole)
    parts = [part for part in shapely.get_parts(whole) if part.geom_type == "Polygon" and part.area > 1e-3]
    return max(parts, key=lambda part: part.area) if parts else shapely.box(0, 0, 1, 1)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(polygons(), st.sampled_from([0.4, 0.15, 0.05]))
def test_a_random_polygon_is_covered(polygon: shapely.Polygon, edge_length: float) -> None:
    mesh = mesh_region(polygon, edge_length=edge_length, effort="fast")
    corners = mesh.points[mesh.triangles]
    steps = corners[:, 1:] - corners[:, :1]
    turn = steps[:, 0, 0] * steps[:, 1, 1] - steps[:, 0, 1] * steps[:, 1, 0]
    assert (turn > 0).all()
    assert turn.sum() / 2 == pytest.approx(polygon.area, abs=0.03 * edge_length * polygon.length)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(polygons(), st.integers(3, 300))
def test_a_random_number_of_vertices_is_met_or_refused(polygon: shapely.Polygon, n: int) -> None:
    try:
        found = str(len(mesh_region(polygon, n=n, effort="fast").points))
    except ValueError as error:
        found = str(error)
    assert found == str(n) or "the vertices that the border needs" in found

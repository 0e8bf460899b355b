"""Random polygons with holes, and random labels, have a mesh of the whole, or one clear error."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from cvtimg import mesh_labels, mesh_region


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


@st.composite
def rings(draw: st.DrawFn) -> list[list[tuple[float, float]]]:
    """Draw a ring and up to two holes of any points on a coarse grid, so that they cross, touch and repeat."""
    at = st.integers(0, 8).map(float)
    ring = st.lists(st.tuples(at, at), min_size=3, max_size=7)
    return [draw(ring), *draw(st.lists(ring, max_size=2))]


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(rings())
def test_any_rings_have_a_mesh_or_one_clear_error(given_rings: list[list[tuple[float, float]]]) -> None:
    edge_length, message = 3.0, ""
    try:
        mesh = mesh_region(given_rings, edge_length=edge_length, effort="fast")
    except ValueError as error:
        message = str(error)
    whole = shapely.Polygon(given_rings[0], given_rings[1:])
    if whole.is_valid and whole.area > 0:
        assert not message
        assert mesh.area == pytest.approx(whole.area, abs=0.05 * edge_length * whole.length)
    else:
        assert any(
            word in message for word in ("cross themselves", "a hole at", "must be a polygon with area > 0", "be valid")
        ), message


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.6, 1.5, 4.0]), st.sampled_from([0, 0.7]))
def test_any_labels_have_a_mesh(seed: int, edge_length: float, tolerance: float) -> None:
    random = np.random.default_rng(seed)
    labels = random.integers(0, random.integers(2, 5), random.integers(1, 9, 2))
    labels.flat[0] = 1
    mesh = mesh_labels(labels, edge_length=edge_length, tolerance=tolerance, effort="fast")
    assert mesh.area == pytest.approx((labels > 0).sum(), rel=1e-4)

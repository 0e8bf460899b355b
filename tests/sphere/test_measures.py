"""Measures of grids against definitions."""

from __future__ import annotations

import numpy as np
import pytest

from cvtimg.halfedges import measure_triangles
from cvtimg.sphere import measure_grid, triangulate
from cvtimg.sphere.triangulation import unit


def test_measures_agree_with_their_definitions() -> None:
    points = unit(np.random.default_rng(2).normal(size=(40, 3)))
    triangles = triangulate(points)
    measures = measure_grid(points, triangles)
    each = measure_triangles(points, triangles)
    assert (measures.least_angle, measures.largest_angle) == (each.angles.min(), each.angles.max())
    assert measures.n_obtuse == (each.angles > 90).sum()
    assert (measures.least_quality, measures.mean_quality) == (each.qualities.min(), each.qualities.mean())
    neighbors = [set(triangles[(triangles == i).any(axis=1)].ravel()) - {i} for i in range(40)]
    gaps = [[np.linalg.norm(points[i] - points[j]) for j in near] for i, near in enumerate(neighbors)]
    assert measures.uniformity == pytest.approx(min(min(gap) / max(gap) for gap in gaps))
    assert measures.shortest_edge == pytest.approx(2 * np.arcsin(min(map(min, gaps)) / 2))
    assert measures.longest_edge == pytest.approx(2 * np.arcsin(max(map(max, gaps)) / 2))
    sizes = [len(near) for near in neighbors]
    assert [sizes.count(5), sizes.count(6), sizes.count(7)] == [
        measures.n_pentagons, measures.n_hexagons, measures.n_heptagons,
    ]  # fmt: skip

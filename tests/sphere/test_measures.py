"""Measures of grids against definitions."""

from __future__ import annotations

import numpy as np
import pytest

from cvtimg.sphere import measure_grid, triangulate
from cvtimg.sphere.triangulation import unit


def test_measures_agree_with_their_definitions() -> None:
    points = unit(np.random.default_rng(2).normal(size=(40, 3)))
    triangles = triangulate(points)
    measures = measure_grid(points, triangles)
    angles, qualities = [], []
    for triangle in points[triangles]:
        sides = [np.linalg.norm(triangle[i] - triangle[j]) for i, j in ((1, 2), (2, 0), (0, 1))]
        area = np.linalg.norm(np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])) / 2
        qualities.append(2 * (2 * area / sum(sides)) / (np.prod(sides) / (4 * area)))
        for i in range(3):
            u, v = triangle[i - 1] - triangle[i], triangle[i - 2] - triangle[i]
            angles.append(np.degrees(np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v))))
    assert (measures.least_angle, measures.largest_angle) == pytest.approx((min(angles), max(angles)))
    assert measures.n_obtuse == sum(angle > 90 for angle in angles)
    assert (measures.least_quality, measures.mean_quality) == pytest.approx((min(qualities), np.mean(qualities)))
    neighbors = [set(triangles[(triangles == i).any(axis=1)].ravel()) - {i} for i in range(40)]
    gaps = [[np.linalg.norm(points[i] - points[j]) for j in near] for i, near in enumerate(neighbors)]
    assert measures.uniformity == pytest.approx(min(min(gap) / max(gap) for gap in gaps))
    assert measures.shortest_edge == pytest.approx(2 * np.arcsin(min(map(min, gaps)) / 2))
    assert measures.longest_edge == pytest.approx(2 * np.arcsin(max(map(max, gaps)) / 2))
    sizes = [len(near) for near in neighbors]
    assert [sizes.count(5), sizes.count(6), sizes.count(7)] == [
        measures.n_pentagons, measures.n_hexagons, measures.n_heptagons,
    ]  # fmt: skip

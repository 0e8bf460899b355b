from __future__ import annotations

import numpy as np
import pytest
import shapely

from cvtimg import mesh_labels, mesh_region
from cvtimg.meshes import Mesh

#: A cell of a lattice of holes, one of which is over its sides.
HOLES = shapely.union_all([shapely.Point(x, 0.3).buffer(0.2) for x in (0.1, 0.7, 1.3)])
CELL = shapely.box(0.1, 0, 1.3, 0.7).difference(HOLES)


def shifts(mesh: Mesh) -> set[tuple[float, ...]]:
    """Check that vertices are paired once along each axis; return by how much they are apart."""
    assert mesh.pairs is not None
    steps = mesh.points[mesh.pairs[:, 0]] - mesh.points[mesh.pairs[:, 1]]
    assert ((steps == 0).sum(axis=1) == 1).all()
    for axis in (0, 1):
        copies = mesh.pairs[steps[:, axis] != 0, 0]
        assert len(copies) == len(set(copies.tolist()))
    return set(map(tuple, steps.round(12).tolist()))


def test_vertices_on_periodic_sides_are_equal_by_translation() -> None:
    mesh = mesh_region(CELL, n=300, periodic="xy", effort="fast")
    assert len(mesh.points) == 300
    assert shifts(mesh) == {(1.2, 0), (0, 0.7)}


@pytest.mark.parametrize("edge_length", [0.05, 0.2])  # the latter is mended: edges on the other borders are split
def test_all_vertices_on_periodic_sides_are_in_pairs(edge_length: float) -> None:
    mesh = mesh_region(CELL, edge_length=edge_length, periodic="xy", effort="fast")
    assert mesh.pairs is not None
    for axis in (0, 1):
        for column, bound in zip((1, 0), CELL.bounds[axis::2], strict=True):
            on_bound = np.flatnonzero(np.abs(mesh.points[:, axis] - bound) < 1e-12)
            assert np.isin(on_bound, mesh.pairs[:, column]).all()


def test_periodic_sides_may_bend_and_have_six_nodes() -> None:
    y = np.linspace(0, 1, 40)
    wave = np.stack([0.15 * np.sin(2 * np.pi * y), y], axis=1)
    mesh = mesh_region(
        np.concatenate([wave[::-1], wave + np.array([1.5, 0])]), n=120, periodic="x", order=2, effort="fast"
    )
    assert shifts(mesh) == {(1.5, 0)}
    assert mesh.quadratic is not None
    assert mesh.quadratic.pairs is not None
    assert mesh.pairs is not None
    assert len(mesh.quadratic.pairs) == 2 * len(mesh.pairs) - 1
    a, b = mesh.quadratic.nodes[mesh.quadratic.pairs.T]
    assert (a[:, 1] == b[:, 1]).all()
    assert np.allclose(a[:, 0] - b[:, 0], 1.5)


def test_labels_are_periodic_where_their_borders_are() -> None:
    y, x = np.mgrid[:24, :30]
    labels = 1 + (np.hypot((x + 8) % 30 - 8, y - 12) < 7).astype(np.int32)
    labels[:, -1] = labels[:, 0]
    mesh = mesh_labels(labels, edge_length=3, periodic="xy", effort="fast")
    assert shifts(mesh) == {(30, 0), (0, 24)}

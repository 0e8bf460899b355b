from pathlib import Path

import meshio
import numpy as np
import pytest

from cvtimg._shared.types import Array, Bools, Floats, Indices, Ints64
from cvtimg.meshes import VolumeMesh, mesh_volume
from cvtimg.meshes.tetrahedra import dihedral_angles, pinched, stuff, widened


def shapes(side: int = 32) -> dict[str, Bools]:
    z, y, x = ((np.mgrid[:side, :side, :side] + 0.5) / side * 2 - 1)[:]
    turns = 2 * np.pi / 1.6
    waves = np.sum([np.sin(turns * a) * np.cos(turns * b) for a, b in ((x, y), (y, z), (z, x))], axis=0)
    return {
        "sphere": x * x + y * y + z * z < 0.64,
        "torus": (np.hypot(x, y) - 0.6) ** 2 + z * z < 0.0625,
        "gyroid": (np.abs(waves) < 0.6) & (x * x + y * y + z * z < 0.7),
        "box": np.maximum(np.maximum(abs(x), abs(y)), abs(z)) < 0.6,
        "two": (x - 0.5) ** 2 + y * y + z * z < 0.16,
        "whole": np.ones((side, side, side), bool),
    }


def volume_of_surface(mesh: VolumeMesh) -> float:
    """Volume that the surface encloses, by the divergence theorem."""
    a, b, c = (mesh.points[mesh.surface[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def labels(side: int = 24) -> dict[str, Ints64]:
    z, y, x = ((np.mgrid[:side, :side, :side] + 0.5) / side * 2 - 1)[:]
    squares = y * y + z * z
    balls = (x + 0.35) ** 2 + squares < 0.25, (x - 0.35) ** 2 + squares < 0.25
    sharp = np.random.default_rng(5).uniform(-0.7, 0.7, (5, 3))
    seeds = ((np.stack([x, y, z], axis=-1)[..., None, :] - sharp) ** 2).sum(axis=-1)
    return {
        "balls": np.select([balls[0] & (x < 0), balls[1]], [1, 2]),
        "shells": np.digitize(-np.sqrt(x * x + squares), [-0.9, -0.6]),
        "quadrants": np.where(np.maximum(abs(x), np.maximum(abs(y), abs(z))) < 0.8, 5 + (x > 0) + 2 * (y > 0), 0),
        "cells": seeds.argmin(axis=-1) + 1,
    }


VOXELS: dict[str, Array] = {**shapes(), **labels()}


@pytest.mark.parametrize(
    ("name", "n"), [("torus", 500), ("balls", 500), *(pytest.param(k, 4000, marks=pytest.mark.slow) for k in VOXELS)]
)
def test_labels_share_faces_and_keep_numbers_angles_volumes_and_manifolds(name: str, n: int) -> None:
    voxels = VOXELS[name]
    mesh = mesh_volume(voxels, n=n)
    assert len(mesh.points) == pytest.approx(n, rel=0.03 + 15 / n)
    assert mesh.dihedral_angles.min() > 10
    assert mesh.is_manifold
    volumes = {tag: one.volume for tag, one in mesh.measures_by_label().items()}
    assert volumes == pytest.approx({tag: (voxels == tag).sum() for tag in volumes}, rel=0.003)
    assert set(volumes) == set(np.unique(voxels)) - {0}
    # Each face is in one tetrahedron, or in two: what is inside is filled once.
    faces = np.sort(mesh.tetrahedra[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    assert (np.unique(faces, axis=0, return_counts=True)[1] <= 2).all()
    assert volume_of_surface(mesh) == pytest.approx(mesh.volume, rel=1e-9)


def test_points_stay_where_surfaces_would_meet_themselves_and_narrow_tetrahedra_are_widened() -> None:
    class Quadrants:
        """Two boxes that meet in a line."""

        def distances(self, points: Floats, labels: Indices) -> Floats:
            level = np.maximum(-points[:, 0] * points[:, 1], np.abs(points).max(axis=1) - 2)
            return np.where(labels == 1, level, -level)

        def nearest(self, points: Floats) -> Indices:
            return (self.distances(points, np.ones(len(points), np.intp)) < 0).astype(np.intp)

    found = stuff(Quadrants(), np.full(3, -3.0), np.full(3, 3.0), 0.7)
    assert not len(pinched(found.cells, found.labels, len(found.points)))
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0.05]])
    wide = widened(flat, np.array([[0, 1, 2, 3]]), 1.0)
    assert dihedral_angles(wide, np.array([[0, 1, 2, 3]])).min() > 10


def test_regular_tetrahedra_have_quality_1() -> None:
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    cell, tag = np.arange(4, dtype=np.int32)[None], np.ones(1, np.int32)
    mesh = VolumeMesh(corners, cell[:, [0, 1, 3, 2]], tag, None)
    assert mesh.measures().mean_quality == pytest.approx(1)
    assert mesh.measures().least_angle == pytest.approx(np.degrees(np.arccos(1 / 3)))
    # A corner of a cube: r = 1 / (3 + 3^(1/2)), R = 3^(1/2) / 2.
    mesh = VolumeMesh(np.vstack([np.zeros(3), np.eye(3)]), cell, tag, None)
    assert mesh.qualities == pytest.approx(3 / (3 + 3**0.5) / (3**0.5 / 2))


def test_the_surface_is_where_the_mask_ends() -> None:
    mask = shapes()["sphere"]
    mesh = mesh_volume(mask, edge_length=3)
    radii = np.linalg.norm(mesh.points[np.unique(mesh.surface)] - 16, axis=1)
    assert np.abs(radii - 12.8).max() < 0.6


def test_axes_of_points_are_those_of_the_mask_from_last_to_first() -> None:
    mask = np.zeros((12, 20, 30), bool)
    mask[2:8, 3:15, 5:25] = True
    mesh = mesh_volume(mask, edge_length=2)
    assert np.abs(mesh.points.min(axis=0) - [5, 3, 2]).max() < 0.7
    assert np.abs(mesh.points.max(axis=0) - [25, 15, 8]).max() < 0.7


@pytest.mark.parametrize("suffix", [".vtu", ".msh", ".inp", ".vtk"])
def test_other_programs_read_the_same_tetrahedra_and_tags(tmp_path: Path, suffix: str) -> None:
    mesh = mesh_volume(np.where(shapes(20)["sphere"], [[[3] * 10 + [7] * 10]], 0), edge_length=6)
    mesh.save(tmp_path / f"a{suffix}")
    found = meshio.read(tmp_path / f"a{suffix}")
    assert (found.cells_dict["tetra"] == mesh.tetrahedra).all()
    assert np.abs(found.points - mesh.points).max() < 1e-12
    if suffix == ".inp":
        assert "*ELSET, ELSET=label-7" in (tmp_path / "a.inp").read_text()
    else:
        tags = found.cell_data_dict["gmsh:physical" if suffix == ".msh" else "tag"]
        assert (tags["tetra"].ravel() == mesh.tags).all()
    if suffix == ".msh":
        assert len(found.cells_dict["triangle"]) == len(mesh.surface) + len(mesh.interfaces)
        assert set(found.field_data) == {"label-3", "label-7", "surface", "between"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"labels": np.zeros((4, 4, 4), bool), "n": 9}, "labels must not be empty"),
        ({"labels": np.ones((4, 4), bool), "n": 9}, r"must be \(D, H, W\)"),
        ({"labels": -np.ones((4, 4, 4), int), "n": 9}, r"labels must be in 0\.\."),
        ({"labels": np.ones((8, 8, 8), bool)}, "must be one of them"),
        ({"labels": np.ones((8, 8, 8), bool), "edge_length": 0}, "edge_length=0 must be"),
        ({"labels": np.ones((6, 6, 6), bool), "n": 20000}, "n=20000 must be at most 16 for each voxel"),
        ({"labels": shapes()["gyroid"], "n": 200}, "n=200 must let tetrahedra be smaller"),
        (
            {"labels": np.pad([[[9]]], 4, constant_values=1), "n": 50},
            "label 9 of labels must have parts at least three",
        ),
        ({"labels": np.pad(np.ones((1, 9, 9), bool), 4), "n": 50}, "three voxels thick"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        mesh_volume(**arguments)

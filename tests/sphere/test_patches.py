"""Moves in patches: the same bits as in one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cvtimg import sphere_grid
from cvtimg.sphere import Refinement, move_in_patches
from cvtimg.sphere.triangulation import Triangulation, unit

GRID = sphere_grid(6000, effort="fast", polish=False)


@pytest.mark.parametrize("n_patches", [1, 2, 5])
def test_patches_give_the_bits_of_one_mesh(n_patches: int) -> None:
    mesh = Triangulation(GRID.points)
    for _ in range(4):
        moments = mesh.uniform_moments()
        areas = np.sqrt(np.einsum("ij,ij->i", moments, moments))
        moments -= np.einsum("ij,ij->i", moments, mesh.points)[:, None] * mesh.points
        mesh.replace(unit(mesh.points + moments / areas[:, None]))
    assert (move_in_patches(GRID, 4, n_patches=n_patches).points == mesh.points).all()


def test_patches_follow_a_density() -> None:
    density = Refinement(0, 0, 40, 2)
    grid = sphere_grid(6000, density=density, effort="fast", polish=False)
    one, three = (move_in_patches(grid, 3, n_patches=n, density=density) for n in (1, 3))
    assert (one.points == three.points).all()
    assert one.energy < grid.energy


# Distributed leaves sockets to the garbage collector.
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_workers_of_dask_give_the_same_bits() -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.Client(processes=False, n_workers=2, threads_per_worker=1, dashboard_address=":0") as client:
        found = move_in_patches(GRID, 2, n_patches=2, client=client)
    assert (found.points == move_in_patches(GRID, 2).points).all()


def test_triangles_too_wide_for_a_patch_are_refused() -> None:
    with pytest.raises(ValueError, match="grid must have triangles no wider"):
        move_in_patches(replace(GRID, points=unit(np.random.default_rng(0).normal(size=(6000, 3)))), 1)
    with pytest.raises(ValueError, match="n_patches=0 must be an integer >= 1"):
        move_in_patches(GRID, 1, n_patches=0)

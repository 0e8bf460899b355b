"""Moves in patches: the same bits as in one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cvtimg import sphere_grid
from cvtimg.sphere import Refinement, move_in_patches
from cvtimg.sphere.descent import N_STEPS, _Whole, descend
from cvtimg.sphere.patches import _Patches
from cvtimg.sphere.triangulation import SphereTriangulation, uniform_cells, unit

GRID = sphere_grid(6000, effort="fast", polish=False)


@pytest.mark.parametrize("n_patches", [1, 2, 5])
def test_patches_give_the_bits_of_one_mesh(n_patches: int) -> None:
    mesh = SphereTriangulation(GRID.points)
    descend(mesh, uniform_cells, 12, 0.0)
    assert not (mesh.points == GRID.points).all()
    assert (move_in_patches(GRID, 12, n_patches=n_patches).points == mesh.points).all()


def test_patches_rest_within_a_tolerance() -> None:
    assert move_in_patches(GRID, 1000, tolerance=1e-4).offset <= 1e-4 < GRID.offset


def test_steps_that_turn_triangles_over_are_halved_in_all_patches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cvtimg.sphere.descent._LONGEST", 10.0)
    points = unit(GRID.points + 0.2 * np.sqrt(GRID.areas)[:, None] * np.random.default_rng(1).normal(size=(6000, 3)))
    mesh = SphereTriangulation(points)
    whole = _Whole(mesh, uniform_cells)
    patches = _Patches(replace(GRID, points=points), 3, uniform_cells, None)
    step = np.zeros(2 * N_STEPS + 1)
    answers = []
    for moving in (whole, patches):
        sums = moving.measured(0).sum(axis=0)
        step[-1] = -5 * sums[3] / sums[2]  # ten times as far as centers of mass
        part = 1.0
        while not moving.move(step, part, False):
            part /= 2
        answers.append(part)
    assert answers[0] == answers[1] < 1
    assert (patches.points() == mesh.points).all()


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
        found = move_in_patches(GRID, 9, n_patches=3, client=client)
    assert (found.points == move_in_patches(GRID, 9, n_patches=1).points).all()


def test_a_client_without_workers_is_refused() -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.Client(processes=False, n_workers=0, dashboard_address=":0") as client,
        pytest.raises(ValueError, match="client must have workers"),
    ):
        move_in_patches(GRID, 1, client=client)


def test_triangles_too_wide_for_a_patch_are_refused() -> None:
    with pytest.raises(ValueError, match="grid must have triangles no wider"):
        move_in_patches(replace(GRID, points=unit(np.random.default_rng(0).normal(size=(6000, 3)))), 1)
    with pytest.raises(ValueError, match="n_patches=0 must be an integer >= 1"):
        move_in_patches(GRID, 1, n_patches=0)

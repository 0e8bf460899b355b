from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from cvtimg import key_frames, reduced_basis

RNG = np.random.default_rng(2)
SHOTS = RNG.normal(size=(4, 500)) * 20
#: Four shots of 12 frames, which change along ten directions.
FILM = np.repeat(SHOTS, 12, axis=0) + RNG.normal(size=(48, 10)) @ RNG.normal(size=(10, 500)) / 3


def test_each_shot_of_a_film_gets_a_key_frame_of_its_own() -> None:
    found = key_frames(FILM, 4)
    assert (found.indices // 12).tolist() == [0, 1, 2, 3]
    assert found.labels.tolist() == np.repeat(np.arange(4), 12).tolist()
    assert found.masses.tolist() == [12] * 4


def test_a_key_frame_is_the_frame_nearest_to_the_mean_of_its_cell() -> None:
    found = key_frames(FILM, 4)
    for cell, index in enumerate(found.indices):
        members = np.flatnonzero(found.labels == cell)
        apart = ((FILM[members] - FILM[members].mean(axis=0)) ** 2).sum(axis=1)
        assert index == members[apart.argmin()]


def test_scenes_are_cut_where_that_leaves_the_least_error() -> None:
    film = np.concatenate([FILM, FILM[:12]])  # the first shot comes back
    assert len(key_frames(film, "auto").indices) == 4
    scenes = key_frames(film, "auto", by="scenes")
    assert scenes.labels.tolist() == np.repeat(np.arange(5), 12).tolist()
    assert (scenes.indices // 12).tolist() == [0, 1, 2, 3, 4]
    rows = RNG.normal(size=(11, 3)).cumsum(axis=0)

    def energy(cuts: tuple[int, ...]) -> float:
        return sum(((part - part.mean(axis=0)) ** 2).sum() for part in np.split(rows, cuts))

    best = min(combinations(range(1, 11), 2), key=energy)
    assert tuple(np.flatnonzero(np.diff(key_frames(rows, 3, by="scenes").labels)) + 1) == best


def test_auto_finds_the_number_of_shots() -> None:
    assert len(key_frames(FILM, "auto").indices) == 4


def test_more_key_frames_than_frames_are_refused() -> None:
    with pytest.raises(ValueError, match=r"n_frames=49 must be in 1\.\.48, the number of frames"):
        key_frames(FILM, 49)


def test_frames_that_differ_limit_their_number() -> None:
    film = np.repeat(np.eye(3)[:2], 5, axis=0)
    with pytest.raises(ValueError, match=r"^n_frames=4 must be in 1\.\.2, the number of frames that differ"):
        key_frames(film, 4)
    with pytest.raises(ValueError, match=r"^n_modes=4 must be in 1\.\.2, the number of snapshots that differ"):
        reduced_basis(film, 4, kind="cvt")
    with pytest.raises(ValueError, match=r"^n_cells=4 must be in 1\.\.2, the number of snapshots that differ"):
        reduced_basis(film, 1, kind="cvod", n_cells=4)
    assert reduced_basis(film, "auto", kind="cvt").n_modes <= 2

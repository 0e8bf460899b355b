from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from damaging import SCRIPT, card, damage
from PIL import Image

Damage = damage.Damage


def test_the_same_seed_gives_the_same_versions() -> None:
    clean, _ = card()
    everything = Damage(noise=0.2, holes=0.1, blocks=1, scratches=1, occlusions=1)
    one, other, third = (damage.damaged_versions(clean, 2, everything, seed) for seed in (4, 4, 5))
    for a, b, c in zip(one[0], other[0], third[0], strict=True):
        np.testing.assert_array_equal(a, b)
        assert (a != c).any()


def test_noise_and_holes_are_as_much_as_was_asked_for() -> None:
    clean, _ = card()
    versions, known = damage.damaged_versions(clean, 2, Damage(noise=0.2, holes=0.3), seed=0)
    for version, mask in zip(versions, known, strict=True):
        assert np.mean(~mask) == pytest.approx(0.3, abs=0.02)
        assert np.std((version - clean)[mask]) == pytest.approx(0.2, rel=0.03)
        assert (version[~mask] == 0).all()


def test_what_is_painted_over_has_the_color_of_the_background_and_is_there_in_the_other_versions() -> None:
    clean, which = card()
    versions, known = damage.damaged_versions(clean, 3, Damage(occlusions=2), seed=0)
    assert np.all(known)
    changed = [(version != clean).any(axis=2) for version in versions]
    assert all(one.any() for one in changed)
    assert np.sum(changed, axis=0).max() == 1
    for version, where in zip(versions, changed, strict=True):
        np.testing.assert_allclose(version[where], np.broadcast_to(clean[which == 0][0], version[where].shape))


def test_blocks_and_scratches_are_lost() -> None:
    clean, _ = card()
    for suffered, most in ((Damage(blocks=1), 0.1), (Damage(scratches=1), 0.15)):
        _, known = damage.damaged_versions(clean, 1, suffered, seed=0)
        assert 0.01 < np.mean(~known[0]) < most


def test_the_script_writes_versions_with_alpha(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    picture = SCRIPT.parent / "drawing.png"
    arguments = [str(picture), "--out-dir", str(tmp_path), "--versions", "2", "--holes", "0.5", "--seed", "3"]
    monkeypatch.setattr(sys, "argv", ["damage.py", *arguments])
    damage.main()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["drawing_1.png", "drawing_2.png"]
    with Image.open(tmp_path / "drawing_1.png") as image:
        rgba = np.asarray(image)
    assert rgba.shape == (192, 256, 4)
    assert np.mean(rgba[:, :, 3] == 0) == pytest.approx(0.5, abs=0.01)

import sys
from pathlib import Path

import numpy as np
import pytest
from damaging import SCRIPT, card, damage
from PIL import Image

Damage = damage.Damage


def test_noise_and_holes_are_as_much_as_was_asked_for() -> None:
    clean, _ = card()
    versions, known = damage.damaged_versions(clean, 2, Damage(noise=0.2, holes=0.3), seed=0)
    for version, mask in zip(versions, known, strict=True):
        assert np.mean(~mask) == pytest.approx(0.3, abs=0.02)
        assert np.std((version - clean)[mask]) == pytest.approx(0.2, rel=0.03)
        assert (version[~mask] == 0).all()


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

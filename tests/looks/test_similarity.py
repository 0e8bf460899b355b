"""The measure of looks, against the package `ssimulacra2` and by what it must say."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import cvtimg
from cvtimg.looks import visual_quality

COFFEE = cvtimg.read_image("sample_images/coffee.png")[100:260, 200:420]


@pytest.mark.parametrize(("rows", "columns"), [(160, 220), (64, 64), (37, 101), (15, 200), (8, 9)])
def test_it_equals_the_reference(rows: int, columns: int, tmp_path: Path) -> None:
    ssimulacra2 = pytest.importorskip("ssimulacra2")
    original = COFFEE[:rows, :columns]
    for name, image in {"a.png": original, "b.png": original // 32 * 32 + 16}.items():
        Image.fromarray(image).save(tmp_path / name)
    expected = ssimulacra2.compute_ssimulacra2(str(tmp_path / "a.png"), str(tmp_path / "b.png"))
    assert visual_quality(original, original // 32 * 32 + 16) == pytest.approx(expected, abs=0.01)


def test_what_is_transparent_is_not_seen() -> None:
    clear = np.dstack([COFFEE, np.zeros(COFFEE.shape[:2], np.uint8)])
    other = clear.copy()
    other[:, :, :3] = 0
    assert visual_quality(clear, other) == pytest.approx(100, abs=0.01)


def test_images_of_other_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"image of \(10, 12\) pixels must have the size of the original"):
        visual_quality(COFFEE, COFFEE[:10, :12])
    with pytest.raises(ValueError, match=r"shape \(2, 2, 5\)"):
        visual_quality(np.zeros((2, 2, 5)), np.zeros((2, 2, 5)))


def test_the_content_of_a_photograph_has_its_visual_quality_and_that_of_a_small_logo_is_worse() -> None:
    cat = cvtimg.read_image("sample_images/chelsea.png")[:128, :160]
    assert cvtimg.content_quality(cat, cat // 32 * 36) == pytest.approx(cvtimg.visual_quality(cat, cat // 32 * 36))
    canvas = np.full((400, 500, 3), 255, np.uint8)
    canvas[:128, :160] = cat
    flat = np.where(canvas < 255, canvas // 32 * 36, 255)
    assert cvtimg.content_quality(canvas, flat) < cvtimg.visual_quality(canvas, flat) - 5


def test_what_is_seen_on_white_alone_counts() -> None:
    rng = np.random.default_rng(0)
    veil = np.zeros((64, 64, 4), np.uint8)
    veil[..., 3] = rng.integers(0, 60, (64, 64))
    flat = veil.copy()
    flat[..., 3] = 30
    assert cvtimg.content_quality(veil, flat) < cvtimg.visual_quality(veil, flat) - 2
    assert cvtimg.content_quality(veil, veil) > 99

"""Sprite sheets: frames in cells, there and back, with their description."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cvtimg import quantize, read_image, write_image
from cvtimg.pictures import Frames, cut_sheet, read_sheet, sprite_sheet, write_sheet


def film(n_frames: int, shape: tuple[int, ...], seed: int = 0) -> Frames:
    images = np.random.default_rng(seed).integers(1, 256, (n_frames, *shape), np.uint8)
    return Frames(tuple(images), tuple(40.0 + 10 * number for number in range(n_frames)), 0)


def opaque(image: NDArray[Any]) -> NDArray[Any]:
    """Return an image with alpha."""
    color = np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image[..., :3]
    alpha = image[..., 3:] if image.shape[2:] == (4,) else np.full((*image.shape[:2], 1), 255, np.uint8)
    return np.concatenate([color, alpha], axis=2)


@given(
    st.integers(1, 9),
    st.tuples(st.integers(1, 5), st.integers(1, 5)),
    st.sampled_from([(), (3,), (4,)]),
    st.none() | st.integers(1, 9),
    st.integers(0, 2),
    st.integers(0, 2),
)
def test_a_sheet_is_cut_into_the_frames_that_it_was_made_of(
    n_frames: int, size: tuple[int, int], channels: tuple[int, ...], columns: int | None, margin: int, spacing: int
) -> None:
    frames = film(n_frames, (*size, *channels))
    sheet = sprite_sheet(frames, columns=columns, margin=margin, spacing=spacing)
    again = cut_sheet(sheet, size[::-1], margin=margin, spacing=spacing)
    # Cells after the last frame are empty in the last row, and more columns than frames are not made.
    assert len(again.images) == n_frames
    for image, other in zip(frames.images, again.images, strict=True):
        assert (opaque(image) == opaque(other)).all()


def test_gaps_are_transparent_and_a_full_sheet_keeps_its_channels() -> None:
    frames = film(4, (3, 3, 3))
    assert sprite_sheet(frames).shape == (6, 6, 3)
    sheet = sprite_sheet(frames, columns=2, margin=2, spacing=1)
    assert sheet.shape == (11, 11, 4)
    assert np.count_nonzero(sheet[..., 3]) == 4 * 9
    assert (sheet[2:5, 6:9, :3] == frames.images[1]).all()


def test_cells_that_do_not_fill_the_sheet_are_refused() -> None:
    sheet = np.zeros((8, 10), np.uint8)
    with pytest.raises(ValueError, match="cell=4x4 must divide the width of the sheet, 10"):
        cut_sheet(sheet, (4, 4))
    with pytest.raises(ValueError, match="height of the sheet, 8, margin=1 and spacing=0"):
        cut_sheet(sheet, (8, 4), margin=1)
    with pytest.raises(ValueError, match="width"):
        cut_sheet(sheet, (12, 8))
    with pytest.raises(ValueError, match="spacing=-1 must be an integer >= 0"):
        cut_sheet(sheet, (5, 4), spacing=-1)


def test_the_description_brings_frames_and_durations_back(tmp_path: Path) -> None:
    frames = film(5, (4, 6, 4))
    write_sheet(tmp_path / "walk.png", frames, data=tmp_path / "walk.json", columns=2, margin=1, spacing=3)
    again = read_sheet(tmp_path / "walk.json")
    assert again.durations == frames.durations
    assert (np.stack(again.images) == np.stack(frames.images)).all()
    content = json.loads((tmp_path / "walk.json").read_text())
    assert content["frames"]["walk 3"]["frame"] == {"x": 10, "y": 8, "w": 6, "h": 4}
    assert content["meta"]["size"] == {"w": 17, "h": 20}


def test_lists_and_trimmed_frames_of_other_programs_are_read(tmp_path: Path) -> None:
    sheet = film(1, (4, 8, 4)).images[0]
    write_image(tmp_path / "s.png", sheet)
    whole = {"frame": {"x": 0, "y": 0, "w": 4, "h": 4}, "trimmed": False}
    trimmed = {
        "frame": {"x": 5, "y": 1, "w": 2, "h": 3},
        "trimmed": True,
        "spriteSourceSize": {"x": 1, "y": 1, "w": 2, "h": 3},
        "sourceSize": {"w": 4, "h": 4},
        "duration": 70,
    }
    (tmp_path / "s.json").write_text(json.dumps({"frames": [whole, trimmed], "meta": {"image": "s.png"}}))
    again = read_sheet(tmp_path / "s.json")
    assert again.durations == (100, 70)
    assert (again.images[0] == sheet[:, :4]).all()
    assert (again.images[1][1:, 1:3] == sheet[1:4, 5:7]).all()
    assert np.count_nonzero(again.images[1][..., 3]) == 6


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "describes no sprite sheet"),
        ("[]", "describes no sprite sheet"),
        ('{"frames": {}, "meta": {"image": "s.png"}}', "has no frames"),
        (
            '{"frames": [{"frame": {"x": 0, "y": 0, "w": 9, "h": 1}}], "meta": {"image": "s.png"}}',
            "has a frame of 9x1 at 0, 0, outside s.png",
        ),
        ('{"frames": [{"frame": {"x": "a", "y": 0, "w": 9, "h": 1}}], "meta": {"image": "s.png"}}', "s.json: "),
        (
            '{"frames": [{"frame": {"x": 0, "y": 0, "w": 1, "h": 1}, "rotated": true}], "meta": {"image": "s.png"}}',
            "has a frame that is rotated",
        ),
        ('{"frames": [{"frame": {"x": 0, "y": 0, "w": 1, "h": 1}}], "meta": {"image": "none.png"}}', "none.png"),
    ],
)
def test_descriptions_of_no_sheet_are_named(content: str, message: str, tmp_path: Path) -> None:
    write_image(tmp_path / "s.png", np.zeros((4, 4), np.uint8))
    (tmp_path / "s.json").write_text(content)
    with pytest.raises(OSError, match=message):
        read_sheet(tmp_path / "s.json")


def test_a_quantized_sheet_keeps_its_cells(tmp_path: Path, photograph: NDArray[Any]) -> None:
    frames = Frames(tuple(photograph[at : at + 16, :16].copy() for at in range(0, 80, 16)), (50,) * 5, 0)
    sheet = sprite_sheet(frames, columns=3, spacing=2)
    result = quantize(sheet, 8, alpha=True)
    result.save(tmp_path / "sheet.png")
    cut = cut_sheet(read_image(tmp_path / "sheet.png"), (16, 16), spacing=2)
    assert len(cut.images) == 5
    assert all((image[..., 3] == 255).all() for image in cut.images)
    assert len(np.unique(np.concatenate([image.reshape(-1, 4) for image in cut.images]), axis=0)) == 7

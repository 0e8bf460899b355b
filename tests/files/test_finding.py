"""Names, folders and patterns stand for the images that a shell would find."""

import re
from pathlib import Path
from typing import Any

import pytest

from cvtimg.files import find_images


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("b.PNG", "a.jpg", "notes.txt", "sub/c.tif", "sub/deep/d.webp", "table.h5"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    for name in (".hidden.png", ".cache/e.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "trap.png").mkdir()
    return tmp_path


def found(folder: Path, paths: Any) -> list[str]:
    return [path.relative_to(folder).as_posix() for path in find_images(paths)]


def test_a_folder_stands_for_the_pictures_below_it_in_order(folder: Path) -> None:
    assert found(folder, folder) == ["a.jpg", "b.PNG", "sub/c.tif", "sub/deep/d.webp"]


def test_a_file_given_by_name_is_kept_whatever_its_suffix_and_once(folder: Path) -> None:
    paths = [folder / "notes.txt", str(folder / "b.PNG"), folder / "notes.txt", folder / "sub"]
    assert found(folder, paths) == ["notes.txt", "b.PNG", "sub/c.tif", "sub/deep/d.webp"]


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ("*.jpg", ["a.jpg"]),
        ("[ab].*", ["a.jpg", "b.PNG"]),
        ("note?.txt", ["notes.txt"]),
        ("s*", ["sub/c.tif", "sub/deep/d.webp"]),
        ("**/*.webp", ["sub/deep/d.webp"]),
    ],
)
def test_a_pattern_stands_for_what_a_shell_would_find(folder: Path, pattern: str, expected: list[str]) -> None:
    assert found(folder, [folder / pattern]) == expected


def test_outputs_beside_their_inputs_are_no_inputs_unless_they_are_named(folder: Path) -> None:
    for name in ("a-labels.png", "a-overlay.tif", "b_cp_masks.png", "other-labels.png"):
        (folder / name).touch()
    assert found(folder, folder) == ["a.jpg", "b.PNG", "other-labels.png", "sub/c.tif", "sub/deep/d.webp"]
    assert found(folder, [folder / "a-labels.png", folder / "b*"]) == ["a-labels.png", "b.PNG", "b_cp_masks.png"]


def test_a_file_whose_name_looks_like_a_pattern_is_itself(folder: Path) -> None:
    (folder / "x[1].png").touch()
    assert found(folder, [folder / "x[1].png"]) == ["x[1].png"]


@pytest.mark.parametrize(
    ("name", "reason"), [("none.png", "no such file"), ("*.gif", "no file matches"), ("trap.png", "no images in")]
)
def test_what_stands_for_nothing_is_named(folder: Path, name: str, reason: str) -> None:
    with pytest.raises(FileNotFoundError, match="^" + re.escape(f"{folder / name}: {reason}")):
        find_images([folder / name])

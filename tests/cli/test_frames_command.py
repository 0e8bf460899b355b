"""``cvtimg frames``: animations, sprite sheets and single frames, each from the others."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg import read_image, write_image
from cvtimg.cli import app as cli
from cvtimg.pictures import Frames, read_frames, write_frames


@pytest.fixture
def walk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> NDArray[Any]:
    """Write the frames of an animation, walk1.png to walk12.png, and return them."""
    monkeypatch.chdir(tmp_path)
    colors = np.array([[0, 0, 0, 0], [200, 40, 50, 255], [40, 60, 160, 255], [90, 50, 20, 255]], np.uint8)
    images = colors[np.random.default_rng(0).integers(0, 4, (12, 6, 8))]
    for number, image in enumerate(images, start=1):
        write_image(f"walk{number}.png", image)
    return images


def frames(*words: str) -> int:
    return cli.main(["frames", *words, "--quiet"])


def shown(image: NDArray[Any]) -> NDArray[Any]:
    """Return an image whose transparent pixels are black."""
    return image * (image[..., 3:] > 0)


@pytest.mark.parametrize("film", ["walk.gif", "walk.png", "walk.webp"])
def test_frames_become_an_animation_a_sheet_and_frames_again(film: str, walk: NDArray[Any]) -> None:
    names = sorted(path.name for path in Path().glob("walk*.png"))  # walk10.png before walk2.png, as shells list them
    assert frames(*names, "-o", film, "--duration", "80") == 0
    assert frames(film, "--sheet", "sheet.png", "--data", "sheet.json", "--sheet-columns", "5", "--spacing", "1") == 0
    assert read_image("sheet.png").shape == (3 * 6 + 2, 5 * 8 + 4, 4)
    assert frames("sheet.json", "-o", "again.webp", "--out-dir", "one") == 0
    again = read_frames("again.webp")
    assert again.durations == (80.0,) * 12
    assert frames("sheet.png", "--cell", "8x6", "--spacing", "1", "-o", "cut.png") == 0
    cut = read_frames("cut.png")
    for number, image in enumerate(walk):
        for other in (again.images[number], cut.images[number], read_image(f"one/frame-{number:02}.png")):
            assert (shown(other) == image).all()


def test_an_order_that_is_given_is_kept(walk: NDArray[Any]) -> None:
    assert frames("walk2.png", "walk10.png", "walk1.png", "-o", "film.webp") == 0
    assert [
        int(abs(image.astype(int) - walk[n]).max())
        for image, n in zip(read_frames("film.webp").images, (1, 9, 0), strict=True)
    ] == [0, 0, 0]


def test_a_gif_gets_the_best_colors_if_it_has_too_many(walk: NDArray[Any], photograph: NDArray[Any]) -> None:
    small = photograph[::4, ::4]
    write_frames("many.webp", Frames((small.copy(), small[::-1].copy()), (40, 60), 0))
    assert frames("many.webp", "-o", "many.gif") == 0
    film = read_frames("many.gif")
    assert film.durations == (40.0, 60.0)
    assert ((film.images[0].astype(float) - small) ** 2).mean() < 60


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["walk1.png"], "one of -o, --sheet and --out-dir must be given"),
        (["walk1.png", "-o", "a.bmp"], "-o"),
        (["walk1.png", "-o", "a.gif", "--data", "a.json"], "--data needs --sheet"),
        (["walk1.png", "-o", "a.gif", "--cell", "8"], "'8' must be a width and a height"),
        (["walk1.png", "-o", "a.gif", "--cell", "5x6"], "cell=5x6 must divide the width of the sheet, 8"),
        (["walk1.png", "walk2.png", "-o", "a.gif", "--cell", "8x6"], "--cell cuts one sheet, and there are 2 inputs"),
        (["walk1.png", "-o", "a.gif", "--duration", "0"], "'0' must be a number > 0"),
        (["walk1.png", "--sheet", "walk1.png", "--overwrite"], "walk1.png"),
        (["walk1.png", "other.png", "-o", "a.gif"], "must have the same shape"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_line(
    words: list[str], message: str, walk: NDArray[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    write_image("other.png", np.zeros((3, 3), np.uint8))
    assert frames(*words) in (1, 2)
    error = capsys.readouterr().err
    assert message in error
    assert error.startswith("cvtimg: ")
    assert not Path("a.gif").exists()
    assert (read_image("walk1.png") == walk[0]).all()


def test_the_row_tells_the_frames(walk: NDArray[Any], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["frames", "walk1.png", "walk2.png", "--out-dir", "one", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert (row["frames"], row["width"], row["height"], row["durations"]) == (2, 8, 6, [100.0, 100.0])
    assert row["output"] == "one"

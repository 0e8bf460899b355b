from pathlib import Path

import numpy as np
import pytest
from commands import RowOf, Run

from cvtimg import read_image, reduced_basis, write_image
from cvtimg.bases import read_basis
from cvtimg.pictures import Frames, write_frames

RNG = np.random.default_rng(0)
SHOTS = RNG.integers(0, 200, (3, 16, 20, 3))
FILM = np.repeat(SHOTS, 5, axis=0) + RNG.integers(0, 20, (15, 16, 20, 3))
IMAGES = FILM.astype(np.uint8)


@pytest.fixture(autouse=True)
def film(here: Path) -> None:
    write_frames("film.png", Frames(tuple(IMAGES.copy()), (40,) * 15, 0))


@pytest.mark.parametrize("kind", ["pod", "cvt", "cvod"])
def test_the_basis_is_that_of_the_function(kind: str, row_of: RowOf) -> None:
    row = row_of("basis", "film.png", "-n", "2", "--kind", kind, "--cells", "3", "-o", "a.npz")
    expected = reduced_basis(IMAGES, 2, kind=kind, n_cells=3)
    assert (read_basis("a.npz").modes == expected.modes).all()
    assert (row["snapshots"], row["kind"], row["n"], row["energy"]) == (15, kind, 2, expected.energy)


@pytest.mark.slow
def test_sheets_and_plots_are_drawn(run: Run) -> None:
    run("basis", "film.png", "-n", "auto", "-o", "a.npz", "--sheet", "sheet.png", "--plot", "plot.svg")
    assert read_image("sheet.png").std() > 5
    assert "share of the variance" in Path("plot.svg").read_text()


def test_arrays_that_are_no_images_have_no_sheet(run: Run) -> None:
    np.save("rows.npy", RNG.normal(size=(12, 30)))
    assert run("basis", "rows.npy", "-n", "2", "-o", "rows.npz", "--quiet").status == 0
    outcome = run("basis", "rows.npy", "-n", "2", "-o", "b.npz", "--sheet", "s.png", "--quiet")
    assert "--sheet needs frames that are gray or RGB images, not snapshots of shape (30,)" in outcome.err


def test_a_folder_of_frames_is_an_animation(row_of: RowOf) -> None:
    Path("frames").mkdir()
    for number, image in enumerate(IMAGES):
        write_image(f"frames/{number:02}.png", image)
    assert row_of("basis", "frames", "-n", "auto", "-o", "a.npz")["snapshots"] == 15

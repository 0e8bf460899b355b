"""A shared palette is that of all pixels together, whoever counts them in whatever order."""

from pathlib import Path

import numpy as np
import pytest
from commands import Run

from cvtimg import find_palette, read_image, write_image
from cvtimg._shared.pixels import AlphaArray
from cvtimg.cli import app as cli
from cvtimg.colors.samples import color_samples
from cvtimg.quantization import shared_palette

RNG = np.random.default_rng(21)
PICTURES = [RNG.normal(center, 25, (20, 30, 3)).clip(0, 255).astype(np.uint8) for center in (40, 90, 150, 220, 60)]


@pytest.fixture
def folder(here: Path) -> Path:
    Path("in").mkdir()
    for number, picture in enumerate(PICTURES):
        write_image(f"in/{number}.png", picture)
    return here


def test_it_is_the_palette_of_one_picture_with_all_pixels() -> None:
    whole = find_palette(color_samples(np.concatenate(PICTURES)), 9)
    np.testing.assert_array_equal(shared_palette(PICTURES, 9).colors, whole.colors)


@pytest.mark.parametrize(
    "pictures",
    [
        PICTURES,
        [picture[..., :2] for picture in PICTURES],  # grey and alpha
        [np.dstack([picture, picture[..., 0]]) for picture in PICTURES],
        [picture.astype(np.uint16) * 211 for picture in PICTURES],
        [picture / 255 for picture in PICTURES],
        [np.concatenate([picture, picture], axis=2) for picture in PICTURES],
    ],
    ids=["rgb", "grey-alpha", "rgba", "deep", "float", "bands"],
)
def test_the_order_of_the_pictures_changes_no_bit(pictures: list[np.ndarray]) -> None:
    first = shared_palette(pictures, 7, init="k-means++")
    for order in ([4, 3, 2, 1, 0], [2, 0, 4, 1, 3]):
        other = shared_palette([pictures[n] for n in order], 7, init="k-means++")
        assert first.colors.tobytes() == other.colors.tobytes()


def test_grey_and_color_and_transparency_go_together() -> None:
    grey, rgba = PICTURES[0][..., 0], np.dstack([PICTURES[1], PICTURES[2][..., 0]]).view(AlphaArray)
    assert shared_palette([grey, PICTURES[1]], 5).colors.shape == (5, 3)
    assert shared_palette([grey, rgba, PICTURES[3].astype(np.uint16) * 257], 5).colors.shape == (5, 4)


def test_what_does_not_go_together_is_refused() -> None:
    with pytest.raises(ValueError, match="one type and number of channels"):
        shared_palette([PICTURES[0], PICTURES[0] / 255], 4)
    with pytest.raises(ValueError, match="at least one"):
        shared_palette([], 4)


@pytest.mark.slow
def test_files_are_the_same_whatever_the_jobs_and_hold_the_palette(folder: Path) -> None:
    options = ["quantize", "-k", "9", "--shared-palette", "--quiet"]
    assert cli.main([*options, "in", "--out-dir", "one", "--jobs", "1", "--save-palette", "p.gpl"]) == 0
    names = [f"in/{n}.png" for n in (3, 1, 4, 0, 2)]
    assert cli.main([*options, *names, "--out-dir", "two", "--jobs", "2"]) == 0
    palette = {tuple(color) for color in shared_palette(PICTURES, 9).colors.tolist()}
    for n in range(len(PICTURES)):
        assert Path(f"one/{n}.png").read_bytes() == Path(f"two/{n}.png").read_bytes()
        assert {tuple(pixel) for pixel in read_image(f"one/{n}.png").reshape(-1, 3).tolist()} <= palette
    assert len(Path("p.gpl").read_text().splitlines()) == 4 + len(palette)


def test_a_bad_picture_is_named_once_and_the_others_share(folder: Path, run: Run) -> None:
    Path("in/bad.png").write_text("no picture")
    options = ["quantize", "-k", "9", "--shared-palette", "--quiet"]
    assert run(*options, "in", "--out-dir", "out").err.count("in/bad.png") == 1
    assert len(list(Path("out").iterdir())) == len(PICTURES)
    assert run(*options, "in/bad.png", "-o", "no.png").err.count("in/bad.png") == 1


@pytest.mark.parametrize("others", [["--psnr", "30"], ["--max-bytes", "900"], ["--palette", "in/0.png"], []])
def test_it_needs_a_number_of_colors_and_goes_with_no_other_aim(folder: Path, others: list[str]) -> None:
    assert cli.main(["quantize", "in", "--shared-palette", "--out-dir", "out", *others]) == 2

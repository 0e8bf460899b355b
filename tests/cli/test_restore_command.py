"""``cvtimg restore``: what it writes, reports and refuses."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Run
from damaging import card, damage, psnr
from PIL import Image, ImageDraw
from scipy.ndimage import gaussian_filter

from cvtimg import quantize_frames, read_image, write_image
from cvtimg._shared.types import Array
from cvtimg.cli import app as cli
from cvtimg.pictures import Frames, Pages, read_frames, read_pages, write_frames, write_pages

CLEAN = card(64)[0]


@pytest.fixture
def run(run: Run) -> Run:
    """Run the command in a folder with three damaged versions and their masks."""
    versions, known = damage.damaged_versions(CLEAN, 3, damage.Damage(noise=0.1, holes=0.2, blocks=1), seed=0)
    for number, (version, mask) in enumerate(zip(versions, known, strict=True), start=1):
        damage.save(Path(f"v_{number}.png"), version, mask)
        write_image(f"rgb_{number}.png", read_image(f"v_{number}.png")[:, :, :3].copy())
        write_image(f"mask_{number}.png", mask)
    return lambda *arguments: run("restore", *arguments)


def test_masks_on_disk_say_what_alpha_says(run: Run) -> None:
    how = ["-k", "4", "--effort", "fast", "-o"]
    run("v_1.png", "v_2.png", "v_3.png", *how, "alpha.png")
    masks = [word for number in (1, 2, 3) for word in ("--mask", f"mask_{number}.png")]
    assert run("rgb_1.png", "rgb_2.png", "rgb_3.png", *masks, *how, "masks.png")[0] == 0
    np.testing.assert_array_equal(read_image("masks.png"), read_image("alpha.png"))
    assert run("rgb_1.png", "rgb_2.png", "rgb_3.png", "--nodata", "0", *how, "nodata.png")[0] == 0
    np.testing.assert_array_equal(read_image("nodata.png"), read_image("alpha.png"))


def test_json_tells_of_every_version(run: Run) -> None:
    status, out, _ = run("v_*.png", "-k", "4", "--effort", "fast", "-o", "whole.png", "--json")
    row = json.loads(out)
    assert status == 0
    assert [Path(name).name for name in row["inputs"]] == ["v_1.png", "v_2.png", "v_3.png"]
    assert row["versions"] == len(row["noise"]) == len(row["weights"]) == len(row["shifts"]) == 3
    assert row["k"] == 4
    assert 0 < row["unknown"] < 0.1
    assert set(row["seconds"]) == {"read", "cluster", "write"}
    assert run("v_*.png", "-k", "4", "--effort", "fast", "-o", "more.png", "--quiet") == (0, "", "")


def test_the_sheet_has_the_versions_and_the_restored_picture(run: Run) -> None:
    assert run("v_*.png", "-k", "4", "--effort", "fast", "-o", "whole.png", "--sheet", "sheet.svg")[0] == 0
    sheet = Path("sheet.svg").read_text()
    assert all(text in sheet for text in ("v_1.png", "v_2.png", "v_3.png", "restored: 4 segments", "versions used"))


def test_max_pixels_guards_each_version_and_the_report_tells(run: Run) -> None:
    how = ["v_1.png", "v_2.png", "-k", "4", "--effort", "fast", "-o", "out.png", "--report", "rows.jsonl"]
    status, _, err = run(*how, "--max-pixels", "99")
    assert (status, err.count("has over 99 pixels")) == (1, 2)
    assert [json.loads(line)["status"] for line in Path("rows.jsonl").read_text().splitlines()] == ["failed"] * 2
    assert run(*how, "--overwrite", "--json")[0] == 0
    (row,) = [json.loads(line) for line in Path("rows.jsonl").read_text().splitlines()]
    assert (row["status"], row["inputs"]) == ("done", ["v_1.png", "v_2.png"])
    before = Path("v_2.png").read_bytes()
    assert run("v_1.csv", "v_2.png", "-k", "4", "-o", "out.png", "--report", "v_2.png", "--overwrite")[0] == 2
    assert Path("v_2.png").read_bytes() == before


def test_a_version_given_twice_is_told(run: Run) -> None:
    status, _, err = run("v_1.png", "v_2.png", "v_1.png", "-k", "4", "--effort", "fast", "-o", "a.png")
    assert (status, "v_1.png is given more than once and counts once" in err) == (0, True)
    assert "more than once" not in run("v_1.png", "v_2.png", "-k", "4", "--effort", "fast", "-o", "b.png")[2]


@pytest.mark.slow
def test_what_is_left_of_stripes_and_the_noise_that_is_known_are_told(run: Run, photograph: Array) -> None:
    part = np.ascontiguousarray(photograph[:96, :96])
    rows = np.random.default_rng(1).normal(0, 8, (96, 1, 1))
    write_image("rows.png", np.clip(np.rint(part + rows), 0, 255).astype(np.uint8))
    write_image("a.png", part)
    write_image("b.png", part)
    fast = ("--detail", "--effort", "fast", "-o", "c.png", "--overwrite")
    assert re.search(
        r"rows of the result differ by [4-9]\.\d levels", "".join(run("rows.png", *fast, "--hidden", "none")[1:])
    )
    told = re.search(r"no noise found: (.*); --noise", "".join(run("a.png", "b.png", *fast)[1:]))
    assert told is None or re.fullmatch(r"0\.\d\d", told[1])


@pytest.mark.slow
def test_a_version_that_does_not_fit_is_told_by_its_name(run: Run, photograph: Array) -> None:
    small = np.ascontiguousarray(photograph[::2, ::2])
    write_image("upright.png", small)
    write_image("upside_down.png", small[::-1])
    status, _, err = run("upright.png", "upside_down.png", "-k", "4", "--effort", "fast", "-o", "a.png")
    assert status == 0
    assert re.search(r"upside_down\.png cannot be laid over .*upright\.png and is left out", err)


@pytest.mark.slow
def test_photographs_are_recognized_and_both_options_force(run: Run, photograph: Array) -> None:
    noise = np.random.default_rng(0).normal(0, 18, (64, 64, 3))
    write_image("photo.png", np.clip(photograph[40:104, 80:144] + noise, 0, 255).astype(np.uint8))
    status, _, said = run("photo.png", "-o", "chosen.png", "--effort", "fast")
    assert status == 0
    assert "no flat drawing, so detail is restored" in said
    said = run("photo.png", "-o", "asked.png", "--effort", "fast", "--detail")[2]
    assert "flat" not in said
    np.testing.assert_array_equal(read_image("chosen.png"), read_image("asked.png"))
    assert "flat" not in run("photo.png", "-o", "segments.png", "-k", "4", "--effort", "fast")[2]
    assert len(np.unique(read_image("segments.png").reshape(-1, 3), axis=0)) <= 4
    assert "flat" not in run("v_*.png", "-o", "drawing.png", "--effort", "fast")[2]


@pytest.mark.slow
def test_the_report_says_what_noise_is_like(run: Run, photograph: Array) -> None:
    noise = gaussian_filter(np.random.default_rng(0).normal(0, 50, (64, 64, 3)), (0.8, 0.8, 0))
    write_image("photo.png", np.clip(photograph[40:104, 80:144] + noise, 0, 255).astype(np.uint8))

    def reported(*options: str) -> dict[str, Any]:
        status, out, _ = run("photo.png", "-o", "out.png", "--overwrite", "--effort", "fast", "--json", *options)
        assert status == 0
        return dict(json.loads(out))

    found = reported("--detail")
    assert found["noise_like"] == "shared"
    np.testing.assert_allclose(np.mean(np.square(found["noise_bands"])), found["noise"][0] ** 2)
    assert 0.4 < found["noise_neighbors"] < 0.9
    white = reported("--detail", "--noise-like", "white", "--noise", "12")
    assert (white["noise_like"], white["noise"]) == ("white", [12.0])
    assert "noise_like" not in reported("-k", "4")
    assert run("photo.png", "-o", "no.png", "--noise", "0")[0] == 2


def test_info_measures_the_noise_of_any_picture(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    noise = np.random.default_rng(0).normal(0, 8, (96, 96))
    write_image("gray.tif", (np.clip(120 + noise, 0, 255) * 257).astype(np.uint16))
    write_image("tiny.png", np.zeros((2, 2), np.uint8))
    assert cli.main(["info", "gray.tif", "tiny.png", "--noise", "--json"]) == 0
    gray, tiny = map(json.loads, capsys.readouterr().out.splitlines())
    assert gray["noise"] == pytest.approx(8, rel=0.15)
    assert (gray["noise_slope"], gray["noise_neighbors"], tiny["noise"]) == (0, 0, None)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["gif", "png", "tif"])
def test_films_stay_films_with_their_durations(run: Run, photograph: Array, suffix: str) -> None:
    rng = np.random.default_rng(0)
    clean = [photograph[number : number + 48, 40:104] for number in range(3)]
    images = tuple(np.clip(one + rng.normal(0, 12, one.shape), 0, 255).astype(np.uint8) for one in clean)
    frames, name = Frames(images, (40.0, 70.0, 1000.0), 3), f"film.{suffix}"
    if suffix == "tif":
        write_pages(name, Pages(images, "T", (3,), "ome"))
    elif suffix == "gif":
        quantize_frames(frames, 256).save(name)
    else:
        write_frames(name, frames)
    status, out, _ = run(name, "-o", f"out.{suffix}", "--effort", "fast", "--json")
    row = json.loads(out)
    assert (status, row["pages"], row["versions"]) == (0, 3, 1)
    before, after = (read_pages(one) if suffix == "tif" else read_frames(one) for one in (name, f"out.{suffix}"))
    for one, other, truth in zip(before.images, after.images, clean, strict=True):
        assert psnr(other / 255, truth / 255) > psnr(one / 255, truth / 255) + 3
    if isinstance(after, Frames):
        assert isinstance(before, Frames)
        assert (after.durations, after.plays) == (before.durations, before.plays)
    else:
        assert after.axes == "T"
    assert run(name, "-o", "out.jpg")[0] == 1
    assert not Path("out.jpg").exists()


def test_transparency_comes_back_and_names_have_a_default(run: Run, photograph: Array) -> None:
    alpha = np.where(np.indices((64, 64)).sum(axis=0) < 40, 0, 255).astype(np.uint8)
    alpha[40:50] = 90
    write_image("cut.png", np.dstack([photograph[40:104, 60:124], alpha]))
    run("cut.png", "--effort", "fast")
    np.testing.assert_array_equal(read_image("cut-restored.png")[:, :, 3], alpha)
    run("cut.png", "--effort", "fast", "--fill-transparent", "-o", "filled.png")
    assert read_image("filled.png").shape == (64, 64, 3)


@pytest.mark.slow
def test_faint_text_is_no_drawing(run: Run) -> None:
    page = Image.new("L", (160, 120), 200)
    for line in range(0, 120, 12):
        ImageDraw.Draw(page).text((2, line), "neither flat nor a drawing", fill=90)
    noisy = np.asarray(page) + np.random.default_rng(0).normal(0, 30, (120, 160))
    write_image("page.png", np.clip(noisy, 0, 255).astype(np.uint8))
    assert "no flat drawing" in run("page.png", "-o", "out.png", "--effort", "fast")[2]


def test_a_gif_of_one_frame_is_restored_into_a_png(tmp_path: Path) -> None:
    write_image(tmp_path / "a.gif", np.eye(24, dtype=np.uint8), palette=np.uint8([[9, 9, 200], [250, 240, 0]]))
    assert cli.main(["restore", str(tmp_path / "a.gif"), "-k", "2"]) == 0
    assert (tmp_path / "a-restored.png").exists()

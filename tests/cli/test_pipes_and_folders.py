"""Images come and go through pipes, and many files of a folder keep what they are."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from commands import RowOf, Run
from PIL import Image

from cvtimg import quantize, quantize_frames, read_image, write_image
from cvtimg.options.common import n_bytes
from cvtimg.pictures import Frames, image_info, read_frames

pytestmark = pytest.mark.timeout(120)
RNG = np.random.default_rng(21)
RGB = RNG.integers(0, 256, (24, 32, 3), np.uint8)
posix = pytest.mark.skipif(os.name == "nt", reason="POSIX pipes")


@pytest.fixture(autouse=True)
def picture(here: Path) -> None:
    """Work in an empty folder but for a.png."""
    write_image("a.png", RGB)


# Pipes


@pytest.mark.slow
@posix
def test_dev_stdin_is_standard_input(run: Run) -> None:
    content = Path("a.png").read_bytes()
    assert run("quantize", "-k", "5", "a.png", "-o", "b.png").status == 0
    command = [sys.executable, "-P", "-m", "cvtimg", "quantize", "/dev/stdin", "-k", "5"]
    assert subprocess.run(command, input=content, capture_output=True).stdout == Path("b.png").read_bytes()


def test_tables_arrays_and_figures_are_read_from_standard_input(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fed(content: bytes, *command: str) -> str:
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(content)))
        outcome = run(*command)
        assert outcome.status == 0
        return outcome.out

    table = b"x,y\n0,0\n0,1\n9,9\n9,8\n"
    head, *labels = fed(table, "cluster", "-", "-k", "2", "--labels-only").split()
    assert head == "label"
    assert labels in (["0", "0", "1", "1"], ["1", "1", "0", "0"])
    buffer = io.BytesIO()
    np.save(buffer, RGB.astype(np.float32))
    row = json.loads(fed(buffer.getvalue(), "info", "-", "--json"))
    assert (row["input"], row["width"], row["height"]) == ("-", 32, 24)
    for command in (["palette", "-", "-k", "3"], ["elbow", "-", "--k-max", "4"]):
        assert fed(Path("a.png").read_bytes(), *command).startswith(("-: 3 of", "input"))


# Folders


def names(folder: str) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in Path(folder).rglob("*") if path.is_file())


def test_inputs_that_differ_in_their_suffix_alone_keep_it(run: Run) -> None:
    Path("in").mkdir()
    for name in ("a.png", "a.webp", "a.tif", "b.webp"):
        write_image(f"in/{name}", RGB)
    assert run("quantize", "in", "-k", "4", "--out-dir", "out", "--quiet").status == 0
    assert names("out") == ["a.png", "a.tif.png", "a.webp.png", "b.png"]


def test_ext_ends_the_names_of_outputs_beside_their_inputs(run: Run) -> None:
    write_image("b.png", RGB)
    assert run("quantize", "a.png", "b.png", "-k", "4", "--ext", "-small.webp", "--quiet").status == 0
    assert names(".") == ["a-small.webp", "a.png", "b-small.webp", "b.png"]
    assert run("quantize", "a.png", "-k", "4", "--ext", ".tif", "--out-dir", "out", "--quiet").status == 0
    assert names("out") == ["a.tif"]


def test_gifs_of_a_folder_stay_animated_gifs(run: Run) -> None:
    Path("in").mkdir()
    frames = tuple(np.roll(RGB, number, axis=0) for number in range(3))
    quantize_frames(Frames(frames, (40.0,) * 3, 0), 200).save("in/film.gif")
    write_image("in/still.webp", RGB)
    assert run("quantize", "in", "-k", "8", "--out-dir", "out", "--quiet").status == 0
    assert names("out") == ["film.gif", "still.png"]
    assert len(read_frames("out/film.gif").images) == 3


def test_in_place_replaces_each_input_by_a_whole_output(run: Run) -> None:
    write_image("b.webp", RGB)
    assert run("quantize", "a.png", "b.webp", "-k", "4", "--in-place", "--quiet").status == 0
    expected = quantize(RGB, 4).image
    for name in ("a.png", "b.webp"):
        np.testing.assert_array_equal(read_image(name), expected)
    assert names(".") == ["a.png", "b.webp"]


def test_in_place_keeps_the_original_of_what_fails(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    before = Path("a.png").read_bytes()

    def fail(*_: object, **__: object) -> None:
        assert Path("a.png").read_bytes() == before
        raise KeyboardInterrupt

    monkeypatch.setattr("shutil.copyfileobj", fail)
    assert run("quantize", "a.png", "-k", "4", "--in-place", "--quiet").status == 130
    assert Path("a.png").read_bytes() == before
    assert names(".") == ["a.png"]
    Image.fromarray(RGB).save("photo.jpg")
    assert run("quantize", "photo.jpg", "-k", "4", "--in-place", "--quiet").status == 1


def test_outputs_that_are_no_smaller_are_not_written(run: Run, row_of: RowOf) -> None:
    row = row_of("quantize", "a.png", "-k", "4", "-o", "small.png", "--skip-if-larger")
    assert row["output_bytes"] == Path("small.png").stat().st_size < row["input_bytes"]
    options = ["-k", "256", "--skip-if-larger", "--json", "--report", "r.csv"]
    (row,) = run("quantize", "small.png", *options, "-o", "again.png").rows
    assert (row["output"], row["skipped"]) == (None, "output not smaller")
    assert not Path("again.png").exists()
    assert "skipped,small.png" in Path("r.csv").read_text()
    Image.fromarray(RGB).resize((64, 64)).save("photo.webp", quality=1)
    (row,) = run("quantize", "photo.webp", "--out-dir", "small", "--json").rows
    assert row["output_bytes"] > row["input_bytes"]
    assert "larger than the .webp file" in row["warning"]


@pytest.mark.parametrize("way", ["-o", "--out-dir", "--in-place"])
@pytest.mark.parametrize("suffix", [".png", ".gif", ".webp", ".bmp", ".tif", ".ppm", ".pgm", ".npy"])
def test_no_output_in_the_format_of_its_input_is_larger_and_one_that_is_no_smaller_is_told(
    run: Run, suffix: str, way: str
) -> None:
    name, levels = f"b{suffix}", RGB[:24, :24, 1] if suffix in (".pgm", ".npy") else RGB[:24, :24]
    if suffix in (".gif", ".webp"):
        Image.fromarray(levels).save(name, quality=1)
    else:
        write_image(name, levels)
    shape, before = read_image(name).shape, Path(name).stat().st_size
    outputs = {"-o": ["-o", f"out/{name}"], "--out-dir": ["--out-dir", "out", "--ext", suffix]}.get(way, [way])
    Path("out").mkdir()
    (row,) = run("quantize", name, *outputs, "--json").rows
    after = Path(name if way == "--in-place" else f"out/{name}")
    told = row.get("skipped") == "output not smaller" or "a copy of the input" in row.get("warning", "")
    assert told == (row.get("output_bytes", before) == before)
    assert after.stat().st_size <= before
    assert read_image(after).shape == shape


def test_sizes_are_in_table_json_and_report(run: Run) -> None:
    outcome = run("quantize", "a.png", "-k", "4", "-o", "o.png", "--report", "r.jsonl")
    shown = dict(zip(*(row.split() for row in outcome.out.splitlines()), strict=True))
    row = json.loads(Path("r.jsonl").read_text())
    assert row["input_bytes"] == Path("a.png").stat().st_size
    assert row["output_bytes"] == Path("o.png").stat().st_size
    assert float(shown["before"].rstrip("kB")) == pytest.approx(row["input_bytes"] / 1000, rel=0.01)
    assert shown["after"] == f"{row['output_bytes']}B"


@pytest.mark.parametrize(
    ("text", "size"),
    [("900", 900), ("60K", 61440), ("60k", 61440), ("60kB", 60000), ("1.5M", 3 << 19), ("2G", 2 << 30)],
)
def test_sizes_can_have_units(text: str, size: int) -> None:
    assert n_bytes(text) == size


def test_in_place_follows_links_within_a_folder_that_is_given(run: Run) -> None:
    Path("proj/store").mkdir(parents=True)
    Path("proj/store/b.data").write_bytes(Path("a.png").read_bytes())
    Path("proj/a.png").symlink_to("store/b.data")
    assert run("quantize", "proj", "-k", "4", "--in-place", "--yes", "--quiet").status == 0
    assert len(image_info("proj/store/b.data").bands) == 1
    assert Path("proj/a.png").is_symlink()

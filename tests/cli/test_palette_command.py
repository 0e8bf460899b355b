"""``cvtimg palette`` prints the colors that a picture has, with their shares."""

import os
import pty
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import RowOf

from cvtimg import quantize, read_palette, write_image
from cvtimg._shared.types import Bytes
from cvtimg.cli.app import main

FLAG = np.array([[0, 0, 255], [0, 0, 255], [255, 255, 0], [200, 16, 46]], np.uint8)[np.newaxis]


def palette_of(row_of: RowOf, *arguments: str | Path) -> list[tuple[str, float]]:
    row = row_of("palette", *map(str, arguments))
    return [(color["hex"], color["share"]) for color in row["colors"]]


def test_few_colors_are_told_as_they_are_the_most_frequent_first(row_of: RowOf) -> None:
    write_image("a.png", FLAG)
    assert palette_of(row_of, "a.png") == [("#0000ff", 0.5), ("#c8102e", 0.25), ("#ffff00", 0.25)]
    assert len(palette_of(row_of, "a.png", "-k", 2)) == 2


def test_the_colors_of_a_palette_file_are_told_and_saved_in_its_order(row_of: RowOf) -> None:
    Path("a.hex").write_text("ffff00\n0000ff\nc8102e\n")
    found = palette_of(row_of, "a.hex", "--save-palette", "a.gpl")
    assert [code for code, _ in found] == ["#ffff00", "#0000ff", "#c8102e"]
    assert read_palette("a.gpl").tolist() == read_palette("a.hex").tolist()
    assert len(palette_of(row_of, "a.hex", "-k", 2)) == 2


def test_many_colors_are_reduced_as_quantize_does(row_of: RowOf, photograph: Bytes) -> None:
    write_image("a.png", photograph)
    for options, n_colors in (((), 16), (("-k", 5), 5)):
        found = palette_of(row_of, "a.png", *map(str, options))
        result = quantize(photograph, n_colors)
        assert {code for code, _ in found} == {f"#{color.tobytes().hex()}" for color in result.palette}
        shares = [share for _, share in found]
        assert shares == sorted(shares, reverse=True)
        assert sum(shares) == pytest.approx(1)


def test_a_pipe_gets_plain_lines(capsys: pytest.CaptureFixture[str]) -> None:
    write_image("a.png", FLAG)
    assert main(["palette", "a.png"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "a.png: 3 of 3 colors"
    assert [line.split("\t") for line in lines[1:]] == [
        ["#0000ff", "0.500000", "2"],
        ["#c8102e", "0.250000", "1"],
        ["#ffff00", "0.250000", "1"],
    ]


@pytest.mark.skipif(os.name == "nt", reason="needs a terminal")
def test_a_terminal_gets_blocks_of_the_color() -> None:
    write_image("a.png", FLAG)
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor", "COLUMNS": "80"}
    environment.pop("NO_COLOR", None)
    command = [sys.executable, "-P", "-m", "cvtimg", "palette", "a.png"]
    subprocess.run(command, stdout=theirs, env=environment, check=True)
    os.close(theirs)
    text = os.read(ours, 1 << 16).decode()
    os.close(ours)
    assert "\x1b[48;2;0;0;255m" in text
    assert "50.00%" in text
    assert "#c8102e" in text


def test_colors_are_sorted_as_asked(row_of: RowOf) -> None:
    codes = ["#ffffff", "#ff0000", "#000080", "#808080", "#00ff00"]
    write_image("a.png", np.array([[list(bytes.fromhex(code[1:])) for code in codes]], np.uint8))

    def sorted_by(key: str) -> list[str]:
        return [code for code, _ in palette_of(row_of, "a.png", "--sort", key)]

    assert sorted_by("lightness") == ["#000080", "#808080", "#ff0000", "#00ff00", "#ffffff"]
    assert sorted_by("hue") == ["#808080", "#ffffff", "#ff0000", "#00ff00", "#000080"]


@pytest.mark.parametrize("main_colors", [False, True])
def test_locked_colors_are_in_the_palette(main_colors: bool, row_of: RowOf, photograph: Bytes) -> None:
    write_image("a.png", photograph)
    words = ["-k", "5", "--lock", "#ff00ff", *(["--main"] if main_colors else [])]
    found = {code for code, _ in palette_of(row_of, "a.png", *words)}
    assert "#ff00ff" in found
    assert len(found) == 5


def test_colors_themselves_are_a_palette() -> None:
    assert read_palette("#102030,#F0e0d0").tolist() == [[16, 32, 48], [240, 224, 208]]
    assert read_palette("#10203040").tolist() == [[16, 32, 48, 64]]
    for wrong in ("#102030,#f0e0d0ff", "#1020", "102030,f0e0d0"):
        with pytest.raises(OSError, match="is no file, and no known palette: cga, game-boy"):
            read_palette(wrong)


def test_wide_integers_are_the_picture_that_they_hold_and_nan_is_no_color(row_of: RowOf) -> None:
    holes = np.where(FLAG == 46, np.nan, FLAG / 255)
    np.save("wide.npy", FLAG.astype(np.int64))
    np.save("holes.npy", holes)
    assert palette_of(row_of, "wide.npy") == [("#0000ff", 0.5), ("#c8102e", 0.25), ("#ffff00", 0.25)]
    assert palette_of(row_of, "holes.npy") == [("#0000ff", 2 / 3), ("#ffff00", 1 / 3)]
    np.save("dark.npy", FLAG.astype(np.uint16))
    assert "nearly black" in row_of("palette", "dark.npy")["warning"]

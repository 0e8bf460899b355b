"""Files of settings: the options of a command as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Run

from cvtimg import read_image, write_image
from cvtimg.batch import WrongUsageError
from cvtimg.cli.overview import COMMANDS
from cvtimg.options import options_of
from cvtimg.options.settings import read_settings, settings_of


@pytest.fixture(autouse=True)
def pictures(here: Path) -> None:
    rng = np.random.default_rng(0)
    for name in ("a.png", "b.png"):
        write_image(name, rng.integers(0, 255, (12, 16, 3), np.uint8))


def written(settings: Any) -> str:
    Path("s.json").write_text(json.dumps(settings))
    return "s.json"


def test_settings_are_the_options_that_they_name(run: Run) -> None:
    words = ["-k", "3", "--dither", "bayer", "--lock", "#fff", "--lock", "#102030", "--quiet"]
    path = written(settings_of("quantize", words))
    assert run("quantize", "a.png", "b.png", "--settings", path, "--out-dir", "one")[0] == 0
    assert run("quantize", "a.png", "b.png", *words, "--out-dir", "other")[0] == 0
    for name in ("a.png", "b.png"):
        assert Path("one", name).read_bytes() == Path("other", name).read_bytes()


def test_the_command_line_overrides_settings(run: Run) -> None:
    path = written({"colors": 3})
    assert run("quantize", "--settings", path, "a.png", "--colors", "5", "-o", "c.png")[0] == 0
    assert len(np.unique(read_image("c.png").reshape(-1, 3), axis=0)) == 5


def test_settings_give_what_a_command_needs(run: Run) -> None:
    assert run("mosaic", "a.png", "--settings", written({"tiles": 4}), "-o", "m.png")[0] == 0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"colour": 3}, "s.json: cvtimg quantize has no option 'colour'; did you mean 'colors'?"),
        ({"settings": "s.json"}, "has no option 'settings'"),
        ({"inputs": ["a.png"]}, "has no option 'inputs'"),
        ({"colors": "many"}, "s.json: colors: 'many' must be auto or a whole number in 1..65536"),
        ({"colors": True}, "colors: true must be a number or a text"),
        ({"colors": None}, "colors: null must be a number or a text"),
        ({"colors": 2.5}, "colors: '2.5' must be auto or a whole number"),
        ({"colors": [2, 3]}, "colors: [2, 3] must be one value"),
        ({"quiet": 1}, "quiet: 1 must be true or false"),
        ({"lock": ["#ggg"]}, "lock: '#ggg' must be a color"),
        ({"command": "mesh"}, "s.json has settings of cvtimg mesh, not of cvtimg quantize"),
        ({"psnr": 30, "colors": "auto"}, "--psnr and -k auto exclude each other"),
        ([1], "s.json must be an object of options"),
    ],
    ids=str,
)
def test_what_is_wrong_is_said_in_one_line(settings: Any, message: str, run: Run) -> None:
    code, out, err = run("quantize", "a.png", "--settings", written(settings), "-o", "c.png")
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert not Path("c.png").exists()


def test_files_that_cannot_be_read_are_named(run: Run) -> None:
    assert run("quantize", "a.png", "--settings", "none.json") == (
        1,
        "",
        "cvtimg: none.json: no such file or directory\n",
    )
    Path("s.json").write_text("{'colors': 3}")
    assert "s.json is not JSON" in run("quantize", "a.png", "--settings", "s.json")[2]


@pytest.mark.parametrize("verb", [verb for verb in COMMANDS if verb != "explore"])
def test_every_command_takes_settings(verb: str) -> None:
    assert any(option.name == "settings" for option in options_of(verb))
    assert read_settings(written({"command": verb, "quiet": True}), verb) == ["--quiet"]
    with pytest.raises(WrongUsageError, match="did you mean 'quiet'"):
        read_settings(written({"quie": True}), verb)

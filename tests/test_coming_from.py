"""The tables of docs/coming_from.md for users of pngquant, gifsicle, Fiji and Gmsh: commands do what theirs do."""

import io
import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import tifffile
from commands import SAMPLES
from PIL import Image

from cvtimg.cli.app import main

PAGE = Path(__file__).parents[1] / "docs" / "coming_from.md"
pytestmark = [
    pytest.mark.skipif(not PAGE.exists(), reason="the tests run without the checkout"),
    pytest.mark.timeout(120),
]


def rows(title: str) -> list[list[str]]:
    """Return what each row of the table of a program has on both sides."""
    section = re.split(r"^## ", PAGE.read_text(), flags=re.MULTILINE)
    (text,) = (part for part in section if part.startswith(f"{title}\n"))
    return [
        re.findall(r"\|\s+`?(.*?)`?\s+(?=\|)", line) for line in text.splitlines() if "`cvtimg" in line and "|" in line
    ]


def parameters() -> list[object]:
    if not PAGE.exists():
        return []
    found = {title: rows(title) for title in ("pngquant", "gifsicle", "Fiji", "Gmsh")}
    assert {title: len(pairs) for title, pairs in found.items()} == {**dict.fromkeys(found, 10), "gifsicle": 4}
    return [
        pytest.param(*pair, id=pair[1], marks=pytest.mark.slow if number > 2 or "best" in pair[1] else ())
        for pairs in found.values()
        for number, pair in enumerate(pairs)
    ]


@pytest.fixture(autouse=True)
def inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    photograph = Image.open(SAMPLES / "coffee.png").convert("RGB").resize((96, 72))
    for name in ("in.png", "a.png", "b.png"):
        photograph.save(name)
    for suffix in (".png", ".gif"):
        photograph.quantize(8).save(f"palette{suffix}")
    first, *others = (photograph.crop((n, 0, 80 + n, 72)).quantize(200) for n in range(3))
    first.save("in.gif", save_all=True, append_images=others, duration=80)
    y, x = np.mgrid[:80, :90]
    disks = ((x % 30 - 15) ** 2 + (y % 40 - 20) ** 2 < 90).astype(float)
    cells = np.uint8(40 + 120 * disks + np.random.default_rng(0).normal(0, 5, disks.shape))
    Path("plates").mkdir()
    for name in ("cells.tif", "plates/a.tif", "plates/b.tif"):
        tifffile.imwrite(name, cells)
    tifffile.imwrite("stack.tif", np.stack([cells] * 4), imagej=True, metadata={"axes": "ZYX"})
    Image.fromarray(np.uint8(255) * (disks > 0)).save("mask.png")
    Image.fromarray(np.full(disks.shape, 4, np.uint8)).save("sizes.png")
    ring = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]
    Path("square.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    corners = "".join(f"Point({n + 1}) = {{{x}, {y}, 0, 0.2}};\n" for n, (x, y) in enumerate(ring[:4]))
    sides = "".join(f"Line({n}) = {{{n}, {n % 4 + 1}}};\n" for n in range(1, 5))
    square = f"{corners}{sides}Curve Loop(1) = {{1:4}};\nPlane Surface(1) = {{1}};\n"
    named = 'Physical Surface("steel") = {1};\nPhysical Curve("clamped") = {4};\n'
    field = 'Field[1] = MathEval;\nField[1].F = "0.1";\nBackground Field = 1;\n'
    for name, more in {
        "square": "",
        "named": named,
        "periodic": "Periodic Curve {2} = {-4};\n",
        "field": field,
    }.items():
        Path(f"{name}.geo").write_text(square + more)


def run(line: str, monkeypatch: pytest.MonkeyPatch) -> int:
    """Run a command line, with what it reads and writes by < and >."""
    command, *moved = re.split(r" ([<>]) ", line)
    given, out = (dict(zip(moved[::2], moved[1::2], strict=True)).get(sign) for sign in "<>")
    words = shlex.split(command)
    content = Path(given).read_bytes() if given else b""
    if words[0] != "cvtimg":
        done = subprocess.run(words, input=content, capture_output=True, timeout=60, check=False)
        status, printed = done.returncode, done.stdout
    else:
        streams = [io.TextIOWrapper(io.BytesIO(start)) for start in (content, b"")]
        monkeypatch.setattr(sys, "stdin", streams[0])
        monkeypatch.setattr(sys, "stdout", streams[1])
        status, printed = main(words[1:]), streams[1].detach().getvalue() if out else b""  # type: ignore[attr-defined]
    if out:
        Path(out).write_bytes(printed)
    return status


def figures(path: Path) -> tuple[object, ...]:
    """Return what outputs of a command and of its peer must have in common: kind and size, and how many things."""
    if path.suffix in (".png", ".gif"):
        with Image.open(path) as image:
            return image.size, getattr(image, "n_frames", 1), len(image.getcolors(1 << 16) or ()) <= 256
    return path.suffix, path.stat().st_size > 0


@pytest.mark.parametrize(("theirs", "ours"), parameters())
def test_each_command_runs_and_writes_what_the_command_of_the_other_program_does(
    theirs: str, ours: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = ours.replace("\\|", "|")
    before = {path: path.read_bytes() for path in Path().rglob("*.*")}
    if "cells" in ours and ".zip" in ours:
        pytest.importorskip("roifile")
    if "cvtimg mesh" in ours:
        pytest.importorskip("meshio")
    if "--plot" in ours:
        pytest.importorskip("matplotlib")

    def written(line: str) -> dict[str, tuple[object, ...]]:
        assert run(line, monkeypatch) == 0, line
        changed = [path for path in Path().rglob("*.*") if before.get(path) != path.read_bytes()]
        found = {
            path.name.replace("-fs8", "").replace("-or8", "").replace("-quantized", ""): figures(path)
            for path in changed
        }
        for path in changed:
            path.unlink() if path not in before else path.write_bytes(before[path])
        return found

    made = written(ours)
    assert made or ours.startswith("cvtimg info")
    program = shlex.split(theirs)[0]
    if program not in ("pngquant", "gifsicle", "gmsh") or shutil.which(program) is None:
        return
    if theirs == "gmsh -check square.msh":
        assert run("gmsh -2 square.geo -o square.msh", monkeypatch) == run(theirs, monkeypatch) == 0
    else:
        assert written(theirs) == made

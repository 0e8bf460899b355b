"""Every example in the help of a command runs, on small inputs of the names that it has."""

import json
import re
import shlex
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from commands import SAMPLES
from PIL import Image

from cvtimg.cli import cluster_command, palette_command
from cvtimg.cli.app import main
from cvtimg.cli.overview import COMMANDS, whole_help_of

pytestmark = pytest.mark.timeout(300)
#: Largest count of points, dots or colors that is run; results are as right with fewer.
MOST = 300


def examples(verb: str) -> list[list[str]]:
    """Return the words of each example, without those that need another machine."""
    text = import_module(f"cvtimg.cli.{verb}_command").EXAMPLES
    found = []
    for line in re.findall(r"cvtimg [^|\n]+(?=\n|$)", text):
        words = shlex.split(line.replace("> ", "-o ").replace(" - ", " photo.jpg ").replace("s3://bucket/", ""))[1:]
        if "--quality" in words:  # of which a thumbnail of a JPEG file reaches less
            words[words.index("--quality") + 1] = "50"
        if "--dask" in words:
            words = words[: words.index("--dask")]
        found.append([word for part in words for word in sorted(map(str, Path().glob(part))) or [part]])
    return found


def smaller(words: list[str]) -> list[str]:
    return [str(MOST) if last == "-n" and word.isdigit() and int(word) > MOST else word
            for last, word in zip(["", *words], words, strict=False)]  # fmt: skip


@pytest.fixture
def inputs() -> None:
    """Fill a folder with all that examples read."""
    rng = np.random.default_rng(0)
    photo = Image.open(SAMPLES / "coffee.png").convert("RGB").resize((96, 72))
    pixels = np.asarray(photo)
    y, x = np.mgrid[:72, :96]
    disk = (x - 48) ** 2 + (y - 36) ** 2 < 700
    for folder in ("photos", "scans", "frames", "icons", "slides", "runs"):
        Path(folder).mkdir()
    for name in ("photo.jpg", "portrait.jpg", "photo_1.png", "photo_2.png", "drawing.png", "sprite.png", "logo.png",
                 "noisy.png", "photos/a.png", "photos/b.jpg", "scans/c.tif", "slides/a.png", "icons/a.png", "day.png",
                 "frames/0.png", "frames/1.png", "frames/2.png", "frames/3.png", "frames/4.png", "frames/5.png",
                 *(f"scan_{number}.png" for number in (1, 2, 3))):  # fmt: skip
        noise = rng.normal(0, 4 if "_" in name or "/" in name else 0, pixels.shape)
        Image.fromarray(np.clip(pixels + noise, 0, 255).astype(np.uint8)).save(name)
    Image.fromarray(pixels[..., 1]).save("night.png")
    Image.fromarray(np.uint8(255) * disk).save("mask.png")
    Image.fromarray((disk + 2 * (x > 80)).astype(np.uint8)).save("labels.png")
    for name in ("bone.png", "cells.tif", "nuclei.tif", "scene.tif", "a.tif", "b.tif"):
        Image.fromarray(np.clip(60 + 120 * disk + rng.normal(0, 4, disk.shape), 0, 255).astype(np.uint8)).save(name)
    for name in ("a-known.png", "b-known.png"):
        Image.fromarray(np.full(disk.shape, 255, np.uint8)).save(name)
    tifffile.imwrite("sizes.tif", np.full(disk.shape, 5, np.float32))
    for name in ("lights.png", "land.png"):
        Image.open(SAMPLES / "land.png").convert("L").resize((144, 72)).save(name)
    stack = np.zeros((9, 20, 20), np.uint8)
    stack[2:7, 5:15, 5:15] = 2
    sizes = {"axes": "ZYX", "spacing": 2, "unit": "um"}
    tifffile.imwrite("stack.tif", stack, imagej=True, resolution=(1 / 0.3, 1 / 0.3), metadata=sizes)
    films = [Image.fromarray(np.roll(pixels[::2, ::2], 4 * step, 1)) for step in range(12)]
    for name in ("film.gif", "film.webp"):
        films[0].save(name, save_all=True, append_images=films[1:], lossless=True)
    angles = np.linspace(0, 6.2, 40)
    ring = np.stack([3 * np.cos(angles), 2 * np.sin(angles)], axis=1).tolist()
    Path("coast.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [[*ring, ring[0]]]}))
    plate = [[0, 0], [3, 0], [3, 1], [0, 1], [0, 0]]
    Path("plate.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [plate]}))
    Path("game.gpl").write_text("GIMP Palette\n#\n 10 20 30 a\n240 200 150 b\n")
    rows = rng.random((90, 4))
    np.savetxt("trees.csv", np.abs(rows), delimiter=",", header="height,girth,count,age", comments="")
    for name in ("runs.npy", "runs/a.npy", "runs/b.npy"):
        np.save(name, rows)
    _tables(rows)
    Path("bounds.csv").write_text("name,low,high\nheat,1,5\ntime,0,2\n")
    _surfaces()


def _tables(rows: Any) -> None:
    parquet, arrow = pytest.importorskip("pyarrow.parquet"), pytest.importorskip("pyarrow")
    parquet.write_table(arrow.table({"lon": rows[:, 0], "lat": rows[:, 1]}), "rides.parquet")
    pytest.importorskip("zarr").save("pixels.zarr", rows)


def _surfaces() -> None:
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(2)
    ball.export("scan.stl")
    ball.export("part.obj")
    ball.export("voxels.stl")
    ball.vertex_attributes["quality"] = np.linspace(1, 2, len(ball.vertices)).astype(np.float32)
    ball.export("scan.ply")


@pytest.mark.slow
@pytest.mark.usefixtures("inputs")
@pytest.mark.parametrize("verb", COMMANDS)
def test_each_example_in_the_help_runs(
    verb: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("cvtimg.explore.serve", lambda paths, **options: None)
    if verb == "sphere":
        assert main(["sphere", "-n", "500", "-o", "globe.nc", "--quiet"]) == 0
    for words in examples(verb):
        common = [] if verb == "explore" else ["--overwrite"]
        assert main([*smaller(words), *common]) == 0, (words, capsys.readouterr().err)


def test_help_tells_numbers_that_are_not_options() -> None:
    assert f"up to {cluster_command._SILHOUETTE_ROWS:,} rows" in " ".join(whole_help_of("cluster").split())
    assert f"at most {palette_command._MOST_OWN} colors" in " ".join(whole_help_of("palette").split())

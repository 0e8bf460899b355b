"""Masks, labels and maps are the same however a program saves them: gray, indexed, in RGB or RGBA, with equal bands."""

from pathlib import Path

import numpy as np
import pytest
from commands import Run
from PIL import Image

#: Commands that read a drawing, each with what it writes.
READERS = {
    "mask": [
        "quantize photo.png -k 4 --mask {} -o out.png",
        "segment photo.png -k 3 --mask {} -o out.png",
        "restore photo.png -k 3 --effort fast --mask {} -o out.png",
        "mesh {} -n 60 -o out.obj",
        "stipple {} -n 60 -o out.csv",
        "sphere -n 60 --effort fast --coast {} -o out.csv",
        "sphere -n 60 --effort fast --land {} -o out.csv",
    ],
    "labels": ["mesh {} -n 60 -o out.obj"],
    "map": [
        "mesh mask-L.png -n 60 --size {} -o out.obj",
        "quantize photo.png -k 4 --weight-map {} -o out.png",
        "sphere -n 60 --effort fast --density {} -o out.csv",
    ],
}


@pytest.fixture(autouse=True)
def drawings(here: Path) -> None:
    y, x = np.mgrid[:30, :60]
    Image.fromarray(np.stack([4 * x, 8 * y, 2 * x + 4 * y], axis=2).astype(np.uint8)).save("photo.png")
    labels = 1 + (x > 25).astype(int) + (y > 18)
    drawn = {"mask": 255 * (np.hypot(x - 30, y - 15) < 12), "labels": 60 * labels, "map": 60 + x}
    for name, values in drawn.items():
        for mode in ("L", "P", "LA", "RGB", "RGBA"):
            Image.fromarray(values.astype(np.uint8)).convert(mode).save(f"{name}-{mode}.png")
    colors = np.array([[0, 0, 0], [255, 0, 0], [0, 200, 0], [30, 30, 250]], np.uint8)
    Image.fromarray(colors[labels]).convert("RGBA").save("labels-colored.png")
    Image.fromarray(colors[labels]).save("map-colored.png")


@pytest.mark.parametrize(
    ("drawing", "command"),
    [
        pytest.param(name, line, marks=[pytest.mark.slow] if line.startswith(("mesh", "restore")) else [])
        for name, lines in READERS.items()
        for line in lines
    ],
)
def test_a_drawing_is_the_same_in_all_modes(drawing: str, command: str, run: Run) -> None:
    written = []
    for mode in ("L", "P", "LA", "RGB", "RGBA"):
        assert run(*command.format(f"{drawing}-{mode}.png").split(), "--overwrite")[0] == 0, mode
        (path,) = Path().glob("out.*")
        written.append(path.read_bytes())
        path.unlink()
    assert written[1:] == written[:1] * 4


def test_each_color_of_a_label_image_is_a_region_and_a_map_must_be_gray(run: Run) -> None:
    (colored,), (gray,) = (
        run("mesh", f"labels-{name}.png", "-n", "60", "-o", f"{name}.obj", "--json").rows for name in ("colored", "L")
    )
    assert colored["triangles"] == gray["triangles"]
    outcome = run("mesh", "mask-L.png", "-n", "60", "--size", "map-colored.png", "-o", "out.obj")
    assert "--size map-colored.png must be a gray image; this one has colors" in outcome.err

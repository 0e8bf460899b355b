"""What is registered works everywhere: a new color space, method or palette format needs one file and one line."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import cvtimg
from cvtimg._shared.types import Bytes
from cvtimg.cli.app import main
from cvtimg.colors import SPACES, ColorSpace
from cvtimg.engine import METHODS, Conditions, Iteration, Method
from cvtimg.palettes import PALETTE_FORMATS

Floats = NDArray[np.float64]


@pytest.fixture
def image() -> Bytes:
    """Return four noisy fields of color."""
    fields = np.array([[[20, 20, 30], [200, 60, 40]], [[40, 160, 80], [230, 220, 190]]])
    noise = np.random.default_rng(0).integers(-8, 9, (24, 24, 3))
    return (fields.repeat(12, axis=0).repeat(12, axis=1) + noise).astype(np.uint8)


@pytest.fixture
def dark(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Register a space in which dark colors are far from each other, and count how often it is asked."""
    asked: list[int] = []

    def forward(rgb: Floats) -> Floats:
        asked.append(len(rgb))
        return np.sqrt(rgb)

    gray = (1.0, 1.0, 1.0)
    monkeypatch.setitem(SPACES, "dark", ColorSpace(forward, np.square, gray=gray))
    yield asked
    assert asked


@pytest.mark.usefixtures("dark")
def test_a_new_color_space_works_in_every_verb(image: Bytes) -> None:
    for given in (image, image[..., 0]):
        assert len(cvtimg.quantize(given, 4, space="dark", dither="floyd-steinberg").palette) == 4
    for options in ({}, {"edge_weight": "auto"}, {"averaging": 2}, {"components": True}):
        labels = cvtimg.segment(image, 4, space="dark", **options).labels
        assert len(set(labels[6::12, 6::12].ravel().tolist())) == 4
    assert cvtimg.superpixels(image, 9, space="dark").labels.max() > 1
    assert cvtimg.energy_curve(image, 16, space="dark").elbow() == 4
    assert cvtimg.restore([image, image[::-1, ::-1][::-1, ::-1]], 4, space="dark").labels.max() == 4


def test_a_new_method_works_by_its_name(image: Bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def renamed(points: Any, generators: Floats, conditions: Conditions) -> Iteration:
        asked.append(len(generators))
        return METHODS["lloyd"](points, generators, conditions)

    monkeypatch.setitem(METHODS, "renamed", Method(renamed))
    plain = cvtimg.quantize(image, 4)
    assert np.array_equal(cvtimg.quantize(image, 4, method="renamed").palette, plain.palette)
    rows = image.reshape(-1, 3).astype(float)
    assert len(cvtimg.tessellate(rows, 4, method="renamed").generators) == 4
    assert len(cvtimg.CVT(4, method="renamed").fit(rows).cluster_centers_) == 4
    assert len(asked) >= 3


def test_a_new_palette_format_is_read_and_written_by_its_suffix(
    tmp_path: Path, image: Bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(content: bytes) -> Bytes:
        return np.frombuffer(content, np.uint8).reshape(-1, 3)

    form = SimpleNamespace(read=read, write=lambda swatches: swatches.colors.tobytes())
    monkeypatch.setitem(PALETTE_FORMATS, ".raw", form)
    cvtimg.write_image(tmp_path / "a.png", image)
    words = ["quantize", str(tmp_path / "a.png"), "-k", "3", "--save-palette", str(tmp_path / "a.raw")]
    assert main(words) == 0
    assert cvtimg.read_palette(tmp_path / "a.raw").shape == (3, 3)

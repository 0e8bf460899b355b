"""Messages name the argument that people gave, and say what to do; no internals leak."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from skimage import data

import cvtimg
from cvtimg.pictures.formats import encoding

IMAGE = np.random.default_rng(0).integers(0, 256, (8, 9, 3), np.uint8)
PHOTO, ROWS = data.coffee()[::12, ::12, 0], np.random.default_rng(0).random((150, 2))


class Tensor:
    """Like a tensor of torch: it has an attribute `mode` that is no mode of Pillow."""

    def mode(self) -> None: ...

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        return IMAGE


def test_what_has_a_mode_of_another_kind_is_an_array() -> None:
    image: Any = Tensor()
    np.testing.assert_array_equal(cvtimg.quantize(image, 4).image, cvtimg.quantize(IMAGE, 4).image)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda **_: cvtimg.quantize("a.png", 4), r"image='a.png' must be an array; read .* cvtimg.read_image"),
        (lambda **_: cvtimg.segment(Path("a.png"), 4), r"must be an array; read .* cvtimg.read_image"),
        (lambda **_: cvtimg.restore(["a.png", "b.png"], 4), r"must be an array; read .* cvtimg.read_image"),
        (lambda **_: cvtimg.superpixels("a.png", 4), r"must be an array; read .* cvtimg.read_image"),
        (lambda **wrong: cvtimg.quantize(IMAGE, 4, **wrong, zoom=0), r"'zoom'; options are n_colors, .*dither, .*rng"),
        (lambda **wrong: cvtimg.find_palette(IMAGE, 4, **wrong, speed=0), r"find_palette\(\) .* 'speed'; options are"),
        (lambda **_: cvtimg.restore(IMAGE, 3), r"shape \(8, 9, 3\) must be a list of versions: .*list\(images\)"),  # type: ignore[arg-type]
        (lambda **_: cvtimg.quantize(IMAGE, 4, dither="fs"), r"dither='fs' must be one of floyd-steinberg"),
        (lambda **_: cvtimg.segment(IMAGE, 4, averaging=-1), r"averaging=-1 must be"),
    ],
)
def test_wrong_arguments_are_named_as_they_were_given(call: Callable[..., Any], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        call()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
def test_a_full_disk_is_said_whatever_the_encoder_says(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def fail(*_: object) -> None:
        raise OSError("codec initialization failed")

    begin = Path.open
    monkeypatch.setattr(encoding, "_write", fail)
    monkeypatch.setattr(Path, "open", lambda path, mode="r": begin(Path("/dev/full") if mode == "w+b" else path, mode))
    with pytest.raises(OSError, match="no space left on device"):
        cvtimg.write_image(tmp_path / "a.tif", IMAGE)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
@pytest.mark.parametrize(
    "command",
    [
        "info a.png",
        pytest.param("quantize a.png -k 2 -o -", marks=pytest.mark.slow),
        pytest.param("design -n 4 -d 1", marks=pytest.mark.slow),
    ],
)
def test_a_full_standard_output_is_named(tmp_path: Path, command: str) -> None:
    cvtimg.write_image(tmp_path / "a.png", IMAGE)
    environ = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-P", "-m", "cvtimg", *command.split()],
            cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, check=False, timeout=120, env=environ,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (1, "cvtimg: standard output: no space left on device\n")


@pytest.mark.parametrize(
    "take",
    [
        lambda rows: cvtimg.tessellate(rows, 2),
        lambda rows: cvtimg.tessellate(rows.data, 2, density=rows[:, 0]),
        cvtimg.energy_curve,
        cvtimg.CVT(2).fit,
        lambda rows: cvtimg.reduced_basis(rows, 1),
        lambda rows: cvtimg.place_generators(None, 2, density=rows),
        lambda rows: cvtimg.find_contours(rows.astype(int)),
    ],
)
def test_what_is_masked_is_not_taken_for_data(take: Callable[..., object]) -> None:
    with pytest.raises(ValueError, match="1 masked values and must have none"):
        take(np.ma.masked_equal(np.arange(12.0).reshape(4, 3), 6))


@pytest.mark.parametrize(
    "verb",
    [
        lambda n: cvtimg.tessellate(ROWS, n).energy,
        lambda n: cvtimg.CVT(n).fit(ROWS).inertia_,
        lambda n: cvtimg.energy_curve(ROWS, n).energies[-1],
        lambda n: cvtimg.reduced_basis(ROWS, n, kind="cvt").energy,
        lambda n: cvtimg.quantize(PHOTO, n).energy,
        lambda n: cvtimg.segment(PHOTO, n).energy,
        lambda n: cvtimg.superpixels(PHOTO, n).energy,
        lambda n: cvtimg.segment_hierarchy(PHOTO, n_leaves=n).energies.sum(),
        lambda n: cvtimg.mosaic(PHOTO, n, effort="fast").energy,
        lambda n: cvtimg.stipple(PHOTO, n).energy,
        lambda n: cvtimg.place_generators(None, n, density=PHOTO).energy,
        lambda n: cvtimg.mesh_region([[0, 0], [1, 0], [1, 1]], n=n).area,
        lambda n: cvtimg.sphere_grid(n, effort="fast").energy,
        lambda n: cvtimg.design(n, 2, effort="fast").energy,
    ],
)
def test_a_number_is_the_same_in_a_type_of_few_bits(verb: Callable[[Any], float]) -> None:
    assert verb(np.uint8(100)) == verb(100)


@pytest.mark.parametrize("function", [cvtimg.restore, cvtimg.denoise])
def test_warnings_name_the_line_of_the_caller(function: Callable[..., object]) -> None:
    image = np.random.default_rng(0).integers(0, 255, (32, 32), np.uint8)
    with pytest.warns(UserWarning, match="has nothing to align") as caught:
        function([image], align=True)
    assert {warning.filename for warning in caught} == {__file__}

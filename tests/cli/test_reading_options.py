"""--page and --channel-axis, and standard input that is cut short or declares too much."""

import io
import struct
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tifffile

from cvtimg import quantize, read_image, segment
from cvtimg.cli import app as cli
from cvtimg.pictures import encode_image, image_info
from cvtimg.pictures.formats.png_chunks import chunk

PAGES = np.random.default_rng(5).integers(0, 4000, (3, 24, 32), np.uint16)


def test_commands_read_one_page() -> None:
    tifffile.imwrite("a.tif", PAGES, photometric="minisblack")
    tifffile.imwrite("masks.tif", (PAGES > 1000).astype(np.uint8), photometric="minisblack")
    assert cli.main(["quantize", "a.tif", "-k", "4", "--page", "2", "-o", "out.png"]) == 0
    np.testing.assert_array_equal(read_image("out.png"), quantize(PAGES[1], 4).image)
    assert cli.main(["segment", "a.tif", "-k", "3", "--page", "3", "--mask", "masks.tif", "-o", "labels.npy"]) == 0
    np.testing.assert_array_equal(np.load("labels.npy"), segment(PAGES[2], 3, mask=PAGES[2] > 1000).labels)
    assert cli.main(["mosaic", "a.tif", "-n", "5", "--page", "1", "-o", "tiles.png"]) == 0
    assert image_info("tiles.png").width == 32
    tifffile.imwrite("z.tif", PAGES, imagej=True, metadata={"axes": "ZYX"})
    assert cli.main(["restore", "z.tif", "-k", "4", "--page", "2", "-o", "restored.png"]) == 0
    assert image_info("restored.png").frames == 1


def test_the_bands_of_an_array_are_where_the_option_says() -> None:
    np.save("a.npy", PAGES)
    assert cli.main(["quantize", "a.npy", "-k", "4", "--channel-axis", "0", "-o", "out.npy"]) == 0
    expected = quantize(PAGES.transpose(1, 2, 0), 4).image
    np.testing.assert_array_equal(np.load("out.npy"), expected)


def huge_png() -> bytes:
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0))


COMMANDS = {
    "quantize": ["-k", "4"],
    "segment": ["-k", "3"],
    "stipple": ["-n", "20"],
    "mosaic": ["-n", "5"],
    "restore": ["-k", "3"],
    "palette": [],
    "info": [],
}
WHOLE = encode_image(".png", PAGES[0].astype(np.uint8))
BAD = {"cut short": WHOLE[: len(WHOLE) // 2], "huge": huge_png(), "empty": b"", "text": b"not an image"}
BAD["bands, which no PNG holds"] = encode_image(".tif", PAGES.transpose(1, 2, 0)[..., [0, 1, 2, 0, 1]])


@pytest.mark.parametrize(
    ("command", "content"), [*(("quantize", content) for content in BAD), *((verb, "cut short") for verb in COMMANDS)]
)
def test_bad_standard_input_is_one_line_and_no_output(
    command: str, content: str, monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(BAD[content])))
    output = [] if command in ("palette", "info") else ["-o", "-"]
    assert cli.main([command, "-", *COMMANDS[command], *output]) == 1
    out, err = capfdbinary.readouterr()
    assert out == b""
    assert err.startswith(b"cvtimg: -: ")
    assert err.count(b"\n") == 1
    assert not list(Path().iterdir())


@pytest.mark.parametrize("command", ["quantize", "segment", "stipple", "mosaic", "restore"])
def test_one_picture_goes_through_pipes(
    command: str, monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(WHOLE)))
    assert cli.main([command, "-", *COMMANDS[command], "-o", "-"]) == 0
    out, err = capfdbinary.readouterr()
    assert (out[:4], err) == (b"\x89PNG", b"")
    assert image_info(out).format == "PNG"

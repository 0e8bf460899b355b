"""A palette file says the colors that it was given, in the words of its format, and gives them back."""

import json
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageCms

from cvtimg._shared.types import Array
from cvtimg.palettes.files import PALETTE_FORMATS, read_palette, write_palette
from cvtimg.pictures.files import write_image

RGB = np.array([[0, 0, 0], [200, 16, 46], [255, 255, 255]], np.uint8)
RGBA = np.array([[0, 0, 0, 0], [200, 16, 46, 128]], np.uint8)


def ase(*colors: tuple[bytes, tuple[float, ...]], group: str = "ab", last: int = 0) -> bytes:
    """Build a file with a group that has the first color, and the others outside; or as we write it, with `last`."""
    title = (group if len(group) > 1 else f"{group}\0").encode("utf-16-be")
    blocks = [struct.pack(">HIH", 0xC001, 2 + len(title), len(title) // 2) + title]
    for model, values in colors:
        letters = (f"#{bytes(round(255 * value) for value in values).hex()}\0" if last else "\0").encode("utf-16-be")
        body = struct.pack(">H", len(letters) // 2) + letters + model + struct.pack(f">{len(values)}fH", *values, last)
        blocks.append(struct.pack(">HI", 1, len(body)) + body)
    blocks.insert(2 if not last else len(blocks), struct.pack(">HI", 0xC002, 0))
    return struct.pack(">4sHHI", b"ASEF", 1, 0, len(blocks)) + b"".join(blocks)


SQUARES = "".join(
    f'<rect x="{40 * n}" y="0" width="40" height="40" fill="{code}"><title>{code}</title></rect>\n'
    for n, code in enumerate(("#000000", "#c8102e", "#ffffff"))
)
#: What is written of RGB into a file of the name "a".
WRITTEN = {
    ".json": b"""{
  "name": "a",
  "colors": [
    {"hex": "#000000", "rgb": [0, 0, 0]},
    {"hex": "#c8102e", "rgb": [200, 16, 46]},
    {"hex": "#ffffff", "rgb": [255, 255, 255]}
  ]
}
""",
    ".gpl": b"GIMP Palette\nName: a\nColumns: 16\n#\n"
    b"  0   0   0\t#000000\n200  16  46\t#c8102e\n255 255 255\t#ffffff\n",
    ".hex": b"000000\nc8102e\nffffff\n",
    ".css": b":root {\n  --a-1: #000000;\n  --a-2: #c8102e;\n  --a-3: #ffffff;\n}\n",
    ".scss": b"$a-1: #000000;\n$a-2: #c8102e;\n$a-3: #ffffff;\n",
    ".svg": f'<svg xmlns="http://www.w3.org/2000/svg" width="120" height="40">\n{SQUARES}</svg>\n'.encode(),
    ".act": RGB.tobytes().ljust(768, b"\0") + b"\0\3\xff\xff",
    ".ase": ase(*((b"RGB ", tuple(color / 255)) for color in RGB), group="a", last=2),
    ".pal": b"JASC-PAL\r\n0100\r\n3\r\n0 0 0\r\n200 16 46\r\n255 255 255\r\n",
    ".txt": b"; paint.net Palette File\r\n; Palette Name: a\r\nFF000000\r\nFFC8102E\r\nFFFFFFFF\r\n",
}


def test_what_is_written_is_in_the_words_of_the_format(tmp_path: Path) -> None:
    for suffix, content in WRITTEN.items():
        write_palette(tmp_path / f"a{suffix}", RGB)
        assert (tmp_path / f"a{suffix}").read_bytes() == content, suffix
    write_palette(tmp_path / "a.png", RGB)
    with Image.open(tmp_path / "a.png") as image:
        np.testing.assert_array_equal(np.asarray(image.convert("RGB"))[16, 16::32], RGB)
    assert set(PALETTE_FORMATS) == {*WRITTEN, ".png"}


def test_an_act_holds_one_clear_color(tmp_path: Path) -> None:
    palette = np.array([[9, 9, 9, 255], [1, 2, 3, 0], [4, 5, 6, 255]], np.uint8)
    write_palette(tmp_path / "a.act", palette)
    np.testing.assert_array_equal(read_palette(tmp_path / "a.act"), palette)
    for alpha in (128, 0):
        palette[2, 3] = alpha
        with pytest.raises(ValueError, match="one transparent color, and no half-transparent"):
            write_palette(tmp_path / "b.act", palette)
    with pytest.raises(ValueError, match=r"\.act holds at most 256 colors, and these are 257"):
        write_palette(tmp_path / "b.act", np.zeros((257, 3), np.uint8))


# --- files of other programs

ENTRIES = [[1, 2, 3], [250, 128, 0]]


@pytest.mark.parametrize(
    ("name", "content", "palette"),
    [
        ("a.gpl", b"GIMP Palette\r\n1 2 3 night\r\n\r\n# 9 9 9\r\n 255   0\t7\r\n", [[1, 2, 3], [255, 0, 7]]),
        ("a.gpl", b"GIMP Palette\nChannels: RGBA\n1 2 3 4 night\n", [[1, 2, 3, 4]]),
        ("a.gpl", b"GIMP Palette\nName: \xff\xfe\n1 2 3 #01020304\n9 9 9 grey\n", [[1, 2, 3], [9, 9, 9]]),
        ("a.hex", b"\xef\xbb\xbf#0A0b0C\r\nffffff\r\n", [[10, 11, 12], [255, 255, 255]]),
        ("a.hex", b"102030\n10203040\n", [[16, 32, 48, 255], [16, 32, 48, 64]]),
        ("a.json", b'["#abc", [1, 2, 3]]', [[0xAA, 0xBB, 0xCC], [1, 2, 3]]),
        ("a.json", b'{"colors": [{"rgb": [1, 2, 3], "alpha": 9}]}', [[1, 2, 3, 9]]),
        (
            "a.css",
            b"#abc { --x : #112233 } /* --y: #000; */ :root{--z:#abc;--w: 3px; color: #999}",
            [[17, 34, 51], [170, 187, 204]],
        ),
        ("a.act", bytes(range(256)) * 3, np.array([*range(256)] * 3).reshape(-1, 3)),
        ("a.act", bytes(768) + b"\0\3\xff\xff", [[0, 0, 0]] * 3),
        ("jasc.pal", b"JASC-PAL\r\n0100\r\n2\r\n1 2 3\r\n250 128 0\r\n", ENTRIES),
        ("riff.pal", b"RIFF\x18\0\0\0PAL data\x0c\0\0\0\0\3\2\0\1\2\3\0\xfa\x80\0\0", ENTRIES),
        ("paint.txt", b"; paint.net Palette File\r\n;\r\nFF010203\r\nFFFA8000\r\n", ENTRIES),
        ("names.css", b":root { --a: #010203; --font: serif; --b: #fa8000 }", ENTRIES),
    ],
)
def test_files_of_other_programs_are_read(tmp_path: Path, name: str, content: bytes, palette: Any) -> None:
    (tmp_path / name).write_bytes(content)
    np.testing.assert_array_equal(read_palette(tmp_path / name), palette)


def test_every_color_model_of_an_ase_is_read(tmp_path: Path) -> None:
    colors = [
        (b"RGB ", (1.0, 0.5, 0.0)),
        (b"CMYK", (1.0, 0.0, 0.5, 0.2)),
        (b"Gray", (0.2,)),
        (b"LAB ", (0.5, 20.0, -30.0)),
        (b"LAB ", (1.0, 0.0, 0.0)),
    ]
    (tmp_path / "a.ase").write_bytes(ase(*colors))
    palette = read_palette(tmp_path / "a.ase")
    np.testing.assert_array_equal(palette[:3], [[255, 128, 0], [0, 204, 102], [51, 51, 51]])
    # LittleCMS, through Pillow, works under D50, in whole steps of a and b.
    lab = np.array([round(50 * 2.55), 20, -30 & 255], np.uint8)
    profiles = [ImageCms.createProfile(name) for name in ("LAB", "sRGB")]
    convert = ImageCms.buildTransform(profiles[0], profiles[1], "LAB", "RGB")
    pixel = ImageCms.applyTransform(Image.frombytes("LAB", (1, 1), lab.tobytes()), convert)
    assert np.abs(np.asarray(pixel)[0, 0] - palette[3].astype(int)).max() <= 2
    assert palette[4].tolist() == [255, 255, 255]


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.gpl", b"", "is empty"),
        ("a.gpl", b"GIMP Palette\nName: x\n", "has no colors"),
        ("a.gpl", b"GIMP Palette\n1 2 x\n", "has a line '1 2 x', which must begin with 3 or 4 numbers"),
        ("a.gpl", b"GIMP Palette\n1 2\n", r"has a color \(1, 2\), which must be three or four"),
        ("a.gpl", b"GIMP Palette\n1 2 256\n", r"has a color \(1, 2, 256\)"),
        ("a.hex", b"ffffff\n12345\n", "has a color '12345', which must be like #rrggbb"),
        ("a.hex", b"", "is empty"),
        ("a.json", b"{", r"is truncated or damaged \(Expecting"),
        ("a.json", b"{}", "must have a list of colors, or one called 'colors'"),
        ("a.json", b"[[1.5, 2, 3]]", r"has a color \[1\.5, 2, 3\]"),
        ("a.json", b"[{}]", r"has a color \(\)"),
        ("a.act", bytes(767), "has 767 bytes; a color table must have 768 or 772"),
        ("a.act", bytes(768) + b"\1\1\0\0", "declares 257 colors"),
        ("a.ase", b"", "is empty"),
        ("a.ase", b"GIMP Palette\n", "is not an Adobe Swatch Exchange file"),
        ("a.ase", ase((b"RGB ", (1.0, 0.5, 0.0)))[:-12], "is truncated or damaged"),
        ("a.ase", ase((b"HSB ", (1.0, 0.5, 0.0))), "has a color with the model b'HSB '"),
        ("a.ase", ase((b"Gray", (float("nan"),))), "has a color that is not finite"),
        ("a.css", b"body { color: #123456 }", "has no colors"),
        ("a.css", b"--x: #12345;", "has a color '#12345'"),
        ("a.png", b"GIMP Palette", "cannot be read: unknown image format"),
        ("a.png", b"", "is empty"),
        ("a.xyz", b"#112233", "cannot be read: unknown image format"),
        ("a.txt", b"; only\n; comments", "has no colors"),
        ("a.txt", b"FF11223", "has a color 'FF11223'"),
        ("a.pal", b"JASC", "is not a JASC or RIFF palette"),
        ("a.pal", b"JASC-PAL\n0100\n1\n1 2 x", "has a line .1 2 x., which must begin with 3 or 4 numbers"),
    ],
)
def test_a_file_that_is_no_palette_is_named_with_the_reason(
    tmp_path: Path, name: str, content: bytes, reason: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(OSError, match=f"^{re.escape(str(tmp_path / name))}: {reason}"):
        read_palette(tmp_path / name)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", PALETTE_FORMATS)
def test_a_damaged_palette_is_read_or_is_an_os_error(tmp_path: Path, suffix: str) -> None:
    write_palette(tmp_path / f"a{suffix}", RGB)
    whole = (tmp_path / f"a{suffix}").read_bytes()
    rng = np.random.default_rng(3)
    n_failed = 0
    for _ in range(40):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole), 3):
            damaged[place] = rng.integers(0, 256)
        (tmp_path / f"a{suffix}").write_bytes(damaged[: rng.integers(1, len(whole) + 1)])
        try:
            read_palette(tmp_path / f"a{suffix}")
        except OSError:
            n_failed += 1
    assert n_failed


# --- pictures as palettes


def test_the_palette_of_an_indexed_picture_is_taken_with_entries_that_no_pixel_has(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", np.array([[2, 0]]), palette=RGB)
    np.testing.assert_array_equal(read_palette(tmp_path / "a.png"), RGB)
    write_image(tmp_path / "b.png", np.array([[1, 0]]), palette=RGBA)
    np.testing.assert_array_equal(read_palette(tmp_path / "b.png"), RGBA)
    write_image(tmp_path / "a.gif", np.array([[2, 0, 1]]), palette=RGB)  # whose padding is no color
    np.testing.assert_array_equal(read_palette(tmp_path / "a.gif"), RGB)


def test_grey_and_16_bits_become_rgb_of_8(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", np.array([[7, 0, 7]], np.uint8))
    np.testing.assert_array_equal(read_palette(tmp_path / "a.png"), [[7] * 3, [0] * 3])
    write_image(tmp_path / "b.tif", np.array([[[257, 514, 65535]]], np.uint16))
    np.testing.assert_array_equal(read_palette(tmp_path / "b.tif"), [[1, 2, 255]])


def test_a_picture_of_too_many_colors_is_no_palette(tmp_path: Path) -> None:
    codes = np.arange(65537 + 63).reshape(-1, 64)
    write_image(tmp_path / "a.png", np.stack([codes % 256, codes // 256 % 256, codes // 65536], 2).astype(np.uint8))
    with pytest.raises(OSError, match=r"a\.png: has 65600 colors, over the limit of 65536; quantize it first"):
        read_palette(tmp_path / "a.png")
    write_image(tmp_path / "b.tif", np.zeros((2, 2), np.float32))
    with pytest.raises(OSError, match=r"b\.tif: has floating point samples"):
        read_palette(tmp_path / "b.tif")


# --- writing


def test_alpha_and_shares_are_written(tmp_path: Path) -> None:
    write_palette(tmp_path / "a.JSON", RGBA, density=[1, 3])  # the case of the suffix does not matter
    assert json.loads((tmp_path / "a.JSON").read_text())["colors"] == [
        {"hex": "#00000000", "rgb": [0, 0, 0], "alpha": 0, "share": 0.25},
        {"hex": "#c8102e80", "rgb": [200, 16, 46], "alpha": 128, "share": 0.75},
    ]
    write_palette(tmp_path / "two\nlines.gpl", RGBA)
    lines = (tmp_path / "two\nlines.gpl").read_text().splitlines()
    assert (lines[1], lines[-1]) == ("Name: two lines", "200  16  46\t#c8102e80")


@pytest.mark.parametrize(
    "palette",
    [
        np.array([0, 128, 255], np.uint8),
        np.array([[0], [128], [255]], np.uint8),
        np.array([0, 128 * 257 + 100, 65535], np.uint16),
        np.array([[0], [128 / 255 + 0.001], [1]], np.float32),
    ],
    ids=["uint8", "uint8 column", "uint16", "float32"],
)
def test_grey_of_any_depth_is_written_with_8_bits(tmp_path: Path, palette: Array) -> None:
    write_palette(tmp_path / "a.json", palette)
    np.testing.assert_array_equal(read_palette(tmp_path / "a.json"), [[0] * 3, [128] * 3, [255] * 3])


@pytest.mark.parametrize(
    ("palette", "error", "message"),
    [
        (np.zeros((0, 3), np.uint8), ValueError, r"palette of shape \(0, 3\) must be .*K >= 1"),
        (np.zeros((4, 2), np.uint8), ValueError, r"palette of shape \(4, 2\) must be \(K,\), \(K, 1\)"),
        (np.zeros((4, 3), np.int64), TypeError, "palette of type int64 must be uint8"),
        (np.array([[0.0, 1.5, 0.0]]), ValueError, r"palette of type float64 in 0\.\.1\.5 must be in 0\.\.1"),
        (np.array([[0.0, np.nan, 0.0]]), ValueError, r"must be in 0\.\.1"),
    ],
)
def test_what_is_no_palette_is_refused_and_leaves_nothing(
    tmp_path: Path, palette: Array, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        write_palette(tmp_path / "a.gpl", palette)
    assert not list(tmp_path.iterdir())


def test_an_unknown_suffix_and_a_density_of_another_length_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"a\.xyz: suffix='\.xyz' must be one of \.gpl, \.json"):
        write_palette(tmp_path / "a.xyz", RGB)
    with pytest.raises(ValueError, match=r"density of shape \(2,\) must be \(3,\)"):
        write_palette(tmp_path / "a.json", RGB, density=[1, 2])


def test_colors_of_style_sheets_are_read_by_name(tmp_path: Path) -> None:
    (tmp_path / "named.css").write_text(":root { --a: White; --b: rebeccapurple; --c: #0f08 }")
    expected = [[255, 255, 255, 255], [102, 51, 153, 255], [0, 255, 0, 136]]
    for _ in range(2):
        assert read_palette(tmp_path / "named.css").tolist() == expected
        Image.new("RGB", (1, 1), "white")  # Pillow then keeps the color in its table of names in another form


def test_palettes_are_known_by_name_unless_a_file_has_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    sizes = {name: len(read_palette(name)) for name in ("pico-8", "game-boy", "cga", "nes", "web-safe")}
    assert sizes == {"pico-8": 16, "game-boy": 4, "cga": 16, "nes": 55, "web-safe": 216}
    assert read_palette("game-boy")[0].tolist() == [15, 56, 15]
    assert all(len(np.unique(read_palette(name), axis=0)) == size for name, size in sizes.items())
    Image.new("RGB", (1, 1), (1, 2, 3)).save(tmp_path / "cga", "PNG")
    assert read_palette("cga").tolist() == [[1, 2, 3]]

"""What chunks of a PNG say: colors by gAMA, cHRM and cICP become sRGB, and damaged chunks are left out."""

import struct
import zlib
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from cvtimg import read_image
from cvtimg._shared.types import Array, Bytes
from cvtimg.pictures.formats.png_chunks import chunk, described

RGB = np.random.default_rng(0).integers(0, 256, (6, 8, 3), np.uint8)
GAMMA, LINEAR = (chunk(b"gAMA", struct.pack(">I", value)) for value in (45455, 100000))
SRGB = chunk(b"sRGB", b"\0")
CHRM = chunk(b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000))


def png(pixels: Array, *chunks: bytes) -> bytes:
    """Return a PNG with chunks behind its header."""
    buffer = BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()[:33] + b"".join(chunks) + buffer.getvalue()[33:]


def cicp(*numbers: int) -> bytes:
    return chunk(b"cICP", bytes(numbers))


def encoded(light: Array) -> Array:
    """Return 8-bit sRGB of light, as IEC 61966-2-1 has it."""
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize("pixels", [RGB, RGB[..., 0], np.dstack([RGB, RGB[..., :1]])], ids=["RGB", "gray", "RGBA"])
@pytest.mark.parametrize(
    ("chunks", "power"), [((LINEAR,), 1.0), ((GAMMA, CHRM), 1 / 0.45455), ((cicp(1, 8, 0, 1),), 1.0)]
)
def test_a_gamma_becomes_that_of_srgb(pixels: Bytes, chunks: tuple[bytes, ...], power: float) -> None:
    found = read_image(png(pixels, *chunks))
    seen = np.s_[..., :3] if pixels.ndim == 3 else np.s_[...]
    np.testing.assert_allclose(found[seen], encoded((pixels[seen] / 255) ** power), atol=0.51)
    assert pixels.shape[2:] != (4,) or (found[..., 3] == pixels[..., 3]).all()


@pytest.mark.parametrize("chunks", [(SRGB, LINEAR), (cicp(1, 13, 0, 1), LINEAR), (SRGB, GAMMA, CHRM), (CHRM,)])
def test_the_first_of_cicp_srgb_and_gamma_counts(chunks: tuple[bytes, ...]) -> None:
    np.testing.assert_array_equal(read_image(png(RGB, *chunks)), RGB)


@pytest.mark.parametrize(
    ("primaries", "first_row"), [(12, [1.22494, -0.22494, 0]), (9, [1.660491, -0.587641, -0.07285])]
)
def test_primaries_become_those_of_srgb(primaries: int, first_row: list[float]) -> None:
    found = described({"cicp": (primaries, 13, 0, 1)})
    assert found is not None
    np.testing.assert_allclose(found.matrix[0], first_row, atol=1e-4)  # as published, ITU-R BT.2087 for BT.2020
    gray = np.repeat(RGB[..., :1], 3, axis=2)
    np.testing.assert_allclose(read_image(png(gray, cicp(primaries, 13, 0, 1))).astype(int), gray, atol=1)


def test_white_of_pq_is_that_of_a_screen_and_16_bits_are_kept() -> None:
    light = (203 / 10000) ** (1305 / 8192)
    sample = ((0.8359375 + 18.8515625 * light) / (1 + 18.6875 * light)) ** (2523 / 32)
    assert read_image(png(np.full((2, 2, 3), round(255 * sample), np.uint8), cicp(9, 16, 0, 1))).min() >= 252


def test_unknown_colors_are_kept_and_told() -> None:
    with pytest.warns(UserWarning, match="cICP 9, 18, 0, 1 are kept"):
        found = read_image(png(RGB, cicp(9, 18, 0, 1)))
    np.testing.assert_array_equal(found, RGB)


def test_ancillary_chunks_with_wrong_checksums_are_left_out_and_told() -> None:
    damaged = chunk(b"gAMA", struct.pack(">I", 100000))[:-4] + b"1234"
    with pytest.warns(UserWarning, match="left out: gAMA"):
        found = read_image(png(RGB, damaged))
    np.testing.assert_array_equal(found, RGB)
    whole = png(RGB)
    with pytest.raises(OSError, match="truncated or damaged"):
        read_image(whole[:29] + struct.pack(">I", zlib.crc32(b"other")) + whole[33:])


def test_an_alpha_of_10_is_read() -> None:
    picture = Image.fromarray(np.array([[0, 1]], np.uint8))
    picture.putpalette([1, 2, 3, 4, 5, 6])
    buffer = BytesIO()
    picture.save(buffer, "PNG", transparency=b"\0\n")
    assert read_image(buffer.getvalue())[0, :, 3].tolist() == [0, 10]

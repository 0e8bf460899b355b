"""Adobe Swatch Exchange (.ase). Alpha is stored only in color names."""

from __future__ import annotations

import struct
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cvtimg.palettes.formats import aseprite
from cvtimg.palettes.swatches import Swatches, as_palette, with_named_alpha
from cvtimg.pictures.formats.opening import UnfitContentError

_HEADER = struct.Struct(">4sHHI")
_BLOCK = struct.Struct(">HI")
_MAGIC = b"ASEF"
_COLOR, _GROUP, _GROUP_END = 0x0001, 0xC001, 0xC002
_NORMAL = 2  # neither global nor a spot color
#: Bradford adaptation of XYZ colors to the white point of sRGB.
_D50_TO_D65 = np.array(
    [
        [0.9555766, -0.0282895, 0.0122982],
        [-0.0230393, 1.0099416, -0.0204830],
        [0.0631636, 0.0210077, 1.3299098],
    ]
)
_N_VALUES = {b"RGB ": 3, b"CMYK": 4, b"LAB ": 3, b"Gray": 1}


def read(content: bytes) -> NDArray[np.uint8]:
    """Read all colors, including those in groups. CMYK is converted without a profile; Lab is CIELAB under D50.

    Aseprite sprites, which have the same suffix, are read as well.
    """
    if aseprite.is_sprite(content):
        return aseprite.read(content)
    magic, *_, n_blocks = _HEADER.unpack_from(content)
    if magic != _MAGIC:
        raise UnfitContentError("is not an Adobe Swatch Exchange file: it must begin with ASEF")
    swatches = [_color(block) for kind, block in _blocks(content, n_blocks) if kind == _COLOR]
    return as_palette(with_named_alpha([color for color, _ in swatches], [name for _, name in swatches]))


def _blocks(content: bytes, n_blocks: int) -> Iterator[tuple[int, bytes]]:
    at = _HEADER.size
    for _ in range(n_blocks):
        kind, length = _BLOCK.unpack_from(content, at)
        at += _BLOCK.size
        if at + length > len(content):
            raise EOFError("the last block is cut off")
        yield kind, content[at : at + length]
        at += length


def _color(block: bytes) -> tuple[tuple[int, ...], str]:
    """Return the color and its name."""
    n_letters = int.from_bytes(block[:2], "big")
    at = 2 + 2 * n_letters
    model = block[at : at + 4]
    if model not in _N_VALUES:
        raise UnfitContentError(f"has a color with the model {model!r}, which must be RGB, CMYK, LAB or Gray")
    values = np.array(struct.unpack_from(f">{_N_VALUES[model]}f", block, at + 4))
    if not np.isfinite(values).all():
        raise UnfitContentError("has a color that is not finite")
    name = block[2:at].decode("utf-16-be", "replace").rstrip("\0")
    return tuple(_to_srgb(model, values).tolist()), name


def _to_srgb(model: bytes, values: NDArray[np.float64]) -> NDArray[np.uint8]:
    if model == b"LAB ":
        from skimage.color import lab2xyz, xyz2rgb

        rgb = xyz2rgb(lab2xyz(values * (100, 1, 1), illuminant="D50") @ _D50_TO_D65)
    else:
        rgb = (1 - values[:3]) * (1 - values[3]) if model == b"CMYK" else np.broadcast_to(values, 3)
    levels: NDArray[np.uint8] = np.rint(np.clip(rgb, 0, 1) * 255).astype(np.uint8)
    return levels


def write(swatches: Swatches) -> bytes:
    """Write the colors as RGB, in one group named after the palette."""
    blocks = [(_GROUP, _text(swatches.name))]
    for color, code in zip(swatches.colors[:, :3] / 255, swatches.hexes(), strict=True):
        blocks.append((_COLOR, _text(code) + b"RGB " + struct.pack(">3fH", *color, _NORMAL)))
    blocks.append((_GROUP_END, b""))
    body = b"".join(_BLOCK.pack(kind, len(block)) + block for kind, block in blocks)
    return _HEADER.pack(_MAGIC, 1, 0, len(blocks)) + body


def _text(text: str) -> bytes:
    encoded = text.encode("utf-16-be", "replace") + b"\0\0"
    return struct.pack(">H", len(encoded) // 2) + encoded

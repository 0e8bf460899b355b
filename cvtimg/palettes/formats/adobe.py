"""Palettes of Adobe programs: color tables (.act) and Swatch Exchange (.ase)."""

import struct
from collections.abc import Iterator

import numpy as np

from cvtimg._shared.types import Bytes
from cvtimg.palettes.swatches import Swatches, as_palette, with_named_alpha
from cvtimg.pictures.formats.opening import UnfitContentError

_TABLE = struct.Struct(">768sHH")  # 256 colors, their number, and the transparent one
_NONE_CLEAR = 0xFFFF
_HEADER = struct.Struct(">4sHHI")
_BLOCK = struct.Struct(">HI")
_MAGIC = b"ASEF"
_COLOR, _GROUP, _GROUP_END = 0x0001, 0xC001, 0xC002
#: Bradford adaptation of XYZ colors to the white point of sRGB.
_D50_TO_D65 = np.array(
    [[0.9555766, -0.0282895, 0.0122982], [-0.0230393, 1.0099416, -0.0204830], [0.0631636, 0.0210077, 1.3299098]]
)
_N_VALUES = {b"RGB ": 3, b"CMYK": 4, b"LAB ": 3, b"Gray": 1}


def read_act(content: bytes) -> Bytes:
    """Read a color table: 256 RGB triples, then perhaps the number of colors in use and the transparent index."""
    if len(content) not in (768, 772):
        raise UnfitContentError(f"has {len(content)} bytes; a color table must have 768 or 772")
    table, n_colors, clear = _TABLE.unpack(content.ljust(770, b"\0").ljust(772, b"\xff"))
    n_colors = n_colors or 256  # some programs write 0 for all
    if n_colors > 256:
        raise UnfitContentError(f"declares {n_colors} colors; a color table has at most 256")
    colors = np.frombuffer(table, np.uint8).reshape(-1, 3)[:n_colors]
    if clear >= n_colors:
        return colors.copy()
    alpha = np.where(np.arange(n_colors) == clear, 0, 255).astype(np.uint8)
    return np.column_stack([colors, alpha])


def write_act(swatches: Swatches) -> bytes:
    """Write a color table of at most 256 colors, at most one fully transparent and none partially transparent."""
    colors = swatches.colors
    if len(colors) > 256:
        raise ValueError(f".act holds at most 256 colors, and these are {len(colors)}")
    clear = np.flatnonzero(colors[:, 3] < 255) if colors.shape[1] == 4 else np.empty(0, int)
    if len(clear) > 1 or (len(clear) and colors[clear[0], 3]):
        raise ValueError(".act holds at most one transparent color, and no half-transparent ones")
    table = np.ascontiguousarray(colors[:, :3]).tobytes()  # the rest is filled with 0
    return _TABLE.pack(table, len(colors), clear[0] if len(clear) else _NONE_CLEAR)


def read_ase(content: bytes) -> Bytes:
    """Read all swatches, including those in groups. CMYK is converted without a profile; Lab is CIELAB under D50."""
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
    n_letters = int.from_bytes(block[:2], "big")
    at = 2 + 2 * n_letters
    model = block[at : at + 4]
    if model not in _N_VALUES:
        raise UnfitContentError(f"has a color with the model {model!r}, which must be RGB, CMYK, LAB or Gray")
    values = np.array(struct.unpack_from(f">{_N_VALUES[model]}f", block, at + 4))
    if not np.isfinite(values).all():
        raise UnfitContentError("has a color that is not finite")
    name = block[2:at].decode("utf-16-be", "replace").rstrip("\0")
    if model == b"LAB ":
        from skimage.color import lab2xyz, xyz2rgb

        rgb = xyz2rgb(lab2xyz(values * (100, 1, 1), illuminant="D50") @ _D50_TO_D65)
    else:
        rgb = (1 - values[:3]) * (1 - values[3]) if model == b"CMYK" else np.broadcast_to(values, 3)
    return tuple(np.rint(np.clip(rgb, 0, 1) * 255).astype(np.uint8).tolist()), name


def write_ase(swatches: Swatches) -> bytes:
    """Write swatches as RGB, in one group named after the palette, with alpha in their names."""
    blocks = [(_GROUP, _text(swatches.name))]
    for color, code in zip(swatches.colors[:, :3] / 255, swatches.hexes(), strict=True):
        values = struct.pack(">3fH", *color, 2)  # neither global nor a spot color
        blocks.append((_COLOR, _text(code) + b"RGB " + values))
    blocks.append((_GROUP_END, b""))
    body = b"".join(_BLOCK.pack(kind, len(block)) + block for kind, block in blocks)
    return _HEADER.pack(_MAGIC, 1, 0, len(blocks)) + body


def _text(text: str) -> bytes:
    encoded = text.encode("utf-16-be", "replace") + b"\0\0"
    return struct.pack(">H", len(encoded) // 2) + encoded

"""What chunks of a PNG say beyond Pillow: damaged ones are left out, and colors that they describe become sRGB.

Portable Network Graphics (PNG) Specification (Third Edition), W3C (2025), https://www.w3.org/TR/png-3/. Of cICP, iCCP,
sRGB, and gAMA with cHRM, the first that is there counts (section 4.3).
"""

import struct
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from PIL.ImageFile import ImageFile

from cvtimg._shared.types import Array, Floats

Light = Callable[[Array], Array]

#: First bytes of every PNG.
PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
#: Chromaticities x, y of white, red, green and blue, by their numbers in ITU-T H.273; white is D65 in all.
_D65 = (0.3127, 0.329)
_PRIMARIES = {
    1: (*_D65, 0.64, 0.33, 0.3, 0.6, 0.15, 0.06),  # BT.709, as sRGB
    9: (*_D65, 0.708, 0.292, 0.17, 0.797, 0.131, 0.046),  # BT.2020
    12: (*_D65, 0.68, 0.32, 0.265, 0.69, 0.15, 0.06),  # Display P3
}
#: Of the Bradford transform to another white.
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
#: Candela per square meter of PQ that are white on a screen of standard range (ITU-R BT.2408).
_WHITE = 203.0


class Described(NamedTuple):
    """Colors that chunks describe: light by sample in 0..1, and light of sRGB by that of the three primaries."""

    light: Light
    matrix: Floats

    def to_srgb(self, colors: Array) -> Array:
        """Return (..., C) colors of integers in sRGB; C is 3, or 1 for gray, and one more for alpha that stays."""
        white, n = np.iinfo(colors.dtype).max, colors.shape[-1] - (colors.shape[-1] in (2, 4))
        levels = self.light(np.arange(white + 1) / white)
        light = levels[colors[..., :n]]
        if n == 3 and not np.allclose(self.matrix, np.eye(3), atol=1e-3):
            light = np.einsum("ij,...j->...i", self.matrix, light)
        light = np.clip(light, 0, 1)
        encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        return np.concatenate([np.rint(white * encoded).astype(colors.dtype), colors[..., n:]], axis=-1)


def without_damage(file: BinaryIO) -> BinaryIO:
    """Return a PNG without the ancillary chunks whose checksum is wrong, as browsers read it, with a warning."""
    damaged, parts, rest = list[tuple[bytes, int, int]](), list[bytes](), 0
    for name, start, length in _places(file):
        if name[:1].islower() and name != b"fdAT":  # pixels, which are checked when they are read
            data = file.read(length)
            if len(data) == length and file.read(4) != struct.pack(">I", zlib.crc32(name + data)):
                damaged.append((name, start, start + 12 + length))
    file.seek(0)
    if not damaged:
        return file
    content = file.read()
    for _, start, stop in damaged:
        parts.append(content[rest:start])
        rest = stop
    names = ", ".join(dict.fromkeys(name.decode("latin-1") for name, *_ in damaged))
    warnings.warn(f"chunks with wrong checksums are left out: {names}", UserWarning, stacklevel=2)
    return BytesIO(b"".join([*parts, content[rest:]]))


def read_more(file: BinaryIO, image: ImageFile) -> None:
    """Add what Pillow does not read of a PNG to its `info`: cICP as "cicp", and an alpha of 10 at the end of tRNS."""
    for name, _, length in _places(file):
        if name == b"IDAT":
            return
        if name == b"cICP":
            image.info["cicp"] = tuple(file.read(length))
        elif name == b"tRNS" and image.mode == "P":  # a pattern of Pillow takes 10 for the end of a line
            image.info["transparency"] = file.read(length)


def described(info: Mapping[Any, Any]) -> Described | None:
    """Return the colors that chunks describe, from Pillow's `info`; None for sRGB, ICC profiles and unknown ones."""
    if "cicp" in info:
        primaries, transfer, matrix, full = (*info["cicp"], 0, 0, 0, 0)[:4]
        if primaries in _PRIMARIES and transfer in _LIGHT and (matrix, full) == (0, 1):
            return Described(_LIGHT[transfer], _to_709(_PRIMARIES[primaries]))
        text = f"colors of cICP {primaries}, {transfer}, {matrix}, {full} are kept, as those of sRGB"
        warnings.warn(text, UserWarning, stacklevel=2)
        return None
    if "icc_profile" in info or "srgb" in info or not (info.get("gamma") or "chromaticity" in info):
        return None
    gamma = info.get("gamma")
    light: Light = (lambda sample: sample ** (1 / gamma)) if gamma else _LIGHT[13]
    try:
        matrix = _to_709(info.get("chromaticity", _PRIMARIES[1]))
    except (ArithmeticError, np.linalg.LinAlgError):  # primaries on a line
        matrix = np.eye(3)
    return Described(light, matrix)


def chunk(name: bytes, data: bytes) -> bytes:
    """Return a chunk with its length and checksum."""
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def chunks_of(png: bytes) -> list[tuple[bytes, bytes]]:
    """List the names and the data of all chunks."""
    file = BytesIO(png)
    return [(name, file.read(length)) for name, _, length in _places(file)]


def _places(file: BinaryIO) -> Iterator[tuple[bytes, int, int]]:
    """Yield the name, place and length of each chunk; the file is where its data begin."""
    start = len(PNG_MAGIC)
    while True:
        file.seek(start)
        head = file.read(8)
        if len(head) < 8:
            return
        length, name = int.from_bytes(head[:4], "big"), head[4:]
        yield name, start, length
        start += 12 + length


def _to_709(chromaticities: tuple[float, ...]) -> Floats:
    """Return the matrix from the light of primaries to that of sRGB."""
    return np.linalg.inv(_to_xyz(_PRIMARIES[1])) @ _to_xyz(chromaticities)


def _to_xyz(chromaticities: tuple[float, ...]) -> Floats:
    """Return the matrix from the light of primaries to XYZ whose white is D65."""
    x, y = np.reshape(chromaticities, (4, 2)).T
    white, *primaries = np.stack([x / y, np.ones(4), (1 - x - y) / y], axis=1)
    columns = np.stack(primaries, axis=1)
    seen, wanted = (_BRADFORD @ point for point in (white, [_D65[0] / _D65[1], 1, (1 - sum(_D65)) / _D65[1]]))
    to_d65 = np.linalg.inv(_BRADFORD) @ np.diag(wanted / seen) @ _BRADFORD
    return to_d65 @ columns * np.linalg.solve(columns, white)


def _of_pq(sample: Array) -> Array:
    """Return light by SMPTE ST 2084, in shares of white."""
    root = sample ** (32 / 2523)
    return 10000 / _WHITE * (np.maximum(root - 0.8359375, 0) / (18.8515625 - 18.6875 * root)) ** (8192 / 1305)


#: Light by sample, by the numbers of ITU-T H.273.
_LIGHT: dict[int, Light] = {
    1: lambda sample: np.where(sample < 0.08124286, sample / 4.5, ((sample + 0.09929683) / 1.09929683) ** (1 / 0.45)),
    8: lambda sample: sample,
    13: lambda sample: np.where(sample <= 0.04045, sample / 12.92, ((sample + 0.055) / 1.055) ** 2.4),
    16: _of_pq,
}

"""Image files made for tests: PNG by hand, color profiles, and what Pillow saves."""

import struct
import zlib
from pathlib import Path
from typing import Any

import tifffile
from PIL import Image, ImageCms

from cvtimg._shared.types import Array
from cvtimg.pictures.formats.png_chunks import chunk


def png(size: tuple[int, int], depth: int, kind: int, rows: bytes, trns: bytes) -> bytes:
    """Build a PNG that Pillow cannot write."""
    header = struct.pack(">IIBBBBB", *size, depth, kind, 0, 0, 0)
    pixels = zlib.compress(rows)
    body = chunk(b"IHDR", header) + chunk(b"tRNS", trns) + chunk(b"IDAT", pixels)
    return b"\x89PNG\r\n\x1a\n" + body + chunk(b"IEND", b"")


def profile(kind: bytes, space: bytes, pcs: bytes, tags: dict[bytes, bytes]) -> bytes:
    """Build an ICC profile of version 2 from its tags."""
    tags = {b"desc": b"desc" + struct.pack(">III", 0, 5, 0) + bytes(75), **tags}
    table, data = b"", b""
    start = 128 + 4 + 12 * len(tags)
    for name, value in tags.items():
        table += name + struct.pack(">II", start + len(data), len(value))
        data += value + bytes(-len(value) % 4)
    header = struct.pack(">I4xI", start + len(data), 0x02100000) + kind + space + pcs
    header += bytes(12) + b"acsp" + bytes(28) + xyz(0.9642, 1.0, 0.8249)[8:]
    return header.ljust(128, b"\0") + struct.pack(">I", len(tags)) + table + data


def xyz(*values: float) -> bytes:
    return b"XYZ " + bytes(4) + struct.pack(">3i", *(round(value * 65536) for value in values))


def gamma(value: float) -> bytes:
    return b"curv" + struct.pack(">IIH", 0, 1, round(value * 256))


def rgb_profile(order: str = "rgb", value: float = 2.2) -> bytes:
    """Build a profile with the primaries of sRGB, given to the bands in another order."""
    columns = {"r": xyz(0.4361, 0.2225, 0.0139), "g": xyz(0.3851, 0.7169, 0.0971), "b": xyz(0.1431, 0.0606, 0.7141)}
    tags = {b"wtpt": xyz(0.9642, 1.0, 0.8249)}
    for band, source in zip("rgb", order, strict=True):
        tags[f"{band}XYZ".encode()] = columns[source]
        tags[f"{band}TRC".encode()] = gamma(value)
    return profile(b"mntr", b"RGB ", b"XYZ ", tags)


def grey_profile(value: float) -> bytes:
    tags = {b"wtpt": xyz(0.9642, 1.0, 0.8249), b"kTRC": gamma(value)}
    return profile(b"mntr", b"GRAY", b"XYZ ", tags)


def cmyk_profile() -> bytes:
    """Build a print profile whose inks are all grey: half of the light for each."""
    inks = [bin(corner).count("1") for corner in range(16)]
    table = b"".join(bytes([round(255 * 0.5**n), 128, 128]) for n in inks)
    identity = struct.pack(">9i", *(65536 * (i % 4 == 0) for i in range(9)))
    lut = b"mft1" + bytes(4) + bytes([4, 3, 2, 0]) + identity
    lut += bytes(range(256)) * 4 + table + bytes(range(256)) * 3
    return profile(b"prtr", b"CMYK", b"Lab ", {b"wtpt": xyz(0.9642, 1, 0.8249), b"A2B0": lut})


SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


def save(path: Path, image: Image.Image | Array, **options: Any) -> Path:
    (image if isinstance(image, Image.Image) else Image.fromarray(image)).save(path, **options)
    return path


def write_tiff(image: Array, **layout: Any) -> None:
    """Write a.tif."""
    rgb = image.ndim == 3 and image.shape[2] in (3, 4)
    if image.ndim == 3:
        layout = {"planarconfig": "contig", **layout}
    tifffile.imwrite("a.tif", image, photometric="rgb" if rgb else "minisblack", metadata=None, **layout)

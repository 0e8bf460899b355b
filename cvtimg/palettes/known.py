"""Palettes of well-known machines, by name: files of this package; the NES has no fixed RGB values but usual ones."""

from __future__ import annotations

import re
from pathlib import Path

from cvtimg._shared.types import Bytes
from cvtimg.palettes.formats.text import read_hex


def known_palette(text: str) -> Bytes | None:
    """Return the (K, 3) or (K, 4) colors of a name, or those written as ``"#102030,#f0e0d0"``; None for other texts."""
    if not re.fullmatch(r"#(?:[0-9a-fA-F]{6}(?:,#[0-9a-fA-F]{6})*|[0-9a-fA-F]{8}(?:,#[0-9a-fA-F]{8})*)", text):
        return known_palettes().get(text)
    return read_hex(text.replace(",", "\n").encode())


def known_palettes() -> dict[str, Bytes]:
    """Return (K, 3) palettes by name."""
    paths = sorted((Path(__file__).parent / "known").glob("*.hex"))
    return {path.stem: read_hex(path.read_bytes()) for path in paths}

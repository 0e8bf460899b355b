"""Palettes of well-known machines, by name."""

from __future__ import annotations

import re

import numpy as np

from cvtimg._shared.types import Bytes

_WEB = ("00", "33", "66", "99", "cc", "ff")
#: Hexadecimal colors; the NES had no fixed RGB values, and these are the usual ones.
_CODES = {
    "pico-8": """000000 1d2b53 7e2553 008751 ab5236 5f574f c2c3c7 fff1e8 ff004d ffa300 ffec27 00e436 29adff 83769c
        ff77a8 ffccaa""",
    "game-boy": "0f380f 306230 8bac0f 9bbc0f",
    "cga": """000000 0000aa 00aa00 00aaaa aa0000 aa00aa aa5500 aaaaaa 555555 5555ff 55ff55 55ffff ff5555 ff55ff ffff55
        ffffff""",
    "nes": """7c7c7c 0000fc 0000bc 4428bc 940084 a80020 a81000 881400 503000 007800 006800 005800 004058 000000 bcbcbc
        0078f8 0058f8 6844fc d800cc e40058 f83800 e45c10 ac7c00 00b800 00a800 00a844 008888 f8f8f8 3cbcfc 6888fc 9878f8
        f878f8 f85898 f87858 fca044 f8b800 b8f818 58d854 58f898 00e8d8 787878 fcfcfc a4e4fc b8b8f8 d8b8f8 f8b8f8 f8a4c0
        f0d0b0 fce0a8 f8d878 d8f878 b8f8b8 b8f8d8 00fcfc d8d8d8""",
    "web-safe": " ".join(f"{r}{g}{b}" for r in _WEB for g in _WEB for b in _WEB),
}


def known_palette(text: str) -> Bytes | None:
    """Return the (K, 3) or (K, 4) colors of a name, or those written as ``"#102030,#f0e0d0"``; None for other texts."""
    if not re.fullmatch(r"#(?:[0-9a-fA-F]{6}(?:,#[0-9a-fA-F]{6})*|[0-9a-fA-F]{8}(?:,#[0-9a-fA-F]{8})*)", text):
        return known_palettes().get(text)
    return np.array([list(bytes.fromhex(code[1:])) for code in text.split(",")], np.uint8)


def known_palettes() -> dict[str, Bytes]:
    """Return (K, 3) palettes by name."""
    return {
        name: np.frombuffer(bytes.fromhex("".join(codes.split())), np.uint8).reshape(-1, 3).copy()
        for name, codes in _CODES.items()
    }

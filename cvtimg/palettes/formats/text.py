"""Palettes as text: of GIMP, JASC and paint.net, and lists of colors for Lospec, JSON and style sheets."""

import json
import re
import struct
from collections.abc import Sequence

import numpy as np

from cvtimg._shared.types import Bytes
from cvtimg.palettes.swatches import Swatches, as_palette, hex_color, lines_of, with_named_alpha
from cvtimg.pictures.formats.opening import UnfitContentError

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
#: Custom properties of any rule of CSS, variables of SCSS, and fills of shapes of SVG.
PROPERTY = re.compile(r"--[\w-]+\s*:\s*(#[0-9a-fA-F]+|[a-zA-Z]+)\s*(?=[;}]|$)")
VARIABLE = re.compile(r"\$[\w-]+\s*:\s*(#[0-9a-fA-F]+|[a-zA-Z]+)\s*(?=[;!]|$)")
FILL = re.compile(r"fill\s*[=:]\s*[\"']?(#[0-9a-fA-F]+|[a-zA-Z]+)")


def _lines(*lines: str, end: str = "\n") -> bytes:
    return "".join(line + end for line in lines).encode("utf-8", "replace")


def _numbers(words: list[str]) -> tuple[int, ...]:
    try:
        return tuple(map(int, words))
    except ValueError:
        raise UnfitContentError(f"has a line {' '.join(words)[:40]!r}, which must begin with 3 or 4 numbers") from None


def read_gpl(content: bytes) -> Bytes:
    """Read a GIMP palette (.gpl), as Inkscape, Krita and Aseprite write them too; alpha may be in color names."""
    lines = lines_of(content)
    if not lines or lines[0].strip() != "GIMP Palette":
        raise UnfitContentError("is not a GIMP palette: its first line must be 'GIMP Palette'")
    n_bands = 4 if any(line.replace(" ", "") == "Channels:RGBA" for line in lines[:6]) else 3  # as in Aseprite
    colors, names = [], []
    for line in lines[1:]:
        if line.startswith(("#", "Name:", "Columns:", "Channels:")):
            continue
        words = line.split(maxsplit=n_bands)
        colors.append(_numbers(words[:n_bands]))
        names.append(words[n_bands] if len(words) > n_bands else "")
    return as_palette(with_named_alpha(colors, names))


def write_gpl(swatches: Swatches) -> bytes:
    """Write a GIMP palette, with alpha in the names of the colors."""
    pairs = zip(swatches.colors[:, :3].tolist(), swatches.hexes(), strict=True)
    rows = (f"{red:3} {green:3} {blue:3}\t{code}" for (red, green, blue), code in pairs)
    return _lines("GIMP Palette", f"Name: {swatches.name}", "Columns: 16", "#", *rows)


def read_jasc(content: bytes) -> Bytes:
    """Read a JASC palette (.pal): ``red green blue`` or ``red green blue alpha`` in each line; or a RIFF palette."""
    if content[:4] == b"RIFF" and content[8:16] == b"PAL data":
        *_, n_colors = struct.unpack_from("<4sI8sIHH", content)  # RIFF, size, PAL data, size, version
        entries = np.frombuffer(content, np.uint8, 4 * n_colors, 24).reshape(-1, 4)
        return as_palette(entries[:, :3].tolist())
    lines = lines_of(content)
    if not lines or lines[0].strip() != "JASC-PAL":
        raise UnfitContentError("is not a JASC or RIFF palette: its first line must be 'JASC-PAL'")
    return as_palette(_numbers(line.split()) for line in lines[3:])


def write_jasc(swatches: Swatches) -> bytes:
    """Write the colors, with alpha as a fourth number if the palette has transparency, as Aseprite does."""
    rows = (" ".join(map(str, color)) for color in swatches.colors.tolist())
    return _lines("JASC-PAL", "0100", str(len(swatches.colors)), *rows, end="\r\n")


def read_paintnet(content: bytes) -> Bytes:
    """Read a palette of paint.net (.txt): ``aarrggbb`` in each line, and comments after a semicolon."""
    codes = [line.partition(";")[0].strip() for line in lines_of(content)]
    colors = [hex_color(code[2:] + code[:2] if len(code) == 8 else code) for code in codes if code]
    opaque = all(len(color) == 3 or color[3] == 255 for color in colors)
    return as_palette(color[:3] if opaque else color for color in colors)


def write_paintnet(swatches: Swatches) -> bytes:
    """Write the colors. paint.net reads only the first 96."""
    rows = (f"{code[7:] or 'ff'}{code[1:7]}".upper() for code in swatches.hexes())
    return _lines("; paint.net Palette File", f"; Palette Name: {swatches.name}", *rows, end="\r\n")


def read_hex(content: bytes) -> Bytes:
    """Read ``rrggbb`` or ``rrggbbaa`` from each line, with or without a leading ``#``, as on Lospec."""
    return as_palette(hex_color(line) for line in lines_of(content))


def write_hex(swatches: Swatches) -> bytes:
    """Write the colors."""
    return _lines(*(code[1:] for code in swatches.hexes()))


def read_styles(content: bytes, pattern: re.Pattern[str], distinct: bool = False) -> Bytes:
    """Read what a pattern finds and is a color, as ``#rrggbb`` or by name, not other keywords, such as ``auto``."""
    from PIL.ImageColor import colormap, getrgb

    codes = pattern.findall(_COMMENT.sub("", content.decode("utf-8-sig", "replace")))
    known = (hex_color(code) if code.startswith("#") else colormap.get(code.lower()) for code in codes)
    colors = [getrgb(color) if isinstance(color, str) else color for color in known if color]
    return as_palette(dict.fromkeys(colors) if distinct else colors)


def _named(swatches: Swatches, mark: str) -> str:
    name = re.sub(r"[^a-z0-9]+", "-", swatches.name.lower()).strip("-") or "color"
    return "".join(f"{mark}{name}-{number}: {code};\n" for number, code in enumerate(swatches.hexes(), 1))


def write_css(swatches: Swatches) -> bytes:
    """Write CSS custom properties ``--name-1: #rrggbb;`` in one ``:root`` rule."""
    return f":root {{\n{_named(swatches, '  --')}}}\n".encode()


def write_scss(swatches: Swatches) -> bytes:
    """Write SCSS variables ``$name-1: #rrggbb;``."""
    return _named(swatches, "$").encode()


def write_svg(swatches: Swatches) -> bytes:
    """Write a drawing of squares in rows of 16, each with its code as a title."""
    side, codes = 40, swatches.hexes()
    squares = "".join(
        f'<rect x="{i % 16 * side}" y="{i // 16 * side}" width="{side}" height="{side}" fill="{code}">'
        f"<title>{code}</title></rect>\n"
        for i, code in enumerate(codes)
    )
    width, height = min(len(codes), 16) * side, -(-len(codes) // 16) * side
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">\n{squares}</svg>\n'.encode()


def read_json(content: bytes) -> Bytes:
    """Read JSON written by cvtimg, and lists of ``"#rrggbb"`` or ``[r, g, b]``."""
    value = json.loads(content)
    entries = value.get("colors") if isinstance(value, dict) else value
    if not isinstance(entries, list):
        raise UnfitContentError("must have a list of colors, or one called 'colors'; outlines are for cvtimg mesh")
    return as_palette(_json_color(entry) for entry in entries)


def _json_color(entry: object) -> tuple[int, ...]:
    if isinstance(entry, dict):
        alpha = [entry["alpha"]] if "alpha" in entry else []
        entry = entry["hex"] if "hex" in entry else [*entry.get("rgb", ()), *alpha]
    if isinstance(entry, str):
        return hex_color(entry)
    if not isinstance(entry, list) or not all(isinstance(value, int) for value in entry):
        raise UnfitContentError(f"has a color {str(entry)[:40]}, which must be like '#rrggbb' or [r, g, b]")
    return tuple(entry)


def write_json(swatches: Swatches) -> bytes:
    """Write the colors, and the share of each if it is known."""
    shares: Sequence[float | None] = swatches.shares or [None] * len(swatches.colors)
    rows = zip(swatches.colors.tolist(), swatches.hexes(), shares, strict=True)
    full = ({"hex": code, "rgb": color[:3], "alpha": (*color, None)[3], "share": share} for color, code, share in rows)
    entries = [{name: value for name, value in entry.items() if value is not None} for entry in full]
    # One line per color is easy to read and to diff.
    lines = ",\n".join("    " + json.dumps(entry) for entry in entries)
    return f'{{\n  "name": {json.dumps(swatches.name)},\n  "colors": [\n{lines}\n  ]\n}}\n'.encode()

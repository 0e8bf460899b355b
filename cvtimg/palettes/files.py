"""Read and write palette files of other programs.

Formats are registered here by suffix. Images can be read as palettes, too.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_choice, check_density, check_shape, check_within, refuse_type
from cvtimg._shared.pixels import peak
from cvtimg._shared.types import Array, Bytes
from cvtimg.colors.spaces import to_depth
from cvtimg.files.whole import StrPath, write_whole
from cvtimg.palettes.formats import adobe, text
from cvtimg.palettes.formats.picture import read_picture, write_picture
from cvtimg.palettes.swatches import Swatches
from cvtimg.pictures.formats.opening import reading


@dataclass(frozen=True, slots=True)
class PaletteFormat:
    """A palette format: the (K, 3) or (K, 4) colors of the bytes of a file, and the bytes of a file with swatches."""

    read: Callable[[bytes], Bytes]
    write: Callable[[Swatches], bytes]


#: Formats by suffix.
PALETTE_FORMATS = {
    ".gpl": PaletteFormat(text.read_gpl, text.write_gpl),
    ".json": PaletteFormat(text.read_json, text.write_json),
    ".hex": PaletteFormat(text.read_hex, text.write_hex),
    ".act": PaletteFormat(adobe.read_act, adobe.write_act),
    ".ase": PaletteFormat(adobe.read_ase, adobe.write_ase),
    ".css": PaletteFormat(partial(text.read_styles, pattern=text.PROPERTY), text.write_css),
    ".scss": PaletteFormat(partial(text.read_styles, pattern=text.VARIABLE), text.write_scss),
    ".svg": PaletteFormat(partial(text.read_styles, pattern=text.FILL, distinct=True), text.write_svg),
    ".pal": PaletteFormat(text.read_jasc, text.write_jasc),
    ".txt": PaletteFormat(text.read_paintnet, text.write_paintnet),
    ".png": PaletteFormat(read_picture, write_picture),
}


#: Colors in place of a name, all of them with alpha or none.
_COLORS = re.compile(r"#(?:[0-9a-fA-F]{6}(?:,#[0-9a-fA-F]{6})*|[0-9a-fA-F]{8}(?:,#[0-9a-fA-F]{8})*)")


def known_palettes() -> dict[str, Bytes]:
    """Return the (K, 3) palettes of well-known machines by name; the NES has no fixed RGB values but usual ones."""
    paths = sorted((Path(__file__).parent / "known").glob("*.hex"))
    return {path.stem: text.read_hex(path.read_bytes()) for path in paths}


def read_palette(path: StrPath) -> Bytes:
    r"""Read the colors of a palette file or of an image.

    Parameters
    ----------
    path : str or path-like
        Ends in .gpl (GIMP), .json, .hex (Lospec), .act or .ase (Adobe), .css, .scss, .svg (fills), .pal (JASC, RIFF)
        or .txt (paint.net); any other file is read as an image. Or the name of a palette: "cga", "game-boy",
        "nes", "pico-8", "web-safe"; or the colors themselves, as "#102030,#f0e0d0".

    Returns
    -------
    (K, 3) or (K, 4) uint8 array
        RGB, or RGBA if the file has transparency, in sRGB and in file order. For an indexed image, its palette; for
        other images, the distinct colors in order of first appearance.

    Raises
    ------
    OSError
        If the file cannot be read or does not match its suffix, or if an image without a palette has more than 65536
        colors.

    Notes
    -----
    CMYK colors in an .ase file are converted without a profile, so they only approximate the printed colors.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg.palettes.files import read_palette
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "flag.hex").write_text("0000ff\nffff00\n")
    ...     read_palette(f"{folder}/flag.hex").tolist()
    [[0, 0, 255], [255, 255, 0]]
    """
    if not Path(path).exists():
        name, known = str(path), known_palettes()
        if _COLORS.fullmatch(name):
            return text.read_hex(name.replace(",", "\n").encode())
        if name in known:
            return known[name]
        if "." not in name:
            raise FileNotFoundError(f"{path}: is no file, and no known palette: {', '.join(known)}")
    form = PALETTE_FORMATS.get(Path(path).suffix.lower(), PALETTE_FORMATS[".png"])
    with reading(path) as file:
        return form.read(file.read())


def write_palette(
    path: StrPath, palette: ArrayLike, *, density: ArrayLike | None = None, overwrite: bool = False
) -> None:
    """Write the colors of a palette atomically, in the format given by the suffix.

    Parameters
    ----------
    path : str or path-like
        Ends as those that `read_palette` reads, or in .png, for one square per color. The palette is named after it.
    palette : (K,), (K, 1), (K, 3) or (K, 4) array
        Gray, RGB or RGBA, in sRGB. uint8 is written unchanged; other integers up to their largest value, and
        floating point in 0..1, are rounded to the 8 bits that these formats store.
    density : (K,) array, optional
        Number of pixels of each color; a .json file stores it as a fraction of all pixels.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    FileExistsError
        If the file exists and `overwrite` is false.
    OSError
        If the file cannot be written. No partial file remains, and an existing file is unchanged.

    Notes
    -----
    The .gpl and .ase formats have no transparency: alpha is stored in the name of the color, ``#rrggbbaa``, where
    `read_palette` finds it. An .act file holds at most 256 colors, one of which can be fully transparent.

    Examples
    --------
    >>> import json, tempfile
    >>> from pathlib import Path
    >>> from cvtimg.palettes.files import write_palette
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "flag.json")
    ...     write_palette(file, np.array([[0, 0, 255], [255, 255, 0]], np.uint8), density=[1, 3])
    ...     json.loads(file.read_text())["colors"][1]
    {'hex': '#ffff00', 'rgb': [255, 255, 0], 'share': 0.75}
    """
    target = Path(path)
    form = PALETTE_FORMATS[check_choice(f"{path}: suffix", target.suffix.lower(), PALETTE_FORMATS)]
    colors = _eight_bit(np.asarray(palette))
    weights = check_density(density, len(colors))
    shares = None if density is None else (weights / weights.sum()).tolist()
    # File names need not be valid text; invalid characters are replaced.
    name = " ".join(target.stem.encode("utf-8", "replace").decode().split())
    write_whole(path, form.write(Swatches(name, colors, shares)), overwrite=overwrite)


def _eight_bit(palette: Array) -> Bytes:
    """Convert any palette to (K, 3) or (K, 4) uint8."""
    rows = palette[:, np.newaxis] if palette.ndim == 1 else palette
    fits = rows.ndim == 2 and len(rows) > 0 and rows.shape[1] in (1, 3, 4)
    check_shape("palette", palette.shape, fits, "(K,), (K, 1), (K, 3) or (K, 4) with K >= 1")
    # NumPy's default integers say nothing about white: they hold 8-bit colors as often as others.
    if rows.dtype.kind not in "iuf" or (rows.dtype.kind in "iu" and rows.dtype.itemsize == 8):
        refuse_type("palette", rows.dtype, "uint8, other integers of up to 32 bits, or floating point")
    check_within(f"palette of type {rows.dtype}", rows, 0, peak(rows.dtype), " to be written with 8 bits")
    rows = to_depth(rows, np.dtype(np.uint8))
    return np.ascontiguousarray(np.repeat(rows, 3, axis=1) if rows.shape[1] == 1 else rows)

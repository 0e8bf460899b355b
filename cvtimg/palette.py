"""Palettes as files that other programs read.

A format is one function from a palette to bytes, registered by its suffix in `PALETTE_WRITERS`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._checks import check_choice, check_density
from cvtimg.files import StrPath, whole_file

__all__ = ["PALETTE_WRITERS", "write_palette"]


@dataclass(frozen=True, slots=True, eq=False)
class _Swatches:
    """What a writer gets: (K, 3) or (K, 4) uint8 colors, and for each its share of the pixels where that is known."""

    name: str
    colors: NDArray[np.uint8]
    shares: list[float] | None

    def hexes(self) -> list[str]:
        """Each color as ``#rrggbb``, or as ``#rrggbbaa`` where the palette has transparency."""
        return [f"#{color.tobytes().hex()}" for color in self.colors]


def write_palette(
    path: StrPath, palette: ArrayLike, *, density: ArrayLike | None = None, overwrite: bool = False
) -> None:
    """Write the colors of a palette whole or not at all, in the format that the suffix names.

    Parameters
    ----------
    path : str or path-like
        Ends in .json or .gpl (GIMP, Inkscape, Krita). The palette is named after the file.
    palette : (K,), (K, 1), (K, 3) or (K, 4) array
        Grey, RGB or RGBA, in sRGB. uint8 is written as it is; uint16 and floating point in 0..1 are rounded to
        8 bits, which is what these formats hold.
    density : (K,) array, optional
        How many pixels have each color. A .json tells it as the share of all.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    TypeError, ValueError
        If the suffix is unknown, or the palette or density is not what is said here.
    FileExistsError
        If the file exists and `overwrite` is false.
    OSError
        If the file cannot be written. Nothing is left behind, an old file stays as it was.

    Notes
    -----
    A .gpl has no transparency: there the alpha of a color is in its name alone, ``#rrggbbaa``.

    Examples
    --------
    >>> import json, tempfile
    >>> from pathlib import Path
    >>> from cvtimg.palette import write_palette
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "flag.json")
    ...     write_palette(file, np.array([[0, 0, 255], [255, 255, 0]], np.uint8), density=[1, 3])
    ...     json.loads(file.read_text())["colors"][1]
    {'hex': '#ffff00', 'rgb': [255, 255, 0], 'share': 0.75}
    """
    target = Path(path)
    writer = PALETTE_WRITERS[check_choice(f"{path}: suffix", target.suffix.lower(), PALETTE_WRITERS)]
    colors = _eight_bit(np.asarray(palette))
    shares = None
    if density is not None:
        weights = check_density(density, len(colors))
        shares = (weights / weights.sum()).tolist()
    content = writer(_Swatches(" ".join(target.stem.split()), colors, shares))
    with whole_file(path, overwrite=overwrite) as file:
        # A file name need not be text; replacing what is not is better than refusing the palette.
        file.write(content.encode("utf-8", "replace"))


def _json(swatches: _Swatches) -> str:
    entries: list[dict[str, Any]] = []
    for number, (color, code) in enumerate(zip(swatches.colors.tolist(), swatches.hexes(), strict=True)):
        entry: dict[str, Any] = {"hex": code, "rgb": color[:3]}
        if len(color) == 4:
            entry["alpha"] = color[3]
        if swatches.shares is not None:
            entry["share"] = swatches.shares[number]
        entries.append(entry)
    # A line for each color: short to read, and to compare.
    lines = ",\n".join("    " + json.dumps(entry) for entry in entries)
    return f'{{\n  "name": {json.dumps(swatches.name)},\n  "colors": [\n{lines}\n  ]\n}}\n'


def _gpl(swatches: _Swatches) -> str:
    rows = (
        f"{red:3} {green:3} {blue:3}\t{code}"
        for (red, green, blue), code in zip(swatches.colors[:, :3].tolist(), swatches.hexes(), strict=True)
    )
    return "\n".join(["GIMP Palette", f"Name: {swatches.name}", "Columns: 16", "#", *rows, ""])


#: From the colors to the text of the file, by suffix.
PALETTE_WRITERS: dict[str, Callable[[_Swatches], str]] = {".gpl": _gpl, ".json": _json}


def _eight_bit(palette: NDArray[Any]) -> NDArray[np.uint8]:
    """(K, 3) or (K, 4) uint8 of any palette."""
    rows = palette[:, np.newaxis] if palette.ndim == 1 else palette
    if rows.ndim != 2 or len(rows) == 0 or rows.shape[1] not in (1, 3, 4):
        raise ValueError(f"palette of shape {palette.shape} must be (K,), (K, 1), (K, 3) or (K, 4), and have colors")
    if rows.dtype == np.uint16:
        rows = np.rint(rows / 257)
    elif rows.dtype.kind == "f":
        if not ((rows >= 0) & (rows <= 1)).all():  # NaN fails too
            raise ValueError(f"palette of type {rows.dtype} must be in 0..1 to be written with 8 bits")
        rows = np.rint(rows * 255)
    elif rows.dtype != np.uint8:
        raise TypeError(f"palette of type {rows.dtype} must be uint8, uint16 or floating point")
    return np.ascontiguousarray(np.repeat(rows, 3, axis=1) if rows.shape[1] == 1 else rows, np.uint8)

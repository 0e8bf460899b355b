"""How formats of text write numbers and files."""

from __future__ import annotations

from collections.abc import Iterable

from cvtimg.files.whole import StrPath, whole_file

#: Decimal places of a coordinate in pixels; half of the last is far below the clearance of borders.
PLACE_DIGITS = 4


def shortest(value: float) -> str:
    """Format a number with as few digits as identify it."""
    return str(int(value)) if value == int(value) else repr(value)


def write_text(path: StrPath, parts: Iterable[str], overwrite: bool) -> None:
    """Write text in UTF-8; the file appears whole or not at all."""
    with whole_file(path, overwrite=overwrite) as file:
        for part in parts:
            file.write(part.encode())

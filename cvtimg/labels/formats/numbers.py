"""How formats of text write numbers."""

from __future__ import annotations

#: Decimal places of a coordinate in pixels; half of the last is far below the clearance of borders.
PLACE_DIGITS = 4


def shortest(value: float) -> str:
    """Format a number with as few digits as identify it."""
    return str(int(value)) if value == int(value) else repr(value)

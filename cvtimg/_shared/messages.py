"""Errors said in one line."""

from __future__ import annotations

_LONGEST_REASON = 200


def one_line(error: Exception) -> str:
    """Give the reason of an error in one plain line."""
    system = error.strerror if isinstance(error, OSError) else None
    lines = (system.lower() if system else str(error)).splitlines()
    # What some decoders raise holds all that they read.
    return lines[0][:_LONGEST_REASON] if lines else type(error).__name__

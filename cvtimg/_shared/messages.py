"""Errors said in one line."""

from __future__ import annotations


def one_line(error: Exception, longest: int = 200) -> str:
    """Give the reason of an error in one plain line."""
    if isinstance(error, MemoryError):
        return "needs more memory than there is"
    system = error.strerror if isinstance(error, OSError) else None
    lines = (system.lower() if system else str(error)).splitlines()
    # What some decoders raise holds all that they read.
    return lines[0][:longest] if lines else type(error).__name__

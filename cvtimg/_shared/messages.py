"""Errors said in one line, and warnings that name the line of the caller."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

_PACKAGE = str(Path(__file__).parents[1])


def one_line(error: Exception, longest: int = 200) -> str:
    """Give the reason of an error in one plain line."""
    if isinstance(error, MemoryError):
        return "needs more memory than there is"
    system = error.strerror if isinstance(error, OSError) else None
    lines = (system.lower() if system else str(error)).splitlines()
    # What some decoders raise holds all that they read.
    return lines[0][:longest] if lines else type(error).__name__


def warn(message: str, kind: type[Warning] = UserWarning) -> None:
    """Warn at the first line outside of the package that led here."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back and frame.f_code.co_filename.startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, kind, stacklevel=level)

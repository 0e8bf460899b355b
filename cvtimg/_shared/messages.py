"""Errors said in one line, and warnings that name the line of the caller."""

import re
import sys
import warnings
from collections.abc import Mapping
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


def reworded(message: str, words: Mapping[str, str], between: str) -> str:
    """Say what others call arguments in a message such as "n_colors='auto' must be ..."; `between` replaces "="."""
    names = "|".join(sorted(map(re.escape, words), key=len, reverse=True))
    if not names:
        return message
    said = re.compile(rf"(?<![\w.])({names})(?:=(?:'([^']*)')?| (?=must))")
    return said.sub(lambda name: words[name[1]] + (f"{between}{name[2] or ''}" if "=" in name[0] else " "), message)


def warn(message: str, kind: type[Warning] = UserWarning) -> None:
    """Warn at the first line outside of the package that led here."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back and frame.f_code.co_filename.startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, kind, stacklevel=level)

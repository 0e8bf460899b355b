"""What part of a file to read as an image: a page, and the axis that holds the bands of an array."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

__all__ = ["Selection", "selected", "selecting"]


@dataclass(frozen=True, slots=True)
class Selection:
    """A choice within files.

    Attributes
    ----------
    page : int or None
        Page to read from files of several pages or planes, from 1; None to refuse such files as images.
    channel_axis : int or None
        Axis of the bands in .npy arrays of three axes; None for the last, unless that is doubtful.
    """

    page: int | None = None
    channel_axis: int | None = None


_SELECTED: ContextVar[Selection] = ContextVar("cvtimg_selection", default=Selection())  # noqa: B039, immutable


def selected() -> Selection:
    """Return the choice in force."""
    return _SELECTED.get()


@contextmanager
def selecting(selection: Selection) -> Iterator[None]:
    """Read files by another choice within a block."""
    token = _SELECTED.set(selection)
    try:
        yield
    finally:
        _SELECTED.reset(token)

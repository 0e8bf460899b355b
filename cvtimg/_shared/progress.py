"""How far a long computation is: it tells its share, and whoever calls it says which part of his own that is.

Nobody listens by default, and then nothing but a look at a variable is done. Only the thread that called is listened
to; threads that share its work need not tell.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple, Self, TypeVar

T = TypeVar("T")


class _Listening(NamedTuple):
    """Who listens, and the part of the whole that is now computed."""

    told: Callable[[float], None]
    start: float = 0.0
    length: float = 1.0

    def part(self, start: float, stop: float) -> Self:
        return self._replace(start=self.start + start * self.length, length=(stop - start) * self.length)


_listening: ContextVar[_Listening | None] = ContextVar("_listening", default=None)


def tell(share: float) -> None:
    """Say how much of a computation is done, 0 to 1."""
    if listening := _listening.get():
        listening.told(listening.start + share * listening.length)


@contextmanager
def part(start: float, stop: float) -> Iterator[None]:
    """Let what is told within stand for a part of what is computed; its end is told."""
    with _set(listening.part(start, stop) if (listening := _listening.get()) else None):
        yield
    tell(stop)


def each(items: Sequence[T]) -> Iterator[T]:
    """Go through items that take about the same time each; what is told within the loop is a part of it."""
    for number, item in enumerate(items):
        with part(number / len(items), (number + 1) / len(items)):
            yield item


def first_few(items: Iterable[T], left: float = 0.75) -> Iterator[T]:
    """Go through items of which only the first few may be needed: after each, a share of what was left is left."""
    done = 0.0
    for item in items:
        start, done = done, 1 - left * (1 - done)
        with part(start, done):
            yield item


@contextmanager
def watched(told: Callable[[float], None]) -> Iterator[None]:
    """Call a function with the share of what is computed within, 0 to 1, which never falls, whenever it is told.

    An exception that the function raises ends the computation.
    """
    done = 0.0

    def more(share: float) -> None:
        nonlocal done
        done = max(done, min(share, 1.0))
        told(done)

    with _set(_Listening(more)):
        yield


@contextmanager
def _set(listening: _Listening | None) -> Iterator[None]:
    before = _listening.get()
    _listening.set(listening)
    try:
        yield
    finally:
        # A loop that an exception has left is closed later, when nobody or somebody else may be listening.
        if listening and (now := _listening.get()) and now.told is listening.told:
            _listening.set(before)

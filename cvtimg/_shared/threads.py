"""Threads for the kernels, which release the GIL: parts of one pass, run side by side.

A pool of Python's own and not OpenMP: its threads sleep while they wait, so that a busy machine is not slowed by
spinning, and it survives a fork. No result depends on the number of threads.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, wraps
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar, cast

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

_Function = TypeVar("_Function", bound=Callable[..., Any])
S = TypeVar("S")
T = TypeVar("T")

#: Variables of the environment that limit the threads of libraries, and ours.
THREAD_VARIABLES = ("CVTIMG_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
#: Steps of a kernel, about 0.5 ms, below which handing a part to a thread costs more than it saves.
_WORTH_A_THREAD = 1 << 20
_alone: ContextVar[bool] = ContextVar("_alone", default=False)


@cache
def n_threads() -> int:
    """Threads of a pass: the environment variable CVTIMG_THREADS, or the processors that this process may use."""
    wanted = os.environ.get("CVTIMG_THREADS", "")
    if wanted:
        from cvtimg._shared.checks import check_in_range  # imports NumPy, which printing help must not

        check_in_range("CVTIMG_THREADS", wanted, wanted.isdigit() and int(wanted) > 0, "a whole number >= 1")
        return int(wanted)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def limit_threads(n: int) -> None:
    """Let this process have `n` threads, and so the libraries that it loads from now on."""
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, str(n)))
    n_threads.cache_clear()
    _pool.cache_clear()


@contextmanager
def one_thread() -> Iterator[None]:
    """Let the passes in this block of code run in the thread that calls them, one of several that are at work."""
    before = _alone.set(True)
    try:
        yield
    finally:
        _alone.reset(before)


def one_blas_thread(function: _Function) -> _Function:
    """Let a function whose matrices are small have one thread of the BLAS: more would only wait for each other."""

    @wraps(function)
    def alone(*arguments: Any, **options: Any) -> Any:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(1, user_api="blas"):
            return function(*arguments, **options)

    return cast("_Function", alone)


@cache
def _pool() -> ThreadPoolExecutor:
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(n_threads() - 1, thread_name_prefix="cvtimg")


# The threads of a pool do not follow into a forked process.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


def in_parts(kernel: Callable[[int, int], None], n_items: int, work: float) -> None:
    """Call ``kernel(start, stop)`` for parts of `n_items`, in threads where `work`, in steps, is worth them."""
    n_parts = int(min(1 if _alone.get() else n_threads(), n_items, max(1, work // _WORTH_A_THREAD)))
    if n_parts <= 1:
        kernel(0, n_items)
        return
    bounds = [n_items * part // n_parts for part in range(n_parts + 1)]
    others = [_pool().submit(kernel, *ends) for ends in pairwise(bounds[1:])]
    kernel(bounds[0], bounds[1])
    for other in others:
        other.result()


def side_by_side(work: Callable[[S], T], items: Sequence[S]) -> Iterator[T]:
    """Yield what `work` makes of each item, in their order; as many items as there are threads are at work at once."""
    if len(items) == 1 or _alone.get():
        yield from map(work, items)
        return

    def alone(item: S) -> T:
        with one_thread():
            return work(item)

    for start in range(0, len(items), n_threads()):
        batch = items[start : start + n_threads()]
        others = [_pool().submit(alone, item) for item in batch[1:]]
        yield alone(batch[0])
        yield from (other.result() for other in others)


def pairwise_sum(values: Iterable[T], add: Callable[[T, T], T]) -> T | None:
    """Add values as they come, sums of equally many two by two, so that each is touched few times; None of none."""
    sums: list[tuple[int, T]] = []  # with how often each was added, falling
    for value in values:
        sums.append((0, value))
        while len(sums) > 1 and sums[-1][0] == sums[-2][0]:
            sums[-2:] = [(sums[-1][0] + 1, add(sums[-2][1], sums[-1][1]))]
    if not sums:
        return None
    total = sums.pop()[1]
    while sums:
        total = add(sums.pop()[1], total)
    return total

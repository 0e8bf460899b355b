"""Threads for the kernels, which release the GIL: parts of one pass, run side by side.

A pool of Python's own and not OpenMP: its threads sleep while they wait, so that a busy machine is not slowed by
spinning, and it survives a fork. No result depends on the number of threads.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, reduce, wraps
from itertools import pairwise
from operator import length_hint
from typing import TYPE_CHECKING, Any, TypeVar, cast

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

_Function = TypeVar("_Function", bound=Callable[..., Any])
S = TypeVar("S")
T = TypeVar("T")

#: Variables of the environment that limit the threads of libraries, and ours.
THREAD_VARIABLES = ("CVTIMG_THREADS", *(f"{name}_NUM_THREADS" for name in ("OMP", "OPENBLAS", "MKL", "NUMEXPR")))
#: Steps of a kernel, about 0.05 ms, that each thread is worth: T steps by n threads, of which the last is woken after
#: log2(n) times w, take the least time where T / n is w / ln 2, and w was 0.036 ms on a virtual machine.
_TO_HAND_OVER = 1 << 18
#: Parts that each thread may take: with more of them, all end at about the same time.
_PARTS_OF_A_THREAD = 3
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


def limit_libraries() -> None:
    """Let CVTIMG_THREADS hold for libraries as well, unless the environment says otherwise."""
    wanted = os.environ.get("CVTIMG_THREADS", "")
    unsaid = [name for name in THREAD_VARIABLES if name not in os.environ]
    if not wanted.isdigit() or not unsaid:
        return
    os.environ.update(dict.fromkeys(unsaid, wanted))
    if "numpy" in sys.modules and {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"} <= {*unsaid}:
        from threadpoolctl import threadpool_limits

        threadpool_limits(int(wanted))  # of those that have been loaded


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
    n_at_once = int(min(1 if _alone.get() else n_threads(), n_items, work / _TO_HAND_OVER))
    if n_at_once <= 1:
        kernel(0, n_items)
        return
    n_parts = min(n_items, _PARTS_OF_A_THREAD * n_at_once)
    left = iter([*pairwise(n_items * part // n_parts for part in range(n_parts + 1))])
    others: list[Future[None]] = []

    def take(n_to_wake: int) -> None:
        # Who wakes a thread waits for that: the caller wakes one, and whoever is woken two.
        for n in (n_to_wake // 2, n_to_wake - n_to_wake // 2):
            if n and length_hint(left):
                others.append(_pool().submit(take, n - 1))
        for part in left:
            kernel(*part)

    # Only those that have begun are waited for, so that passes within passes cannot wait for each other.
    others.append(_pool().submit(take, n_at_once - 2))
    try:
        take(0)
    finally:
        begun = _begun(others)
    for other in begun:
        other.result()


def of_each(kernel: Callable[[int], T], n_items: int, work: float) -> list[T]:
    """Return what ``kernel(n)`` makes of each of `n_items`, in threads where `work`, in steps, is worth them."""
    results: dict[int, T] = {}
    in_parts(lambda start, stop: results.update((n, kernel(n)) for n in range(start, stop)), n_items, work)
    return [results[n] for n in range(n_items)]


def in_stripes(kernel: Callable[[slice], T], n_rows: int, work: float, n: int = 32) -> list[T]:
    """Return what `kernel` makes of each `n` rows, few enough to stay in the cache, whatever the threads."""
    return of_each(lambda stripe: kernel(slice(n * stripe, min(n * (stripe + 1), n_rows))), -(-n_rows // n), work)


def _begun(futures: Sequence[Future[T]]) -> list[Future[T]]:
    """Wait for those that have begun; the others never will."""
    from concurrent.futures import wait

    for future in futures:
        future.cancel()
    for future in futures:  # to which those that have begun may add
        if not future.cancel():
            wait([future])
    return [future for future in futures if not future.cancelled()]


def side_by_side(work: Callable[[S], T], items: Sequence[S]) -> Iterator[T]:
    """Yield what `work` makes of each item, in their order; as many items as there are threads are at work at once."""
    if min(len(items), n_threads()) == 1 or _alone.get():
        yield from map(work, items)
        return
    from concurrent.futures import Future

    def alone(item: S) -> T:
        with one_thread():
            return work(item)

    # With fewer items than threads, the passes in each have the others.
    each = alone if len(items) >= n_threads() else work
    ahead = 3 * n_threads() // 2  # ends wait for those before them
    ends: list[Future[T]] = []
    try:
        for number in range(len(items)):
            ends += [_pool().submit(each, item) for item in items[len(ends) : number + ahead]]
            # Until this one ends, take those that no thread has begun.
            for later in range(number, len(ends)):
                if ends[number].done():
                    break
                if ends[later].cancel():
                    ends[later] = Future()
                    ends[later].set_result(each(items[later]))
            yield ends[number].result()
            ends[number] = Future()  # lets go of the result
    finally:
        _begun(ends)


def pairwise_sum(values: Iterable[T], add: Callable[[T, T], T]) -> T | None:
    """Add values as they come, sums of equally many two by two, so that each is touched few times; None of none."""
    sums: list[tuple[int, T]] = []  # with how often each was added, falling
    for value in values:
        sums.append((0, value))
        while len(sums) > 1 and sums[-1][0] == sums[-2][0]:
            sums[-2:] = [(sums[-1][0] + 1, add(sums[-2][1], sums[-1][1]))]
    parts = [part for _, part in reversed(sums)]
    return reduce(lambda total, part: add(part, total), parts) if parts else None

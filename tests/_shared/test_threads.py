import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from reference import at_threads

from cvtimg._shared import threads
from cvtimg._shared.threads import in_parts, limit_threads, side_by_side
from cvtimg.colors import color_samples
from cvtimg.engine.samples import along_curve

RNG = np.random.default_rng(0)


@pytest.fixture(autouse=True)
def four_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in threads.THREAD_VARIABLES}
    limit_threads(4)
    yield
    for name, value in before.items():
        monkeypatch.delenv(name) if value is None else monkeypatch.setenv(name, value)
    threads.n_threads.cache_clear()
    threads._pool.cache_clear()


def test_each_item_is_in_one_part_also_when_passes_are_within_passes() -> None:
    seen, at_work, most = np.zeros(600), set(), []

    def inner(start: int, stop: int) -> None:
        at_work.add(threading.get_ident())
        most.append(len(at_work))
        time.sleep(1e-4)

    def outer(start: int, stop: int) -> None:
        seen[start:stop] += 1
        in_parts(inner, 20, work=1e9)

    in_parts(outer, len(seen), work=1e9)
    assert (seen == 1).all()
    assert max(most) <= 4


def test_all_threads_that_a_pass_asks_for_take_part_though_each_wakes_few() -> None:
    limit_threads(9)
    everyone = threading.Barrier(9, timeout=20)
    in_parts(lambda start, stop: everyone.wait() and None, 9, work=1e9)


def test_an_error_in_a_part_is_raised() -> None:
    def kernel(start: int, stop: int) -> None:
        if stop == 100:
            raise IndexError("the last part")

    with pytest.raises(IndexError, match="the last part"):
        in_parts(kernel, 100, work=1e9)


@pytest.mark.parametrize("n_items", [1, 3, 30])
def test_ends_come_in_the_order_of_the_items_though_the_first_takes_longest(n_items: int) -> None:
    def work(item: int) -> int:
        time.sleep(0.02 if item == 0 else 0.001)
        in_parts(lambda start, stop: None, 10, work=1e9)
        return item

    assert list(side_by_side(work, range(n_items))) == list(range(n_items))


def test_a_slow_item_holds_up_no_thread_but_its_own() -> None:
    released = threading.Event()

    def work(item: int) -> None:
        # The first ends when some of those after it have, which a batch of four would not let begin.
        assert released.wait(20) if item == 0 else True
        if item == 5:
            released.set()

    list(side_by_side(work, range(6)))


@pytest.mark.parametrize("n_dims", [1, 2, 3, 4])
@pytest.mark.parametrize("n", [3, 200_000])
def test_the_order_along_a_curve_is_that_of_interleaved_bits(n: int, n_dims: int) -> None:
    rows = RNG.integers(0, 1 << (16 if n_dims < 3 else 8), (n, n_dims)) * 1.0
    rows[:2] = np.array([[0], [65535 if n_dims < 3 else 255]])
    steps = ((rows - rows.min()) * (65535 / (rows.max() - rows.min()))).astype(np.uint64)
    keys = np.zeros(n, np.uint64)
    for bit in range(16):
        for dim in range(n_dims):
            keys |= (steps[:, dim] >> np.uint64(bit) & np.uint64(1)) << np.uint64(bit * n_dims + dim)
    if n_dims == 4 and n > 3:
        keys >>= np.uint64(18)  # keys and places have 64 bits together
    if n_dims == 3 and n > 3:
        keys >>= np.uint64(2)
    np.testing.assert_array_equal(along_curve(rows), np.argsort(keys, kind="stable"))


@pytest.mark.parametrize("n_colors", [2, 1 << 24])
def test_colors_are_counted_alike_by_one_thread_and_by_three(n_colors: int) -> None:
    pixels = RNG.integers(0, n_colors, (700, 1000)).astype("<u4").view(np.uint8).reshape(700, 1000, 4)[..., :3]
    found = at_threads(lambda: color_samples(pixels))
    for name in ("rows", "density", "inverse"):
        np.testing.assert_array_equal(getattr(found[0], name), getattr(found[1], name))
    np.testing.assert_array_equal(found[0].colors[found[0].inverse], pixels)


@pytest.mark.parametrize("before", [pytest.param("", marks=pytest.mark.slow), "import numpy; "])
def test_the_limit_of_threads_holds_for_the_blas(before: str) -> None:
    command = (
        f"{before}import cvtimg, scipy.linalg, threadpoolctl; "
        "print({one['num_threads'] for one in threadpoolctl.threadpool_info()})"
    )
    free = {name: value for name, value in os.environ.items() if name not in threads.THREAD_VARIABLES}
    done = subprocess.run(
        [sys.executable, "-P", "-c", command],
        env={**free, "CVTIMG_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout.strip() == "{1}", done.stderr

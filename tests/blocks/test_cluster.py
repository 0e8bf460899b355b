"""One worker or two, in whatever order they end, and even when one is killed: the bits are the same."""

import os
import random
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from cvtimg import tessellate
from cvtimg._shared.types import Floats
from cvtimg.blocks import Blocks, as_blocks

distributed = pytest.importorskip("distributed")
import dask  # noqa: E402
import dask.array as da  # noqa: E402

ROWS = np.random.default_rng(3).normal(size=(1200, 3)).cumsum(axis=0)
# Distributed leaves sockets to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.timeout(280),
]


def read(start: int, folder: str, kill_at: int = -1) -> Floats:
    """Read some rows, after a while; the first to come to some place kills its worker."""
    time.sleep(random.random() / 50)
    if start == kill_at:
        try:
            Path(folder, "killed").touch(exist_ok=False)
        except FileExistsError:
            pass
        else:
            os.kill(os.getpid(), signal.SIGKILL)
    return ROWS[start : start + 100]


def blocks(folder: Path, kill_at: int = -1) -> Blocks:
    parts = [dask.delayed(read, pure=False)(start, str(folder), kill_at) for start in range(0, 1200, 100)]
    return as_blocks(da.concatenate([da.from_delayed(part, (100, 3), np.float64) for part in parts]))


@pytest.mark.slow
def test_a_killed_worker_costs_time_and_no_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Workers are processes that import this module.
    monkeypatch.setattr(sys, "path", [*sys.path, str(Path(__file__).parents[2])])
    with dask.config.set(scheduler="sync"):
        expected = tessellate(blocks(tmp_path), 7)
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0"}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster):
        result = tessellate(blocks(tmp_path, kill_at=500), 7)
    assert (tmp_path / "killed").exists()
    np.testing.assert_array_equal(result.generators, expected.generators)
    assert result.energies == expected.energies


reading, closing = threading.Event(), threading.Event()


def _read_until_the_cluster_is_lost(start: int) -> Floats:
    reading.set()
    assert closing.wait(60)
    return ROWS[start : start + 100]


def test_a_lost_cluster_is_said_in_one_error() -> None:
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": ":0"}
    parts = [dask.delayed(_read_until_the_cluster_is_lost, pure=False)(start) for start in range(0, 1200, 100)]
    rows = da.concatenate([da.from_delayed(part, (100, 3), np.float64) for part in parts])
    cluster = distributed.LocalCluster(**options)

    async def close() -> None:
        closing.set()
        await cluster._close()

    def close_while_reading() -> None:
        assert reading.wait(60)
        cluster.sync(close)

    with distributed.Client(cluster):
        closer = threading.Thread(target=close_while_reading)
        closer.start()
        with pytest.raises(ConnectionError, match="the Dask cluster was lost"):
            tessellate(rows, 7)
        closer.join()

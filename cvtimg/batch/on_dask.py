"""Run tasks on a Dask cluster, whose scheduler distributes them and retries those of lost workers."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from time import time
from typing import Any, TypeAlias

from cvtimg._shared.extras import needs
from cvtimg.batch.report import reason
from cvtimg.batch.tasks import Attempt, Outcome, Task, WrongUsageError

# Dask is not typed.
Client: TypeAlias = Any
Future: TypeAlias = Any

#: Address of a temporary cluster on this machine.
LOCAL = "local"
#: Settings of temporary workers. Profiling takes a tenth of the time, and Dask's default environment makes workers
#: return memory to the system after every image, only to request it again.
_FOR_SHORT = {
    "distributed.worker.profile.enabled": False,
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(
        ("CVTIMG_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
    ),
}
#: Tasks that a worker takes at a time, at most, and how often each of its threads takes some.
_MOST_AT_A_TIME = 16
_GROUPS_PER_THREAD = 16
#: Seconds to wait for the scheduler, at the start and after it is lost.
_PATIENCE = 8


def on_dask(attempt: Attempt, tasks: Sequence[Task], address: str, n_workers: int) -> Generator[tuple[int, Outcome]]:
    """Yield the index and the outcome of each task as it completes."""
    # The address of the scheduler is "tcp://HOST:PORT", whose workers need the same paths of inputs and outputs as this
    # process, or "local" for a cluster of `n_workers` processes, each with one thread. `attempt` never raises.
    with _client(address, n_workers) as client:
        from distributed import as_completed, wait

        n_each = _tasks_at_a_time(len(tasks), sum(client.nthreads().values()))
        whole = range(len(tasks))
        groups = [list(whole[first : first + n_each]) for first in range(0, len(tasks), n_each)]
        started = time()
        futures = {}
        for group in groups:
            some = [tasks[place] for place in group]
            futures[client.submit(_several, attempt, some, started, pure=False)] = group
        suspects: list[int] = []
        for future in as_completed(list(futures)):  # type: ignore[no-untyped-call]
            group = futures[future]
            if future.status == "finished":
                yield from zip(group, future.result(), strict=True)
            elif future.status == "cancelled":
                yield from ((place, Outcome.failed(tasks[place], "the Dask cluster was lost")) for place in group)
            else:
                suspects += group
            future.release()
        # One of them ends its workers, or cannot be sent back. One after the other, the others are done without it.
        for place in suspects:
            alone = client.submit(_several, attempt, [tasks[place]], started, pure=False)
            wait(alone)  # type: ignore[no-untyped-call]
            yield place, alone.result()[0] if alone.status == "finished" else _outcome(alone, tasks[place])


def sum_on_dask(
    attempt: Attempt, tasks: Sequence[Task], add: Callable[[Any, Any], Any], address: str, n_workers: int
) -> tuple[Any, dict[int, str]]:
    """Add the results of tasks in pairs on the workers; return the sum (None if there is none) and the failures."""
    with _client(address, n_workers) as client:
        from distributed import as_completed

        places = {client.submit(_alone, attempt, task, pure=False): place for place, task in enumerate(tasks)}
        why: dict[int, str] = {}
        for future in as_completed(list(places)):  # type: ignore[no-untyped-call]
            # Only the reason is transferred; results stay on the workers.
            failed = client.submit(attrgetter("why"), future).result() if future.status == "finished" else ""
            if failed or future.status != "finished":
                why[places[future]] = failed or _outcome(future, tasks[places[future]]).why
        sums = [future for future, place in places.items() if place not in why]
        sums = [client.submit(attrgetter("result"), future) for future in sums]
        while len(sums) > 1:
            pairs = [client.submit(add, *sums[n : n + 2]) for n in range(0, len(sums) - 1, 2)]
            sums = pairs + sums[2 * len(pairs) :]
        return (sums[0].result() if sums else None), why


@contextmanager
def on_cluster_of_task() -> Iterator[None]:
    """Let what a task computes with Dask be done by all workers of the cluster that the task is on, if it is on one."""
    if "distributed" not in sys.modules:
        yield
        return
    from distributed import get_worker, worker_client

    try:
        get_worker()
    except ValueError:
        yield
        return
    with worker_client():
        yield


def _tasks_at_a_time(n_tasks: int, n_threads: int) -> int:
    """Several, so that handing them over costs little, but no more than let all workers end at about the same time."""
    return min(_MOST_AT_A_TIME, max(1, n_tasks // (_GROUPS_PER_THREAD * max(1, n_threads))))


def _several(attempt: Attempt, tasks: Sequence[Task], started: float) -> list[Outcome]:
    """Do some tasks; rows tell which worker did them."""
    from distributed import get_worker

    name = str(get_worker().name)
    outcomes = []
    for task in tasks:
        for path in task.outputs.values():
            _remove_own(path, started)
        outcome = _alone(attempt, task)
        if isinstance(outcome.result, dict):
            outcome = replace(outcome, result={**outcome.result, "worker": name})
        outcomes.append(outcome)
    return outcomes


def _remove_own(path: Path, started: float) -> None:
    """Remove an output that was written since this run started: by a worker that was lost before it could say so."""
    with suppress(OSError):
        if path.is_file() and path.stat().st_mtime > started:
            path.unlink()


def _alone(attempt: Attempt, task: Task) -> Outcome:
    """Do a task with one thread, because the cluster runs a task on each of its own threads."""
    from cvtimg._shared.threads import limit_threads, n_threads

    if n_threads() != 1:
        limit_threads(1)
    return attempt(task)


def _outcome(future: Future, task: Task) -> Outcome:
    from distributed import KilledWorker

    try:
        outcome: Outcome = future.result()
    except KilledWorker as error:
        return Outcome.failed(task, f"{error.allowed_failures + 1} workers were lost while they worked on it")
    except Exception as error:  # results that cannot be pickled, or a worker with another version of cvtimg
        return Outcome.failed(task, reason(task.name, error))
    return outcome


@contextmanager
def _client(address: str, n_workers: int) -> Iterator[Client]:
    try:
        import dask
        import distributed
    except ImportError as error:
        raise WrongUsageError(f"--dask needs {needs('distributed', 'dask')}") from error
    library: Any = distributed
    if address == LOCAL:
        options = {"n_workers": n_workers, "threads_per_worker": 1, "dashboard_address": ":0"}
        with dask.config.set(_FOR_SHORT), library.LocalCluster(**options) as cluster, library.Client(cluster) as client:
            yield client
        return
    try:
        client = library.Client(address, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise WrongUsageError(f"--dask: no scheduler answers at {address!r}") from error
    with client:
        yield client

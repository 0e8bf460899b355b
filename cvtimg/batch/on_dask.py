"""Run tasks on a Dask cluster, whose scheduler distributes them and retries those of lost workers."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeAlias

from cvtimg.batch.report import reason
from cvtimg.batch.tasks import Attempt, Outcome, Task, WrongUsageError

__all__ = ["LOCAL", "on_dask", "sum_on_dask"]

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
#: Seconds to wait for the scheduler.
_PATIENCE = 10


def on_dask(attempt: Attempt, tasks: Sequence[Task], address: str, n_workers: int) -> Generator[tuple[int, Outcome]]:
    """Yield the index and the outcome of each task as it completes.

    Parameters
    ----------
    attempt : callable
        Does one task and never raises; picklable.
    tasks : sequence of Task
        Tasks to do. Workers need the same paths of inputs and outputs as this process.
    address : str
        Address of the scheduler, "tcp://HOST:PORT", or "local".
    n_workers : int
        Number of processes of a local cluster, each with one thread.
    """
    with _client(address, n_workers) as client:
        places = _submitted(client, attempt, tasks)
        for future in _as_completed(places):
            yield places[future], _outcome(future, tasks[places[future]])
            future.release()


def sum_on_dask(
    attempt: Attempt,
    tasks: Sequence[Task],
    add: Callable[[Any, Any], Any],
    address: str,
    n_workers: int,
) -> tuple[Any, dict[int, str]]:
    """Add the results of tasks in pairs on the workers; return the sum (None if there is none) and the failures."""
    with _client(address, n_workers) as client:
        places = _submitted(client, attempt, tasks)
        why: dict[int, str] = {}
        for future in _as_completed(places):
            # Only the reason is transferred; results stay on the workers.
            failed = client.submit(_why, future).result() if future.status == "finished" else ""
            if failed or future.status != "finished":
                why[places[future]] = failed or _outcome(future, tasks[places[future]]).why
        sums = [future for future, place in places.items() if place not in why]
        sums = [client.submit(_result, future) for future in sums]
        while len(sums) > 1:
            pairs = [client.submit(add, *sums[n : n + 2]) for n in range(0, len(sums) - 1, 2)]
            sums = pairs + sums[2 * len(pairs) :]
        return (sums[0].result() if sums else None), why


def _submitted(client: Client, attempt: Attempt, tasks: Sequence[Task]) -> dict[Future, int]:
    alone = partial(_alone, attempt=attempt)
    return {client.submit(alone, task, pure=False): place for place, task in enumerate(tasks)}


def _alone(task: Task, *, attempt: Attempt) -> Outcome:
    """Do a task with one thread, because the cluster runs a task on each of its own threads."""
    from cvtimg._shared.threads import limit_threads, n_threads

    if n_threads() != 1:
        limit_threads(1)
    return attempt(task)


def _why(outcome: Outcome) -> str:
    return outcome.why


def _result(outcome: Outcome) -> Any:
    return outcome.result


def _as_completed(futures: Any) -> Iterator[Future]:
    import distributed

    library: Any = distributed
    completed: Iterator[Future] = library.as_completed(list(futures))
    return completed


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
        raise WrongUsageError("--dask needs the package distributed: pip install 'cvtimg[dask]'") from error
    library: Any = distributed
    if address == LOCAL:
        options = {"n_workers": n_workers, "threads_per_worker": 1, "dashboard_address": ":0"}
        with (
            dask.config.set(_FOR_SHORT),
            library.LocalCluster(**options) as cluster,
            library.Client(cluster) as client,
        ):
            yield client
        return
    try:
        client = library.Client(address, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise WrongUsageError(f"--dask: no scheduler answers at {address!r}") from error
    with client:
        yield client

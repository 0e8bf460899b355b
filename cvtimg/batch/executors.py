"""Where tasks of a batch are done: in processes or on a Dask cluster. A worker that dies fails only its own task."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import cache
from multiprocessing import active_children, get_context, parent_process
from time import sleep, time
from typing import Any, TypeAlias

from cvtimg._shared.extras import needs
from cvtimg._shared.threads import THREAD_VARIABLES, limit_threads, n_threads
from cvtimg.batch.report import reason
from cvtimg.batch.tasks import Attempt, Outcome, Task, WrongUsageError

#: Address of a temporary cluster on this machine.
LOCAL = "local"
#: Settings of temporary workers. Profiling takes a tenth of the time, and Dask's default environment makes workers
#: return memory to the system after every image, only to request it again.
_FOR_SHORT = {
    "distributed.worker.profile.enabled": False,
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(THREAD_VARIABLES, "1"),
}
#: Seconds that a worker has to clean up after it is told to stop, and a scheduler to answer.
_PATIENCE = 8
#: A place where one task is done at a time: begins it.
_Seat: TypeAlias = Callable[[Task], Future[Outcome]]


def in_processes(
    attempt: Attempt, tasks: Sequence[Task], n_workers: int, threads_each: int, late: tuple[str, ...]
) -> Generator[tuple[int, Outcome]]:
    """Yield the index and the outcome of each task as it completes; `attempt` never raises."""
    before = set(active_children())
    workers = [_Worker(attempt, threads_each, late) for _ in range(n_workers)]
    try:
        yield from _performed(tasks, [worker.submit for worker in workers])
    finally:  # at once, leaving neither a partial file nor a zombie
        for worker in workers:
            worker.close()
        processes = set(active_children()) - before
        for process in processes:
            process.terminate()
        for process in processes:
            process.join(_PATIENCE)
            process.kill()
            process.join()


def on_dask(attempt: Attempt, tasks: Sequence[Task], address: str, n_workers: int) -> Generator[tuple[int, Outcome]]:
    """Yield the index and the outcome of each task as it completes, on a cluster."""
    # The address of the scheduler is "tcp://HOST:PORT", whose workers need the same paths of inputs and outputs as this
    # process, or "local" for a cluster of `n_workers` processes, each with one thread.
    with _client(address, n_workers) as client:
        executor, started = client.get_executor(pure=False), time()

        def alone(task: Task) -> Future[Outcome]:
            job: Future[Outcome] = executor.submit(_alone, attempt, task, started)
            return job

        suspects = []
        seats = [alone] * len(tasks)
        for place, outcome in _performed(tasks, seats):
            if outcome.result is _LOST:
                suspects.append(place)
            else:
                yield place, outcome
        # One of them ends its workers. One after the other, the others are done without it.
        for place in suspects:
            outcome = _outcome(alone(tasks[place]), tasks[place])
            yield place, replace(outcome, result=None) if outcome.result is _LOST else outcome


def _performed(tasks: Sequence[Task], seats: Sequence[_Seat]) -> Generator[tuple[int, Outcome]]:
    free, waiting = [*seats], iter(enumerate(tasks))
    busy: dict[Future[Outcome], tuple[int, _Seat]] = {}
    try:
        while True:
            while free and (task := next(waiting, None)):
                seat = free.pop()
                busy[seat(task[1])] = task[0], seat
            if not busy:
                return
            for job in wait(busy, return_when=FIRST_COMPLETED).done:
                place, seat = busy.pop(job)
                free.append(seat)
                yield place, _outcome(job, tasks[place])
    except KeyboardInterrupt:  # what is done is told
        for job in wait(busy, 0).done:
            yield busy[job][0], _outcome(job, tasks[busy[job][0]])
        raise


#: Result of a task whose workers were lost, perhaps because of another.
_LOST = object()


def _outcome(job: Future[Outcome], task: Task) -> Outcome:
    try:
        return job.result()
    except BrokenProcessPool:
        why = "its worker process was lost, as the system ends one when memory runs out"
    except CancelledError:
        why = "the Dask cluster was lost"
    except Exception as error:  # results that cannot be pickled, or a worker with another version of cvtimg
        if type(error).__name__ == "KilledWorker":
            n_lost = getattr(error, "allowed_failures", 0) + 1
            return Outcome(_LOST, ((task.name, f"{n_lost} workers were lost while they worked on it"),))
        why = reason(task.name, error)
    return Outcome(None, ((task.name, why),))


class _Worker:
    """A process, never a fork of this one, because a forked program with threads can hang; a lost one is replaced."""

    def __init__(self, attempt: Attempt, n_threads: int, late: tuple[str, ...]) -> None:
        self._attempt, self._n_threads, self._late = attempt, n_threads, late
        self._pool: ProcessPoolExecutor | None = None

    def submit(self, task: Task) -> Future[Outcome]:
        self._pool = self._pool or ProcessPoolExecutor(1, _context(self._late), _begin, (self._n_threads,))
        try:
            with _interrupts_held():
                return self._pool.submit(self._attempt, task)
        except BrokenProcessPool:
            self._pool = None
            return self.submit(task)

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)


@cache
def _context(late: tuple[str, ...]) -> Any:
    """Return how workers start: from a server of one thread, which has imported what all of them need, by forks."""
    if sys.platform != "linux":
        return get_context("spawn")
    from multiprocessing import forkserver

    context = get_context("forkserver")
    context.set_forkserver_preload([*late, *(name for name in sys.modules if name.startswith("cvtimg."))])
    # Nothing is imported from the current folder.
    here, variables = dict(os.environ), {**dict.fromkeys(THREAD_VARIABLES, "1"), "PYTHONSAFEPATH": "1"}
    os.environ |= variables
    try:
        with _interrupts_held():
            forkserver.ensure_running()
    finally:
        os.environ |= here
        for name in variables.keys() - here.keys():
            del os.environ[name]
    return context


def _begin(n_threads: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))  # so that partial files are removed
    limit_threads(n_threads)
    if n_threads > 1:
        from threadpoolctl import threadpool_limits

        threadpool_limits(n_threads)  # the server, and so its fork, has one
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
    os.kill(os.getpid(), signal.SIGTERM)
    sleep(_PATIENCE)
    os._exit(1)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Block SIGINT in processes started in this block: Ctrl-C reaches the whole terminal, but we stop the workers."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _alone(attempt: Attempt, task: Task, started: float) -> Outcome:
    """Do a task with one thread, because the cluster runs a task on each of its own; its row tells by which worker."""
    from distributed import get_worker

    if n_threads() != 1:
        limit_threads(1)
    for path in task.outputs.values():
        # An output of this run is of a worker that was lost before it could say so.
        with suppress(OSError):
            if path.is_file() and path.stat().st_mtime > started:
                path.unlink()
    outcome = attempt(task)
    if not isinstance(outcome.result, dict):
        return outcome
    return replace(outcome, result={**outcome.result, "worker": str(get_worker().name)})


@contextmanager
def on_cluster_of_task() -> Iterator[None]:
    """Let what a task computes with Dask be done by all workers of the cluster that the task is on, if it is on one."""
    if "distributed" not in sys.modules:
        yield
        return
    from distributed import get_worker, worker_client

    with ExitStack() as stack:
        with suppress(ValueError):  # not in a worker
            get_worker()
            stack.enter_context(worker_client())
        yield


@contextmanager
def _client(address: str, n_workers: int) -> Iterator[Any]:
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

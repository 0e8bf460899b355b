"""Run tasks in worker processes; a worker that dies fails only its own task.

Processes are spawned, never forked, because a forked program with threads can hang. Each worker has its own pipe, so it
is known which task a dead worker had. The pools of the standard library would lose all tasks in progress.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import NoReturn

from cvtimg._shared.messages import one_line
from cvtimg.batch.tasks import Attempt, Outcome, Task

#: Seconds that a worker has to clean up after it is told to stop.
_PATIENCE = 5.0


def in_workers(
    attempt: Attempt, tasks: Sequence[Task], n_workers: int, n_threads: int
) -> Generator[tuple[int, Outcome]]:
    """Yield the index and the outcome of each task as it completes; `attempt` never raises."""
    crew = {worker.pipe: worker for worker in (_Worker(attempt, n_threads) for _ in range(n_workers))}
    waiting = iter(enumerate(tasks))
    try:
        for worker in crew.values():
            worker.take(next(waiting, None))
        while busy := [pipe for pipe, worker in crew.items() if worker.place is not None]:
            for pipe in wait(busy):
                assert isinstance(pipe, Connection)
                worker = crew[pipe]
                place, outcome = worker.place, worker.outcome()
                assert place is not None
                yield place, outcome
                task = next(waiting, None)
                if task and not worker.lives:
                    worker.end()
                    del crew[pipe]
                    worker = _Worker(attempt, n_threads)
                    crew[worker.pipe] = worker
                worker.take(task)
    except KeyboardInterrupt:  # what is done is told
        for worker in crew.values():
            if worker.place is not None and worker.pipe.poll():
                yield worker.place, worker.outcome()
        raise
    finally:
        for worker in crew.values():
            worker.end()


class _Worker:
    """A worker process, its current task and the index of that task."""

    def __init__(self, attempt: Attempt, n_threads: int) -> None:
        context = get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(target=_serve, args=(theirs, attempt, n_threads), daemon=True)
        with _interrupts_held():
            self._process.start()
        theirs.close()  # so that the pipe closes when the worker ends
        self.place: int | None = None
        self._task = Task(())
        self.lives = True

    def take(self, task: tuple[int, Task] | None) -> None:
        """Start a task, or idle if there is none."""
        self.place = None
        if task:
            self.place, self._task = task
            with suppress(OSError):  # a dead worker is noticed when its outcome is read
                self.pipe.send(self._task)

    def outcome(self) -> Outcome:
        """Wait until the task or the worker ends."""
        try:
            outcome: Outcome = self.pipe.recv()
        except (EOFError, OSError):
            self.lives = False
            self._process.join(_PATIENCE)
            return Outcome.failed(self._task, f"its worker process {_how_it_ended(self._process.exitcode)}")
        return outcome

    def end(self) -> None:
        """Stop at once, leaving neither a partial file nor a zombie."""
        if self.place is None:
            self.pipe.close()  # which ends the worker
        else:
            self._process.terminate()
        self._process.join(_PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process.close()
        self.pipe.close()


def _how_it_ended(status: int | None) -> str:
    if status is None or status >= 0:
        return f"ended with exit status {status}"
    with suppress(ValueError):
        name = signal.Signals(-status).name
        return f"was killed by {name}" + (", as the system does when memory runs out" if name == "SIGKILL" else "")
    return f"was killed by signal {-status}"


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


def _serve(pipe: Connection, attempt: Attempt, n_threads: int) -> None:
    """Do tasks until the pipe closes."""
    from cvtimg._shared.threads import limit_threads

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _stop)  # so that partial files are removed
    limit_threads(n_threads)
    with suppress(EOFError, OSError):
        while True:
            task = pipe.recv()
            outcome = attempt(task)
            try:
                pipe.send(outcome)
            except (TypeError, ValueError, AttributeError) as error:
                pipe.send(Outcome.failed(task, f"{type(error).__name__}: {one_line(error)}"))


def _stop(*_: object) -> NoReturn:
    sys.exit(0)

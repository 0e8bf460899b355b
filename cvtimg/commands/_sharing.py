"""One palette for all pictures of a batch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Missing, Running, Task, WrongUsageError, check_no_clash, gather

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cvtimg.samples import ColorSamples

__all__ = ["share"]


def share(
    tasks: Sequence[Task],
    missing: Missing,
    find: Callable[[ColorSamples], NDArray[Any]],
    depth: str | None,
    running: Running,
) -> tuple[list[Task], NDArray[Any] | None]:
    """Find the palette of all pictures together.

    Returns
    -------
    list of Task
        Those whose picture was counted; the others are now in `missing`, with the reason.
    array or None
        What `find` makes of the sum of the densities; None if no picture is left.
    """
    from cvtimg.sharing import add_samples

    check_no_clash(tasks)
    failed: dict[Path, str] = {}

    def counted() -> Iterator[ColorSamples]:
        for task, samples, why in gather(tasks, partial(_count, depth=depth), running):
            if samples is None:
                failed[task.source] = why
            else:
                yield samples

    palette = None
    try:
        palette = find(add_samples(counted()))
    except ValueError as error:
        if len(failed) < len(tasks):
            raise WrongUsageError(f"--shared-palette: {error}") from error
    missing += [(str(task.source), OSError(failed[task.source])) for task in tasks if task.source in failed]
    return [task for task in tasks if task.source not in failed], palette


def _count(task: Task, *, depth: str | None) -> ColorSamples:
    from cvtimg.sharing import count_picture

    return count_picture(task.source, depth)

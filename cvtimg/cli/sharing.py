"""One palette for all pictures of a batch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Missing, Running, Task, WrongUsageError, check_no_clash, fold

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cvtimg.colors.samples import ColorSamples

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
    from cvtimg.quantization.sharing import add_samples, in_fixed_order

    check_no_clash(tasks)
    palette = None
    try:
        total, failed = fold(tasks, partial(_count, depth=depth), add_samples, running)
        if total is not None:
            palette = find(in_fixed_order(total))
    except ValueError as error:
        raise WrongUsageError(f"--shared-palette: {error}") from error
    missing += [(str(task.source), OSError(failed[task.source])) for task in tasks if task.source in failed]
    return [task for task in tasks if task.source not in failed], palette


def _count(task: Task, *, depth: str | None) -> ColorSamples:
    from cvtimg.quantization.sharing import count_picture

    return count_picture(task.source, depth)

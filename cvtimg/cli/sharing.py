"""One palette for all images of a batch."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Plan, Running, Task, WrongUsageError, check_plan, fold, is_pipe

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cvtimg.colors.samples import ColorSamples

__all__ = ["share"]


def share(
    plan: Plan,
    find: Callable[[ColorSamples], NDArray[Any]],
    *,
    depth: str | None,
    max_pixels: int | None,
    running: Running,
) -> NDArray[Any] | None:
    """Find the palette of all images together, and move those that cannot be read to the missing of the plan.

    Returns
    -------
    array or None
        What `find` makes of the sum of the densities; None if no image is left.
    """
    from cvtimg.quantization.sharing import add_samples, in_fixed_order

    check_plan(plan, running)
    if any(is_pipe(task.source) for task in plan.tasks):
        raise WrongUsageError("--shared-palette reads each input twice: standard input and pipes cannot be used")
    palette = None
    try:
        total, failed = fold(plan.tasks, partial(_count, depth=depth, max_pixels=max_pixels), add_samples, running)
        if total is not None:
            palette = find(in_fixed_order(total))
    except ValueError as error:
        raise WrongUsageError(f"--shared-palette: {error}") from error
    plan.missing += [(str(task.source), OSError(failed[task.source])) for task in plan.tasks if task.source in failed]
    plan.tasks = [task for task in plan.tasks if task.source not in failed]
    return palette


def _count(task: Task, *, depth: str | None, max_pixels: int | None) -> ColorSamples:
    from cvtimg.pictures.formats.opening import pixels_limited
    from cvtimg.quantization.sharing import count_picture

    if max_pixels is None:
        return count_picture(task.source, depth)
    with pixels_limited(max_pixels):
        return count_picture(task.source, depth)

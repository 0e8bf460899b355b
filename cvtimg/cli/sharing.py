"""One palette for all images of a batch."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvtimg.batch import Plan, Running, Task, WrongUsageError, fold
from cvtimg.batch.pipes import is_pipe
from cvtimg.batch.runner import check_plan
from cvtimg.pictures.known import known_pixels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cvtimg.colors.samples import ColorSamples

__all__ = ["count_known", "share"]


def share(
    plan: Plan,
    find: Callable[[ColorSamples], NDArray[Any]],
    count: Callable[[Task], ColorSamples],
    *,
    running: Running,
) -> NDArray[Any] | None:
    """Find the palette of all images together, and move those that cannot be read to the missing of the plan.

    Returns
    -------
    array or None
        What `find` makes of the sum of what `count` returns for each image; None if no image is left.
    """
    from cvtimg.colors.counting import add_samples, in_fixed_order

    check_plan(plan, running)
    if any(is_pipe(task.source) for task in plan.tasks):
        raise WrongUsageError("--shared-palette reads each input twice: standard input and pipes cannot be used")
    palette = None
    try:
        total, failed = fold(plan.tasks, count, add_samples, running)
        if total is not None:
            palette = find(in_fixed_order(total))
    except ValueError as error:
        raise WrongUsageError(f"--shared-palette: {error}") from error
    plan.missing += [(str(task.source), OSError(failed[task.source])) for task in plan.tasks if task.source in failed]
    plan.tasks = [task for task in plan.tasks if task.source not in failed]
    return palette


def count_known(
    task: Task, *, depth: str | None, mask: Path | None, nodata: float | None, max_pixels: int | None
) -> ColorSamples:
    """Count the colors of the pixels of an image that are not left out."""
    from cvtimg import read_image
    from cvtimg.colors.counting import count_picture
    from cvtimg.pictures import image_info
    from cvtimg.pictures.formats.opening import pixels_limited

    with nullcontext() if max_pixels is None else pixels_limited(max_pixels):
        image = read_image(task.source)
        known = known_pixels(image, image_info(task.source), mask, nodata)
    return count_picture(image, depth, mask=None if known.all() else known)

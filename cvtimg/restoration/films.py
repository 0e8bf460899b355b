"""Films: each frame restored from those around it in time, with its own moment where things move."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from itertools import islice
from typing import Any, TypeVar

from cvtimg._shared.checks import check_at_least
from cvtimg.pictures import Frames, Pages
from cvtimg.restoration.reconstruction import restore
from cvtimg.restoration.result import Restoration

T = TypeVar("T")


def restore_frames(frames: Frames | Pages | Iterable[Any], *, window: int = 5, **options: Any) -> Iterator[Restoration]:
    """Restore each frame of a film from those around it in time, which are aligned with it.

    Parameters
    ----------
    frames : Frames, Pages, or iterable of (H, W) or (H, W, C) arrays
        From `read_frames` or `read_pages`; or images in the order of time, of which no more than a window is kept.
    window : int
        Number of frames from which each is restored, >= 1: itself and those nearest to it.
    **options
        Other arguments of `restore`. By default, ``detail=True``, ``align=True`` and ``hidden="motion"``: of the other
        frames, what has moved by itself or belongs to another scene is left out.

    Returns
    -------
    iterator of Restoration
        Of each frame, restored when it is asked for.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.

    See Also
    --------
    restore : One image from several versions of it.
    cvtimg.pictures.read_frames, cvtimg.pictures.write_frames : Films as files.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import restore_frames
    >>> rng = np.random.default_rng(0)
    >>> clean = np.add.outer(np.arange(24.0), np.arange(32.0)) + 50
    >>> film = [clean + rng.normal(0, 5, clean.shape) for _ in range(2)]
    >>> restored = [result.image for result in restore_frames(film, effort="fast")]
    >>> len(restored), bool(np.std(restored[1] - clean) < 2.5)
    (2, True)
    """
    how = {"detail": True, "align": True, "hidden": "motion", **options}
    images = frames.images if isinstance(frames, (Frames, Pages)) else frames
    length = check_at_least("window", window, 1, "the frame itself")
    return map(partial(_restored, how), _windows(images, length))


def _restored(how: Mapping[str, Any], versions: list[Any]) -> Restoration:
    """Restore the first of some frames."""
    if len(versions) == 1:
        how = {**how, "align": False}
    with warnings.catch_warnings():
        if how["hidden"] == "motion":  # frames of other scenes are none of its versions
            warnings.filterwarnings("ignore", "images.* cannot be ", UserWarning)
        return restore(versions, **how)


def _windows(items: Iterable[T], length: int) -> Iterator[list[T]]:
    """Yield each item followed by others around it, the nearest first."""
    rest = iter(items)
    around, at = deque(islice(rest, length), maxlen=length), 0
    while at < len(around):
        yield [around[other] for other in sorted(range(len(around)), key=lambda other: abs(other - at))]
        if at < length // 2:
            at += 1
        else:
            following = list(islice(rest, 1))
            around.extend(following)
            at += not following

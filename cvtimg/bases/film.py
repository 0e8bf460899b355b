"""Key frames: the frames of an animation that represent the others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_count, hints_at_keywords
from cvtimg._shared.records import ReadOnly
from cvtimg.bases.reduction import nearest_members
from cvtimg.bases.sketch import sketch
from cvtimg.bases.snapshots import as_snapshots
from cvtimg.elbow.curves import energy_curve
from cvtimg.engine.seeding import TooFewSamplesError
from cvtimg.engine.tessellation import tessellate

_OVERSAMPLING = 24
_MOST_AUTO_FRAMES = 32


@dataclass(frozen=True, slots=True, eq=False)
class KeyFrames(ReadOnly):
    """Key frames, and the frames that each represents.

    Attributes
    ----------
    indices : (n,) int64 array
        The frames, rising: of each cell the one nearest to its mean.
    labels : (N,) int64 array
        For each frame the cell that it belongs to; cell i has the key frame ``indices[i]``.
    masses : (n,) int64 array
        Frames of each cell.
    """

    indices: NDArray[np.int64]
    labels: NDArray[np.int64]
    masses: NDArray[np.int64]


@hints_at_keywords
def key_frames(
    animation: Any, n_frames: int | Literal["auto"], *, passes: int = 4, rng: int | np.random.Generator = 0
) -> KeyFrames:
    """Choose the frames that represent an animation with the least error: the medoids of a tessellation of its frames.

    Parameters
    ----------
    animation : array-like, Frames, path, or sequence of paths
        (N, ...) frames, as `as_snapshots` takes them.
    n_frames : int or "auto"
        How many, at most the number of distinct frames. "auto" takes the elbow of the energy, at most 32.
    passes : int
        How often the frames are read, an even number.
    rng : int or numpy.random.Generator
        Seed of what is drawn.

    Returns
    -------
    KeyFrames

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid.
    OSError
        If a file cannot be read.

    See Also
    --------
    reduced_basis : Modes instead of frames.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import key_frames
    >>> film = np.repeat([[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]], 10, axis=0) + np.arange(30)[:, None] / 100
    >>> key_frames(film, 3).labels.tolist() == [0] * 10 + [1] * 10 + [2] * 10
    True
    """
    given = as_snapshots(animation)
    if n_frames != "auto":
        check_count("n_frames", n_frames, given.n_snapshots, "the number of frames")
    most = _MOST_AUTO_FRAMES if n_frames == "auto" else n_frames
    generator = np.random.default_rng(rng)
    rows = sketch(given, most + _OVERSAMPLING, passes, generator).coordinates
    n_cells = (
        energy_curve(rows, min(most, len(rows)), rng=generator).elbow("chord-linear")
        if n_frames == "auto"
        else n_frames
    )
    try:
        cells = tessellate(rows, n_cells, init="k-means++", effort="best", rng=generator)
    except TooFewSamplesError as error:
        raise ValueError(
            f"n_frames={n_frames} must be in 1..{error.n_distinct}, the number of frames that differ"
        ) from error
    indices = nearest_members(rows, cells.labels.astype(np.int64), cells.generators)
    order = np.argsort(indices)
    labels = np.argsort(order)[cells.labels]
    return KeyFrames(indices[order], labels, np.bincount(labels, minlength=len(order)))

"""Key frames: the frames of an animation that represent the others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_count, hints_at_keywords
from cvtimg._shared.records import ReadOnly
from cvtimg.bases.reduction import nearest_members
from cvtimg.bases.sketch import sketch
from cvtimg.bases.snapshots import as_snapshots
from cvtimg.elbow.curves import energy_curve
from cvtimg.elbow.rules import Scale, chord_linear
from cvtimg.engine.seeding import TooFewSamplesError
from cvtimg.engine.tessellation import tessellate

_OVERSAMPLING = 24
#: Cuts of longer animations are between runs of a few frames.
_MOST_RUNS = 2048
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
    animation: Any,
    n_frames: int | Literal["auto"],
    *,
    by: Literal["looks", "scenes"] = "looks",
    passes: int = 4,
    rng: int | np.random.Generator = 0,
) -> KeyFrames:
    """Choose the frames that represent an animation with the least error: the medoids of a tessellation of its frames.

    Parameters
    ----------
    animation : array-like, Frames, path, or sequence of paths
        (N, ...) frames, as `as_snapshots` takes them.
    n_frames : int or "auto"
        How many, at most the number of distinct frames. "auto" takes the elbow of the energy, at most 32.
    by : {"looks", "scenes"}
        What a key frame represents: frames that look alike, whenever they are; or a scene, frames that follow each
        other, cut where that leaves the least error.
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
    check_choice("by", by, ("looks", "scenes"))
    given = as_snapshots(animation)
    if n_frames != "auto":
        check_count("n_frames", n_frames, given.n_snapshots, "the number of frames")
    most = min(_MOST_AUTO_FRAMES, given.n_snapshots) if n_frames == "auto" else n_frames
    generator = np.random.default_rng(rng)
    rows = sketch(given, most + _OVERSAMPLING, passes, generator).coordinates
    if by == "scenes":
        labels, generators = _scenes(rows, most, n_frames == "auto")
        indices = nearest_members(rows, labels, generators)
        return KeyFrames(indices, labels, np.bincount(labels))
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


def _scenes(rows: NDArray[np.float64], most: int, at_elbow: bool) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Cut (N, d) rows into at most so many scenes of least energy, or as many as the elbow of the energies says.

    By dynamic programming over the ends of scenes, which is exact: W. Fisher, J. American Statistical Association 53
    (1958) 789-798, doi 10.1080/01621459.1958.10501479. Returns the scene (N,) of each row, and their means (K, d).
    """
    ends = np.unique(np.linspace(0, len(rows), min(len(rows), _MOST_RUNS) + 1).round().astype(int))
    sums = np.concatenate([np.zeros((1, rows.shape[1])), np.cumsum(rows, axis=0)])[ends]
    squares = np.append(0, np.cumsum((rows**2).sum(axis=1)))[ends]
    n = len(ends) - 1
    least = np.full((most + 1, n + 1), np.inf)  # of the first runs, in so many scenes
    least[0, 0] = 0
    starts = np.zeros((most + 1, n + 1), np.intp)  # of the last of these scenes
    for end in range(1, n + 1):
        inside = squares[end] - squares[:end] - ((sums[end] - sums[:end]) ** 2).sum(axis=1) / (ends[end] - ends[:end])
        totals = least[:-1, :end] + np.maximum(inside, 0)
        starts[1:, end] = totals.argmin(axis=1)
        least[1:, end] = totals.min(axis=1)
    n_scenes = chord_linear(least[1:, n], Scale(rows.size, None)) if at_elbow else most
    cuts = [n]
    for left in range(n_scenes, 0, -1):
        cuts.append(int(starts[left, cuts[-1]]))
    at = ends[cuts[::-1]]
    labels = np.repeat(np.arange(n_scenes), np.diff(at))
    return labels, np.add.reduceat(rows, at[:-1], axis=0) / np.diff(at)[:, None]

"""Edges as lines with the chance that people draw them: borders of leaves, joined where no third one meets them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.types import Floats, ImageLike, Ints, Points
from cvtimg.halfedges import EdgeTable
from cvtimg.labels.components import find_borders
from cvtimg.labels.contours import find_contours, simplify


class Lines(NamedTuple):
    """Lines, the most likely first.

    Attributes
    ----------
    lines : tuple of (N, 2) float64 arrays
        Points (x, y) in pixels, as in `Contours`. A closed line ends where it begins; lines meet at their ends.
    chances : (L,) float64 array
        Chance that a person draws each line, the mean along it, in 0..1.
    """

    lines: tuple[Points, ...]
    chances: Floats


def find_lines(
    leaves: Ints, chances: NDArray[np.floating], least: float, most: int | None, image: ImageLike | None, off: float
) -> Lines:
    """Join borders between leaves, (B,) chances each, from the least on; keep the `most` that people draw most of."""
    contours = find_contours(leaves, image)
    border = EdgeTable(find_borders(leaves).pairs, int(leaves.max()) + 1).find(contours.sides - 1)
    chance_of = np.where((contours.sides > 0).all(axis=1), np.append(chances, 0.0)[border], 0.0)
    kept = np.flatnonzero((chance_of >= least) & (chance_of > 0))
    lengths = np.array([np.hypot(*np.diff(contours.lines[line], axis=0).T).sum() for line in kept])
    lines, drawn, lengths_of = [], [], []
    for chain in _chains([contours.lines[line] for line in kept]):
        parts = [contours.lines[kept[part]][:: 1 if forward else -1] for part, forward in chain]
        lines.append(np.concatenate([parts[0], *(part[1:] for part in parts[1:])]))
        numbers = [part for part, _ in chain]
        lengths_of.append(lengths[numbers].sum())
        drawn.append(np.einsum("n,n->", chance_of[kept[numbers]], lengths[numbers]))
    means = np.array(drawn) / lengths_of
    order = np.argsort(-np.array(drawn), kind="stable")[:most]
    order = order[np.argsort(-means[order], kind="stable")]
    simple = simplify(lines, off) if off and lines else lines
    return Lines(tuple(simple[line] for line in order), means[order])


def _chains(lines: Sequence[Points]) -> list[list[tuple[int, bool]]]:
    """Join lines at the ends where just two meet: numbers of lines, and whether each is passed forward."""
    ends: dict[tuple[float, float], list[tuple[int, bool]]] = {}
    for number, line in enumerate(lines):
        for forward, place in ((True, line[0]), (False, line[-1])):  # how the line is passed from that end
            ends.setdefault((float(place[0]), float(place[1])), []).append((number, forward))
    following = {}  # the end at which a line is left, and how the one that follows there is passed
    for meeting in ends.values():
        if len(meeting) == 2:
            (one, from_start), (other, other_start) = meeting
            following[one, not from_start] = other, other_start
            following[other, not other_start] = one, from_start
    chains, is_used = [], np.zeros(len(lines), bool)
    # From ends where a chain begins; what is left then are rings.
    begins = [(n, way) for n in range(len(lines)) for way in (True, False) if (n, not way) not in following]
    for begin in [*begins, *((n, True) for n in range(len(lines)))]:
        chain: list[tuple[int, bool]] = []
        step: tuple[int, bool] | None = begin
        while step is not None and not is_used[step[0]]:
            chain.append(step)
            is_used[step[0]] = True
            step = following.get(step)
        chains += [chain] if chain else []
    return chains

"""Labels changed by hand: segments merged, split by a tree of regions, painted and erased."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_shape
from cvtimg._shared.types import Array, Ints
from cvtimg.segmentation.hierarchy.tree import RegionHierarchy
from cvtimg.segmentation.touching import numbered

#: Kinds of edits by a brush, whose radius comes before its points, and others.
_BRUSHES, _OTHERS = ("paint", "add", "erase"), ("merge", "split")


@dataclass(frozen=True, slots=True)
class Edit:
    """A change of labels.

    Parameters
    ----------
    kind : {"merge", "split", "paint", "add", "erase"}
    points : sequence of (x, y)
        Pixels: in the segments to merge or to split, or those that a brush moves along.
    radius : float
        Of the brush, in pixels.
    """

    kind: str
    points: tuple[tuple[int, int], ...]
    radius: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Edit:
        """Read an edit from a text, such as ``"merge 3,4 8,9"``, ``"split 3,4"`` or ``"paint 5 3,4 8,9"``.

        Raises
        ------
        ValueError
            If the text is something else.
        """
        kind, *words = text.split() or [""]
        with suppress(ValueError):
            radius = float(words.pop(0)) if kind in _BRUSHES and words else 0.0
            points = tuple((int(x), int(y)) for x, y in (word.split(",") for word in words))
            if kind in (*_BRUSHES, *_OTHERS) and len(points) > (kind == "merge") and 0 <= radius < np.inf:
                return cls(kind, points, radius)
        edits = "merge X,Y X,Y..., split X,Y, paint R X,Y..., add R X,Y... or erase R X,Y..."
        raise ValueError(f"{text[:60]!r} must be {edits}")


def edit_labels(
    labels: ArrayLike,
    edits: Sequence[str | Edit],
    *,
    hierarchy: RegionHierarchy | Callable[[], RegionHierarchy] | None = None,
) -> Ints:
    """Change labels by hand.

    Parameters
    ----------
    labels : (H, W) integer array
        0 for no segment.
    edits : sequence of str
        In their order, with pixels as x,y: ``"merge 3,4 8,9 5,5"`` makes one segment of those at these pixels;
        ``"split 3,4"`` divides a segment where the tree does so first; ``"paint 5 3,4 8,9"`` lets the segment of the
        first pixel grow along a brush of radius 5; ``"add 5 3,4 8,9"`` makes a segment of what a brush covers;
        ``"erase 5 3,4 8,9"`` leaves it out. Pixels beside the image have no effect.
    hierarchy : RegionHierarchy, optional
        The tree of the image, or a function that returns it, for splits.

    Returns
    -------
    (H, W) int32 array
        Labels from 1, in the order in which they were; new ones come last.

    Raises
    ------
    ValueError
        If an edit is not what is said here, or a segment has no parts in the tree.

    Examples
    --------
    >>> from cvtimg.segmentation import edit_labels
    >>> labels = np.repeat([[1, 2, 3, 4]], 2, axis=0)
    >>> edit_labels(labels, ["merge 0,0 2,1", "erase 0 3,0"])
    array([[1, 2, 1, 0],
           [1, 2, 1, 3]], dtype=int32)
    """
    edited = np.array(labels, np.int32)
    check_shape("labels", edited.shape, edited.ndim == 2, "(H, W)")
    for text in edits:
        edit = Edit.parse(text) if isinstance(text, str) else text
        if edit.kind == "merge":
            merged = [label for label in _labels_at(edited, edit.points) if label]
            edited[np.isin(edited, merged[1:])] = merged[0] if merged else 0
        elif edit.kind == "split":
            _split(edited, edit, hierarchy() if callable(hierarchy) else hierarchy)
        else:
            painted = next(iter(_labels_at(edited, edit.points)), 0)
            target = {"erase": 0, "add": edited.max() + 1, "paint": painted}[edit.kind]
            brush(edited, edit.points, edit.radius, target)
    return numbered(edited)


def brush(image: Array, points: Sequence[tuple[int, int]], radius: float, value: object) -> None:
    """Set the pixels of an (H, W) array whose centers are within a radius of lines from point to point (x, y)."""
    height, width = image.shape
    for (x0, y0), (x1, y1) in zip(points, [*points[1:], points[-1]], strict=True):
        left, top = (max(int(min(ends) - radius), 0) for ends in ((x0, x1), (y0, y1)))
        right, bottom = min(int(max(x0, x1) + radius) + 1, width), min(int(max(y0, y1) + radius) + 1, height)
        y, x = np.ogrid[top : max(bottom, top), left : max(right, left)]
        dx, dy = x1 - x0, y1 - y0
        along = np.clip(((x - x0) * dx + (y - y0) * dy) / max(dx * dx + dy * dy, 1), 0, 1)
        near = (x - x0 - along * dx) ** 2 + (y - y0 - along * dy) ** 2 <= radius * radius
        image[top : max(bottom, top), left : max(right, left)][near] = value


def _labels_at(labels: Ints, points: Sequence[tuple[int, int]]) -> list[int]:
    height, width = labels.shape
    return [int(labels[y, x]) for x, y in points if 0 <= x < width and 0 <= y < height]


def _split(labels: Ints, edit: Edit, tree: RegionHierarchy | None) -> None:
    if tree is None:
        raise ValueError("a split needs the tree of the image, hierarchy")
    check_shape("hierarchy", tree.leaves.shape, tree.leaves.shape == labels.shape, "that of the labels")
    if not (touched := _labels_at(labels, edit.points)) or not touched[0]:
        return
    segment = labels == touched[0]
    leaves = np.unique(tree.leaves[segment & (tree.leaves > 0)]) - 1
    if len(leaves) < 2:
        raise ValueError(f"split {edit.points[0][0]},{edit.points[0][1]}: this segment has no parts in the tree")
    other = np.append(False, tree.divide(leaves))[tree.leaves]
    labels[segment & other] = labels.max() + 1

"""The frame in which an image is segmented: around what counts, and turned as no other way of holding it is.

Sweeps and superpixels go by rows, so that a mirrored image would end elsewhere. Of all ways to mirror and to turn an
image, that is taken whose values come first in order, row by row: the same for all of them. What is left out around
the pixels that count is cut off, so that a wider frame of such pixels changes nothing either.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from cvtimg._shared.sums import copy_rows
from cvtimg._shared.types import Array, Bools


class Frame(NamedTuple):
    """A part of an image or of a volume, (Z, H, W), and how it is held."""

    part: tuple[slice, ...]  # from first to last along each axis
    steps: tuple[slice, ...]  # forward or backward along each axis
    transposed: bool  # whether rows and columns change places after that

    def of(self, array: Array) -> Array:
        """Return a view of the part; further axes stay as they are. What is written to it is written to the array."""
        view, n_axes = array[self.part][self.steps], len(self.part)
        return view.swapaxes(n_axes - 2, n_axes - 1) if self.transposed else view

    def back(self, view: Array, shape: tuple[int, ...]) -> Array:
        """Return an array of the image's shape that holds the view, and 0 around it."""
        array = np.zeros((*shape, *view.shape[len(shape) :]), view.dtype)
        copy_rows(view, self.of(array))
        return array


def frame_of(image: Array, inside: Bools, turns: bool = True) -> Frame:
    """Find the frame of an image or a volume, of any number of bands, by the pixels that count; there is at least one.

    Without `turns`, rows and columns do not change places.
    """
    n_axes = inside.ndim
    ends = [np.flatnonzero(inside.any(axis=tuple({*range(n_axes)} - {axis})))[[0, -1]] for axis in range(n_axes)]
    part = tuple(slice(int(first), int(last) + 1) for first, last in ends)
    ways = [slice(None), slice(None, None, -1)]
    height, width = (axis.stop - axis.start for axis in part[-2:])
    turned = [False, True] if turns and height == width else [turns and height < width]
    left = [Frame(part, steps, turn) for steps in product(ways, repeat=n_axes) for turn in turned]
    n_rows, first, n_more = len(left[0].of(inside)), 0, 1
    while len(left) > 1 and first < n_rows:
        rows = slice(first, first + n_more)
        values = [_values(frame.of(image)[rows], frame.of(inside)[rows]) for frame in left]
        least = values[0]
        for other in values[1:]:
            at = int((other != least).argmax())
            least = other if other[at] < least[at] else least
        left = [frame for frame, other in zip(left, values, strict=True) if np.array_equal(other, least)]
        first, n_more = first + n_more, 2 * n_more
    return left[0]


def _values(image: Array, inside: Bools) -> Array:
    """Return values in order, with 0 for pixels that do not count."""
    known = inside.reshape(*inside.shape, *(1,) * (image.ndim - inside.ndim))
    return np.where(known, image, image.dtype.type(0)).ravel()

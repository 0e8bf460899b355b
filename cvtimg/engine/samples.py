"""Weighted samples, which the engine tessellates, and their order along a curve, where near ones are consecutive."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.budgets import IN_CACHE, SAMPLES_OF_FIGURE
from cvtimg._shared.records import ReadOnly
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Array, Floats, Indices
from cvtimg.engine.points import GROUPED_FROM, Points, pack

#: A key of 64 bits has room for 16 bits in each of this many coordinates.
MAX_ORDERED_DIMS = 4
#: Rows of a table are sorted along a space-filling curve, so that neighbors are compared with few generators, if there
#: are enough generators for a gain and few enough rows that sorting does not cost more.
_FEW_ENOUGH_TO_SORT = 1 << 23


@dataclass(frozen=True, slots=True, eq=False)
class WeightedSamples(ReadOnly):
    """Samples and their weights.

    Attributes
    ----------
    rows : (M, D) array
        One sample per row: uint8, uint16, float32 or float64.
    density : (M,) float64 array
        The weight of each sample, >= 0.
    in_order : bool
        Whether consecutive samples are near each other, which makes computations faster.
    """

    rows: Array
    density: Floats
    in_order: bool

    def __repr__(self) -> str:
        """Tell size and type in one line."""
        n_samples, n_dims = self.rows.shape
        return f"{type(self).__name__}({n_samples} x {n_dims} {self.rows.dtype}, mass {self.density.sum():g})"

    @property
    def n_samples(self) -> int:
        """Number of samples, M."""
        return len(self.rows)


class Line(NamedTuple):
    """Rows on a line: each is ``origin + direction * place``, whose place is its value in the widest column."""

    origin: Floats
    direction: Floats
    places: Array


def line_through(rows: Array) -> Line | None:
    """Return the line that (N, D > 1) rows lie on but for rounding, as gray pixels in three equal bands do, if any."""
    step = -(-len(rows) // SAMPLES_OF_FIGURE)
    if rows.shape[1] < 2 or (step > 1 and line_through(rows[::step]) is None):  # which takes less time and memory
        return None
    wide = rows.astype(np.float64)
    first = wide[np.abs(wide).max(axis=1).argmin()].copy()
    wide -= first  # differences from the least one lose no digit of another that is far away
    sizes = np.abs(wide).max(axis=1)
    farthest = wide[sizes.argmax()]
    widest = int(np.abs(farthest).argmax())
    if not farthest[widest]:
        return None
    direction = farthest / farthest[widest]
    rounding = 4 * np.finfo(np.float64).eps * (np.abs(first).max() + sizes)
    if (np.abs(wide - wide[:, [widest]] * direction).max(axis=1) > rounding).any():
        return None
    return Line(first - direction * first[widest], direction, np.ascontiguousarray(rows[:, widest]))


def pack_in_order(
    rows: Array, weights: Floats, n_generators: int, *, in_order: bool = False, exact: bool = False
) -> tuple[Points, Indices | None]:
    """Pack the (N, D) rows of a table; also return their order, if it is not the given one."""
    sortable = rows.shape[1] <= MAX_ORDERED_DIMS and len(rows) <= _FEW_ENOUGH_TO_SORT
    if in_order or not sortable or n_generators < GROUPED_FROM:
        return pack(rows, weights, in_order=in_order, exact=exact), None
    order = along_curve(rows)
    return pack(rows, weights, order=order, exact=exact), order


def along_curve(rows: Array) -> Indices:
    """Return the order of (M, D <= 4) rows along a Morton curve, with up to 2^16 steps over their range."""
    n_rows, n_dims = rows.shape
    # Keys and places are sorted as one number each, in which long keys of many rows lose their last bits.
    place_bits = np.uint64(n_rows.bit_length())
    lost = np.uint64(max(0, 16 * n_dims + n_rows.bit_length() - 64))
    keyed = np.empty(n_rows, np.uint64)
    low, high = float(rows.min()), float(rows.max())
    span = high - low or 1.0

    def make(part: slice) -> None:
        key = np.zeros(part.stop - part.start, np.uint64)
        for dim in range(n_dims):
            steps = ((rows[part, dim].astype(np.float64) - low) / span * 65535).astype(np.uint64)
            key |= _spread(steps, n_dims) << np.uint64(dim)
        keyed[part] = key >> lost << place_bits | np.arange(part.start, part.stop, dtype=np.uint64)

    in_stripes(make, n_rows, 16.0 * rows.size, IN_CACHE)
    keyed.sort()
    return (keyed & ((np.uint64(1) << place_bits) - np.uint64(1))).astype(np.intp)


def _spread(steps: NDArray[np.uint64], n_dims: int) -> NDArray[np.uint64]:
    """Insert zeros between the bits of 16-bit numbers, one for each other dimension."""
    for width in (8, 4, 2, 1):
        mask = sum(((1 << width) - 1) << start * n_dims for start in range(0, 16, width))
        steps = (steps | steps << np.uint64(width * (n_dims - 1))) & np.uint64(mask)
    return steps

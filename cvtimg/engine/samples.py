"""Weighted samples, which the engine tessellates, and their order along a curve, where near ones are consecutive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.records import ReadOnly
from cvtimg.engine.points import GROUPED_FROM, Frame, Points, pack

#: A key of 64 bits has room for 16 bits in each of this many coordinates.
MAX_ORDERED_DIMS = 4
#: Shifts and masks that insert three zeros between the bits of a 16-bit number.
_INSERT_ZEROS = ((24, 0x000000FF000000FF), (12, 0x000F000F000F000F), (6, 0x0303030303030303), (3, 0x1111111111111111))

#: Rows of a table are sorted along a space-filling curve, so that neighbors are compared with few generators, if there
#: are enough generators for a gain and not so many rows that sorting costs more.
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

    rows: NDArray[Any]
    density: NDArray[np.float64]
    in_order: bool

    def __repr__(self) -> str:
        """Tell size and type in one line."""
        n_samples, n_dims = self.rows.shape
        return f"{type(self).__name__}({n_samples} x {n_dims} {self.rows.dtype}, mass {self.density.sum():g})"

    @property
    def n_samples(self) -> int:
        """Number of samples, M."""
        return len(self.rows)


def pack_in_order(
    rows: NDArray[Any], weights: NDArray[np.float64], n_generators: int, frame: Frame | None = None
) -> tuple[Points, NDArray[np.intp] | None]:
    """Pack the (N, D) rows of a table; also return their order, if it is not the given one."""
    sortable = rows.shape[1] <= MAX_ORDERED_DIMS and len(rows) <= _FEW_ENOUGH_TO_SORT
    if not sortable or n_generators < GROUPED_FROM:
        return pack(rows, weights, frame=frame), None
    order = along_curve(rows)
    return pack(rows[order], weights[order], frame=frame, in_order=True), order


def along_curve(rows: NDArray[Any]) -> NDArray[np.intp]:
    """Return the order of (M, D <= 4) rows along a Morton curve, with 2^16 steps over their range."""
    low, high = float(rows.min()), float(rows.max())
    scale = 65535 / (high - low) if high > low else 0.0
    keys = np.zeros(len(rows), np.uint64)
    for dim in range(rows.shape[1]):
        bits = ((rows[:, dim].astype(np.float64) - low) * scale).astype(np.uint64)
        for shift, mask in _INSERT_ZEROS:
            bits = (bits | bits << np.uint64(shift)) & np.uint64(mask)
        keys |= bits << np.uint64(dim)
    return np.argsort(keys, kind="stable")

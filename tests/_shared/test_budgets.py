"""Budgets hold what their comments say, with room on both sides: neither half nor twice as much would."""

import tracemalloc

import numpy as np
import pytest

from cvtimg._shared import budgets
from cvtimg.blocks.passes import Block
from cvtimg.blocks.rows import block_length
from cvtimg.blocks.spread import Spread
from cvtimg.colors.counting import MOST_COLORS


@pytest.mark.parametrize(
    ("figure", "most"),
    [
        (budgets.MAX_COLORS, 2**16),  # as many as 16 bits number
        (6 * budgets.MOST_POINTS, 2**31),  # both sides of three edges for each point, by numbers of 32 bits
        (100 * budgets.MOST_IN_MEMORY, 8e9),  # bytes: a machine
        (100 * budgets.PIXELS_AT_ONCE, 1e9),  # bytes: a segmentation
        (200 * MOST_COLORS, 1e9),  # bytes: the engine
        (8 * budgets.IN_CACHE, 2**18),  # bytes: half of a cache of 512 kB
        (256**2, budgets.SAMPLES_OF_FIGURE),  # a mean is right to a shade of 8 bits of the deviation
        (0.5**2 / 1.5e-3**2, budgets.ENOUGH_SAMPLES),  # half of a region is right to 1.5 thousandths
        (5e-7, 0.75 * budgets.GIVEN),  # six digits behind the point
        (3000 * np.finfo(np.float64).eps, budgets.ROUNDING),  # some thousand roundings
        (8 * block_length(8), 2**25),  # bytes of a block, as the documentation says
    ],
)
def test_budgets_are_used_and_not_exceeded(figure: float, most: float) -> None:
    assert 0.5 * most < figure <= most


def test_what_is_made_of_rows_at_once_takes_less_than_100_mb() -> None:
    block = Block(0, np.zeros((3 * budgets.ROWS_AT_ONCE, 3), np.uint8), None)
    tracemalloc.start()
    for rows, weights in block.pieces():
        Spread.of(rows, weights)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 60e6 < peak < 110e6

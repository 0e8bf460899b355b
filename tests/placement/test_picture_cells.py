from __future__ import annotations

import numpy as np
import pytest
from reference import shoelace

from cvtimg.placement import pixel_labels
from cvtimg.placement.cells import picture_cells


@pytest.mark.parametrize("n_points", [1, 2, 3, 40, 500])
def test_cells_fill_the_picture_and_agree_with_labels(n_points: int) -> None:
    rng = np.random.default_rng(n_points)
    height, width, fine = 30, 50, 16
    points = rng.random((n_points, 2)) * [width, height]
    cells = picture_cells(points, (height, width))
    areas = np.array(list(map(shoelace, cells)))
    assert areas.sum() == pytest.approx(height * width)
    labels = pixel_labels((height * fine, width * fine), points * fine)
    counted = np.bincount(labels.ravel(), minlength=n_points) / fine**2
    assert np.abs(areas - counted).max() < 0.35


def test_points_on_the_sides_in_rows_and_in_one_place_have_cells_that_fill_the_picture() -> None:
    for points in (
        [[0, 0], [10, 0], [5, 5], [5, 5], [3, 10]],
        [[x + 0.5, y + 0.5] for x in range(10) for y in range(10)],
    ):
        cells = picture_cells(np.array(points, np.float64), (10, 10))
        assert sum(map(shoelace, cells)) == pytest.approx(100)
        assert all(cell.min() >= 0 and cell.max() <= 10 for cell in cells if len(cell))

"""Relocation of the cells of a mosaic."""

from pathlib import Path

import numpy as np
import pytest

import cvtimg
from cvtimg.artwork import tilings
from cvtimg.artwork.tilings import division_gains, paint, removal_costs

SAMPLES = Path(__file__).parents[2] / "sample_images"


def strips(n_columns: int, n_strips: int) -> np.ndarray:
    """Label strips of equal width."""
    return np.tile(np.repeat(np.arange(n_strips, dtype=np.int32), n_columns // n_strips), (10, 1))


def test_removing_a_cell_costs_its_pixels_the_difference_to_the_neighbor():
    labels = strips(40, 2)
    image = np.where(labels == 0, 0.25, 0.75).astype(np.float32)[:, :, np.newaxis]
    costs = removal_costs(paint(image, labels, 2))
    assert costs == pytest.approx([200 * 0.25, 200 * 0.25])


@pytest.mark.parametrize("turned", [False, True])
def test_the_gain_of_a_division_is_that_of_two_halves(turned):
    ramp = np.tile(np.arange(40, dtype=np.float32), (10, 1))
    image, whole, halves = ramp[:, :, np.newaxis], strips(40, 1), strips(40, 2)
    if turned:
        image, whole, halves = (np.ascontiguousarray(np.swapaxes(a, 0, 1)) for a in (image, whole, halves))
    gains, middles, offsets = division_gains(image, paint(image, whole, 1))
    true = paint(image, whole, 1).energy - paint(image, halves, 2).energy
    assert gains[0] == pytest.approx(true, rel=1e-2)
    center, half = ([5, 20], [0, 10]) if turned else ([20, 5], [10, 0])
    assert middles[0] == pytest.approx(center)
    assert np.abs(offsets[0]) == pytest.approx(half, abs=0.05)


def test_relocation_lowers_the_error_of_a_mosaic(monkeypatch):
    image = cvtimg.read_image(SAMPLES / "bone_texture.png")[::2, ::2]
    relocated = cvtimg.mosaic(image, 300).energy
    monkeypatch.setattr(tilings, "DESCENT", tilings.Descent(until=0))
    assert relocated < 0.99 * cvtimg.mosaic(image, 300).energy


def test_cells_that_settle_on_a_smaller_image_first_fit_better(monkeypatch):
    image = cvtimg.read_image(SAMPLES / "coffee.png")[:200, :300]
    both = cvtimg.mosaic(image, 200, effort="fast").energy
    monkeypatch.setattr(tilings, "DESCENT", tilings.Descent(coarsest=np.inf))
    assert both < 0.99 * cvtimg.mosaic(image, 200, effort="fast").energy

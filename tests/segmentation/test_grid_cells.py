import numpy as np
import pytest
from scipy import ndimage

from cvtimg import superpixels
from cvtimg._shared.types import Array


@pytest.mark.parametrize("n", [1, 50, 400])
def test_superpixels_are_connected_and_about_as_many_as_asked(photograph: Array, n: int) -> None:
    result = superpixels(photograph[:255, 3:], n)  # odd sides, which have no halves
    assert abs(result.n_segments - n) <= max(0.1 * n, 0)
    assert all(ndimage.label(result.labels == label)[1] == 1 for label in range(1, result.n_segments + 1))


def test_superpixels_follow_an_edge() -> None:
    rows, columns = np.mgrid[:90, :120]
    truth = (rows - 40) ** 2 + (columns - 65) ** 2 < 30**2
    labels = superpixels((truth * 100).astype(np.uint8), 30).labels
    inside, outside = np.unique(labels[truth]), np.unique(labels[~truth])
    assert not set(inside) & set(outside)


def test_compact_superpixels_have_shorter_borders(photograph: Array) -> None:
    lengths = []
    for compactness in (1, 100):
        labels = superpixels(photograph, 100, compactness=compactness).labels
        lengths.append(np.count_nonzero(labels[1:] != labels[:-1]) + np.count_nonzero(labels[:, 1:] != labels[:, :-1]))
    assert lengths[1] < 0.7 * lengths[0]


def test_superpixels_cover_the_mask_and_nothing_else(photograph: Array) -> None:
    rows, columns = np.mgrid[:256, :256]
    mask = (rows - 128) ** 2 + (columns - 128) ** 2 < 100**2
    result = superpixels(photograph, 100, mask=mask)
    np.testing.assert_array_equal(result.labels > 0, mask)
    assert abs(result.n_segments - 100) <= 15
    assert all(ndimage.label(result.labels == label)[1] == 1 for label in range(1, result.n_segments + 1))


def test_more_superpixels_than_pixels_are_refused() -> None:
    with pytest.raises(ValueError, match=r"n_superpixels=7 must be in 1\.\.6"):
        superpixels(np.zeros((2, 3)), 7)


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(1, 100_000), (6, 20_000), (20_000, 6), (40, 5000)])
def test_strips_get_as_many_superpixels_as_asked(shape: tuple[int, int]) -> None:
    image = np.add.outer(np.arange(shape[0]), np.arange(shape[1])).astype(np.uint16)
    assert 95 <= superpixels(image, 100).n_segments <= 105

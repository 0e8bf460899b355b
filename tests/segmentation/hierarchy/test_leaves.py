import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from cvtimg import segment_hierarchy
from cvtimg._shared.types import Array
from cvtimg.segmentation.hierarchy import leaves
from cvtimg.segmentation.hierarchy.leaves import reduced, reduction
from cvtimg.segmentation.hierarchy.settings import Settings


@given(st.integers(1, 150), st.integers(1, 9), st.integers(2, 5), st.integers(0, 2**31))
def test_blocks_become_the_means_of_their_pixels_inside(height: int, width: int, factor: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = rng.random((height, width, 2))
    inside = rng.random((height, width)) < 0.6
    means, occupied = reduced(image, inside, factor)
    for y in range(-(-height // factor)):
        for x in range(-(-width // factor)):
            block = slice(y * factor, (y + 1) * factor), slice(x * factor, (x + 1) * factor)
            pixels = image[block][inside[block]]
            assert occupied[y, x] == (len(pixels) > 0)
            np.testing.assert_allclose(means[y, x], pixels.mean(axis=0) if len(pixels) else 0)


def test_only_large_images_are_reduced() -> None:
    assert reduction(1224 * 816) == 1
    assert [reduction(n * 10**6) for n in (2, 12, 100)] == [2, 4, 9]


@pytest.fixture
def small_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take images of over 10,000 pixels for large ones."""
    monkeypatch.setattr(leaves, "SETTINGS", Settings(most_pixels=10_000))


@pytest.mark.usefixtures("small_limit")
def test_borders_of_large_images_follow_their_edges() -> None:
    rows, columns = np.mgrid[:240, :320]
    truth = ((rows - 120) ** 2 + (columns - 150) ** 2 < 80**2) + 1
    image = (truth * 90).astype(np.uint8)
    hierarchy = segment_hierarchy(image, n_leaves=100)
    assert reduction(image.size) == 3
    labels = hierarchy.cut(2)
    assert (labels != truth).mean() < 0.001
    assert hierarchy.sizes[-1] == image.size
    np.testing.assert_allclose(hierarchy.colors[-1], image.mean(), rtol=0.02)  # the mean is taken in Lab
    np.testing.assert_array_equal(np.bincount(hierarchy.leaves.ravel())[1:], hierarchy.sizes[: hierarchy.n_leaves])


@pytest.mark.usefixtures("small_limit")
def test_cuts_of_large_masked_images_are_connected(photograph: Array) -> None:
    mask = np.random.default_rng(0).random((256, 256)) < 0.9
    mask[:, 100:103] = False
    mask[50:60, 120:130] = False
    mask[54:56, 124:126] = True  # an island
    hierarchy = segment_hierarchy(photograph, n_leaves=80, mask=mask)
    assert hierarchy.n_parts == ndimage.label(mask)[1]
    for n in (hierarchy.n_parts, hierarchy.n_parts + 10, hierarchy.n_leaves):
        labels = hierarchy.cut(n)
        np.testing.assert_array_equal(labels > 0, mask)
        boxes = ndimage.find_objects(labels)
        assert len(boxes) == n
        assert all(ndimage.label(labels[box] == label)[1] == 1 for label, box in enumerate(boxes, start=1))

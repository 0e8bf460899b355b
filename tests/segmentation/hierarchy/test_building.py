import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from cvtimg import segment_hierarchy
from cvtimg._shared.types import Array, Ints
from cvtimg.segmentation.hierarchy.building import default_threshold


def shapes(height: int = 90, width: int = 120) -> Ints:
    """Draw a disc and a bar on a ground: labels 1, 2, 3."""
    rows, columns = np.mgrid[:height, :width]
    truth = np.ones((height, width), np.int32)
    truth[(rows - 45) ** 2 + (columns - 35) ** 2 < 25**2] = 2
    truth[10:80, 80:105] = 3
    return truth


def agreement(labels: Array, truth: Array) -> float:
    """Share of the pixels that the best region of each true one has right."""
    return sum(np.bincount(labels[truth == label]).max() for label in np.unique(truth)) / truth.size


def test_shapes_are_found_in_color_grey_dim_images_and_many_bands() -> None:
    truth = shapes()
    for levels in (
        np.uint8([40, 120, 200]),
        np.uint16([100, 160, 220]),  # dim: white is 65535
        np.uint8([[200, 30, 40], [40, 160, 60], [60, 60, 190]]),
        np.uint8([[9, 9, 9, 9, 9], [9, 9, 80, 9, 9], [70, 9, 9, 9, 9]]),
    ):
        image = levels[truth - 1]
        image.flags.writeable = False  # it stays as it is
        hierarchy = segment_hierarchy(image, n_leaves=200)
        assert agreement(hierarchy.cut(3), truth) > 0.995
        assert 3 <= hierarchy.cut().max() <= 6


def test_texture_alone_tells_regions_apart() -> None:
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[:120, :160]
    fine = 128 + 60 * np.where(columns < 80, np.sin(rows * 1.2), np.sin(columns * 1.2))
    image = np.clip(fine + rng.normal(0, 4, fine.shape), 0, 255).astype(np.uint8)
    labels = segment_hierarchy(image, n_leaves=100).cut(2)
    assert agreement(labels, 1 + (columns >= 80)) > 0.95


@pytest.mark.parametrize("deviation", [15, 40])
def test_noise_hides_no_large_shapes(deviation: float) -> None:
    truth = shapes()
    rng = np.random.default_rng(1)
    clean = np.array([70.0, 130, 190])[truth - 1]
    image = np.clip(clean + rng.normal(0, deviation, truth.shape), 0, 255).astype(np.uint8)
    assert agreement(segment_hierarchy(image, n_leaves=200).cut(3), truth) > 0.95


@pytest.mark.slow
def test_masked_pixels_have_no_label_and_no_influence(photograph: Array) -> None:
    rows, columns = np.mgrid[:256, :256]
    mask = (rows - 128) ** 2 + (columns - 128) ** 2 < 100**2
    hierarchy = segment_hierarchy(photograph, n_leaves=100, mask=mask)
    np.testing.assert_array_equal(hierarchy.cut(10) > 0, mask)
    missing = np.where(mask[..., None], photograph / 255.0, np.nan)
    np.testing.assert_array_equal(segment_hierarchy(missing, n_leaves=100).cut(10), hierarchy.cut(10))


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (1, 20), (60, 80), (60, 80, 3)])
def test_one_color_is_one_region(shape: tuple[int, ...]) -> None:
    hierarchy = segment_hierarchy(np.full(shape, 77, np.uint8))
    assert (hierarchy.cut() == 1).all()
    assert not (hierarchy.contour_map() > 1e-6).any()


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(ValueError, match=r"n_leaves=0 must be in 1\.\.65536"):
        segment_hierarchy(np.zeros((4, 5)), n_leaves=0)
    with pytest.raises(ValueError, match="space='hsv' must be one of"):
        segment_hierarchy(np.zeros((4, 5)), space="hsv")
    with pytest.raises(ValueError, match="mask of shape"):
        segment_hierarchy(np.zeros((4, 5)), mask=np.ones((5, 4)))


@settings(max_examples=25)
@given(st.integers(1, 24), st.integers(1, 24), st.sampled_from([(), (2,), (3,), (5,)]), st.integers(0, 2**31))
@pytest.mark.slow
def test_every_cut_of_any_image_is_connected_and_nested(
    height: int, width: int, bands: tuple[int, ...], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, rng.choice([2, 256]), (height, width, *bands)).astype(np.uint8)
    mask = rng.random((height, width)) < rng.choice([0.7, 1.0])
    mask[0, 0] = True
    hierarchy = segment_hierarchy(image, n_leaves=20, mask=mask)
    coarse = None
    for n in range(hierarchy.n_parts, hierarchy.n_leaves + 1):
        labels = hierarchy.cut(n)
        assert (labels > 0).tolist() == mask.tolist()
        assert sum(ndimage.label(labels == label)[1] for label in range(1, n + 1)) == n == labels.max()
        if coarse is not None:
            assert len(set(zip(coarse.ravel().tolist(), labels.ravel().tolist(), strict=True)) - {(0, 0)}) == n
        coarse = labels


@pytest.mark.parametrize("white", [255, 60])
def test_the_default_cut_shows_many_small_spots(white: int) -> None:
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[:240, :240]
    spots = (rows % 48 - 24) ** 2 + (columns % 48 - 24) ** 2 < 36
    image = rng.normal(0.06, 0.01, spots.shape) + 0.1 * spots
    image[:8, :16] = 0.8  # something bright beside them
    hierarchy = segment_hierarchy((image * white).round().clip(0, 255).astype(np.uint8))
    labels = hierarchy.cut()
    ground = np.bincount(labels.ravel()).argmax()
    assert 0.25 <= hierarchy.default_threshold < 0.5
    assert ((labels != ground) & spots).sum() > 0.8 * spots.sum()
    assert labels.max() < 60


@pytest.mark.parametrize("deviation", [3, 20, 60])
@pytest.mark.parametrize("bands", [(), (3,)])
def test_flat_noise_is_one_region(deviation: float, bands: tuple[int, ...]) -> None:
    noise = np.random.default_rng(0).normal(60, deviation, (80, 100, *bands))
    assert segment_hierarchy(noise.clip(0, 255).astype(np.uint8)).n_regions() == 1


def test_the_threshold_is_lowered_until_two_thirds_of_the_power_lie_above() -> None:
    lengths = np.array([10, 10, 10, 100], np.int32)
    faint = np.array([0.4, 0.3, 0.3, 0.01])
    threshold = default_threshold(lengths, faint, 0.9)
    assert (faint > threshold).tolist() == [True, True, True, False]
    assert default_threshold(lengths, faint, 0.5) == 0.5  # noise
    assert default_threshold(lengths, np.array([0.6, 0.3, 0.3, 0.01]), 0.9) == 0.5
    assert default_threshold(lengths, faint / 10, 0.9) == 0.25
    assert default_threshold(lengths[:0], faint[:0], 0.9) == 0.5
    assert default_threshold(lengths, faint * 0, 0.9) == 0.5

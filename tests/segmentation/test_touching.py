"""Claims about objects: touching ones are split, and the background is none of them."""

import numpy as np
import pytest
from images import discs
from reference import same_partition
from scipy import ndimage
from scipy.ndimage import gaussian_filter

from cvtimg import segment
from cvtimg._shared.types import Floats32, Ints
from cvtimg.segmentation import Objects
from cvtimg.segmentation.touching import split_touching, with_own_borders

RNG = np.random.default_rng(0)


CENTERS = [(20, 20), (20, 36), (60, 30), (62, 70), (62, 86), (70, 103), (20, 90)]
PAIRS = discs([(y, x, 10.1) for y, x in CENTERS], (90, 120))


def test_touching_discs_are_split_where_they_touch() -> None:
    assert ndimage.label(PAIRS > 0)[1] == 4
    found = split_touching(PAIRS > 0)
    assert found.max() == PAIRS.max() == 7
    np.testing.assert_array_equal(found > 0, PAIRS > 0)
    assert same_partition(found[PAIRS > 0], PAIRS[PAIRS > 0]) > 0.95


@pytest.mark.parametrize("angle", [0, 0.5, 1.2])
def test_a_convex_object_is_never_split(angle: float) -> None:
    down, right = np.indices((90, 120)) - np.array([45, 60])[:, None, None]
    along, across = down * np.sin(angle) + right * np.cos(angle), down * np.cos(angle) - right * np.sin(angle)
    for inside in ((along / 40) ** 2 + (across / 12) ** 2 < 1, (abs(along) < 30) & (abs(across) < 12)):
        assert split_touching(inside).max() == 1
        ragged = inside ^ (ndimage.binary_dilation(inside) & (RNG.random(inside.shape) < 0.1) & ~inside)
        assert split_touching(ragged).max() == 1


def test_a_deeper_neck_is_needed_where_more_is_asked_for() -> None:
    assert split_touching(PAIRS > 0, np.inf).max() == 4
    counts = [int(split_touching(PAIRS > 0, depth).max()) for depth in (0.5, 2, 20)]
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] == 4


def test_small_pieces_are_objects_too_and_nothing_has_none() -> None:
    mask = np.zeros((9, 9), bool)
    assert split_touching(mask).max() == 0
    assert segment(np.full((8, 9), 7, np.uint8), 3, objects=True).n_segments == 0
    mask[1, 1] = mask[5, 5:7] = True
    np.testing.assert_array_equal(np.bincount(split_touching(mask).ravel()), [78, 1, 2])


@pytest.mark.parametrize("edge_weight", [0, "auto"])
def test_segment_finds_objects_and_leaves_the_background_out(edge_weight: float | str) -> None:
    brightness = np.array([20, 120, 130, 140, 150, 160, 170, 180])[PAIRS]
    image = np.clip(brightness + RNG.normal(0, 5, PAIRS.shape), 0, 255).astype(np.uint8)
    result = segment(image, 2, edge_weight=edge_weight, min_size=5, objects=True)
    assert result.n_segments == 7
    assert same_partition(result.labels[PAIRS > 0], PAIRS[PAIRS > 0]) > 0.95
    assert (np.diff(result.generators[:, 0]) > 0).all()
    np.testing.assert_allclose(result.generators[:, 0], np.arange(120, 190, 10), atol=3)
    rows = image[result.labels > 0].astype(float)
    means = result.generators[result.labels[result.labels > 0] - 1, 0]
    assert result.energy == pytest.approx(((rows - means) ** 2).sum(), rel=1e-4)


@pytest.mark.parametrize(("background", "n_objects"), [("largest", 2), ("darkest", 2), ("brightest", 1)])
def test_the_background_is_chosen_by_size_or_brightness(background: str, n_objects: int) -> None:
    image = np.full((40, 60), 100, np.uint8)
    image[10:20, 5:15] = 200
    image[10:20, 40:50] = 200
    if background == "largest":
        image = 255 - image
    result = segment(image, 2, objects=Objects(background, neck_depth=np.inf))
    assert result.n_segments == n_objects


def bright_and_dim() -> tuple[Floats32, Ints]:
    """Draw a bright and a dim disc that touch, blurred as optics do, and where each is halfway to the background."""
    truth = discs([(30, 35, 12), (30, 58, 12)], (60, 100))
    image = gaussian_filter(np.choose(truth, (0.0, 1.0, 0.2)), 1.5)
    noise = 0.01 * np.random.default_rng(0).standard_normal(image.shape)
    return (image + noise).astype(np.float32), truth


def test_own_borders_fit_bright_and_dim_objects_better_than_those_of_one_threshold() -> None:
    image, truth = bright_and_dim()
    objects = split_touching(image > 0.1, contrast=image)
    own = with_own_borders(objects, image[..., None], np.zeros(1, np.float32))
    wrong = [np.count_nonzero((labels > 0) != (truth > 0)) for labels in (own, objects)]
    assert wrong[0] < wrong[1] / 1.5
    assert ((own == 0) | (objects > 0)).all()
    assert same_partition(own[truth > 0], truth[truth > 0]) > 0.8
    assert own.max() == len(np.unique(own)) - 1


def test_own_borders_leave_objects_whole() -> None:
    down, right = np.mgrid[:60, :60]
    far = np.hypot(down - 30, right - 30)
    image = np.where(far < 5, 0.3, np.where(far < 20, 1.0, 0.0)).astype(np.float32)
    objects = with_own_borders((far < 20).astype(np.int32), image[..., None], np.zeros(1, np.float32))
    np.testing.assert_array_equal(objects, far < 20)  # the dark core is enclosed


def test_contrast_splits_where_the_shape_has_no_neck() -> None:
    mask = np.zeros((30, 60), bool)
    mask[5:25, 5:55] = True
    across = np.abs(np.mgrid[:30, :60][1] - 29.5)
    dip = 1 - 0.9 * np.exp(-np.square(across / 3))
    assert split_touching(mask).max() == 1
    split = split_touching(mask, contrast=dip)
    assert split.max() == 2
    assert (split[:, :28][mask[:, :28]] == 1).all()
    np.testing.assert_array_equal(split_touching(mask, contrast=np.full(mask.shape, 7.0)), split_touching(mask))

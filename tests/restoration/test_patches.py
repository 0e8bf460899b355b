"""Claims about patches in groups, and the filter of each group."""

import numpy as np
import pytest
from reference import at_threads

from cvtimg._shared.types import Floats
from cvtimg.restoration.detail import Groups, Noisy, _variances, filtered, group_patches, windows, with_border


def noisy_image(shape: tuple[int, int, int] = (11, 13, 3), *, precisions: tuple[int, ...] = (40, 100, 120)) -> Noisy:
    """An image whose pixels are known unequally well, and an estimate."""
    rng = np.random.default_rng(0)
    estimate = rng.random(shape).astype(np.float32)
    values = estimate + 0.1 * rng.standard_normal(shape).astype(np.float32)
    precision = rng.choice(precisions, shape[:2]).astype(np.float32)
    return Noisy(with_border(values), with_border(estimate), with_border(precision[:, :, None])[:, :, 0])


def as_written(noisy: Noisy, groups: Groups, rounds: int = 2) -> Floats:
    """Filter each group by the formulas, patch by patch."""
    height, width = (side - 4 for side in noisy.precision.shape)
    values, estimate, precision = (
        np.asarray(part, np.float64) for part in (noisy.values, noisy.estimate, noisy.precision)
    )
    n_bands = values.shape[2]
    precisions = windows(precision[:, :, None].astype(np.float32)).reshape(height * width, -1)
    for _ in range(rounds):
        total, weight = np.zeros((height + 4, width + 4, n_bands)), np.zeros((height + 4, width + 4, 1))
        change = precision[:, :, None] * (values - estimate)
        for start, stop in zip(groups.bounds[:-1], groups.bounds[1:], strict=True):
            members = groups.order[start:stop]
            variance = 1 / precisions[members].mean()
            places = [(pixel // width, pixel % width) for pixel in members]
            of_oracle = np.stack([noisy.estimate[y : y + 5, x : x + 5].ravel() for y, x in places]).astype(np.float64)
            mean = of_oracle.mean(axis=0)
            size = len(mean)
            covariance = 1.1 * np.cov(of_oracle.T, bias=True)
            matrix = covariance @ np.linalg.inv(covariance + variance * np.eye(size))
            left = np.diag(matrix).reshape(25, n_bands).mean(axis=1).reshape(5, 5, 1)
            for y, x in places:
                patch = (estimate + variance * change)[y : y + 5, x : x + 5].ravel()
                share = 1 / variance / (left + 0.02)
                total[y : y + 5, x : x + 5] += share * (matrix @ (patch - mean) + mean).reshape(5, 5, n_bands)
                weight[y : y + 5, x : x + 5] += share
        estimate[2:-2, 2:-2] = (total / weight)[2:-2, 2:-2]
    return estimate[2:-2, 2:-2]


@pytest.mark.parametrize(
    ("n_bands", "precisions", "rounds"), [(1, (40, 120), 2), (3, (40, 100, 120), 2), (4, (80, 100, 120), 1)]
)
def test_the_image_is_that_of_patches_filtered_by_the_formulas(
    n_bands: int, precisions: tuple[int, ...], rounds: int
) -> None:
    noisy = noisy_image((11, 13, n_bands), precisions=precisions)
    order = np.random.default_rng(1).permutation(11 * 13).astype(np.int32)
    groups = Groups(slice(0, 11), slice(0, 13), order, np.array([0, 50, 81, 143]))
    found = filtered(noisy, [groups], from_estimate=True)
    np.testing.assert_allclose(found, as_written(noisy, groups, rounds), atol=2e-4)


def test_blocks_leave_no_seams_because_a_pixel_is_the_mean_of_the_patches_of_all_blocks() -> None:
    noisy = noisy_image()
    rng = np.random.default_rng(2)
    blocks, order, sizes = [], [], []
    for rows in (slice(0, 5), slice(5, 11)):
        for columns in (slice(0, 6), slice(6, 13)):
            places = np.mgrid[rows, columns].reshape(2, -1)
            own = rng.permutation(places.shape[1]).astype(np.int32)
            blocks.append(Groups(rows, columns, own, np.array([0, 14, len(own)])))
            order.append((places[0] * 13 + places[1])[own])
            sizes += [14, len(own) - 14]
    together = Groups(slice(0, 11), slice(0, 13), np.concatenate(order).astype(np.int32), np.cumsum([0, *sizes]))
    found = filtered(noisy, blocks, from_estimate=True)
    np.testing.assert_allclose(found, as_written(noisy, together), atol=2e-4)
    np.testing.assert_allclose(found, filtered(noisy, [together], from_estimate=True), atol=1e-5)


def test_groups_are_no_larger_than_allowed_and_hold_each_patch_once() -> None:
    rng = np.random.default_rng(0)
    features = rng.standard_normal((5000, 18)).astype(np.float32)
    features[:1000] = 0  # patches that do not differ at all
    labels = rng.integers(7, size=5000).astype(np.int32)
    order, bounds = group_patches(features, labels, 60)
    assert np.diff(bounds).min() >= 1
    assert 20 < np.diff(bounds).max() <= 60
    np.testing.assert_array_equal(np.sort(order), np.arange(5000))
    assert all(len(np.unique(labels[group])) == 1 for group in np.split(order, bounds[1:-1]))


def test_groups_hold_what_is_alike() -> None:
    rng = np.random.default_rng(0)
    which = rng.integers(8, size=4000)
    places = np.geomspace(80, 10, 8)[which, None] * np.eye(8)[which]
    features = (places + rng.standard_normal((4000, 8))).astype(np.float32)
    order, bounds = group_patches(features, np.zeros(4000, np.int32), 600)
    purest = [np.bincount(which[group]).max() for group in np.split(order, bounds[1:-1])]
    assert sum(purest) > 0.99 * 4000


def test_threads_make_no_difference_to_blocks_side_by_side() -> None:
    features = np.random.default_rng(0).standard_normal((160, 6)).astype(np.float32)
    half = group_patches(features, np.zeros(160, np.int32), 40)
    blocks = [Groups(slice(8 * part, 8 * part + 8), slice(0, 20), *half) for part in range(2)]
    one, three = at_threads(lambda: filtered(noisy_image((16, 20, 3)), blocks, False).tobytes())
    assert one == three


def test_better_pixels_than_those_of_their_group_are_drawn_by_less_than_twice_what_they_are_away() -> None:
    precision = np.ones((20, 20), np.float32)
    precision[9, 9] = 100
    group = Groups(slice(0, 16), slice(0, 16), np.arange(256, dtype=np.int32), np.array([0, 256]))
    assert 1.5 < 100 * _variances(precision, group, 1.0)[0] < 2

"""Relations of restoration: bands repeated, permuted and empty, frames of one color, types; and trivial rivals."""

import warnings
from functools import partial
from typing import Any

import numpy as np
from conftest import SAMPLES
from relations.relation import Relation, close, equal, not_above, quick_and_wide
from relations.remembering import beside, remembered
from scipy.ndimage import median_filter
from skimage.filters import gaussian

from cvtimg import denoise, read_image, restore
from cvtimg._shared.types import Array, Bytes
from cvtimg.restoration import restore_versions

Case = tuple[Bytes, list[Bytes]]
SIDE = 72


def spoiled(n_versions: int, gray: bool = False) -> Any:
    """Return what makes a photograph and versions of it, whose bands share noise more or less."""

    def inputs(rng: np.random.Generator) -> Case:
        photograph = read_image(SAMPLES / "chelsea.png")
        y, x = (int(rng.integers(0, side - SIDE)) for side in photograph.shape[:2])
        clean = photograph[y : y + SIDE, x : x + SIDE, 1 if gray else slice(None)]
        sigma, share = rng.uniform(4, 25), rng.random()
        noises = [
            np.sqrt(share) * rng.standard_normal((SIDE, SIDE, 1))
            + np.sqrt(1 - share) * rng.standard_normal((SIDE, SIDE, 3))
            for _ in range(n_versions)
        ]
        noisy = [clean + sigma * (noise[:, :, 0] if gray else noise) for noise in noises]
        return clean, [np.clip(np.rint(one), 0, 255).astype(np.uint8) for one in noisy]

    return inputs


@remembered
def restored(case: Case) -> Array:
    """(H, W, ...) image of the versions."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # frames of one color are told
        return denoise(case[1], effort="fast", alpha=False).image


def error(case: Case) -> float:
    """Mean squared error of what is restored, in squared levels."""
    return error_of(restored(case), case)


def error_of(image: Array, case: Case) -> float:
    """Mean squared error of an image, in squared levels."""
    return float(np.mean(np.square(image.astype(float) - case[0])))


def each(change: Any) -> Any:
    """Return what changes all versions."""
    return lambda case: (case[0], [change(version) for version in case[1]])


def reversed_bands(case: Case) -> Case:
    return case[0][..., ::-1], [version[..., ::-1] for version in case[1]]


def error_of_mean(case: Case) -> float:
    """Mean squared error of the mean of versions, in squared levels."""
    return error_of(np.mean(case[1], axis=0), case)


def with_passers_by(case: Case) -> Case:
    """Add something to each version, at another place."""
    boxes = [(slice(9 * number + 4, 9 * number + 12), slice(30, 44)) for number in range(len(case[1]))]
    painted = [version.copy() for version in case[1]]
    for version, box in zip(painted, boxes, strict=True):
        version[box] = 255 - version[box].mean(axis=(0, 1)) // 1
    return case[0], painted


def error_of_median(case: Case) -> float:
    """Mean squared error of the median of versions, in squared levels."""
    return error_of(np.median(case[1], axis=0), case)


def with_impulses(rng: np.random.Generator, *, noisy: bool) -> Case:
    """Return a photograph, and it, or a noisy version, with a tenth of the pixels black or white."""
    clean, versions = ONE(rng)
    hit, ends = rng.random((SIDE, SIDE, 1)) < 0.1, rng.choice(np.uint8([0, 255]), (SIDE, SIDE, 1))
    return clean, [np.where(hit, ends, versions[0] if noisy else clean)]


def of_few_pixels(rng: np.random.Generator) -> Case:
    """Return a photograph of 1 to 23 pixels a side and a noisy version."""
    (clean, (noisy,)), (height, width) = ONE(rng), rng.integers(1, 24, 2)
    return clean[:height, :width], [noisy[:height, :width]]


def turned(case: Case) -> Case:
    return np.rot90(case[0]), [np.rot90(version) for version in case[1]]


def error_of_neighbors(case: Case) -> float:
    """Mean squared error of medians of 3 x 3 pixels, in squared levels."""
    return error_of(median_filter(case[1][0], (3, 3, 1)), case)


def first_band(case: Case) -> Array:
    """(H, W) first band of what is restored; the only one of a gray picture."""
    return restored(case).reshape(SIDE, SIDE, -1)[:, :, 0]


def with_flat(case: Case) -> Case:
    return case[0], [*case[1], np.full_like(case[1][0], 37)]


def with_dark(case: Case) -> Case:
    """Add a frame of a tenth of the light, as through a lens that is nearly covered, and of little noise."""
    return case[0], [*case[1], np.rint(case[0] / 10).astype(np.uint8)]


def error_either_way(case: Case) -> float:
    """Mean squared error of what the command restores: a photograph is no drawing."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return error_of(restore_versions(case[1], effort="fast").image, case)


def with_hot_pixel(version: Array) -> Array:
    hot = version.astype(float)
    hot[30, 41] = 1e6
    return hot


def error_of_floats(case: Case) -> float:
    """Mean squared error of what is restored of floating point, in squared levels."""
    return error(each(np.float64)(case))


def as_shorts(case: Case) -> Array:
    """(H, W, C) what is restored of values of 16 bits, in levels of 8 bits."""
    return restored((case[0], [version * np.uint16(257) for version in case[1]])) / 257


def flat_versions(rng: np.random.Generator) -> Case:
    """Return a picture of four flat colors in equal parts, for a rare one may be missed, and three versions of it."""
    light = gaussian(rng.normal(size=(40, 48)), 4)
    levels = (60 * np.digitize(light, np.quantile(light, (0.25, 0.5, 0.75)))).astype(np.uint8)
    clean = np.dstack([levels, 255 - levels, levels // 2])
    noisy = [clean + rng.normal(0, 10, clean.shape) for _ in range(3)]
    return clean, [np.clip(np.rint(one), 0, 255).astype(np.uint8) for one in noisy]


def error_in_flat_colors(case: Case) -> float:
    """Mean squared error of what is restored in flat colors, in squared levels."""
    return error_of(in_flat_colors(case), case)


@remembered
def in_flat_colors(case: Case) -> Array:
    """(H, W, C) what is restored in flat colors."""
    return restore(case[1], 4).image


def but_for_ties(before: Array, after: Array) -> None:
    """Assert that images differ by a level, as means are rounded, but for a pixel of a hundred between two colors."""
    assert (np.abs(after.astype(int) - before).max(axis=2) > 1).mean() <= 0.01


def backwards(case: Case) -> Case:
    return case[0], case[1][::-1]


SINCE, LATER = "2026-11-27", "2026-11-28"
ONE, GRAY, THREE = spoiled(1), spoiled(1, gray=True), spoiled(3)
_RIVALS: list[tuple[str, str, Any, Any, Any, float]] = [
    ("denoise", "one version: itself", ONE, error, error_of_mean, 1),
    ("denoise", "three versions: their mean", THREE, error, error_of_mean, 1),
    ("denoise", "outliers: their median", lambda rng: with_passers_by(spoiled(5)(rng)), error, error_of_median, 1),
    ("denoise", "impulses: a median", partial(with_impulses, noisy=False), error, error_of_neighbors, 0.25),
    ("denoise", "noise and impulses: a median", partial(with_impulses, noisy=True), error, error_of_neighbors, 1),
    ("restore", "versions: their mean", flat_versions, error_in_flat_colors, error_of_mean, 1),
]
RELATIONS = [
    Relation("denoise", "bands repeated", GRAY, first_band, each(lambda v: np.dstack([v] * 3)), equal, SINCE),
    Relation("denoise", "an empty band", ONE, first_band, each(lambda v: np.dstack([v, 0 * v[..., 0]])), equal, SINCE),
    Relation("denoise", "bands permuted", ONE, error, reversed_bands, close(0.03), SINCE, "other patches are alike"),
    Relation("denoise", "a frame of one color", spoiled(2), restored, with_flat, close(0, 1.0), SINCE, "weights are"),
    Relation(
        "denoise", "a dark frame", spoiled(2), error_either_way, with_dark, close(0.01), LATER, "sums are rounded"
    ),
    beside("denoise", "16 bits", ONE, restored, as_shorts, close(0, 2.0), SINCE, "8 bits are rounded"),
    Relation("denoise", "turned", ONE, error, turned, close(0.15), LATER, "evidence of shared noise steps"),
    Relation(
        "restore",
        "few pixels, turned",
        of_few_pixels,
        error_either_way,
        turned,
        close(0.25),
        LATER,
        "means of few pixels",
    ),
    beside("restore", "few pixels: themselves", of_few_pixels, error_either_way, error_of_mean, not_above(1.05)),
    Relation(
        "denoise",
        "a hot pixel",
        ONE,
        error_of_floats,
        each(with_hot_pixel),
        close(0.5),
        LATER,
        "evidence of shared noise steps",
    ),
    Relation("denoise", "versions in another order", THREE, error, backwards, close(0.01), LATER, "sums are rounded"),
    Relation("restore", "versions in another order", flat_versions, in_flat_colors, backwards, but_for_ties, LATER),
] + [beside(*row, not_above(share), SINCE) for *row, share in _RIVALS]
test_a_result_follows_its_input, test_a_result_follows_any_input = quick_and_wide(RELATIONS)

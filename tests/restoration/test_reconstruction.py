from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaging import as_bytes, card, damage, psnr, two_phases
from PIL import Image

from cvtimg import denoise, read_image, restore
from cvtimg._shared.types import Array
from cvtimg.restoration import RENORMALIZATIONS, Restoration

Damage = damage.Damage


@cache
def union(sigma: float, **options: Any) -> Restoration:
    """Restore three noisy versions, each with parts painted over by the background, and nothing that tells where."""
    versions, known = damage.damaged_versions(two_phases(), 3, Damage(noise=sigma, occlusions=3), seed=0)
    assert all(mask.all() for mask in known)
    return restore(versions, 2, **options)


def damaged_card(side: int, n: int = 3, seed: int = 0, **suffered: Any) -> tuple[Any, list[Any], list[Any]]:
    """A card in four colors, damaged versions of it, and what they know."""
    clean, _ = card(side)
    return clean, *damage.damaged_versions(clean, n, Damage(**suffered), seed)


@pytest.mark.parametrize(("sigma", "least"), [(0.1, 0.995), (0.3, 0.98)])
def test_the_union_of_an_object_comes_back_at_full_contrast_without_masks(sigma: float, least: float) -> None:
    truth = two_phases()[:, :, 0] == 1
    assert np.mean((union(sigma).labels == 2) == truth) >= least
    np.testing.assert_allclose(union(sigma).colors.ravel(), [0, 1], atol=0.02)


def test_range_restores_full_contrast_and_means_do_not() -> None:
    ranged, median, mean = (union(0.1, hidden=None, renormalize=rule).colors[1, 0] for rule in RENORMALIZATIONS)
    assert ranged == pytest.approx(1, abs=0.02)
    assert mean < 0.95
    assert mean < median < 1.02


def test_a_card_of_four_colors_comes_back_from_noise_holes_and_blocks() -> None:
    clean, versions, known = damaged_card(64, seed=1, noise=0.3, holes=0.3, blocks=1)
    result = restore(versions, 4, masks=known)
    assert psnr(result.image, clean) > 28
    np.testing.assert_array_equal(result.coverage, np.sum(known, axis=0))
    np.testing.assert_allclose(result.noise, 0.3, rtol=0.1)
    assert (np.diff(result.colors.sum(axis=1)) > 0).all()
    for label in range(1, 5):
        for version, mask, means in zip(versions, known, result.generators[label - 1], strict=True):
            np.testing.assert_allclose(means, version[(result.labels == label) & mask].mean(axis=0))


@pytest.mark.parametrize("edge_weight", ["auto", 0])
def test_what_no_version_knows_is_filled_from_around_it(edge_weight: Any) -> None:
    which = card(64)[1]
    clean, versions, known = damaged_card(64, 2, noise=0.1)
    for mask in known:
        mask[15:21, 16:24] = False  # within the disc
        mask[40:43, 46:49] = False  # within the triangle
    result = restore(versions, 4, masks=known, edge_weight=edge_weight, effort="fast")
    unknown = result.coverage == 0
    assert unknown.sum() == 57
    np.testing.assert_allclose(result.image[unknown], clean[unknown], atol=0.03)
    assert len(np.unique(result.labels[unknown])) == len(np.unique(which[unknown]))
    assert len(result.energies) > 1


def test_nan_alpha_nodata_and_masks_say_the_same() -> None:
    _, versions, known = damaged_card(32, noise=0.1, holes=0.3)
    levels = [np.clip(np.rint(254 * version) + 1, 1, 255).astype(np.uint8) for version in versions]
    clear = [np.dstack([x, np.uint8(255) * mask]) for x, mask in zip(levels, known, strict=True)]
    fast = partial(restore, n_generators=4, effort="fast")
    as_masks = fast(levels, masks=known)
    as_nodata = fast([np.where(mask[..., None], x, 0) for x, mask in zip(levels, known, strict=True)], nodata=0)
    as_alpha, as_images = fast(clear), fast([Image.fromarray(one) for one in clear])
    as_nan = fast([np.where(mask[..., None], x, np.nan) for x, mask in zip(levels, known, strict=True)])
    for other in (as_nodata, as_alpha, as_images, as_nan):
        assert np.mean(other.labels == as_masks.labels) > 0.99  # floating point is not taken for clipped
        np.testing.assert_allclose(other.colors, as_masks.colors, atol=0.3)
        np.testing.assert_array_equal(other.coverage, as_masks.coverage)
    assert as_alpha.image.shape == (32, 32, 3)


@pytest.mark.parametrize(("scale", "dtype"), [(257, np.uint16), (1 / 255, np.float32), (1 / 255, np.float64)])
def test_depths_agree_and_an_edge_weight_means_the_same_at_each(scale: float, dtype: type) -> None:
    _, versions, known = damaged_card(32, noise=0.1, holes=0.2)
    levels = [as_bytes(255 * version) for version in versions]
    how = {"masks": known, "edge_weight": 200, "effort": "fast"}
    shallow = restore(levels, 4, **how)
    deep = restore([(version * np.float64(scale)).astype(dtype) for version in levels], 4, **how)
    assert np.mean(deep.labels == shallow.labels) > 0.999
    np.testing.assert_allclose(deep.colors / scale, shallow.colors, atol=0.01)
    assert (deep.image.dtype, deep.edge_weight) == (dtype, 200)


@pytest.mark.parametrize("shape", [(24, 24), (24, 24, 1), (24, 24, 3), (24, 24, 6)])
def test_the_picture_has_the_shape_of_the_first_version(shape: tuple[int, ...]) -> None:
    picture = np.zeros(shape)
    picture[5:15, 6:20] = 1
    result = restore([picture, picture], 2, effort="fast")
    np.testing.assert_allclose(result.image, picture, atol=1e-6)
    assert result.image.shape == shape
    assert result.generators.shape == (2, 2, shape[2] if len(shape) == 3 else 1)


def test_a_noisier_version_counts_for_less() -> None:
    clean, _ = card(48)
    rng = np.random.default_rng(0)
    versions = [clean + sigma * rng.standard_normal(clean.shape) for sigma in (0.05, 0.05, 0.5)]
    spoiled = [*versions[:2], versions[2] + 0.3]
    for weights, least, most in ((None, 0, 0.01), ([1, 1, 1], 0.08, 0.12)):
        one, other = (
            restore(some, 4, renormalize=None, weights=weights, effort="fast") for some in (versions, spoiled)
        )
        assert least <= np.abs(one.colors - other.colors).max() <= most
        np.testing.assert_allclose(one.weights[0] / one.weights[2], 1 if weights else 100, rtol=0.3)
        np.testing.assert_allclose(one.weights.mean(), 1)


def test_channels_share_segments_and_no_colors() -> None:
    day = np.zeros((20, 30, 3), np.uint8)
    day[:, 15:] = 200, 120, 40
    night = np.zeros((20, 30), np.uint16)
    night[10:] = 50000
    result = restore([day, night], 4, channels=True)
    np.testing.assert_array_equal(result.image, day)
    assert len(np.unique(result.labels)) == 4
    assert result.generators.shape == (4, 2, 3)
    np.testing.assert_allclose(result.generators[result.labels - 1, 1, 0], night)
    assert np.isnan(result.generators[:, 1, 1:]).all()
    swapped = restore([night, day], 4, channels=True)
    np.testing.assert_array_equal(swapped.image, night)


@pytest.mark.parametrize("space", ["linear", "lab", "oklab"])
def test_a_space_is_where_distances_are_measured(space: Any) -> None:
    clean, versions, known = damaged_card(48, noise=0.1, holes=0.2)
    result = restore([as_bytes(255 * one) for one in versions], 4, masks=known, space=space, effort="fast")
    assert psnr(result.image / 255, clean) > 25
    assert np.nanmax(result.generators) > 100  # in the units of the versions


def test_the_same_seed_gives_the_same_bits_and_inputs_stay(photograph: Array) -> None:
    versions = [photograph[:40, :40].copy(), photograph[:40, :40] // 2 * 2]
    for call in (partial(restore, versions, 8, effort="fast"), partial(denoise, versions, rng=3, effort="fast")):
        one, other = call(), call()
        assert one.image.tobytes() == other.image.tobytes()
    np.testing.assert_array_equal(versions[0], photograph[:40, :40])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_a_result_shows_and_saves_itself(dtype: type, tmp_path: Path) -> None:
    clean, _ = card(24)
    white = np.iinfo(dtype).max if dtype is not np.float32 else 1
    result = restore([(clean * white).astype(dtype)] * 9, 4, effort="fast")
    assert len(repr(result).splitlines()) <= 2
    assert len(repr(result)) < 250
    result.save(tmp_path / "a.tif")
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), result.image)
    (tmp_path / "b.png").write_bytes(result._repr_png_())
    np.testing.assert_allclose(read_image(tmp_path / "b.png") / 255, clean, atol=0.005)


GREY = np.zeros((6, 8))
RGB = np.zeros((6, 8, 3))


@pytest.mark.parametrize(
    ("images", "options", "message"),
    [
        ([], {}, "at least one version"),
        ([GREY, np.zeros((6, 9))], {}, r"images\[1\] has size \(6, 9\) and images\[0\] has \(6, 8\)"),
        ([GREY, RGB], {}, r"images\[1\] has bands 3 and images\[0\] has 1; they must be the same"),
        ([GREY, GREY.astype(np.uint8)], {}, r"images\[1\] has type uint8"),
        ([GREY, np.full((6, 8), np.inf)], {}, r"images\[1\] must be finite"),
        ([np.full((6, 8), np.nan)] * 2, {}, "no version knows any pixel"),
        ([GREY] * 2, {"masks": [np.zeros((6, 8))] * 2}, "no version knows any pixel"),
        ([GREY] * 2, {"masks": [np.ones((6, 8))]}, "masks has 1 masks and must have 2"),
        ([GREY] * 2, {"masks": [None, np.ones((8, 6))]}, r"masks\[1\] of shape \(8, 6\) must be \(6, 8\)"),
        ([GREY] * 2, {"weights": [1]}, r"weights of shape \(1,\) must be \(2,\)"),
        ([GREY] * 2, {"weights": [1, 0]}, r"weights=\[1.0, 0.0\] must be finite and > 0"),
        ([GREY] * 2, {"renormalize": "max"}, "renormalize='max' must be one of range, median, none"),
        ([GREY] * 2, {"edge_weight": "much"}, "edge_weight='much' must be"),
        ([GREY] * 2, {"edge_weight": -1}, "edge_weight=-1 must be"),
        ([GREY] * 2, {"n_generators": "many"}, "n_generators='many' must be one of auto"),
        ([GREY] * 2, {"n_generators": 0}, r"n_generators=0 must be in 1\.\.48, the number of pixels"),
        ([GREY] * 2, {"space": "hsv"}, "space='hsv' must be one of"),
        ([GREY] * 2, {"hidden": "all"}, "hidden='all' must be one of outliers, background, motion, none"),
        ([GREY] * 2, {"align": "spline"}, "align='spline' must be"),
        *(([GREY] * 2, {"noise": wrong}, "noise") for wrong in (0, -1, float("nan"))),
    ],
)
def test_what_is_wrong_is_named(images: Any, options: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        restore(images, **{"n_generators": 1, **options})


def test_auto_finds_about_as_many_segments_as_there_are_colors() -> None:
    clean, versions, known = damaged_card(64, noise=0.2, holes=0.3)
    result = restore(versions, "auto", masks=known)
    assert 4 <= len(result.colors) <= 6
    assert psnr(result.image, clean) > 28


def test_a_drawing_of_two_colors_comes_back_as_it_is() -> None:
    y, x = np.mgrid[:60, :80]
    mask = np.uint8(255) * ((x - 40) ** 2 + (y - 30) ** 2 < 400) * (x % 9 > 2)
    np.testing.assert_array_equal(restore([mask]).image, mask)


def test_what_is_transparent_does_not_tell_the_number_of_colors() -> None:
    y, x = np.mgrid[:55, :97]
    cut = np.full((55, 97, 4), (224, 20, 14, 0), np.uint8)
    cut[(x - 20) ** 2 + (y - 20) ** 2 < 25, 3] = 255
    cut[:, 20:, :3] = 81, 61, 202
    result = restore([cut])
    np.testing.assert_array_equal(result.with_alpha()[cut[:, :, 3] > 0], cut[cut[:, :, 3] > 0])

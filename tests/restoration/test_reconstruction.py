from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaging import card, damage, psnr, two_phases
from numpy.typing import NDArray
from PIL import Image

from cvtimg import denoise, read_image, restore
from cvtimg.restoration import RENORMALIZATIONS, Restoration

Damage = damage.Damage


def hidden(sigma: float) -> list[NDArray[np.float64]]:
    """Three noisy versions, each with parts painted over by the background, and nothing that tells where."""
    versions, known = damage.damaged_versions(two_phases(), 3, Damage(noise=sigma, occlusions=3), seed=0)
    assert all(mask.all() for mask in known)
    return list(versions)


@pytest.mark.parametrize(("sigma", "least"), [(0.1, 0.995), (0.3, 0.98)])
def test_the_union_of_an_object_comes_back_without_masks(sigma: float, least: float) -> None:
    truth = two_phases()[:, :, 0] == 1
    versions = hidden(sigma)
    assert max(np.mean((version[:, :, 0] > 0.5) == truth) for version in versions) < 0.97
    result = restore(versions, 2)
    assert np.mean((result.labels == 2) == truth) >= least


@pytest.mark.parametrize("sigma", [0.1, 0.3])
def test_range_restores_full_contrast_and_means_do_not(sigma: float) -> None:
    versions = hidden(sigma)
    np.testing.assert_allclose(restore(versions, 2).colors.ravel(), [0, 1], atol=0.02)
    np.testing.assert_allclose(restore(versions, 2, hidden=None).colors.ravel(), [0, 1], atol=0.02)
    diluted = restore(versions, 2, renormalize=None, hidden=None).colors.ravel()
    assert diluted[1] < 0.95
    assert diluted[1] < restore(versions, 2, renormalize="median", hidden=None).colors[1, 0] < 1.02


def test_a_card_of_four_colors_comes_back_from_noise_holes_and_blocks() -> None:
    clean, _ = card()
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.3, holes=0.3, blocks=1), seed=1)
    result = restore(versions, 4, masks=known)
    assert psnr(result.image, clean) > 32
    np.testing.assert_array_equal(result.coverage, np.sum(known, axis=0))
    np.testing.assert_allclose(result.noise, 0.3, rtol=0.1)


def test_what_no_version_knows_is_filled_from_around_it() -> None:
    clean, which = card()
    versions, known = damage.damaged_versions(clean, 2, Damage(noise=0.1), seed=0)
    for mask in known:
        mask[20:30, 25:35] = False  # within the disc
        mask[60:64, 68:72] = False  # within the triangle
    for edge_weight in ("auto", 0):
        result = restore(versions, 4, masks=known, edge_weight=edge_weight)
        unknown = result.coverage == 0
        assert unknown.sum() == 116
        np.testing.assert_allclose(result.image[unknown], clean[unknown], atol=0.03)
        assert len(np.unique(result.labels[unknown])) == len(np.unique(which[unknown]))


def test_nan_alpha_nodata_and_masks_say_the_same() -> None:
    clean, _ = card(48)
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.1, holes=0.3), seed=0)
    levels = [np.clip(np.rint(254 * version) + 1, 1, 255).astype(np.uint8) for version in versions]
    as_masks = restore(levels, 4, masks=known)
    as_nodata = restore([np.where(mask[..., None], x, 0) for x, mask in zip(levels, known, strict=True)], 4, nodata=0)
    as_alpha = restore([np.dstack([x, np.uint8(255) * mask]) for x, mask in zip(levels, known, strict=True)], 4)
    as_nan = restore([np.where(mask[..., None], x, np.nan) for x, mask in zip(levels, known, strict=True)], 4)
    for other in (as_nodata, as_alpha, as_nan):
        np.testing.assert_array_equal(other.labels, as_masks.labels)
        np.testing.assert_allclose(other.colors, as_masks.colors, atol=1e-3)
        np.testing.assert_array_equal(other.coverage, as_masks.coverage)
    assert as_alpha.image.shape == (48, 48, 3)
    images = [Image.fromarray(np.dstack([x, np.uint8(255) * mask])) for x, mask in zip(levels, known, strict=True)]
    np.testing.assert_array_equal(restore(images, 4).image, as_alpha.image)


def test_depths_agree() -> None:
    clean, _ = card(48)
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.1, holes=0.2), seed=0)
    eight = [np.clip(np.rint(255 * version), 0, 255).astype(np.uint8) for version in versions]
    shallow = restore(eight, 4, masks=known)
    for scale, dtype in ((257, np.uint16), (1 / 255, np.float32), (1 / 255, np.float64)):
        deep = restore([(version * np.float64(scale)).astype(dtype) for version in eight], 4, masks=known)
        np.testing.assert_array_equal(deep.labels, shallow.labels)
        np.testing.assert_allclose(deep.colors / scale, shallow.colors, atol=0.01)
        assert deep.image.dtype == dtype


@pytest.mark.parametrize("shape", [(48, 48), (48, 48, 1), (48, 48, 3), (48, 48, 6)])
def test_the_picture_has_the_shape_of_the_first_version(shape: tuple[int, ...]) -> None:
    picture = np.zeros(shape)
    picture[10:30, 12:40] = 1
    result = restore([picture, picture], 2)
    np.testing.assert_allclose(result.image, picture, atol=1e-6)
    assert result.image.shape == shape
    assert result.generators.shape == (2, 2, shape[2] if len(shape) == 3 else 1)


def test_one_version_alone_is_denoised() -> None:
    clean, _ = card()
    versions, _ = damage.damaged_versions(clean, 1, Damage(noise=0.2), seed=0)
    assert psnr(restore(versions, 4).image, clean) > psnr(versions[0], clean) + 12


def test_identical_versions_give_what_one_gives() -> None:
    clean, _ = card(48)
    flat = np.rint(255 * clean).astype(np.uint8)
    for n_versions in (1, 2, 5):
        result = restore([flat] * n_versions, 4)
        np.testing.assert_array_equal(result.image, flat)
        assert result.energy == pytest.approx(0, abs=1e-3)


@pytest.mark.slow
def test_sixteen_versions_are_better_than_four_and_four_than_two() -> None:
    clean, _ = card()
    versions, known = damage.damaged_versions(clean, 16, Damage(noise=0.3, holes=0.3, blocks=1), seed=0)
    quality = [psnr(restore(versions[:n], 4, masks=known[:n]).image, clean) for n in (2, 4, 16)]
    assert quality[0] < quality[1] < quality[2]
    assert quality[2] > 40


def test_a_noisier_version_counts_for_less() -> None:
    clean, _ = card()
    rng = np.random.default_rng(0)
    versions = [clean + sigma * rng.standard_normal(clean.shape) for sigma in (0.05, 0.05, 0.5)]
    by_noise, alike = restore(versions, 4), restore(versions, 4, weights=[1, 1, 1])
    np.testing.assert_allclose(by_noise.weights[0] / by_noise.weights[2], 100, rtol=0.3)
    np.testing.assert_allclose(by_noise.weights.mean(), 1)
    np.testing.assert_array_equal(alike.weights, 1)
    spoiled = [version.copy() for version in versions]
    spoiled[2] += 0.3
    moved = [
        np.abs(restore(spoiled, 4, renormalize=None, weights=w).colors - r.colors).max()
        for w, r in (
            (None, restore(versions, 4, renormalize=None)),
            ([1, 1, 1], restore(versions, 4, renormalize=None, weights=[1, 1, 1])),
        )
    ]
    assert moved[0] < 0.01
    assert moved[1] == pytest.approx(0.1, abs=0.02)


def test_channels_share_segments_and_no_colors() -> None:
    day = np.zeros((40, 60, 3), np.uint8)
    day[:, 30:] = 200, 120, 40
    night = np.zeros((40, 60), np.uint16)
    night[20:] = 50000
    result = restore([day, night], 4, channels=True)
    np.testing.assert_array_equal(result.image, day)
    assert len(np.unique(result.labels)) == 4
    assert result.generators.shape == (4, 2, 3)
    np.testing.assert_allclose(result.generators[result.labels - 1, 1, 0], night)
    assert np.isnan(result.generators[:, 1, 1:]).all()
    swapped = restore([night, day], 4, channels=True)
    np.testing.assert_array_equal(swapped.image, night)


@pytest.mark.slow
def test_detail_brings_a_photograph_back_better_than_blur_or_flat_segments(photograph: NDArray[Any]) -> None:
    from scipy.ndimage import gaussian_filter

    clean = photograph[:128, 64:192] / 255
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.1, holes=0.3), seed=0)
    result = denoise(versions, masks=known)
    weight = np.sum(known, axis=0)[:, :, None].astype(float)
    total = np.sum(versions, axis=0)
    blurs = [gaussian_filter(total, (s, s, 0)) / gaussian_filter(weight, (s, s, 0)) for s in (0.7, 1, 1.4)]
    assert psnr(result.image, clean) > max(psnr(blurred, clean) for blurred in blurs) + 1.5
    assert psnr(result.image, clean) > psnr(restore(versions, 32, masks=known).image, clean) + 3
    assert result.image.shape == clean.shape


def test_detail_leaves_a_picture_without_noise_as_it_is(photograph: NDArray[Any]) -> None:
    clean = photograph[:64, 64:128]
    assert np.abs(denoise([clean], noise=0.5).image.astype(int) - clean).max() <= 1


def test_energies_never_rise() -> None:
    clean, _ = card(64)
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.3, holes=0.3), seed=0)
    for edge_weight in ("auto", 0):
        energies = restore(versions, 4, masks=known, edge_weight=edge_weight).energies
        assert (np.diff(energies) <= 1e-6 * energies[0]).all()
        assert len(energies) > 1


def test_segments_go_from_dark_to_bright_and_hold_their_means() -> None:
    clean, _ = card(64)
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.2, holes=0.3), seed=0)
    result = restore(versions, 4, masks=known)
    assert (np.diff(result.colors.sum(axis=1)) > 0).all()
    for label in range(1, 5):
        for version in range(3):
            inside = (result.labels == label) & known[version]
            np.testing.assert_allclose(result.generators[label - 1, version], versions[version][inside].mean(axis=0))


def test_a_space_is_where_distances_are_measured() -> None:
    clean, _ = card(64)
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.1, holes=0.2), seed=0)
    levels = [np.clip(np.rint(255 * version), 0, 255).astype(np.uint8) for version in versions]
    for space in ("linear", "lab", "oklab"):
        result = restore(levels, 4, masks=known, space=space)
        assert psnr(result.image / 255, clean) > 25
        assert np.nanmax(result.generators) > 100  # in the units of the versions


def test_an_edge_weight_means_the_same_at_every_depth() -> None:
    clean, _ = card(48)
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.1, holes=0.2), seed=0)
    eight = [np.clip(np.rint(255 * version), 0, 255).astype(np.uint8) for version in versions]
    others = [[version / 255 for version in eight], [version.astype(np.uint16) * 257 for version in eight]]
    others += [[(version // 2).astype(np.int16) * 258 for version in eight]]
    results = [restore(some, 4, masks=known, edge_weight=200) for some in (eight, *others)]
    for result, some in zip(results, (eight, *others), strict=True):
        assert np.mean(result.labels == results[0].labels) > 0.999
        assert result.edge_weight == 200
        assert result.image.dtype == some[0].dtype


def test_the_same_seed_gives_the_same_bits_and_inputs_stay(photograph: NDArray[Any]) -> None:
    versions = [photograph[:48, :48].copy(), photograph[:48, :48] // 2 * 2]
    for call in (partial(restore, versions, 8), partial(denoise, versions, rng=3)):
        one, other = call(), call()
        assert one.image.tobytes() == other.image.tobytes()
    np.testing.assert_array_equal(versions[0], photograph[:48, :48])


def test_a_result_cannot_be_changed() -> None:
    result = restore([np.eye(8)], 2)
    assert isinstance(result, Restoration)
    with pytest.raises(ValueError, match="read-only"):
        result.image[0] = 1


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_a_result_shows_and_saves_itself(dtype: type, tmp_path: Path) -> None:
    clean, _ = card(40)
    white = np.iinfo(dtype).max if dtype is not np.float32 else 1
    versions = [(clean * white).astype(dtype)] * 9
    result = restore(versions, 4)
    assert len(repr(result).splitlines()) <= 2
    assert len(repr(result)) < 250
    result.save(tmp_path / "a.tif")
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), result.image)
    (tmp_path / "b.png").write_bytes(result._repr_png_())
    np.testing.assert_allclose(read_image(tmp_path / "b.png") / 255, clean, atol=0.005)


def test_every_renormalization_is_there() -> None:
    for name in RENORMALIZATIONS:
        assert restore(hidden(0.1), 2, renormalize=name).colors.shape == (2, 1)


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
    ],
)
def test_what_is_wrong_is_named(images: Any, options: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        restore(images, **{"n_generators": 1, **options})


def test_auto_finds_about_as_many_segments_as_there_are_colors() -> None:
    clean, _ = card()
    versions, known = damage.damaged_versions(clean, 3, Damage(noise=0.2, holes=0.3), seed=0)
    result = restore(versions, "auto", masks=known)
    assert 4 <= len(result.colors) <= 6
    assert psnr(result.image, clean) > 28


def test_more_segments_than_colors_are_refused() -> None:
    with pytest.raises(ValueError, match=r"n_generators=2 must be in 1\.\.1"):
        restore([GREY] * 2, 2)

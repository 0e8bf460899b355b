"""Claims about the noise of versions: its level, how it follows that of the picture, and what pixels share of it."""

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SAMPLES
from damaging import as_bytes, card, psnr
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.ndimage import gaussian_filter

from cvtimg import denoise, read_image, restore
from cvtimg._shared.types import Array, Bytes, Floats
from cvtimg.restoration.detail import covariance_of
from cvtimg.restoration.evidence import MOST_MISFIT, misfits
from cvtimg.restoration.noise import Noise, SharedNoise, lines_of, shared_noise
from cvtimg.restoration.versions import Rounding, stack_versions, with_tables
from cvtimg.segmentation.noise import noise_covariance


def noisy(clean: Array, sigma: float, seed: int = 0) -> Bytes:
    return as_bytes(clean + sigma * np.random.default_rng(seed).standard_normal(clean.shape))


def level_of(*images: Any, **known: Any) -> Floats:
    return Noise.of(stack_versions(images, **known)).levels


@pytest.fixture(scope="module")
def part(photograph: Array) -> Array:
    """A part of the photograph: of few pixels, for speed."""
    return np.ascontiguousarray(photograph[40:168, 64:192])


# --- the level


@pytest.mark.slow
@pytest.mark.parametrize("sigmas", [(6,), (2, 6), (2, 5, 20)], ids=str)
@pytest.mark.parametrize("holes", [0, 0.3])
def test_versions_with_holes_tell_noise_from_texture(part: Array, sigmas: tuple[float, ...], holes: float) -> None:
    versions = [noisy(part, sigma, seed) for seed, sigma in enumerate(sigmas)]
    known = [np.random.default_rng(seed + 9).random(part.shape[:2]) >= holes for seed in range(len(sigmas))]
    np.testing.assert_allclose(level_of(*versions, masks=known), sigmas, rtol=0.4 if sigmas == (2, 6) else 0.15)


@pytest.mark.parametrize("sigma", [0, 1, 3, 12])
def test_one_version_tells_noise_from_texture(photograph: Array, sigma: float) -> None:
    version = noisy(photograph[:192, :192], sigma)
    found = level_of(version)[0]
    assert abs(found - sigma) < (0.15 * sigma if sigma > 1 else 0.7)
    assert level_of(version[:, :, 1])[0] < 1.3 * sigma + 1
    if sigma <= 3:  # that of more noise is the larger part
        assert abs(found - sigma) < abs(np.sqrt(np.diag(noise_covariance(version)).mean()) - sigma)


@pytest.mark.parametrize("side", [20, 24, 32, 36, 48])
def test_drawings_of_few_pixels_have_the_noise_that_they_have(side: int) -> None:
    clean = 255 * card(side)[0]
    assert level_of(as_bytes(clean))[0] < 0.01
    assert level_of(noisy(clean, 8))[0] == pytest.approx(8, rel=0.25)


def test_noise_is_that_before_clipping(part: Array) -> None:
    ramp = np.broadcast_to(np.linspace(0, 255, 192), (192, 192))
    for versions in ([noisy(ramp, 50)], [noisy(ramp, 50, seed) for seed in range(3)]):
        np.testing.assert_allclose(level_of(*versions), 50, rtol=0.15)
        assert level_of(*(one / 255 for one in versions))[0] < 0.97 * 50 / 255
    clean = np.where([True, True, False], part, 4.0)  # one of the bands is cut off all over
    image = noisy(clean + 12 * np.random.default_rng(1).standard_normal((*part.shape[:2], 1)), 2)
    assert level_of(image)[0] == pytest.approx(np.std(image - clean), rel=0.15)


@pytest.mark.slow
def test_copies_and_versions_out_of_place_have_the_noise_that_each_has_alone(part: Array) -> None:
    versions = [noisy(part, 10), noisy(np.roll(part, (3, 5), (0, 1)), 10, 1), noisy(part * 0.7, 10, 2), noisy(part, 10)]
    np.testing.assert_allclose(level_of(*versions), [level_of(one)[0] for one in versions])


def test_noise_that_is_given_is_taken(part: Array) -> None:
    image = part[:64, :64] * np.uint16(257)
    assert restore([image, image], 4, noise=3).noise.tolist() == [3 * 257, 3 * 257]
    with pytest.raises(ValueError, match="noise_like"):
        denoise([image], noise_like="pink")  # type: ignore[arg-type]


# --- noise that follows the level


def grainy(clean: Array, constant: float, slope: float, seed: int = 0) -> Bytes:
    """Poisson and Gaussian noise, as a camera of 8 bits has."""
    rng = np.random.default_rng(seed)
    light = slope * rng.poisson(clean / slope) if slope else clean
    return as_bytes(light + np.sqrt(constant) * rng.standard_normal(clean.shape))


def ratio(dark: float, bright: float, *images: Array) -> Array:
    """(C,) how much the variance of noise grows from a level to another."""
    found = lines_of(stack_versions(images), in_place=True)
    assert found is not None
    return np.asarray(found[0] @ [1, bright] / (found[0] @ [1, dark]))


def test_constant_and_slope_are_found_in_quiet_parts() -> None:
    clean = np.tile(np.linspace(20, 220, 256)[:, None], (160, 1, 3)) * [1, 0.8, 0.6]
    clean[80:] = np.where(np.arange(80)[:, None, None] // 4 % 2, clean[80:], 120)
    for seen in (np.s_[:], np.s_[48:112, ::4]):  # of the latter, patches are too few for large ones
        np.testing.assert_allclose(ratio(60, 120, grainy(clean, 16, 1.5)[seen]), 196 / 106, rtol=0.3)


def test_versions_in_place_tell_how_noise_follows_the_level_from_texture(photograph: Array) -> None:
    rough = photograph[:160, :160] * np.where(np.indices((160, 160)).sum(axis=0) % 3, 1, 0.7)[..., None]
    versions = [grainy(rough, 4, 0.5, seed) for seed in range(2)]
    np.testing.assert_allclose(ratio(50, 200, *versions), 104 / 29, rtol=0.25)


@pytest.mark.parametrize("sigma", [0, 5, 40])
def test_even_noise_in_a_photograph_is_even(photograph: Array, sigma: float) -> None:
    assert lines_of(stack_versions([grainy(photograph[:192, :192], sigma**2, 0)]), in_place=True) is None


@pytest.mark.slow
def test_noise_of_light_is_removed_and_told(photograph: Array) -> None:
    clean = photograph[:192]
    light = grainy(clean, 16, 2)
    found, white = (denoise([light], effort="fast", noise_like=kind) for kind in ("auto", "white"))
    assert white.noise_lines is None
    assert found.noise_lines is not None
    np.testing.assert_allclose(found.noise_lines @ [1, 120], 16 + 2 * 120, rtol=0.3)
    assert found.noise[0] == pytest.approx(np.std(light - clean.astype(float)), rel=0.1)
    assert psnr(found.image / 255, clean / 255) > psnr(white.image / 255, clean / 255) + 0.5
    for shade in (clean < 40, clean > 200):
        assert abs((found.image - clean.astype(float))[shade].mean()) < 2.5
    assert denoise([light], effort="fast", noise=12).noise[0] == pytest.approx(12)


# --- noise that pixels share


def blurred_noise(shape: tuple[int, ...], sigma: float, blur: float, seed: int = 0) -> Floats:
    found = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), (blur, blur, *[0] * (len(shape) - 2)))
    return np.asarray(sigma * found / found.std())


def found_in(*images: Array) -> SharedNoise | None:
    return shared_noise(stack_versions(images), in_place=True)


@pytest.mark.slow
@pytest.mark.parametrize("n_bands", [1, 3])
def test_level_and_reach_of_shared_noise_are_found_in_the_quiet_part_of_an_image(n_bands: int) -> None:
    sigmas = np.array([8, 10, 12])[:n_bands]
    noise = blurred_noise((192, 192, n_bands), 1, 0.8) * sigmas
    image = blurred_noise((192, 192, 1), 40, 1.2, 1)
    image[:, 64:, 0] = np.linspace(0, 60, 128)
    found = found_in(128 + image + noise)
    assert found is not None
    np.testing.assert_allclose(np.sqrt(np.diag(found.bands)), sigmas, rtol=0.25)
    beside = np.diag(found.autocovariance[6, 7]) / np.diag(found.bands)
    np.testing.assert_allclose(beside, np.exp(-1 / (4 * 0.8**2)), atol=0.08)


def test_gray_texture_is_not_taken_for_what_bands_share_of_noise() -> None:
    gray = blurred_noise((192, 192, 1), 10, 0.8)
    found = found_in(128 + blurred_noise((192, 192, 3), 10, 0.8, 1) + 0.5 * gray)
    assert found is not None
    assert found.bands[0, 2] / found.bands[0, 0] == pytest.approx(0, abs=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("grows", [False, True])
@pytest.mark.parametrize("n_bands", [1, 3])  # 1: bands have grain in common
def test_grain_is_noise_where_it_does_not_grow_as_texture(grows: bool, n_bands: int) -> None:
    shown, strength = np.linspace([100], [160, 130, 110], 192)[:, None], np.linspace(1 - grows / 2, 1 + grows, 192)
    grain = strength[:, None, None] * blurred_noise((192, 192, n_bands), 10, 0.8)
    found = Noise.of(stack_versions([as_bytes(shown + grain)]), white=False).shared
    assert (found is None) == grows
    assert found is None or np.sqrt(np.diag(found.bands)) == pytest.approx(10, rel=0.2)


@pytest.mark.slow
def test_versions_in_place_tell_shared_noise_from_texture_and_fit(part: Array) -> None:
    versions = stack_versions([part + blurred_noise(part.shape, 25, 0.8, seed) for seed in range(2)])
    found = shared_noise(versions, in_place=True)
    assert found is not None
    np.testing.assert_allclose(np.sqrt(np.diag(found.bands)), 25, rtol=0.08)
    white, shared = (misfits(versions, np.full(2, 25.0), noise).max() for noise in (None, found))
    assert shared < min(0.5 * white, MOST_MISFIT)


@pytest.mark.parametrize("sigma", [5, 40])
def test_white_noise_in_a_photograph_is_white(photograph: Array, sigma: float) -> None:
    # Texture on all of it, too: as gray as texture is.
    rough = gaussian_filter(np.random.default_rng(1).standard_normal((200, 200, 1)), (0.8, 0.8, 0))
    assert found_in(noisy(photograph[:200, :200] + 12 * rough, sigma)) is None


def test_images_without_noise_and_small_ones_have_no_shared_noise() -> None:
    assert found_in(np.full((64, 64), 9, np.uint8)) is None
    assert found_in(blurred_noise((12, 40), 5, 1)) is None


def test_noise_that_pixels_do_not_share_is_filtered_as_white(part: Array, monkeypatch: Any) -> None:
    np.testing.assert_allclose(covariance_of(SharedNoise.white(9 * np.eye(2))), np.eye(50), atol=1e-12)
    same = np.linalg.eigvalsh(covariance_of(SharedNoise(np.ones((9, 9, 1, 1)))))
    assert same[0] == pytest.approx(0.01, rel=0.1)  # in no direction of a patch is there none
    image = part[:40, :40] / 255 + np.random.default_rng(0).normal(0, 0.1, (40, 40, 3))
    white = denoise([image], effort="fast", noise=25.5)
    monkeypatch.setattr("cvtimg.restoration.noise.shared_noise", lambda *_, **__: SharedNoise.white(np.eye(3)))
    shared = denoise([image], effort="fast", noise=25.5)
    np.testing.assert_allclose(shared.image, white.image, atol=0.002)  # but for rounding


@pytest.mark.slow
def test_shared_noise_is_removed_and_told(part: Array) -> None:
    image = as_bytes(part + blurred_noise(part.shape, 15, 0.8))
    found, white = (denoise([image], noise_like=like, effort="fast") for like in ("auto", "white"))
    assert found.noise[0] == pytest.approx(15, rel=0.15)
    assert psnr(found.image / 255, part / 255) > psnr(white.image / 255, part / 255) + 2


# --- what JPEG has rounded away


def as_jpeg(pixels: Bytes, quality: int = 60, subsampling: int = 2) -> Image.Image:
    file = io.BytesIO()
    about: dict[str, Any] = {} if pixels.ndim == 2 else {"subsampling": subsampling}
    Image.fromarray(pixels).save(file, "JPEG", quality=quality, **about)
    return Image.open(file)


@pytest.mark.parametrize("quality", [60, 90])
@pytest.mark.parametrize("subsampling", [0, 2, None])
def test_what_was_rounded_away_is_as_much_and_as_shared(part: Array, quality: int, subsampling: Any) -> None:
    # Of chroma, that which is rounded away once its size is halved: at quality 100 the rest is lost.
    pixels = part if subsampling is not None else part[:, :, 0]
    coarse, fine = (np.asarray(as_jpeg(pixels, one, subsampling), np.float64) for one in (quality, 100))
    rounding = Rounding.of(as_jpeg(pixels, quality, subsampling))
    assert rounding is not None
    lost = rounding.lost(np.atleast_3d(coarse).astype(np.uint8))
    assert lost is not None
    found, true = (SharedNoise.of(np.atleast_3d(one)) for one in (lost, coarse - fine))
    assert 0.5 < np.trace(found.bands) / np.trace(true.bands) < 1.5
    for place in ((6, 7), (7, 6), (7, 7), (6, 8), (9, 6)):
        shares = [np.trace(one.autocovariance[place]) / np.trace(one.bands) for one in (found, true)]
        assert shares[0] == pytest.approx(shares[1], abs=0.25)


def test_arrays_with_tables_count_and_others_do_not(part: Array, tmp_path: Path) -> None:
    gray = as_jpeg(part[:, :, 0])
    rounding = Rounding.of(gray)
    assert rounding is not None
    assert rounding.lost(part) is None
    assert Rounding.of(part) is Rounding.of(gray.convert("RGB")) is None
    gray.save(tmp_path / "a.jpg", quality="keep")
    gray.save(tmp_path / "a.png")
    assert Rounding.of(with_tables(np.asarray(gray), tmp_path / "a.jpg")) is not None
    for other in ("a.png", "missing.jpg"):
        assert Rounding.of(with_tables(np.asarray(gray), tmp_path / other)) is None


@pytest.mark.slow
@pytest.mark.parametrize("quality", [50, 90])
def test_detail_brings_back_what_was_rounded_away_where_the_tables_are_known(part: Array, quality: int) -> None:
    image = as_jpeg(part, quality)
    blind, found = (psnr(denoise([one], effort="fast").image / 255, part / 255) for one in (np.asarray(image), image))
    before = psnr(np.asarray(image) / 255, part / 255)
    assert blind > before - 0.1
    assert found > before + 0.3


# --- nothing fails, and nothing is harmed

SHAPES = [(1, 1), (1, 40), (40, 1), (2, 3), (9, 9, 3), (24, 40), (40, 33, 3), (30, 30, 5)]
CONTENTS = ["white", "black", "half white", "ramp", "white noise", "clipped noise", "stripes"]


def picture(shape: tuple[int, ...], content: str, dtype: type, seed: int) -> Array:
    """A picture with values in 0..1, in a type."""
    noise = np.random.default_rng(seed).standard_normal(shape)
    ramp = np.broadcast_to(np.linspace(0.2, 0.8, shape[1]).reshape(1, -1, *[1] * (len(shape) - 2)), shape)
    contents = {
        "white": np.ones(shape),
        "black": np.zeros(shape),
        "half white": np.where(ramp < 0.5, ramp + 0.05 * noise, 1),
        "ramp": ramp,
        "white noise": ramp + 0.1 * noise,
        "clipped noise": 0.98 + 0.3 * noise,
        "stripes": np.broadcast_to(np.indices(shape)[1] // 3 % 2, shape),
    }
    values = np.clip(contents[content], 0, 1)
    white = 1 if np.dtype(dtype).kind == "f" else np.iinfo(dtype).max
    return (np.rint(values * white) if white > 1 else values).astype(dtype)


@pytest.mark.slow
@settings(max_examples=25)
@given(
    st.builds(
        picture,
        st.sampled_from(SHAPES),
        st.sampled_from(CONTENTS),
        st.sampled_from([np.uint8, np.uint16, np.float32, np.float64]),
        st.integers(0, 99),
    ),
    st.integers(1, 3),
    st.sampled_from([0.0, 0.3, 0.95]),
)
def test_nothing_fails(image: Array, n_versions: int, holes: float) -> None:
    rng = np.random.default_rng(0)
    masks = [rng.random(image.shape[:2]) >= holes for _ in range(n_versions)]
    masks[0].flat[0] = True
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # copies
        result = denoise([image] * n_versions, masks=masks, effort="fast")
    assert (result.image.shape, result.image.dtype) == (image.shape, image.dtype)
    assert np.isfinite(result.image).all()
    if not result.noisy and all(mask.all() for mask in masks):
        np.testing.assert_allclose(result.image, image, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize(("equal", "holes"), [(1, 0.1), (3, 0)])
def test_what_is_known_of_a_photograph_without_noise_comes_back_as_it_is(equal: int, holes: float) -> None:
    photograph = read_image(SAMPLES / "chelsea.png")[60:188, 100:260]
    known = np.random.default_rng(1).random(photograph.shape[:2]) >= holes
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        result = denoise([photograph] * equal, masks=[known] * equal, effort="fast")
    assert not result.noisy
    np.testing.assert_array_equal(result.image[known], photograph[known])


@pytest.mark.slow
@pytest.mark.parametrize(("sigma", "gain"), [(1, 0.5), (3, 2.5)])
def test_little_noise_is_taken_away(part: Array, sigma: float, gain: float) -> None:
    image = noisy(part, sigma)
    done = denoise([image], effort="fast").image
    assert psnr(done / 255, part / 255) > psnr(image / 255, part / 255) + gain


@pytest.mark.slow
def test_noise_of_lightness_and_of_colors_is_taken_away_in_parts(part: Array) -> None:
    image, fast = noisy(part / 2 + 60, 12), {"effort": "fast"}  # far from the ends
    whole, none, half = (
        denoise([image], luma=luma, chroma=chroma, **fast).image.astype(float)
        for luma, chroma in ((1, 1), (0, 0), (0.5, 1))
    )
    np.testing.assert_allclose(none, image, atol=0.5)
    light = np.array([0.299, 0.587, 0.114])
    np.testing.assert_allclose((half - whole) @ light, 0.5 * (image - whole) @ light, atol=1)
    np.testing.assert_allclose(np.diff(half - whole, axis=2), 0, atol=1)  # colors are as clean
    with pytest.raises(ValueError, match=r"chroma=2 must be from 0 to 1"):
        denoise([image], chroma=2)

"""Palettes of samples: locked colors, weights, spaces, several pictures."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from cvtimg import find_palette, quantize, quantize_frames, read_image
from cvtimg._shared.choices import DitherName, SpaceName
from cvtimg._shared.pixels import peak
from cvtimg.colors import SPACES, color_samples, merge_samples
from cvtimg.colors.spaces import to_space
from cvtimg.pictures import Frames, encode_image
from cvtimg.quantization import Quantized, main_palette, map_to_palette
from cvtimg.quantization.palette_search import merged_colors
from cvtimg.quantization.targets import climb

LOCKED = np.array([[255, 0, 0], [1, 2, 3]], np.uint8)


def rows(colors: NDArray[Any]) -> set[tuple[Any, ...]]:
    return set(map(tuple, colors.tolist()))


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float64])
def test_locked_colors_are_in_the_palette_exactly(space: str, dtype: Any, photograph: NDArray[Any]) -> None:
    scale = peak(np.dtype(dtype)) / 255
    picture, locked = ((colors * scale).astype(dtype) for colors in (photograph[::4, ::4], LOCKED))
    result = quantize(picture, 8, space=space, locked=locked)
    assert rows(locked) <= rows(result.palette)
    assert len(result.palette) == 8


def test_locked_colors_leave_the_others_where_they_are_best(photograph: NDArray[Any]) -> None:
    picture = photograph[::2, ::2]
    free, locked = quantize(picture, 14), quantize(picture, 16, locked=LOCKED)
    assert locked.energy < free.energy


def test_all_colors_can_be_locked(photograph: NDArray[Any]) -> None:
    result = quantize(photograph, 2, locked=LOCKED)
    assert rows(result.palette) == rows(LOCKED)
    with pytest.raises(ValueError, match="n_colors=1 must be an integer >= 2, for locked colors"):
        quantize(photograph, 1, locked=LOCKED)


@pytest.mark.parametrize("n_colors", [4, 5, 6, 7, 8, 9])
def test_a_picture_of_few_colors_has_them_beside_the_locked_ones(n_colors: int) -> None:
    picture = np.arange(0, 60, 2, dtype=np.uint8).reshape(2, 5, 3)[:, :3]  # six colors
    locked = [[200, 200, 0], [0, 200, 200]]
    result = quantize(picture, n_colors, locked=locked)
    assert rows(np.array(locked)) <= rows(result.palette)
    assert len(result.palette) == min(n_colors, 8)
    assert (result.energy == 0) == (n_colors >= 8)


def test_grey_stays_grey_unless_a_locked_color_is_none(photograph: NDArray[Any]) -> None:
    grey = photograph[::4, ::4, 1]
    assert quantize(grey, 4, locked=[[9, 9, 9]]).palette.shape == (4, 1)
    result = quantize(grey, 4, locked=[[255, 0, 0]])
    assert result.image.shape == (*grey.shape, 3)
    assert (255, 0, 0) in rows(result.palette)
    assert (np.ptp(result.palette.astype(int), axis=1) == 0).sum() == 3


@pytest.mark.parametrize("space", ["linear", "lab", "oklab"])
def test_a_space_is_best_by_its_own_distances(space: str, photograph: NDArray[Any]) -> None:
    picture = photograph[::2, ::2]

    def error(image: NDArray[Any]) -> float:
        before, after = (to_space(colors.reshape(-1, 3), space) for colors in (picture, image))
        return float(((before - after) ** 2).sum())

    assert error(quantize(picture, 16, space=space).image) < 0.9 * error(quantize(picture, 16).image)


def test_figures_are_in_srgb_whatever_the_space(photograph: NDArray[Any]) -> None:
    for space in SPACES:
        result = quantize(photograph[::2, ::2], 9, space=space)
        assert result.energy == pytest.approx(reference.seen_energy(photograph[::2, ::2], result.image))


def test_merged_neighbors_begin_palettes_as_good_as_searched_ones() -> None:
    samples = color_samples(read_image("sample_images/coffee.png")[100:228, 180:308])
    merged = merged_colors(find_palette(samples, 64), 64, samples.colors[:0])
    assert (np.diff(merged.energies) > 0).all()
    mean = np.average(samples.colors, axis=0, weights=samples.density)
    assert merged.energies[-1] == pytest.approx(samples.density @ ((samples.colors - mean) ** 2).sum(axis=1), rel=0.01)
    for n_colors in (40, 9):
        found = [find_palette(samples, n_colors, init=init) for init in (merged.starts[64 - n_colors], "split")]
        energies = [one.tessellation.energy for one in found if one.tessellation]
        assert energies[0] < 1.05 * energies[1]


def test_what_has_no_weight_gets_no_colors(photograph: NDArray[Any]) -> None:
    picture = photograph[:64, :64].copy()
    picture[:, :32] = np.arange(0, 256, 8, dtype=np.uint8)[:, None]
    weights = np.zeros((64, 64))
    weights[:, :32] = 0.25
    result = quantize(picture, 32, weights=weights)
    np.testing.assert_array_equal(result.image[:, :32], picture[:, :32])
    assert len(result.palette) == 32


def test_samples_that_differ_in_kind_do_not_merge() -> None:
    with pytest.raises(ValueError, match="must have one type and number of channels, not uint16 x 3, uint8 x 3"):
        merge_samples([color_samples(np.zeros((2, 2, 3), dtype)) for dtype in (np.uint8, np.uint16)])
    with pytest.raises(ValueError, match="not none"):
        merge_samples([])


@pytest.mark.parametrize("space", SPACES)
def test_pixels_get_the_nearest_color_in_the_space(space: str, photograph: NDArray[Any]) -> None:
    picture = photograph[::8, ::8]
    palette = np.random.default_rng(3).integers(0, 256, (50, 3), np.uint8)
    result = map_to_palette(picture, palette, space=space)
    np.testing.assert_array_equal(result.palette, palette)
    places = [to_space(colors, space) for colors in (picture.reshape(-1, 3), palette)]
    distances = reference.squared_distances(*places)
    chosen = distances[np.arange(len(distances)), result.indices.reshape(-1)]
    np.testing.assert_allclose(chosen, distances.min(axis=1), rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("n_colors", [5000, 20000])
def test_deep_grey_is_mapped_exactly_to_thousands_of_levels(n_colors: int) -> None:
    rng = np.random.default_rng(4)
    picture = rng.integers(0, 65536, (200, 200), np.uint16)
    palette = np.sort(rng.choice(65536, n_colors, replace=False))
    result = map_to_palette(picture, palette)
    above = np.clip(np.searchsorted(palette, picture), 1, n_colors - 1)
    nearest = np.minimum(np.abs(palette[above] - picture), np.abs(palette[above - 1] - picture))
    np.testing.assert_array_equal(np.abs(result.image.astype(int) - picture), nearest)
    assert result.indices.dtype == np.uint16


def test_a_result_tells_what_files_hold(photograph: NDArray[Any]) -> None:
    for picture, width in ((photograph, 3), (photograph[..., 0], 3), (np.dstack([photograph, photograph[..., 0]]), 4)):
        result = quantize(picture, 9, alpha=width == 4)
        pixels, palette = result.content
        assert palette is not None
        assert palette.shape[1] == width
        np.testing.assert_array_equal(pixels, result.indices)
    for picture in (photograph.astype(np.uint16), photograph[::2, ::2]):
        result = quantize(picture, 9 if picture.dtype == np.uint16 else 300, effort="fast")
        pixels, palette = result.content
        assert palette is None
        np.testing.assert_array_equal(pixels, result.image)


class Overtaken(Exception):  # noqa: N818
    """A newer request makes this search pointless."""


@pytest.mark.parametrize("aim", [{"n_colors": 12}, {"n_colors": "auto"}, {"psnr": 30}], ids=str)
def test_a_callback_that_raises_ends_a_search_at_once(aim: dict[str, Any], photograph: NDArray[Any]) -> None:
    calls = []

    def stop(step: int, energy: float) -> bool:
        calls.append(step)
        raise Overtaken

    with pytest.raises(Overtaken):
        quantize(photograph, **aim, callback=stop)
    assert len(calls) == 1


def test_a_callback_that_returns_true_stops_with_the_best_colors_so_far(photograph: NDArray[Any]) -> None:
    stopped = find_palette(color_samples(photograph), 12, callback=lambda step, energy: True)
    whole = find_palette(color_samples(photograph), 12, callback=lambda step, energy: False)
    assert len(stopped.colors) == 12
    assert stopped.tessellation is not None
    assert whole.tessellation is not None
    assert stopped.tessellation.energy > whole.tessellation.energy


@pytest.mark.parametrize("space", ["rgb", "oklab"])
def test_the_best_colors_of_a_palette_have_the_least_error_of_all_choices(space: SpaceName) -> None:
    rng = np.random.default_rng(3)
    image, palette = rng.integers(0, 256, (12, 9, 3), np.uint8), rng.integers(0, 256, (8, 3), np.uint8)
    result = quantize(image, 3, palette=palette, space=space)
    places, ends = (to_space(some.reshape(-1, 3), space).astype(float) for some in (image, palette))
    errors = ((places[:, None] - ends) ** 2).sum(axis=2)
    best = min(combinations(range(8), 3), key=lambda chosen: errors[:, chosen].min(axis=1).sum())
    np.testing.assert_array_equal(result.palette, palette[list(best)])


def rust_and_roses() -> NDArray[np.uint8]:
    """Draw browns of all tones, and a red spot of 1 % that is no cluster of its own in the energy."""
    rng = np.random.default_rng(0)
    tones = np.clip(rng.normal(0.45, 0.2, (100, 100, 1)), 0, 1) * [200, 160, 110]
    tones[:10, :10] = 215, 25, 40
    return np.clip(tones + rng.normal(0, 6, tones.shape), 0, 255).astype(np.uint8)


def test_auto_keeps_small_vivid_parts_of_photographs_and_the_number_of_flat_ones() -> None:
    image = read_image("sample_images/astronaut.png")[::2, ::2]
    result = quantize(image, "auto", effort="fast")
    assert result.curve is not None
    main, elbow, found = (
        to_space(colors, "oklab")
        for colors in (main_palette(image).colors, quantize(image, result.curve.elbow()).palette, result.palette)
    )
    assert cdist(main, elbow).min(axis=1).max() > 0.2
    assert cdist(main, found).min(axis=1).max() < 0.15
    levels = np.repeat(np.array([[30, 60, 90], [200, 180, 60], [220, 40, 50]]), 900, axis=0).reshape(60, 45, 3)
    noisy = np.clip(levels + np.random.default_rng(0).normal(0, 5, levels.shape), 0, 255).astype(np.uint8)
    assert len(quantize(noisy, "auto").palette) == 3


def test_main_colors_are_colors_of_the_image_beside_the_locked_ones() -> None:
    image = rust_and_roses()
    found = main_palette(image, 4, locked=[[0, 0, 255]]).colors.tolist()
    own = {tuple(color) for color in image.reshape(-1, 3).tolist()}
    assert [0, 0, 255] in found
    assert sum(tuple(color) in own for color in found) == 3
    assert any(red > 180 and green < 60 for red, green, _ in found)


def test_main_colors_of_transparent_and_gray_images() -> None:
    image = np.dstack([rust_and_roses(), np.full((100, 100), 255, np.uint8)])
    image[50:] = 0
    found = main_palette(color_samples(image, alpha=True), 4).colors
    assert (found[:, 3] == [0, 255, 255, 255]).all()
    assert main_palette(image[:, :, 0], 3).colors.shape == (3, 1)
    assert main_palette(np.zeros((2, 2, 3), np.uint8), 3).colors.tolist() == [[0, 0, 0]]


def _sprite() -> NDArray[np.uint8]:
    """Draw random opaque pixels below transparent ones."""
    image = np.random.default_rng(0).integers(0, 120, (12, 12, 4), np.uint8)
    image[..., 3] = 255
    image[:3] = 0
    return image


@pytest.mark.parametrize("dither", [None, "floyd-steinberg"])
def test_a_transparent_color_is_put_first_and_said(dither: DitherName | None) -> None:
    palette = np.repeat(np.arange(0, 60, 5, dtype=np.uint8)[:, None], 3, axis=1)
    with pytest.warns(UserWarning, match="palette has no transparent color: one is put first, for the transparent"):
        result = map_to_palette(_sprite(), palette, alpha=True, dither=dither)
    assert result.palette[:, 3].tolist() == [0] + [255] * 12
    assert (result.indices[:3] == 0).all()
    assert (result.indices[3:] > 0).all()
    np.testing.assert_array_equal(result.palette[1:, :3], palette)


def test_it_takes_the_place_of_an_unused_color_where_indices_would_need_more_bits() -> None:
    palette = np.repeat(np.arange(0, 256, 17, dtype=np.uint8)[:, None], 3, axis=1)  # the bright ones are not used
    with pytest.warns(UserWarning, match=r"in place of entry 15 \(from 0\), which no pixel has"):
        result = map_to_palette(_sprite(), palette, alpha=True)
    assert len(result.palette) == 16
    np.testing.assert_array_equal(result.palette[1:, :3], palette[:-1])
    with pytest.warns(UserWarning, match="one is put first"):
        more = map_to_palette(_sprite(), palette[:-1], alpha=True)  # there is room for one
    np.testing.assert_array_equal(result.image, more.image)


def test_frames_share_the_palette_that_got_a_transparent_color() -> None:
    frames = Frames((_sprite(), np.full((12, 12, 4), 255, np.uint8)), (40, 40), 0)
    with pytest.warns(UserWarning, match="one is put first"):
        result = quantize_frames(frames, palette=np.array([[0, 0, 0], [255, 255, 255]], np.uint8))
    first, second = result.results
    np.testing.assert_array_equal(first.palette, second.palette)
    assert len(first.palette) == 3


@given(st.lists(st.floats(-5, 60), min_size=1, max_size=300), st.floats(-5, 60), st.integers(1, 300), st.booleans())
def test_what_is_found_reaches_the_target_and_one_less_does_not(
    values: list[float], target: float, first: int, rising: bool
) -> None:
    table = sorted(values) if rising else values
    tried: set[int] = set()

    def result(n: Any) -> float:
        assert n not in tried
        tried.add(n)
        return table[n - 1]

    below, reached = climb(range(1, len(table) + 1), result, float, target, lambda n: 2 * np.log2(n), first - 1)
    assert below is None or below[1] == table[int(below[0]) - 1] < target
    assert reached is None or reached[1] == table[int(reached[0]) - 1] >= target
    assert (reached[0] if reached else len(table) + 1) == (below[0] if below else 0) + 1
    if rising:
        assert (below[0] if below else 0) == sum(value < target for value in table)


def test_few_trials_suffice_where_quality_follows_the_logarithm() -> None:
    tried: list[int] = []

    def result(n: Any) -> float:
        tried.append(n)
        return 20 + 2.2 * np.log2(n) + 0.05 * np.sin(n)

    climb(range(1, 65537), result, float, 38.0, lambda n: 2 * np.log2(n), 31)
    assert len(tried) <= 10


@pytest.mark.slow
@pytest.mark.parametrize("psnr", [18, 24.5, 30])
@pytest.mark.parametrize("options", [{}, {"effort": "fast"}, {"space": "oklab"}, {"dither": "floyd-steinberg"}])
def test_no_fewer_colors_reach_the_quality(psnr: float, options: Any, photograph: NDArray[Any]) -> None:
    picture = photograph[::4, ::4]
    result = quantize(picture, psnr=psnr, **options)
    n_colors = len(result.palette)
    assert result.psnr >= psnr
    assert quantize(picture, n_colors - 1, **options).psnr < psnr
    np.testing.assert_array_equal(result.image, quantize(picture, n_colors, **options).image)


def test_locked_and_transparent_colors_are_counted(photograph: NDArray[Any]) -> None:
    picture = np.dstack([photograph[::8, ::8], np.full((32, 32), 255, np.uint8)])
    picture[:4, :, 3] = 0
    result = quantize(picture, psnr=1, alpha=True, locked=[[255, 0, 0], [0, 0, 255]])
    assert len(result.palette) == 3


def size(result: Quantized) -> int:
    pixels, palette = result.content
    return len(encode_image(".png", pixels, palette=palette))


@pytest.mark.parametrize("n_bytes", [2000, pytest.param(4000, marks=pytest.mark.slow)])
def test_the_file_fits_and_one_color_more_does_not(n_bytes: int, photograph: NDArray[Any]) -> None:
    picture = photograph[::4, ::4]
    result = quantize(picture, max_bytes=n_bytes)
    assert size(result) <= n_bytes < size(quantize(picture, len(result.palette) + 1))
    assert len(quantize(picture, 2, max_bytes=n_bytes).palette) == 2

"""Mapping by rate, against plain error diffusion and the bytes that deflate and LZW make of it."""

import zlib
from collections.abc import Callable

import numpy as np
import pytest

import cvtimg
import cvtimg.looks.rate as rate_module
from cvtimg._shared.types import Bytes, Floats32, Indices
from cvtimg.colors.spaces import to_space
from cvtimg.looks.rate import CoderName, Rate, map_by_rate, visibility
from cvtimg.pictures.formats.encoding import encode_image
from cvtimg.quantization.looks import MATCHES

COFFEE = cvtimg.read_image("sample_images/coffee.png")[100:300, 200:420]
PALETTE = np.asarray(cvtimg.quantize(COFFEE, 64, effort="fast").palette)


def placed(colors: Bytes) -> Floats32:
    places = to_space(colors.reshape(-1, 3), "oklab").reshape(colors.shape) * [255, 90, 90]
    return places.astype(np.float32)


#: Shares in 16ths of an error that the next pixel, those beside it below, and that below get.
SHARES: dict[CoderName, tuple[int, int, int]] = {"deflate": (12, 1, 2), "lzw": (7, 2, 5)}
CODERS = pytest.mark.parametrize("coder", SHARES)


def mapped(
    price: float,
    image: Bytes = COFFEE,
    palette: Bytes = PALETTE,
    coder: CoderName = "deflate",
    kept: Bytes | None = None,
) -> Bytes:
    rate, below = Rate(price, coder=coder), None if kept is None else placed(kept)
    return map_by_rate(placed(image), placed(palette), visibility(image.mean(axis=2)), rate, kept=below)


def diffused(places: Floats32, entries: Floats32, coder: CoderName) -> Indices:
    """Error diffusion row by row from the left, as `map_by_rate` shortens, weakens and shares errors."""
    right, aside, down = SHARES[coder]
    height, width, _ = places.shape
    gaps = np.linalg.norm(entries[:, None] - entries, axis=2)
    longest = np.sqrt((np.sort(gaps, axis=1)[:, 1] ** 2).mean())
    rest, labels = np.zeros((height + 1, width + 2, 3)), np.empty((height, width), np.intp)
    for y, x in np.ndindex(height, width):
        wanted = places[y, x] + rest[y, x + 1]
        labels[y, x] = k = ((wanted - entries) ** 2).sum(axis=1).argmin()
        error = wanted - entries[k]
        error *= 0.6 * min(1, longest / max(np.linalg.norm(error), 1e-30))
        for dy, dx, part in ((0, 1, right), (1, -1, aside), (1, 0, down), (1, 1, aside)):
            rest[y + dy, x + 1 + dx] += error * part / 16
    return labels


@CODERS
def test_bits_for_nothing_give_error_diffusion(coder: CoderName) -> None:
    image = COFFEE[:40, :50]
    expected = diffused(placed(image), placed(PALETTE), coder)
    assert (mapped(1e-9, image, coder=coder) == expected).mean() > 0.99  # float32 decides ties


@pytest.mark.parametrize(("n_colors", "price"), [(2, 100), (4, 20), (16, 2), (64, 0.4)])
def test_dearer_bits_give_smaller_files(n_colors: int, price: float) -> None:
    palette = np.asarray(cvtimg.quantize(COFFEE, n_colors, effort="fast").palette)
    n_bits = max(1, (n_colors - 1).bit_length()) if n_colors <= 16 else 8
    sizes = []
    for factor in (1e-9, 1, 4):
        bits = np.unpackbits(mapped(price * factor, COFFEE, palette)[:, :, None], axis=2)[:, :, -n_bits:]
        rows = np.packbits(bits.reshape(len(bits), -1), axis=1)
        sizes.append(len(zlib.compress(np.pad(rows, ((0, 0), (1, 0))).tobytes(), 9)))
    assert sizes[0] > sizes[1] > sizes[2]


@pytest.mark.slow
def test_gifs_by_the_prices_of_lzw_are_a_quarter_smaller_at_the_same_looks() -> None:
    # With a book that is emptied at another moment than that of the encoder, they are only a tenth smaller.
    cat = cvtimg.read_image("sample_images/chelsea.png")[:, :400]
    palette = np.asarray(cvtimg.quantize(cat, 128, space="oklab", effort="fast").palette)
    by_deflate, by_lzw = (mapped(0.4, cat, palette, coder) for coder in SHARES)
    sizes = [len(encode_image(".gif", indices, palette=palette)) for indices in (by_lzw, by_deflate)]
    assert sizes[0] < 0.75 * sizes[1]
    quality = cvtimg.looks.VisualQuality(cat)
    assert quality(palette[by_lzw]) > quality(palette[by_deflate]) - 1


@pytest.mark.slow
@CODERS
def test_twice_the_matches_gain_little_and_half_of_them_lose(coder: CoderName) -> None:
    cat = cvtimg.read_image("sample_images/chelsea.png")[:, :400]
    palette = np.asarray(cvtimg.quantize(cat, 128, space="oklab", effort="fast").palette)
    content = placed(cat), placed(palette), visibility(cat.mean(axis=2))
    suffix, n = {"deflate": ".png", "lzw": ".gif"}[coder], MATCHES[coder]["balanced"]
    rates = (Rate(n_matches=n_matches, coder=coder) for n_matches in (n // 2, n, 2 * n))
    half, usual, twice = (len(encode_image(suffix, map_by_rate(*content, rate), palette=palette)) for rate in rates)
    assert usual < 0.995 * half
    assert twice > 0.995 * usual


def test_bands_cost_few_bytes_and_are_several(monkeypatch: pytest.MonkeyPatch) -> None:
    cup, bands = cvtimg.read_image("sample_images/coffee.png"), list[int]()
    palette, stripes = np.asarray(cvtimg.quantize(cup, 256, effort="fast").palette), rate_module.in_stripes

    def counted(kernel: Callable[[slice], None], n_rows: int, work: float, n: int = 0) -> None:
        bands.extend([-(-n_rows // n)] if n else [])
        stripes(kernel, n_rows, work, n or 32)

    monkeypatch.setattr(rate_module, "in_stripes", counted)
    in_bands = len(zlib.compress(mapped(0.4, cup, palette).tobytes(), 9))
    monkeypatch.setattr(rate_module, "_WINDOWS", 1 << 10)
    assert in_bands < 1.002 * len(zlib.compress(mapped(0.4, cup, palette).tobytes(), 9))
    assert bands == [2, 1]  # for two threads


def test_dearer_bits_give_smaller_gifs() -> None:
    sizes = [len(encode_image(".gif", mapped(price, coder="lzw"), palette=PALETTE)) for price in (1e-9, 0.4, 1.6)]
    assert sizes[0] > 1.2 * sizes[1] > 1.4 * sizes[2]


def test_what_a_frame_is_drawn_over_is_kept_where_that_is_hardly_seen() -> None:
    noisy = np.clip(COFFEE + np.random.default_rng(0).normal(0, 2, COFFEE.shape), 0, 255).astype(np.uint8)
    kept = PALETTE[mapped(0.4, coder="lzw")]
    moved = noisy.copy()
    moved[80:120, 80:120] = noisy[10:50, 10:50]
    stays = mapped(1.0, moved, coder="lzw", kept=kept) == len(PALETTE)
    assert stays[80:120, 80:120].mean() < 0.2
    stays[70:130, 70:130] = True
    assert stays.mean() > 0.7


def test_the_measure_of_looks_falls_less_than_the_bytes() -> None:
    cheap, dear = (PALETTE[mapped(price)] for price in (1e-9, 1.0))
    assert cvtimg.visual_quality(COFFEE, dear) > cvtimg.visual_quality(COFFEE, cheap) - 8


@CODERS
def test_colors_of_the_palette_stay_as_they_are_where_nothing_hides_errors(coder: CoderName) -> None:
    image = np.repeat(np.repeat(PALETTE[:16].reshape(4, 4, 3), 20, axis=0), 20, axis=1)
    np.testing.assert_array_equal(PALETTE[:16][mapped(0.4, image, PALETTE[:16], coder)], image)


@CODERS
@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (3, 1), (1, 700), (130, 3), (2, 3)])
def test_small_and_narrow_images(shape: tuple[int, int], coder: CoderName) -> None:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (*shape, 3), dtype=np.uint8)
    indices = mapped(0.4, image, coder=coder)
    assert indices.shape == shape
    assert indices.max() < len(PALETTE)


def test_errors_count_less_where_brightness_varies() -> None:
    rng = np.random.default_rng(0)
    levels = np.full((60, 60), 100.0)
    levels[:, 30:] += rng.normal(0, 20, (60, 30))
    seen = visibility(levels)
    np.testing.assert_allclose(seen[:, :15], 1, atol=0.02)  # rounding alone is seen as a hundredth of a level
    assert seen[:, 45:].max() < 0.3


def test_smooth_areas_show_no_streaks() -> None:
    rng = np.random.default_rng(0)
    ramp = np.linspace(140, 170, 128)[:, None, None] + np.linspace(0, 12, 200)[:, None] + [-8, 0, 8]
    sky = np.rint(ramp + rng.normal(0, 1, ramp.shape)).astype(np.uint8)
    palette = np.asarray(cvtimg.quantize(sky, 24, space="oklab", effort="fast").palette)
    errors = (palette[mapped(0.4, sky, palette)].astype(float) - sky).mean(axis=2)
    along = errors[:, :195].reshape(128, 13, 15).mean(axis=2)  # what a streak of 15 pixels does not cancel
    beside = np.diff(along, axis=0).std()
    assert beside < 0.5  # 0.6 by the shares of Floyd and Steinberg


@pytest.mark.parametrize("lonely", [False, True])
def test_the_nearest_entry_is_found_also_beside_a_lonely_one(lonely: bool) -> None:
    rng = np.random.default_rng(0)
    entries, places = (rng.uniform(0, 20, shape).astype(np.float32) for shape in ((200, 4), (32, 32, 4)))
    if lonely:
        entries[0] = 400
    labels = map_by_rate(places, entries, np.ones((32, 32), np.float32), Rate(0.0), 0.0)
    distances = ((places[:, :, None] - entries) ** 2).sum(axis=3)
    np.testing.assert_allclose(
        np.take_along_axis(distances, labels[..., None].astype(int), 2)[..., 0], distances.min(2)
    )


def test_gradients_hide_less_than_grain_and_the_less_the_dearer_indices_are() -> None:
    slope = np.tile(np.arange(96.0), (96, 1))
    grain = 128 + np.random.default_rng(0).normal(0, 10, slope.shape)
    middle = np.s_[40:56, 40:56]
    for brightness, factor in ((slope, 6.0), (grain, 1.0)):
        free, dear = (visibility(brightness, bits)[middle].mean() for bits in (0, 6))
        assert dear >= free
        assert (dear > 4 * free) == (factor > 1)

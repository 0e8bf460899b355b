"""Dithering: exact nearest entries, means that are kept, and nothing that depends on threads or on chance."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter, uniform_filter
from scipy.spatial.distance import cdist
from skimage.color import deltaE_ciede2000, rgb2lab

from cvtimg import quantize, read_image, read_palette
from cvtimg.quantization.dithering import DITHERS, dither

SAMPLES = Path(__file__).parents[2] / "sample_images"

Entries = NDArray[np.int32]


def diffused(image: NDArray[np.float32], palette: NDArray[np.float32], strength: float) -> Entries:
    """Floyd and Steinberg's method, pixel by pixel, in the float32 of the kernel."""
    height, width, _ = image.shape
    errors = np.zeros((height + 1, width + 2, 4), np.float32)
    low = np.minimum(image.min(axis=(0, 1)), palette.min(axis=0)).astype(np.float64)
    wide = np.zeros((height, width, 4), np.float32)
    wide[..., : image.shape[2]] = image - low
    entries = np.zeros((len(palette), 4), np.float32)
    entries[:, : palette.shape[1]] = palette - low
    labels = np.empty((height, width), np.int32)
    squares = ((entries[:, None].astype(np.float64) - entries) ** 2).sum(axis=2)
    np.fill_diagonal(squares, np.inf)  # from an entry to the nearest other one
    most = np.float32(np.sqrt(squares.min(axis=1).mean()) if len(entries) > 1 else 0)
    if strength == 1:  # from the middle between any two entries to the nearest entry
        middles = (entries[:, None] + entries) / 2
        gaps = ((middles[:, :, None].astype(float) - entries) ** 2).sum(axis=3).min(axis=2)
        most = max(most, np.float32(3 * np.sqrt(gaps.max())))
    part = np.float32([7 / 16, 3 / 16, 5 / 16, 1 / 16])
    for y in range(height):
        step, ahead = (1 if y % 2 == 0 else -1), np.zeros(4, np.float32)
        for x in range(width)[::step]:
            place = (wide[y, x] + errors[y, x + 1]) + ahead
            steps = (place - entries) ** 2
            distances = (steps[:, 0] + steps[:, 1]) + (steps[:, 2] + steps[:, 3])  # rounded as the kernel rounds
            labels[y, x], squared = distances.argmin(), distances.min()
            share = np.float32(strength) * (most / np.sqrt(squared) if squared > most * most else 1)
            missed = (place - entries[labels[y, x]]) * share
            ahead = missed * part[0]
            errors[y + 1, x + 1 - step] += missed * part[1]
            errors[y + 1, x + 1] += missed * part[2]
            errors[y + 1, x + 1 + step] += missed * part[3]
    return labels


def of_image(image: NDArray[Any], palette: NDArray[Any], **options: Any) -> Entries:
    """Dither an (H, W, D) image whose pixels are all distinct colors."""
    inverse = np.arange(image.shape[0] * image.shape[1], dtype=np.int32).reshape(image.shape[:2])
    return dither(image.reshape(-1, image.shape[2]), inverse, palette, **options)


@given(
    seed=st.integers(0, 2**32 - 1),
    height=st.integers(1, 9),
    width=st.integers(1, 9),
    n_dims=st.sampled_from([1, 2, 3, 4]),
    n_entries=st.integers(1, 40),
    strength=st.sampled_from([0.0, 0.5, 0.9, 1.0]),
)
@settings(max_examples=60, deadline=None)
def test_errors_go_where_floyd_and_steinberg_send_them(
    seed: int, height: int, width: int, n_dims: int, n_entries: int, strength: float
) -> None:
    rng = np.random.default_rng(seed)
    image = rng.random((height, width, n_dims), np.float32)
    palette = rng.random((n_entries, n_dims), np.float32)
    assert np.array_equal(of_image(image, palette, strength=strength), diffused(image, palette, strength))


@pytest.mark.parametrize("method", DITHERS)
@pytest.mark.parametrize(("n_entries", "n_dims"), [(1, 3), (16, 1), (1000, 4)])
def test_at_strength_0_every_pixel_has_its_nearest_entry(method: str, n_entries: int, n_dims: int) -> None:
    rng = np.random.default_rng(n_entries)
    # Most entries crowd in a corner, where cells have many candidates.
    palette = rng.random((n_entries, n_dims)).astype(np.float32) ** 3
    image = rng.random((20, 31, n_dims), np.float32)
    labels = of_image(image, palette, method=method, strength=0)
    chosen = ((image - palette[labels]) ** 2).sum(axis=2, dtype=np.float64)
    least = cdist(image.reshape(-1, n_dims), palette, "sqeuclidean").min(axis=1)
    np.testing.assert_allclose(chosen.ravel(), least, rtol=1e-5)


@pytest.mark.parametrize("method", DITHERS)
def test_of_equal_entries_the_first_is_taken(method: str) -> None:
    palette = np.array([[0.0], [1], [1], [0]])
    assert set(of_image(np.linspace(0, 1, 64).reshape(8, 8, 1), palette, method=method).ravel()) == {0, 1}


@pytest.mark.parametrize("method", DITHERS)
def test_a_ramp_in_black_and_white_keeps_its_local_mean(method: str) -> None:
    ramp = np.tile(np.linspace(0, 1, 256), (64, 1))
    labels = of_image(ramp[..., None], np.array([[0.0], [1.0]]), method=method, strength=1)
    error = np.abs(gaussian_filter(labels.astype(float), 8) - gaussian_filter(ramp, 8))
    # A mixture of n entries is right to 1 / (2 n).
    assert error.max() < {"blue-noise": 0.06}.get(method, 0.03)


@pytest.mark.parametrize("method", DITHERS)
def test_more_strength_keeps_the_mean_better_and_costs_more_grain(method: str) -> None:
    image = read_image(SAMPLES / "chelsea.png")[:96, :96].astype(np.float32)
    palette = quantize(image, 16, effort="fast").palette
    pictures = [palette[of_image(image, palette, method=method, strength=s)] for s in (0, 0.5, 1)]
    grain = [np.square(picture - image).mean() for picture in pictures]
    drift = [np.square(uniform_filter(picture - image, (16, 16, 0))).mean() for picture in pictures]
    assert grain == sorted(grain)
    assert drift == sorted(drift, reverse=True)


@pytest.mark.parametrize("method", DITHERS)
def test_a_picture_in_the_colors_of_the_palette_stays_as_it_is(method: str) -> None:
    rng = np.random.default_rng(0)
    palette = rng.integers(0, 256, (30, 3))
    labels = rng.integers(0, 30, (20, 21)).astype(np.int32)
    assert np.array_equal(palette[dither(palette, labels, palette, method=method)], palette[labels])


@pytest.mark.parametrize("method", DITHERS)
def test_a_color_out_of_reach_has_no_spots_of_far_colors(method: str) -> None:
    # Green that is not in the palette comes near its white by no mixture that looks like it.
    image = np.zeros((48, 48, 3))
    image[:, :, 0] = np.linspace(0, 60, 48)
    image[20:28] = [24, 88, 72]
    palette = np.array([[0, 0, 0], [20, 0, 0], [40, 0, 0], [60, 0, 0], [16, 56, 56], [255, 255, 255]])
    assert set(of_image(image, palette, method=method)[20:28].ravel()) == {4}


@pytest.mark.parametrize("method", DITHERS)
def test_colors_take_only_entries_that_their_kind_may_take(method: str) -> None:
    rng = np.random.default_rng(1)
    places = rng.random((600, 4))
    palette = rng.random((12, 4))
    kinds = rng.integers(0, 3, 600)
    allowed = np.zeros((3, 12), bool)
    allowed[0, 4], allowed[1], allowed[2, 6:] = True, True, True
    labels = of_image(places.reshape(20, 30, 4), palette, method=method, kinds=kinds, allowed=allowed)
    assert allowed[kinds, labels.ravel()].all()
    assert len(set(labels.ravel()[kinds == 1])) > 6


PICO_8 = read_palette("pico-8")


def seen(image: NDArray[Any]) -> NDArray[np.float64]:
    """Return what an eye at some distance sees, in Lab."""
    return np.asarray(rgb2lab(gaussian_filter(image / 255, (2, 2, 0))))


@pytest.mark.parametrize(
    "name", ["chelsea.png", *(pytest.param(name, marks=pytest.mark.slow) for name in ("coffee.png", "astronaut.png"))]
)
@pytest.mark.parametrize("method", ["floyd-steinberg", "edge-aware", "bayer", "blue-noise"])
def test_a_fixed_palette_keeps_the_hues(name: str, method: str) -> None:
    with Image.open(SAMPLES / name) as file:
        image = file.convert("RGB").resize((192, 128), Image.Resampling.LANCZOS)
    palette = Image.new("P", (1, 1))
    palette.putpalette(PICO_8.tobytes() + bytes(PICO_8[0]) * 240)
    pillow = image.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG).convert("RGB")
    original = np.asarray(image)
    ours, theirs = (
        deltaE_ciede2000(seen(np.asarray(result)), seen(original)).mean()
        for result in (quantize(original, palette=PICO_8, dither=method).image, pillow)
    )
    assert ours < (0.9 if method in ("floyd-steinberg", "edge-aware") else 1.2) * theirs


@pytest.mark.parametrize("n_entries", [2, 5, 16, 60])
@pytest.mark.parametrize("crowded", [False, True])
def test_at_strength_1_no_error_is_lost_in_colors_that_the_palette_can_mix(n_entries: int, crowded: bool) -> None:
    rng = np.random.default_rng(n_entries)
    palette = rng.random((n_entries, 3))
    if crowded:  # two crowds, so that most entries are near to another
        palette = np.round(palette[:, :1]) + 0.03 * palette
    shares = rng.dirichlet(np.full(n_entries, 0.3), 24 * 24 // 4)
    image = np.repeat((shares @ palette).reshape(12, 12, 3), 4, axis=0).repeat(4, axis=1)
    error = palette[of_image(image, palette, strength=1)] - image
    # All that is missing has left by the sides: about one row and one column of what a pixel misses.
    assert np.abs(error.sum(axis=(0, 1))).max() <= 48 * 2 * np.abs(error).mean() + 2


def test_edge_aware_dithering_leaves_text_and_flat_areas_clean() -> None:
    picture = Image.new("RGB", (160, 120))
    picture.paste(Image.linear_gradient("L").resize((160, 120)).convert("RGB"))
    draw = ImageDraw.Draw(picture)
    draw.rectangle((10, 10, 80, 60), fill=(235, 232, 220))
    draw.text((14, 14), "some text", fill=(40, 40, 60), font=ImageFont.load_default(13))
    draw.rectangle((20, 75, 60, 110), fill=(120, 40, 50))
    image = np.asarray(picture)
    plain, aware, diffused = (
        quantize(image, palette=PICO_8, dither=method).image for method in (None, "edge-aware", "floyd-steinberg")
    )
    for area in (np.s_[10:61, 10:81], np.s_[75:111, 20:61]):
        assert (aware[area] == plain[area]).all()
        assert (diffused[area] != plain[area]).any(axis=2).mean() > 0.1
    gradient = np.s_[:, 90:]

    def error(result: NDArray[Any]) -> float:
        return float(np.square(gaussian_filter(result[gradient] - image[gradient].astype(float), (2, 2, 0))).mean())

    assert error(aware) < 1.1 * error(diffused) < 0.1 * error(plain)


def test_a_bayer_mask_turns_on_one_pixel_of_a_square_after_the_other() -> None:
    side = 8
    greys = np.arange(side**2 + 1) / side**2
    squares = np.repeat(greys, side) * np.ones((2 * side, 1))
    labels = of_image(squares[..., None], np.array([[0.0], [1.0]]), method="bayer", strength=1)
    assert np.array_equal(labels[:side], labels[side:])
    one_by_one = labels[:side].reshape(side, -1, side).swapaxes(0, 1)
    assert one_by_one.sum(axis=(1, 2)).tolist() == list(range(side**2 + 1))
    assert (np.diff(one_by_one, axis=0) >= 0).all()


def test_no_error_crosses_pixels_that_have_no_choice() -> None:
    image = np.full((16, 48, 1), 0.25)
    image[:, 16:32] = 0
    kinds = (image.ravel() == 0).astype(np.uint8)
    palette, allowed = np.array([[0.0], [1]]), np.array([[True, True], [True, False]])
    with_gap = of_image(image, palette, strength=1, kinds=kinds, allowed=allowed)
    other_start = image.copy()
    other_start[:, :16] = 0.4
    again = of_image(other_start, palette, strength=1, kinds=kinds, allowed=allowed)
    assert not np.array_equal(with_gap[:, :16], again[:, :16])
    # On the way there nothing comes over the gap; on the way back what comes is of the right part.
    assert np.array_equal(with_gap[:, 32:], again[:, 32:])


@pytest.mark.parametrize("method", ["blue-noise", "bayer"])
def test_ordered_dithering_depends_on_color_and_place_alone(method: str) -> None:
    rng = np.random.default_rng(0)
    image, palette = rng.random((70, 90, 3)), rng.random((16, 3))
    changed = image.copy()
    changed[20:30, 40:60] = rng.random((10, 20, 3))
    labels, again = (of_image(picture, palette, method=method) for picture in (image, changed))
    same = (image == changed).all(axis=2)
    assert np.array_equal(labels[same], again[same])


def test_the_mask_of_blue_noise_has_hardly_any_low_frequencies() -> None:
    flat = np.full((64, 64, 1), 0.5)
    for grey in (0.25, 0.5, 0.75):
        labels = of_image(flat * 2 * grey, np.array([[0.0], [1.0]]), method="blue-noise", strength=1)
        power = np.abs(np.fft.fft2(labels - labels.mean())) ** 2
        radius = np.hypot(np.fft.fftfreq(64)[:, None], np.fft.fftfreq(64))
        assert power[radius < 0.15].mean() < 0.05 * power.mean()


@pytest.mark.parametrize("method", DITHERS)
@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_the_unit_does_not_matter(method: str, scale: float) -> None:
    rng = np.random.default_rng(0)
    image, palette = rng.random((20, 20, 3)), rng.random((9, 3))
    image[0, 0], image[0, 1] = 0, 1
    power = 2.0 ** np.round(np.log2(scale))
    labels = of_image(image, palette, method=method)
    assert np.array_equal(of_image(image * power, palette * power, method=method), labels)


def test_what_cannot_be_is_refused() -> None:
    one = np.zeros((1, 3)), np.zeros((1, 1), np.int32), np.zeros((1, 3))
    with pytest.raises(ValueError, match="method='riemersma' must be one of floyd-steinberg, edge-aware, blue-noise"):
        dither(*one, method="riemersma")
    with pytest.raises(ValueError, match=r"strength=1\.5 must be in 0\.\.1"):
        dither(*one, strength=1.5)
    with pytest.raises(ValueError, match="at most 4 coordinates to be dithered, not 5"):
        dither(np.zeros((1, 5)), one[1], np.zeros((1, 5)))

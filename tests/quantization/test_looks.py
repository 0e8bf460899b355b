"""Images for eyes: small files of the same look."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont

import cvtimg
from cvtimg.pictures.formats.encoding import encode_image
from cvtimg.pictures.frames import Frames
from cvtimg.quantization import Quantized, QuantizeOptions, driver, images, quantize_file, quantize_frames
from cvtimg.quantization.remapping import map_samples

COFFEE = cvtimg.read_image("sample_images/coffee.png")[100:292, 180:436]
CHELSEA = cvtimg.read_image("sample_images/chelsea.png")[:192, 100:356]
PART = CHELSEA[32:160, 64:192]
FAST: dict[str, Any] = {"effort": "fast"}


def n_bytes(result: Quantized) -> int:
    pixels, palette = result.content
    return len(encode_image(".png", pixels, palette=palette))


@pytest.mark.parametrize(("n_colors", "share"), [(16, 1.1), (256, 0.9)])
def test_for_eyes_files_are_smaller_and_look_the_same_or_nearly_as_the_colors_can(n_colors: int, share: float) -> None:
    error, eyes = cvtimg.quantize(CHELSEA, n_colors), cvtimg.quantize(CHELSEA, n_colors, goal="eyes")
    assert n_bytes(eyes) < share * n_bytes(error)
    assert eyes.psnr < error.psnr  # which is the goal of the other
    with pytest.warns(UserWarning, match="out of reach"):
        best = cvtimg.quantize(CHELSEA, n_colors, quality=99)
    assert eyes.quality == pytest.approx(min(85, best.quality - 1), abs=1)


@pytest.mark.slow
def test_a_quality_is_reached_in_five_mappings_and_not_much_more_and_less_gives_a_smaller_file(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sizes, n_mappings = list[int](), list[int]()

    def counted(*given: Any) -> Any:
        n_mappings[-1] += 1
        return map_samples(*given)

    monkeypatch.setattr(images, "map_samples", counted)
    for quality in (30, 60, 80):
        n_mappings.append(0)
        result = cvtimg.quantize(PART, quality=quality, **FAST)
        assert quality <= result.quality < quality + (2 if quality < 60 else 0.5)
        assert result.quality == cvtimg.visual_quality(PART, result.image)
        sizes.append(n_bytes(result))
    assert max(n_mappings[1:]) <= 5  # of few colors each is a step of some points
    assert sizes[0] < sizes[1] < 0.9 * sizes[2]
    monkeypatch.setattr(driver, "_AIMING", driver._AIMING._replace(n_most=1))  # more until it is reached
    assert cvtimg.quantize(PART, quality=45, **FAST).quality >= 45


@pytest.mark.slow
def test_a_large_image_is_searched_in_pieces_and_reaches_its_quality(monkeypatch: pytest.MonkeyPatch) -> None:
    cat, sizes = cvtimg.read_image("sample_images/chelsea.png"), list[int]()

    def counted(samples: Any, *others: Any) -> Any:
        sizes.append(samples.inverse.size)
        return map_samples(samples, *others)

    monkeypatch.setattr(images, "_N_PIECES", 3)
    monkeypatch.setattr(images, "map_samples", counted)
    result = cvtimg.quantize(cat, quality=83, **FAST)
    assert 83 <= cvtimg.visual_quality(cat, result.image) < 84
    assert 9 * 64**2 in sizes
    assert sizes.count(cat[..., 0].size) <= 3  # in pieces so small the quality is a little different


def test_a_quality_out_of_reach_gives_the_best_and_tells_what_can_be_had() -> None:
    with pytest.warns(UserWarning, match=r"quality=90 is out of reach of 4 colors: -?\d+\.\d"):
        result = cvtimg.quantize(COFFEE, 4, quality=90, **FAST)
    assert result.quality == cvtimg.visual_quality(COFFEE, result.image)
    assert result.quality > cvtimg.quantize(COFFEE, 4, goal="eyes", **FAST).quality - 1


@pytest.mark.slow
def test_of_a_range_of_qualities_the_upper_end_is_wanted_and_less_than_the_lower_refused() -> None:
    ranged = cvtimg.quantize(PART, quality=(50, 80), **FAST)
    np.testing.assert_array_equal(ranged.image, cvtimg.quantize(PART, quality=80, **FAST).image)
    with pytest.raises(ValueError, match=r"must be at most -?\d+\.\d at its lower end, which 4 colors reach"):
        cvtimg.quantize(COFFEE, 4, quality=(85, 90), **FAST)
    for wrong in (101, (80, 60), (-1, 50)):
        with pytest.raises(ValueError, match=r"quality=.* must be in 0\.\.100, or two such, rising"):
            cvtimg.quantize(PART, quality=wrong, **FAST)


@pytest.mark.parametrize("options", [{"goal": "eyes"}, {"quality": 100}])
def test_images_with_few_colors_stay_exact(options: dict[str, Any]) -> None:
    cat = cvtimg.read_image("sample_images/chelsea.png")[:40, :40] // 64 * 64
    result = cvtimg.quantize(cat, **options)
    assert result.energy == 0
    np.testing.assert_array_equal(result.image, cat)


def test_palettes_for_eyes_serve_smooth_areas_more_than_texture_which_hides_errors() -> None:
    y, x = np.mgrid[:1:96j, :1:64j]
    smooth = np.dstack([120 + 60 * x, 150 + 50 * y, 200 - 60 * x * y])
    rough = np.random.default_rng(0).integers(0, 256, smooth.shape)
    image = np.concatenate([smooth, rough], axis=1).astype(np.uint8)
    colors = image[:, :64].reshape(-1, 1, 3).astype(float)
    palettes = [cvtimg.quantize(image, 256, **how).palette for how in ({"goal": "eyes"}, {"space": "oklab"})]
    eyes, plain = (((colors - palette) ** 2).sum(axis=2).min(axis=1).mean() for palette in palettes)
    assert eyes < 0.7 * plain, eyes / plain


def test_alpha_keeps_opaque_pixels_opaque_and_clear_ones_clear() -> None:
    alpha = np.full(COFFEE.shape[:2], 255, np.uint8)
    alpha[:60], alpha[60:100] = 0, 128
    result = cvtimg.quantize(np.dstack([COFFEE, alpha]), 32, alpha=True, goal="eyes", **FAST)
    np.testing.assert_array_equal(result.image[:60, :, 3], 0)
    np.testing.assert_array_equal(result.image[100:, :, 3], 255)


def film(n_frames: int, noise: float = 0) -> Frames:
    """A cup that stands still, and a part of it that moves over it."""
    rng, images = np.random.default_rng(0), []
    for i in range(n_frames):
        image = COFFEE[:96, :128].copy()
        image[30:60, 10 + 16 * i : 40 + 16 * i] = COFFEE[110:140, 80:110]
        images.append(np.clip(image + rng.normal(0, noise, image.shape), 0, 255).astype(np.uint8))
    return Frames(tuple(images), (80.0,) * n_frames, 0)


def test_what_stands_still_in_an_animation_does_not_flicker() -> None:
    frames = film(3)
    shown = [one.image for one in quantize_frames(frames, 32, goal="eyes", **FAST).results]
    still = (frames.images[0] == frames.images[1]).all(axis=2)
    np.testing.assert_array_equal(shown[0][still], shown[1][still])


@pytest.mark.slow
def test_a_pan_of_few_colors_is_no_larger_than_its_frames_alone_and_reaches_a_low_quality(tmp_path: Path) -> None:
    strip = cvtimg.quantize(COFFEE, 24, dither="floyd-steinberg", **FAST).image
    frames = Frames(tuple(strip[:128, 12 * n : 12 * n + 160] for n in range(3)), (80.0,) * 3, 0)
    how, sizes = QuantizeOptions(quality=60, engine=FAST), []
    for name, several in (("pan", frames.images), *((f"{n}", frames.images[n : n + 1]) for n in range(3))):
        cvtimg.pictures.write_frames(tmp_path / f"{name}.webp", Frames(several, (80.0,) * len(several), 0))
        result = quantize_file(tmp_path / f"{name}.webp", tmp_path / f"{name}.gif", how)
        assert result.content_quality == pytest.approx(60, abs=3)
        sizes.append((tmp_path / f"{name}.gif").stat().st_size)
    assert sizes[0] < 1.2 * sum(sizes[1:])


def test_a_noisy_animation_keeps_what_is_hardly_seen_and_has_half_the_bytes(tmp_path: Path) -> None:
    cvtimg.pictures.write_frames(tmp_path / "a.webp", film(3, noise=2))
    plain = quantize_file(tmp_path / "a.webp", tmp_path / "plain.gif", QuantizeOptions(255, space="oklab", engine=FAST))
    eyes = quantize_file(tmp_path / "a.webp", tmp_path / "eyes.gif", QuantizeOptions(goal="eyes", engine=FAST))
    pairs = zip(film(3, noise=2).images, cvtimg.pictures.read_frames(tmp_path / "eyes.gif").images, strict=True)
    assert eyes.quality == pytest.approx(np.mean([cvtimg.visual_quality(a, b) for a, b in pairs]))
    assert plain.quality is None
    assert (tmp_path / "eyes.gif").stat().st_size < 0.5 * (tmp_path / "plain.gif").stat().st_size


@pytest.mark.slow
def test_of_a_range_of_qualities_of_an_animation_the_upper_end_is_reached_and_less_than_the_lower_refused() -> None:
    frames = film(2)
    ranged = quantize_frames(frames, quality=(50, 60), **FAST)
    pairs = zip(frames.images, ranged.results, strict=True)
    assert 60 <= np.mean([cvtimg.content_quality(image, one.image) for image, one in pairs]) < 66
    with pytest.warns(UserWarning, match=r"quality=90 is out of reach of 48 colors: \d\d\.\d"):
        best = quantize_frames(frames, 48, quality=(30, 90), **FAST)
    with pytest.raises(ValueError, match=f"must be at most {best.content_quality:.1f} at its lower end"):
        quantize_frames(frames, 48, quality=(85, 90), **FAST)


@pytest.mark.slow
def test_the_quality_of_pages_is_the_mean(tmp_path: Path) -> None:
    cvtimg.pictures.write_pages(tmp_path / "a.tif", cvtimg.pictures.Pages(film(2).images, "Q", (2,), "", {}))
    pages = quantize_file(tmp_path / "a.tif", tmp_path / "b.tif", QuantizeOptions(quality=60, engine=FAST))
    assert pages.kind == "pages"
    assert pages.content_quality is not None
    assert 60 <= pages.content_quality < 66


def test_icons_keep_their_pixels_whatever_a_mean_over_few_scales_says() -> None:
    icons = (COFFEE[: 16 * step : step, : 16 * step : step] for step in (4, 8))
    assert min(cvtimg.quantize(icon, goal="eyes").psnr for icon in icons) > 35


def test_gray_and_frames_and_masks() -> None:
    gray = cvtimg.quantize(COFFEE[:, :, 1], 64, goal="eyes")
    assert n_bytes(gray) < n_bytes(cvtimg.quantize(COFFEE[:, :, 1], 64))
    frames = quantize_frames(Frames((COFFEE[:64], COFFEE[64:128]), (40, 40), 0), 32, dither="compact", **FAST)
    assert len(frames.results) == 2
    mask = np.zeros(COFFEE.shape[:2], bool)
    mask[50:90, 50:90] = True
    inside = cvtimg.quantize(COFFEE, 16, goal="eyes", mask=mask, **FAST)
    np.testing.assert_array_equal(inside.image[~mask], COFFEE[~mask])


@pytest.mark.slow
def test_the_best_that_fits(tmp_path: Path) -> None:
    source = tmp_path / "a.png"
    cvtimg.write_image(source, PART)
    fits = quantize_file(source, tmp_path / "b.png", QuantizeOptions(goal="eyes", max_bytes=8_000, engine=FAST))
    assert 6_000 < (tmp_path / "b.png").stat().st_size <= 8_000
    assert fits.n_colors > 100
    small = quantize_file(source, tmp_path / "small.png", QuantizeOptions(goal="eyes", max_bytes=4_000, engine=FAST))
    assert small.n_colors > 100  # few colors would look worse than a high price of bits
    quantize_file(source, tmp_path / "c.png", QuantizeOptions(quality=50, max_bytes=25_000, engine=FAST))
    assert (tmp_path / "c.png").stat().st_size < 8_000  # which is enough for that quality


@pytest.mark.slow
def test_a_gradient_of_many_colors_is_written_as_it_is_and_small(tmp_path: Path) -> None:
    y, x = np.mgrid[:1:120j, :1:160j]
    smooth = np.rint(np.dstack([90 + 80 * x, 140 + 60 * y, 180 + 40 * x * y])).astype(np.uint8)
    for name, picture in (("smooth", smooth), ("cat", CHELSEA)):
        cvtimg.write_image(tmp_path / "a.png", picture, overwrite=True)
        result = quantize_file(tmp_path / "a.png", tmp_path / f"{name}.png", QuantizeOptions(goal="eyes", engine=FAST))
        assert (result.energy == 0) == (name == "smooth")
    np.testing.assert_array_equal(cvtimg.read_image(tmp_path / "smooth.png"), smooth)
    assert (tmp_path / "smooth.png").stat().st_size < 0.5 * n_bytes(cvtimg.quantize(smooth, 256))


def test_a_logo_on_nothing_is_written_without_dithering_in_as_few_colors_as_leave_rims_smooth() -> None:
    image = Image.new("RGBA", (800, 800), (255, 255, 255, 0))
    draw = ImageDraw.Draw(image)
    draw.text((40, 40), "Acme Labs", font=ImageFont.load_default(150), fill=(90, 40, 160, 255))
    draw.ellipse((100, 400, 400, 700), fill=(230, 80, 20, 255))
    logo = np.asarray(image.resize((200, 200), Image.Resampling.LANCZOS))
    result = cvtimg.quantize(logo, goal="eyes", alpha=True)
    colors, shown = logo[logo[..., 3] > 0], result.image[logo[..., 3] > 0]
    n_colors, n_pairs = (len(np.unique(some, axis=0)) for some in (colors, np.hstack([colors, shown])))
    assert n_pairs == n_colors  # each color has one entry
    assert 92 <= result.content_quality < 95


def test_a_soft_shadow_of_few_colors_stays_as_it_is() -> None:
    y, x = np.mgrid[-1:1:120j, -1:1:160j]
    shadow = np.dstack([np.full((120, 160, 3), 20), np.rint(60 * np.exp(-3 * (x**2 + y**2)))]).astype(np.uint8)
    assert cvtimg.quantize(shadow, goal="eyes", alpha=True).energy == 0

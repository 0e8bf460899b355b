"""Claims about impulses and stripes: found where they are, and nowhere else."""

import numpy as np
import pytest
from conftest import SAMPLES
from damaging import as_bytes, card, psnr
from PIL import Image, ImageDraw, ImageFont

from cvtimg import denoise, read_image
from cvtimg._shared.types import Array, Bytes
from cvtimg.restoration.defects import Defects, without_defects
from cvtimg.restoration.versions import stack_versions


def part(side: int = 96) -> Bytes:
    """The middle of a photograph."""
    return np.ascontiguousarray(read_image(SAMPLES / "coffee.png")[60 : 60 + side, 80 : 80 + side])


def peppered(image: Bytes, share: float, ends: tuple[int, ...] = (0, 255)) -> Bytes:
    """An image with impulses in all bands of a share of its pixels."""
    rng, spoiled = np.random.default_rng(0), image.copy()
    hit = rng.random(image.shape[:2]) < share
    spoiled[hit] = rng.choice(ends, np.count_nonzero(hit)).reshape(-1, *[1] * (image.ndim - 2))
    return spoiled


def defects_of(image: Array) -> Defects:
    return without_defects(stack_versions([image]))[1]


@pytest.mark.parametrize("ends", [(0,), (255,)], ids=["dead", "hot"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float64])
def test_dead_and_hot_pixels_alone_are_found(ends: tuple[int, ...], dtype: type) -> None:
    spoiled = peppered(part()[:, :, 1], 0.01, ends).astype(dtype)
    assert defects_of(spoiled).impulses[0] == pytest.approx(0.01, rel=0.15)


def pages() -> dict[str, Array]:
    """Pictures that have no defects: text, dithering, lights, a chart, a drawing and photographs with noise."""
    rng, text = np.random.default_rng(0), Image.new("L", (160, 130), 240)
    for line in range(0, 130, 17):
        ImageDraw.Draw(text).text((3, line), "i.j: 1.5 iii ... lil!", fill=0, font=ImageFont.load_default(14))
    gray, (y, x) = part()[:, :, 1], np.mgrid[:96, :96]
    places = rng.uniform(0, 96, (60, 2))
    stars = 20 + sum(300 * rng.random() * np.exp(-((y - a) ** 2 + (x - b) ** 2) / 0.98) for a, b in places)
    return {
        "text": np.asarray(text),
        "dithering": (gray > 255 * rng.random(gray.shape)) * 255,
        "four levels": np.clip(np.rint(gray / 85 + rng.random(gray.shape) - 0.5), 0, 3) * 85,
        "stars": as_bytes(stars + rng.normal(0, 3, stars.shape)),
        "chart": np.kron(rng.integers(0, 255, (8, 8)), np.ones((16, 16))),
        "drawing": 255 * card(96)[0],
        "photograph": part(),
        "noise": as_bytes(part() + rng.normal(0, 40, part().shape)),
    }


@pytest.mark.parametrize("name", pages())
def test_nothing_is_found_in_what_has_no_defects(name: str) -> None:
    found = defects_of(as_bytes(pages()[name]))
    assert not found.impulses.any()
    assert not found.stripes.any()


@pytest.mark.parametrize(("axis", "gain"), [(1, 0.0), pytest.param(0, 0.1, marks=pytest.mark.slow)])
def test_offsets_and_gains_of_rows_and_of_columns_are_taken_away(axis: int, gain: float) -> None:
    clean, rng = part(), np.random.default_rng(1)
    stripes = rng.normal(0, 1, (len(clean), 1, 1)).swapaxes(0, axis) * (gain * clean if gain else 8)
    spoiled = as_bytes(clean + stripes + rng.normal(0, 3, clean.shape))
    result = denoise([spoiled], effort="fast")
    assert 4 < result.stripes[0, axis] < 12
    assert result.stripes[0, 1 - axis] == 0
    assert psnr(result.image / 255, clean / 255) > psnr(spoiled / 255, clean / 255) + 5


@pytest.mark.parametrize("sigma", [pytest.param(0, marks=pytest.mark.slow), 6])
def test_hot_pixels_of_any_level_are_filled(sigma: float) -> None:
    clean, rng = part(), np.random.default_rng(4)
    hit = rng.random(clean.shape[:2]) < 0.01
    hot = np.where(hit[:, :, None], rng.uniform(30, 150, (*hit.shape, 1)), 0)
    spoiled = as_bytes(clean + hot + rng.normal(0, sigma, clean.shape))
    found, left = (
        psnr(denoise([spoiled], effort="fast", hidden=how).image / 255, clean / 255) for how in ("outliers", "none")
    )
    assert found > left + 3


def test_impulses_that_touch_at_the_border_are_found() -> None:
    y, x = np.mgrid[:48, :48]
    clean = (80 + x + y).astype(np.uint8)
    rng = np.random.default_rng(0)
    noisy = np.where(rng.random(clean.shape) < 0.08, rng.choice(np.uint8([0, 255]), clean.shape), clean)
    noisy[:2, 18:22] = [[98, 255, 0, 101], [99, 0, 0, 102]]
    assert np.abs(denoise([noisy], effort="fast").image.astype(int) - clean).max() < 20

"""Claims about what JPEG has rounded away."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaging import psnr
from numpy.typing import NDArray
from PIL import Image

from cvtimg import denoise
from cvtimg.restoration.compression import Compressed, Rounding, with_tables


def as_jpeg(pixels: NDArray[np.uint8], quality: int = 60, subsampling: int = 2) -> Image.Image:
    file = io.BytesIO()
    about: dict[str, Any] = {} if pixels.ndim == 2 else {"subsampling": subsampling}
    Image.fromarray(pixels).save(file, "JPEG", quality=quality, **about)
    return Image.open(file)


def autocovariance(apart: NDArray[np.float64], down: int, right: int) -> NDArray[np.float64]:
    height, width = apart.shape[0] - down, apart.shape[1] - right
    pairs = apart[:height, :width, :, None] * apart[down:, right:, None]
    return np.asarray(pairs.mean(axis=(0, 1)))


@pytest.mark.parametrize("subsampling", [0, 2])
def test_tables_tell_how_what_was_rounded_away_is_shared(photograph: NDArray[Any], subsampling: int) -> None:
    # Of chroma, that which is rounded away once its size is halved: at quality 100 the rest is lost.
    coarse, fine = (np.asarray(as_jpeg(photograph, quality, subsampling), np.float64) for quality in (60, 100))
    rounding = Rounding.of(as_jpeg(photograph, 60, subsampling))
    assert rounding is not None
    lost = rounding.lost(coarse)
    assert lost is not None
    true = coarse - fine
    variance = np.trace(autocovariance(true, 0, 0))
    found = np.trace(autocovariance(lost, 0, 0))
    assert 0.8 < found / variance < 3.2  # more than on average: what is lost where there is texture
    for down, right in ((0, 1), (1, 0), (1, 1), (0, 2), (3, 0)):
        part = np.trace(autocovariance(lost, down, right)) / found
        assert part == pytest.approx(np.trace(autocovariance(true, down, right)) / variance, abs=0.25)


def test_gray_images_and_arrays_with_tables_count_and_others_do_not(photograph: NDArray[Any], tmp_path: Path) -> None:
    gray = as_jpeg(photograph[:, :, 0])
    rounding = Rounding.of(gray)
    assert rounding is not None
    lost = rounding.lost(np.asarray(gray)[:, :, None])
    assert lost is not None
    true = np.asarray(gray, np.float64) - photograph[:, :, 0]
    assert 0.8 < np.mean(lost**2) / np.mean(true**2) < 3.2
    assert rounding.lost(photograph) is None
    assert Rounding.of(photograph) is Rounding.of(gray.convert("RGB")) is None
    gray.save(tmp_path / "a.jpg", quality="keep")
    gray.save(tmp_path / "a.png")
    assert isinstance(with_tables(np.asarray(gray), tmp_path / "a.jpg"), Compressed)
    for other in ("a.png", "missing.jpg"):
        assert isinstance(with_tables(np.asarray(gray), tmp_path / other), np.ndarray)


@pytest.mark.slow
@pytest.mark.parametrize("quality", [50, 90])
def test_detail_brings_back_what_was_rounded_away(photograph: NDArray[Any], quality: int) -> None:
    clean = photograph[:160, :160]
    image = as_jpeg(np.ascontiguousarray(clean), quality)
    blind = denoise([np.asarray(image)], effort="fast").image
    found = denoise([image], effort="fast").image
    assert psnr(found / 255, clean / 255) > psnr(blind / 255, clean / 255) + 0.5

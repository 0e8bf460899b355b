"""``cvtimg quantize`` keeps an animation one, and what a file says beside its pixels if asked."""

from pathlib import Path
from typing import Any

import numpy as np
import picture_files
import pytest
from commands import RowOf
from PIL import Image

from cvtimg import quantize_frames, read_image, read_palette
from cvtimg._shared.types import Bytes
from cvtimg.cli.app import main
from cvtimg.pictures import Frames, read_frames, read_metadata, write_frames


@pytest.fixture
def film(photograph: Bytes) -> Frames:
    """Write film.gif and film.png, and work beside them."""
    images = tuple(photograph[number : number + 40, 60:120].copy() for number in range(3))
    frames = Frames(images, (40.0, 70.0, 1000.0), 0)
    write_frames("film.png", frames)
    result = quantize_frames(frames, 200)
    result.save("film.gif")
    return Frames(tuple(one.image for one in result.results), frames.durations, 0)


@pytest.mark.parametrize("suffix", ["gif", "png", "webp"])
@pytest.mark.parametrize("words", [[], ["--palette-per-frame"], ["--dither", "blue-noise"]])
def test_an_animation_stays_one(film: Frames, row_of: RowOf, suffix: str, words: list[str]) -> None:
    row = row_of("quantize", "film.gif", "-k", "12", "-o", f"out.{suffix}", *words)
    options: dict[str, Any] = {"per_frame": "--palette-per-frame" in words}
    if "--dither" in words:
        options["dither"] = "blue-noise"
    expected = quantize_frames(film, 12, **options)
    again = read_frames(f"out.{suffix}")
    assert (again.durations, again.plays) == (film.durations, 0)
    for got, one in zip(again.images, expected.results, strict=True):
        np.testing.assert_array_equal(got, one.image)
    assert (row["frames"], row["k"], row["energy"]) == (3, 12, pytest.approx(expected.energy))


def test_an_animation_beside_pictures_is_told_in_one_table(film: Frames, capsys: pytest.CaptureFixture[str]) -> None:
    Image.fromarray(film.images[0]).save("still.png")
    assert main(["quantize", "film.png", "still.png", "-k", "5", "--out-dir", "out"]) == 0
    assert capsys.readouterr().out.count("\n") == 3
    assert len(read_frames("out/film.png").images) == 3
    assert len(read_frames("out/still.png").images) == 1


def test_a_format_without_frames_gets_the_first(film: Frames) -> None:
    assert main(["quantize", "film.gif", "-k", "256", "-o", "out.tif", "--quiet"]) == 0
    np.testing.assert_array_equal(read_image("out.tif"), film.images[0])


def test_a_palette_is_given_or_saved(film: Frames) -> None:
    assert main(["quantize", "film.gif", "-k", "9", "-o", "out.gif", "--save-palette", "a.hex", "--quiet"]) == 0
    colors = {tuple(color) for color in read_palette("a.hex").tolist()}
    again = read_frames("out.gif")
    assert {tuple(color) for image in again.images for color in image.reshape(-1, 3).tolist()} == colors
    assert main(["quantize", "film.gif", "--palette", "a.hex", "-o", "again.gif", "--quiet"]) == 0
    for got, one in zip(read_frames("again.gif").images, again.images, strict=True):
        np.testing.assert_array_equal(got, one)


# --- beside the pixels


@pytest.fixture
def tagged(photograph: Bytes) -> Bytes:
    """Write a.jpg with profile, pixels an inch and EXIF."""
    exif = Image.Exif()
    exif[0x8298] = "(c) somebody"
    options: dict[str, Any] = {"icc_profile": picture_files.rgb_profile("gbr"), "dpi": (300, 300), "exif": exif}
    picture_files.save(Path("a.jpg"), photograph[:50, :50], **options)
    return read_image("a.jpg")


@pytest.mark.parametrize("suffix", ["png", "tif", "webp"])
def test_metadata_is_kept_only_when_asked(tagged: Bytes, suffix: str) -> None:
    for words in ([], ["--keep-metadata"]):
        arguments = ["quantize", "a.jpg", "-k", "20", "-o", f"out.{suffix}", "--overwrite", "--quiet"]
        assert main([*arguments, *words]) == 0
        metadata = read_metadata(f"out.{suffix}")
        assert bool(metadata.icc) is bool(words)
        assert (b"somebody" in (metadata.exif or b"")) is bool(words)
        pixels = read_image(f"out.{suffix}").astype(float)
        assert np.abs(pixels - tagged).mean() < 12, "the colors are those that the profile meant"


def test_the_bytes_of_metadata_count(tagged: Bytes) -> None:
    assert main(["quantize", "a.jpg", "--max-bytes", "1800", "-o", "a.png", "--keep-metadata", "--quiet"]) == 0
    assert Path("a.png").stat().st_size <= 1800
    assert read_metadata("a.png").exif


@pytest.mark.parametrize("suffix", [".png", ".webp"])
def test_an_animation_keeps_its_metadata(film: Frames, suffix: str) -> None:
    metadata = read_metadata(picture_files.save(Path("a.png"), film.images[0], icc_profile=picture_files.SRGB))
    write_frames(f"tagged{suffix}", film, metadata=metadata)
    arguments = ["quantize", f"tagged{suffix}", "-k", "9", "-o", f"out{suffix}", "--quiet"]
    assert main([*arguments, "--keep-metadata"]) == 0
    assert read_metadata(f"out{suffix}").icc == picture_files.SRGB
    assert read_frames(f"out{suffix}").durations == film.durations

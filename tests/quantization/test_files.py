"""`quantize_file` picks the way that suits a file; frames have targets, and indexed images keep their palettes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from PIL import Image

from cvtimg import quantize, quantize_frames, read_image, read_palette
from cvtimg.pictures import Frames, read_frames, read_pages, write_frames, write_image, write_pages
from cvtimg.quantization import QuantizeOptions, Reading, UnfitOptionError, Writing, quantize_file

RNG = np.random.default_rng(5)
PICTURE = RNG.integers(0, 256, (30, 40, 3), np.uint8)
pytestmark = pytest.mark.usefixtures("here")
STACK = RNG.integers(0, 256, (3, 20, 24, 3), np.uint8)


def test_each_file_goes_its_way() -> None:
    write_image("a.png", PICTURE)
    write_frames("film.png", Frames(tuple(STACK), (40,) * 3, 0))
    tifffile.imwrite("pages.tif", STACK, photometric="rgb")
    stages: list[str] = []
    found = {}
    for source, target, tiles in (
        ("a.png", "b.png", None),
        ("film.png", "b.gif", None),
        ("pages.tif", "b.tif", None),
        ("pages.tif", "c.tif", True),
    ):
        if tiles:
            tifffile.imwrite("pages.tif", PICTURE, photometric="rgb")
        reading, writing = Reading(tiles=tiles), Writing(save_palette=f"{target}.hex")
        how = QuantizeOptions(8)
        result = quantize_file(source, target, how, reading=reading, writing=writing, on_stage=stages.append)
        found[target] = (result.kind, len(result.results), result.n_colors)
        np.testing.assert_array_equal(np.sort(read_palette(f"{target}.hex"), axis=0), np.sort(result.palette, axis=0))
    assert found == {
        "b.png": ("image", 1, 8),
        "b.gif": ("frames", 3, 8),
        "b.tif": ("pages", 3, 8),
        "c.tif": ("tiles", 1, 8),
    }
    assert stages == [*("read", "cluster", "write") * 3, "all"]
    np.testing.assert_array_equal(read_image("b.png"), quantize(PICTURE, 8).image)
    np.testing.assert_array_equal(read_image("c.tif"), quantize(PICTURE, 8).image)
    assert len(read_frames("b.gif").images) == len(read_pages("b.tif").images) == 3


@pytest.mark.parametrize(
    ("source", "given", "option"),
    [
        ("film.png", {"writing": Writing(optimize=True)}, "optimize"),
        ("pages.tif", {"reading": Reading(depth="16")}, "depth"),
        ("a.tif", {"how": QuantizeOptions(4, dither="blue-noise")}, "dither"),
        ("a.tif", {"how": QuantizeOptions(4, psnr=30)}, "psnr"),
        ("a.tif", {"how": QuantizeOptions("auto")}, "n_colors='auto'"),
        ("a.tif", {"how": QuantizeOptions(quality=70)}, "quality"),
        ("a.tif", {"writing": Writing(keep_metadata=True)}, "keep_metadata"),
    ],
)
def test_options_that_a_kind_of_file_cannot_have_are_named(source: str, given: dict[str, Any], option: str) -> None:
    write_frames("film.png", Frames(tuple(STACK), (40,) * 3, 0))
    tifffile.imwrite("pages.tif", STACK, photometric="rgb")
    tifffile.imwrite("a.tif", PICTURE, photometric="rgb")
    target, reading = f"b{Path(source).suffix}", Reading(tiles=source == "a.tif")
    with pytest.raises(UnfitOptionError) as error:
        quantize_file(source, target, **{"how": QuantizeOptions(4), "reading": reading, **given})
    assert error.value.option == option
    assert not Path(target).exists()


def test_pages_are_saved_as_quantize_file_writes_them() -> None:
    write_pages("pages.tif", tuple(STACK))
    result = quantize_frames(read_pages("pages.tif"), 6)
    result.save("a.tif")
    quantize_file("pages.tif", "b.tif", QuantizeOptions(6))
    assert Path("a.tif").read_bytes() == Path("b.tif").read_bytes()
    assert all(map(np.array_equal, read_pages("a.tif").images, (one.image for one in result.results)))
    assert len(read_pages("a.tif").images) == len(STACK) == 3


@pytest.mark.slow
def test_frames_reach_a_quality_and_a_size() -> None:
    frames = Frames(tuple(STACK // 16 * 16), (40,) * 3, 0)
    result = quantize_frames(frames, psnr=28)
    n_colors = len(result.palette)
    assert result.psnr >= 28 > quantize_frames(frames, n_colors - 1).psnr
    quantize_frames(frames, 20).save("20.gif")
    found = quantize_frames(frames, max_bytes=Path("20.gif").stat().st_size)
    assert len(found.palette) >= 20
    found.save("most.gif")
    assert Path("most.gif").stat().st_size <= Path("20.gif").stat().st_size
    with pytest.raises(ValueError, match=r"psnr=90 must be at most .* dB, which 256 colors reach"):
        quantize_frames(frames, psnr=90)


def test_an_indexed_image_of_few_colors_keeps_its_palette() -> None:
    palette = np.array([[200, 0, 0], [0, 0, 0], [0, 200, 0], [9, 9, 9]], np.uint8)
    indices = RNG.integers(0, 3, (8, 9), np.uint8)
    write_image("a.png", indices, palette=palette)
    quantize_file("a.png", "b.png", QuantizeOptions(4))
    with Image.open("b.png") as written:
        np.testing.assert_array_equal(np.asarray(written), indices)
    quantize_file("a.png", "c.png", QuantizeOptions(2))  # too few: the palette is a new one
    np.testing.assert_array_equal(read_image("c.png"), quantize(palette[indices], 2).image)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_gif_takes_half_transparent_pixels_by_a_threshold_over_a_matte_or_in_a_pattern(
    tmp_path: Path, dtype: type[np.unsignedinteger[Any]]
) -> None:
    white = np.iinfo(dtype).max
    soft = np.zeros((64, 64, 4), dtype)
    soft[..., 0], soft[..., 3] = white, np.linspace(0, white, 64).astype(dtype)
    write_image(tmp_path / "a.png", soft)
    found = {}
    for name, reading in {
        "half": Reading(depth="8"),
        "matte": Reading(depth="8", alpha_threshold=0.2, matte=(0, 0, 255)),
        "pattern": Reading(depth="8", alpha_threshold="dither"),
    }.items():
        with pytest.warns(UserWarning, match="half-transparent pixels become transparent"):
            quantize_file(
                tmp_path / "a.png", tmp_path / f"{name}.gif", QuantizeOptions(64, space="rgb"), reading=reading
            )
        found[name] = read_image(tmp_path / f"{name}.gif")
    with pytest.warns(UserWarning, match=r"a threshold of alpha and a matte are for \.gif files"):
        quantize_file(
            tmp_path / "a.png", tmp_path / "a.webp", QuantizeOptions(4), reading=Reading(matte=(0, 0, 255), depth="8")
        )
    share = soft[..., 3] / white
    np.testing.assert_array_equal(found["half"][..., 3] > 0, share >= 0.5)
    np.testing.assert_array_equal(found["matte"][..., 3] > 0, share >= 0.2)
    seen = found["matte"][share >= 0.2].astype(float)
    np.testing.assert_allclose(seen[:, 2], 255 * (1 - share[share >= 0.2]), atol=4)
    assert 0.45 < (found["pattern"][..., 3] > 0).mean() < 0.55
    assert (np.diff((found["pattern"][..., 3] > 0).mean(axis=0).reshape(8, 8).mean(axis=1)) > 0).all()

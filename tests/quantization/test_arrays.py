"""Arrays of any kind: bands and alpha, masks, types with their own white, and objects that hold arrays."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from skimage import data

from cvtimg import quantize, read_image, write_image
from cvtimg.quantization import map_to_palette


@pytest.fixture
def scene() -> NDArray[np.uint16]:
    """Return four bands of 16 bits, the last of which is unlike the others and often 0."""
    rng = np.random.default_rng(0)
    bands = rng.integers(0, 65536, (5, 4))[rng.integers(0, 5, (40, 50))] + rng.normal(0, 500, (40, 50, 4))
    bands[..., 3] *= rng.random((40, 50)) < 0.7
    return np.clip(bands, 0, 65535).astype(np.uint16)


def squares(result: Any, image: NDArray[Any]) -> NDArray[np.float64]:
    """Return the sum of the squared errors in each band."""
    return np.square(result.image.astype(float) - image).sum(axis=(0, 1))


def test_four_bands_are_bands(scene: NDArray[np.uint16]) -> None:
    result, with_alpha = quantize(scene, 9), quantize(scene, 9, alpha=True)
    assert squares(result, scene).sum() < 0.7 * squares(with_alpha, scene).sum()
    turned = quantize(np.ascontiguousarray(scene[..., ::-1]), 9)
    assert turned.energy == pytest.approx(result.energy, rel=0.05)
    assert result.energy == pytest.approx(squares(result, scene).sum(), rel=1e-9)
    assert result.psnr == pytest.approx(10 * np.log10(65535**2 * scene.size / squares(result, scene).sum()))
    assert result.image.shape == scene.shape


def test_two_bands_are_two() -> None:
    pair = np.random.default_rng(0).integers(0, 256, (20, 20, 2), np.uint8)
    result = quantize(pair, 7)
    assert result.image.shape == (20, 20, 2)
    assert result.content[0].shape == (20, 20, 2)
    assert result.energy == squares(result, pair).sum()


def test_bytes_that_may_be_rgba_are_asked_about() -> None:
    rgba = np.random.default_rng(0).integers(0, 256, (9, 9, 4), np.uint8)
    with pytest.warns(UserWarning, match="give alpha=True if the last is alpha, else alpha=False"):
        bands = quantize(rgba, 5)
    assert not bands.alpha
    assert bands.energy == quantize(rgba, 5, alpha=False).energy
    assert quantize(rgba, 5, alpha=True).alpha
    with pytest.raises(ValueError, match="alpha=True needs an image of 2 or 4 channels, not 3"):
        quantize(rgba[..., :3], 5, alpha=True)


def test_files_and_pillow_images_say_whether_they_have_alpha(tmp_path: Path) -> None:
    rgba = np.random.default_rng(0).integers(0, 256, (9, 9, 4), np.uint8)
    rgba[:3, :, 3] = 0
    expected = quantize(rgba, 5, alpha=True)
    write_image(tmp_path / "a.png", rgba)
    read = read_image(tmp_path / "a.png")
    for image in (read, Image.fromarray(rgba), expected.image):
        result = quantize(image, 5)
        assert result.alpha
        assert (result.image[:3, :, 3] == 0).all()
    assert quantize(read, 5).energy == expected.energy
    assert not quantize(read[..., :3], 5).alpha


@pytest.mark.parametrize("dither", [None, "floyd-steinberg", "blue-noise"])
def test_pixels_outside_the_mask_have_no_influence_and_stay(dither: str | None) -> None:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (30, 40, 3), np.uint8)
    mask = rng.random((30, 40)) < 0.6
    other = np.where(mask[..., None], image, rng.integers(0, 256, image.shape)).astype(np.uint8)
    one, two = (quantize(some, 6, mask=mask, dither=dither) for some in (image, other))
    np.testing.assert_array_equal(one.palette, two.palette)
    np.testing.assert_array_equal(one.image[mask], two.image[mask])
    np.testing.assert_array_equal(one.image[~mask], image[~mask])
    error = np.square(one.image[mask].astype(float) - image[mask]).sum()
    assert one.energy == pytest.approx(error)
    assert one.mse == pytest.approx(error / (3 * mask.sum()))


def test_masked_arrays_and_nan_are_masks() -> None:
    rng = np.random.default_rng(0)
    image, mask = rng.random((20, 30)).astype(np.float32), rng.random((20, 30)) < 0.7
    expected = quantize(image, 5, mask=mask)
    holed = np.where(mask, image, np.float32(np.nan))
    for masked in (np.ma.array(image, mask=~mask), holed):
        result = quantize(masked, 5)
        np.testing.assert_array_equal(result.image[mask], expected.image[mask])
        assert result.energy == expected.energy
    assert np.isnan(quantize(holed, 5).image[~mask]).all()
    assert np.isnan(map_to_palette(holed, [0.2, 0.8]).image[~mask]).all()
    with pytest.raises(ValueError, match=r"mask of shape \(3,\) must be \(20, 30\), as the image"):
        quantize(image, 5, mask=[1, 0, 1])


@pytest.mark.parametrize("dtype", [">u2", "<u2", "int16", "int32", "uint32", "int8", ">f4", "f2", "f8", "int64"])
@pytest.mark.parametrize("shape", [(24, 20), (24, 20, 3)])
def test_any_type_keeps_its_values_and_has_its_own_white(dtype: str, shape: tuple[int, ...]) -> None:
    kind = np.dtype(dtype)
    white = 1.0 if kind.kind == "f" else min(float(np.iinfo(kind).max), 2.0**60)
    levels = np.random.default_rng(0).integers(0, 32, shape)
    image = (levels / 32 * white).astype(kind)
    result = quantize(image, 6)
    assert result.image.dtype.kind == kind.kind
    assert result.image.shape == shape
    assert result.image.dtype.itemsize == max(kind.itemsize, 4 if kind.kind == "f" else 1)
    peak = 1.0 if kind.kind == "f" else float(np.iinfo(kind).max)
    mse = np.square(result.image.astype(float) - image.astype(float)).mean()
    assert result.psnr == pytest.approx(10 * np.log10(peak**2 / mse), rel=1e-6)
    assert quantize(image, 32**3).energy == 0


CAT = data.chelsea()[100:160, 100:160]


def test_a_list_of_bytes_is_the_picture_that_bytes_are() -> None:
    listed = CAT[:40, :40].tolist()
    for aim in ({"n_colors": 9, "space": "lab"}, {"quality": 60}):
        assert np.array_equal(quantize(listed, **aim).image, quantize(CAT[:40, :40], **aim).image)
    assert quantize(listed, 9).psnr == quantize(CAT[:40, :40], 9).psnr
    with pytest.warns(UserWarning, match="nearly black to eyes: it reaches"):
        quantize(CAT[:40, :40] * np.int64(10), quality=60)


def test_pixels_without_data_have_no_part_in_a_quality() -> None:
    image = CAT / 255
    image[20:30, :40] = np.nan
    result = quantize(image, quality=60)
    assert len(result.palette) > 2
    assert np.array_equal(np.isnan(result.image), np.isnan(image))


def test_negative_values_come_back() -> None:
    image = np.array([[-300, -300, 5], [-298, 7, 5]], np.int16)
    assert quantize(image, 2).image.tolist() == [[-299, -299, 6], [-299, 6, 6]]
    with pytest.raises(ValueError, match="for space='lab'"):
        quantize(image, 2, space="lab")


def test_booleans_are_black_and_white() -> None:
    result = quantize(np.array([[True, False]]), 2)
    assert result.palette.ravel().tolist() == [0, 255]

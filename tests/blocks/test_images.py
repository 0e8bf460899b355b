"""Images in blocks become what they become in memory, labeled as they were, whatever their dimensions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cvtimg import find_palette, quantize, segment
from cvtimg.blocks import BlockError
from cvtimg.segmentation import segment_blocks

dask = pytest.importorskip("dask")
import dask.array as da  # noqa: E402

RNG = np.random.default_rng(5)
IMAGE = RNG.normal(np.repeat([40, 120, 220], 10)[:, None, None], 12, (30, 24, 3)).clip(0, 255).astype(np.uint8)
KINDS: dict[str, NDArray[Any]] = {
    "rgb": IMAGE,
    "gray": IMAGE[..., 0],
    "16 bits": IMAGE.astype(np.uint16) * 257 - 100,
    "int16": IMAGE.astype(np.int16) * 9 - 400,
    "float": (IMAGE / 255).astype(np.float32),
    "uneven": RNG.random((20, 20, 2)),
}


def blocks(image: NDArray[Any], shape: tuple[int, ...] = (7, 11, 2)) -> Any:
    return da.from_array(image, chunks=shape[: image.ndim])


@pytest.mark.parametrize("image", KINDS.values(), ids=KINDS)
def test_quantized_blocks_are_those_of_the_whole(image: NDArray[Any]) -> None:
    result, whole = quantize(blocks(image), 6), quantize(image, 6)
    assert isinstance(result.image, da.Array)
    np.testing.assert_array_equal(result.palette, find_palette(blocks(image), 6).colors)
    assert result.energy == pytest.approx(whole.energy, rel=1e-2)
    assert result.psnr == pytest.approx(whole.psnr, rel=1e-3)
    if image.dtype == np.uint8:
        np.testing.assert_array_equal(result.palette, whole.palette)
        np.testing.assert_array_equal(result.image.compute(), whole.image)
    # The energy is that of all pixels.
    squares = (result.image.compute().astype(float) - image) ** 2
    assert result.energy == pytest.approx(squares.sum(), rel=1e-5)
    assert (result.n_distinct, result.image.shape, result.image.dtype) == (whole.n_distinct, image.shape, image.dtype)


@pytest.mark.parametrize("image", KINDS.values(), ids=KINDS)
@pytest.mark.parametrize("space", ["rgb", "oklab"])
def test_segmented_blocks_are_those_of_the_whole(image: NDArray[Any], space: Any) -> None:
    if space != "rgb" and (image.shape[2:] == (2,) or image.dtype == np.int16):
        pytest.skip("has no colors")
    result, whole = segment(blocks(image), 3, space=space), segment(image, 3, space=space)
    labels = result.labels.compute()
    if image.dtype == np.uint8:
        np.testing.assert_array_equal(labels, whole.labels)
    assert np.mean(labels == whole.labels) > 0.99
    np.testing.assert_allclose(result.generators, whole.generators, rtol=0.02)
    np.testing.assert_array_equal(result.masses, np.bincount(labels.ravel(), minlength=4)[1:])


def test_a_given_palette_is_used_as_it_is() -> None:
    palette = [[0, 0, 0], [120, 120, 120], [255, 255, 255]]
    result, whole = quantize(blocks(IMAGE), palette=palette), quantize(IMAGE, palette=palette)
    np.testing.assert_array_equal(result.indices.compute(), whole.indices)
    assert result.energy == pytest.approx(whole.energy)


def test_gray_becomes_color_by_a_palette_of_colors() -> None:
    xr = pytest.importorskip("xarray")
    palette = [[0, 0, 90], [120, 120, 10], [255, 255, 255]]
    whole = quantize(IMAGE[..., 0], palette=palette)
    np.testing.assert_array_equal(quantize(blocks(IMAGE[..., 0]), palette=palette).image.compute(), whole.image)
    labeled = xr.DataArray(IMAGE[..., 0], {"y": np.arange(30)}, ("y", "x"))
    image = quantize(labeled, palette=palette).image
    assert image.dims == ("y", "x", "band")
    np.testing.assert_array_equal(image.to_numpy(), whole.image)


def test_a_stack_has_one_palette_and_one_set_of_segments_without_nodata() -> None:
    stack = np.stack([IMAGE, IMAGE + 30, IMAGE // 2])
    stack[0, :5] = 9  # as nodata
    stack[1, 5:9] = 9
    given = da.from_array(stack, chunks=(1, 10, 24, 3))
    known = (stack != 9).any(axis=-1)
    result = quantize(given, 5, nodata=9)
    expected = find_palette(stack[known][None], 5)
    np.testing.assert_array_equal(result.palette, expected.colors)
    assert result.indices.shape == stack.shape[:-1]
    found = segment_blocks(given, 4, nodata=9)
    labels = found.labels.compute()
    np.testing.assert_array_equal(labels == 0, ~known)
    np.testing.assert_array_equal(labels[known], segment(stack[known][None], 4).labels[0])


def test_labeled_arrays_keep_their_dimensions_and_coordinates() -> None:
    xr = pytest.importorskip("xarray")
    scene = np.moveaxis(np.stack([IMAGE, IMAGE[::-1]]), -1, 1).astype(np.int16)  # time, band, y, x
    scene[:, :, 3, 4] = -99
    coords = {"time": [2020, 2021], "band": ["r", "g", "b"], "y": np.arange(30.0), "x": np.arange(24) * 10}
    array = xr.DataArray(scene, coords, ("time", "band", "y", "x"), name="scene", attrs={"_FillValue": -99})
    for given in (array, array.chunk({"time": 1, "band": 1, "y": 10})):
        result = quantize(given, 4)
        assert result.image.dims == given.dims
        assert result.image.coords.equals(given.coords)
        assert result.indices.dims == ("time", "y", "x")
        assert set(result.indices.coords) == {"time", "y", "x"}
        assert (result.image.isel(y=3, x=4).to_numpy() == 0).all()
        labels = segment(given, 3).labels
        assert labels.dims == ("time", "y", "x")
        assert (labels.to_numpy() == 0).sum() == 2
        assert (result.image.chunks is None) == (given.chunks is None)
    shifted = np.sort(np.unique(quantize(array, 4).image.to_numpy()[:, 0]))
    assert -99 not in shifted


def test_a_palette_is_applied_by_map_blocks() -> None:
    xr = pytest.importorskip("xarray")
    array = xr.DataArray(IMAGE, dims=("y", "x", "band")).chunk({"y": 10})
    palette = find_palette(array, 5).colors
    mapped = array.map_blocks(lambda block: quantize(block, palette=palette).image, template=array)
    np.testing.assert_array_equal(mapped.to_numpy(), quantize(array, 5).image.to_numpy())


def test_very_many_colors_are_merged(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cvtimg.colors.counting.MOST_COLORS", 200)
    result = quantize(blocks(IMAGE), 6)
    assert not result.exact
    squares = (result.image.compute().astype(float) - IMAGE) ** 2
    assert squares.sum() == pytest.approx(quantize(IMAGE, 6).energy, rel=0.05)


def test_options_that_need_the_whole_image_load_it() -> None:
    np.testing.assert_array_equal(quantize(blocks(IMAGE), psnr=25).image, quantize(IMAGE, psnr=25).image)
    whole = segment(IMAGE, 3, edge_weight=9.0, min_size=3)
    np.testing.assert_array_equal(segment(blocks(IMAGE), 3, edge_weight=9.0, min_size=3).labels, whole.labels)


def test_images_that_are_wrong_are_refused() -> None:
    with pytest.raises(ValueError, match="image must have at least one pixel that is finite and not nodata"):
        segment_blocks(blocks(np.full((20, 20), np.nan)), 2)
    with pytest.raises(ValueError, match=r"image of shape \(4,\) must be"):
        quantize(da.ones(4).reshape(4)[:, None][:, 0], 2)


def test_a_block_of_pixels_that_cannot_be_read_is_named() -> None:
    def read(number: int) -> NDArray[Any]:
        if number == 1:
            raise OSError("tape torn")
        return IMAGE[:10]

    parts = [da.from_delayed(dask.delayed(read)(number), (10, 24, 3), np.uint8) for number in range(3)]
    with pytest.raises(BlockError, match=r"block 1: cannot be read \(OSError: tape torn\)"):
        quantize(da.concatenate(parts), 4)

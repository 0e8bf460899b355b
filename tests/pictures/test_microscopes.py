"""Files as microscopes and ImageJ write them are read as the values that were measured."""

import struct
from pathlib import Path

import numpy as np
import pytest
import tifffile

import cvtimg
from cvtimg.pictures import image_info, read_pages
from cvtimg.pictures.formats.opening import Selection, selecting

VALUES = np.random.default_rng(5).integers(0, 256, (3, 20, 30), np.uint8)
TABLE = np.random.default_rng(6).integers(0, 65536, (3, 256), np.uint16)


@pytest.mark.parametrize("n_pages", [1, 3])
def test_a_color_table_of_imagej_shows_values_and_one_of_others_is_of_colors(tmp_path: Path, n_pages: int) -> None:
    described = f"ImageJ=1.54f\nimages={n_pages}\nslices={n_pages}\n"
    for name, description in (("table.tif", described), ("palette.tif", None)):
        tifffile.imwrite(
            tmp_path / name,
            VALUES[:n_pages],
            photometric="palette",
            colormap=TABLE,
            metadata=None,
            description=description,
        )
    for page, image in enumerate(read_pages(tmp_path / "table.tif").images):
        np.testing.assert_array_equal(image, VALUES[page])
    info = image_info(tmp_path / "table.tif")
    assert (info.bands, info.frames) == (("B1",), n_pages)
    assert read_pages(tmp_path / "palette.tif").images[0].shape == (20, 30, 3)


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_stack_with_one_directory_is_whole(tmp_path: Path, order: str) -> None:
    path = tmp_path / "one.tif"
    tifffile.imwrite(path, VALUES, imagej=True, byteorder=order, metadata={"axes": "ZYX"})
    content = bytearray(path.read_bytes())
    (at,) = struct.unpack(f"{order}I", content[4:8])
    (n_tags,) = struct.unpack(f"{order}H", content[at : at + 2])
    content[at + 2 + 12 * n_tags : at + 6 + 12 * n_tags] = bytes(4)
    path.write_bytes(content)
    assert (image_info(path).axes, image_info(path).shape) == ("ZYX", (3,))
    np.testing.assert_array_equal(read_pages(path).images, VALUES)


def test_a_page_or_a_series_among_others_of_any_size_is_read(tmp_path: Path) -> None:
    path, small = tmp_path / "two.ome.tif", VALUES[0, :9, :7].astype(np.uint16)
    with tifffile.TiffWriter(path, ome=True) as file:
        file.write(VALUES, metadata={"axes": "ZYX", "PhysicalSizeX": 0.5, "PhysicalSizeY": 0.5})
        file.write(small, metadata={"axes": "YX", "PhysicalSizeX": 2.0, "PhysicalSizeY": 2.0})
    np.testing.assert_array_equal(cvtimg.read_image(path, page=2), VALUES[1])
    np.testing.assert_array_equal(cvtimg.read_image(path, page=4), small)
    for series, shape, size in ((1, (3,), "0.5 um"), (2, (), "2 um")):
        with selecting(Selection(series=series)):
            info = image_info(path)
            assert (info.shape, str(info.pixel_size), len(read_pages(path).images)) == (shape, size, max(1, sum(shape)))
    for wrong in (Selection(page=5), Selection(series=3)):
        with selecting(wrong), pytest.raises(OSError, match=f"no (page|series) {wrong.page or wrong.series}"):
            read_pages(path)


@pytest.mark.parametrize(
    ("units", "size"), [("µm nm", "0.25 x 0.25 x 2 um"), ("nm µm", "0.25 x 0.25 x 2e+06 nm"), ("µm pixel", "None")]
)
def test_sizes_in_several_units_are_converted_to_that_of_x(tmp_path: Path, units: str, size: str) -> None:
    across, deep = units.split()
    sizes = {f"PhysicalSize{axis}": 0.25 for axis in "XY"} | {"PhysicalSizeZ": 2000.0}
    named = {f"PhysicalSize{axis}Unit": unit for axis, unit in zip("XYZ", (across, across, deep), strict=True)}
    tifffile.imwrite(tmp_path / "a.ome.tif", VALUES, metadata={"axes": "ZYX", **sizes, **named})
    assert str(image_info(tmp_path / "a.ome.tif").pixel_size) == size


def test_tiff_with_webp_and_arrays_with_axes_are_read(tmp_path: Path) -> None:
    pytest.importorskip("imagecodecs")
    zarr = pytest.importorskip("zarr")
    color = np.dstack(list(VALUES))
    tifffile.imwrite(
        tmp_path / "a.tif", color, photometric="rgb", compression="webp", compressionargs={"lossless": True}
    )
    np.testing.assert_array_equal(cvtimg.read_image(tmp_path / "a.tif"), color)
    zarr.save_array(str(tmp_path / "a.zarr"), VALUES)
    with selecting(Selection(axes="ZYX")):
        assert image_info(tmp_path / "a.zarr").axes == "ZYX"
        np.testing.assert_array_equal(read_pages(tmp_path / "a.zarr").images, VALUES)

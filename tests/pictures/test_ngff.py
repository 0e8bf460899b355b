"""Claims about OME-Zarr: its pages are those of the same stack as TIFF."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import RowOf

from cvtimg import read_image
from cvtimg.pictures import PixelSize, image_info, read_pages
from cvtimg.pictures.formats.opening import Selection, selecting

zarr = pytest.importorskip("zarr")
RNG = np.random.default_rng(5)
STACK = RNG.integers(0, 900, (2, 2, 3, 20, 30), np.uint16)


def written(folder: Path, version: str, values: np.ndarray[Any, Any] = STACK, letters: str = "tczyx") -> Path:
    """Write an image as the specification says, with a second level of half the size."""
    scale = {"t": 1.0, "c": 1.0, "z": 2.0, "y": 0.5, "x": 0.5}
    kinds = {"t": "time", "c": "channel"}
    units = {name: {"unit": "micrometer"} for name in "zyx"}
    axes = [{"name": name, "type": kinds.get(name, "space"), **units.get(name, {})} for name in letters]
    sizes = {"type": "scale", "scale": [scale[name] for name in letters]}
    levels = [{"path": path, "coordinateTransformations": [sizes]} for path in ("0", "1")]
    said: dict[str, Any] = {"multiscales": [{"version": version, "axes": axes, "datasets": levels}]}
    said["omero"] = {"channels": [{"label": "DAPI"}, {"label": "GFP"}]}
    form = 2 if version == "0.4" else 3
    path = folder / f"s{version}.ome.zarr"
    group = zarr.open_group(str(path), mode="w", zarr_format=form)
    group.attrs.update(said if form == 2 else {"ome": {"version": version, **said}})
    for name, level in (("0", values), ("1", values[..., ::2, ::2])):
        group.create_array(name, data=level)
    return path


@pytest.mark.parametrize("version", ["0.4", "0.5"])
def test_axes_channels_and_sizes_are_read(tmp_path: Path, version: str) -> None:
    path = written(tmp_path, version)
    found = image_info(path)
    assert (found.axes, found.shape, found.channels, found.frames) == ("TCZYX", (2, 2, 3), ("DAPI", "GFP"), 12)
    assert (found.width, found.height, found.mode) == (30, 20, "uint16")
    assert found.pixel_size == PixelSize(0.5, 0.5, "um", 2.0)
    pages = read_pages(path)
    np.testing.assert_array_equal(np.stack(pages.images).reshape(STACK.shape), STACK)
    assert (pages.axes, pages.shape, pages.pixel_size) == ("TCZ", (2, 2, 3), found.pixel_size)
    with selecting(Selection(channel="GFP", t=2)):
        np.testing.assert_array_equal(np.stack(read_pages(path).images), STACK[1, 1])
        assert image_info(path).axes == "ZYX"
    with pytest.raises(OSError, match="pages along TCZ, where one image is expected"):
        read_image(path)
    with selecting(Selection(channel="GFP", t=2, z=1)):
        np.testing.assert_array_equal(read_image(path), STACK[1, 1, 0])


def test_an_image_without_other_axes_is_one_page(tmp_path: Path) -> None:
    path = written(tmp_path, "0.5", STACK[0, 0, 0], "yx")
    np.testing.assert_array_equal(read_image(path), STACK[0, 0, 0])
    assert image_info(path).frames == 1


def test_commands_take_it_as_a_stack(here: Path, row_of: RowOf) -> None:
    name = written(here, "0.4").name
    assert row_of("segment", name, "--t", 1, "-k", 2, "-o", "l.tif", "--table", "t.csv")["pages"] == 3
    labels = image_info("l.tif")
    assert (labels.axes, labels.pixel_size) == ("ZYX", PixelSize(0.5, 0.5, "um", 2.0))
    assert {"z", "mean_DAPI", "std_GFP", "area_um2"} <= {*Path("t.csv").read_text().splitlines()[0].split(",")}
    row_of("quantize", name, "--channel", "GFP", "-k", 3, "-o", "q.tif")
    assert image_info("q.tif").axes == "TZYX"


def test_a_damaged_one_is_an_error_in_one_line(tmp_path: Path) -> None:
    path = written(tmp_path, "0.4")
    (path / "0" / ".zarray").write_text("{")
    with pytest.raises(OSError, match=r"s0\.4\.ome\.zarr: "):
        read_pages(path)

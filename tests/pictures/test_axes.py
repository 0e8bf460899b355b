"""Axes, channels and pixel sizes are what files or people say, and what cannot be meant is one clear error."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st

from cvtimg import read_image
from cvtimg.pictures import PixelSize, image_info, read_pages
from cvtimg.pictures.formats.opening import Selection, selecting

STACK = np.random.default_rng(3).integers(0, 65536, (4, 2, 9, 12), np.uint16)
SIZE = PixelSize(0.325, 0.325, "um", 2.0)


@pytest.fixture(params=["imagej", "ome"])
def micrograph(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Write a stack of two channels as ImageJ or OME do."""
    path = tmp_path / f"{request.param}.tif"
    if request.param == "imagej":
        metadata = {"axes": "ZCYX", "unit": "um", "spacing": 2.0, "Labels": ["DAPI", "GFP"] * 4}
        tifffile.imwrite(path, STACK, imagej=True, resolution=(1 / 0.325, 1 / 0.325), metadata=metadata)
    else:
        sizes = {"PhysicalSizeX": 0.325, "PhysicalSizeY": 0.325, "PhysicalSizeZ": 2.0}
        metadata = {"axes": "ZCYX", "Channel": {"Name": ["DAPI", "GFP"]}, **sizes}
        tifffile.imwrite(path, STACK, ome=True, metadata=metadata)
    return path


def test_the_header_tells_axes_channels_and_the_size_of_pixels(micrograph: Path) -> None:
    info = image_info(micrograph)
    assert (info.axes, info.shape, info.channels, info.frames) == ("ZCYX", (4, 2), ("DAPI", "GFP"), 8)
    assert str(info.pixel_size) == str(SIZE) == str(read_pages(micrograph).pixel_size)


@pytest.mark.parametrize(
    ("chosen", "pages"),
    [
        (Selection(channel="GFP"), STACK[:, 1]),
        (Selection(channel="1", z=3), STACK[2:3, 0]),
        (Selection(z=2), STACK[1]),
        (Selection(axes="TCYX", t=4), STACK[3]),
    ],
)
def test_pages_are_chosen_by_names_and_places(micrograph: Path, chosen: Selection, pages: Any) -> None:
    with selecting(chosen):
        np.testing.assert_array_equal(np.stack(read_pages(micrograph).images), pages)
        assert image_info(micrograph).frames == len(pages)
        if len(pages) == 1:
            np.testing.assert_array_equal(read_image(micrograph), pages[0])
        else:
            with pytest.raises(OSError, match=rf"has {len(pages)} pages along [ZC], where one image is expected"):
                read_image(micrograph)


@pytest.mark.parametrize("n_pages", [1, 3])
def test_the_only_channel_of_a_file_has_its_name(tmp_path: Path, n_pages: int) -> None:
    path, planes = tmp_path / "a.tif", STACK[:n_pages, 0].squeeze()
    metadata = {"axes": "ZYX"[-planes.ndim :], "Channel": {"Name": "DAPI"}, "PhysicalSizeX": 0.5}
    tifffile.imwrite(path, planes, ome=True, metadata=metadata, photometric="minisblack")
    for chosen in (Selection(), Selection(channel="DAPI")):
        with selecting(chosen):
            assert image_info(path).channels == read_pages(path).channels == ("DAPI",)
            assert image_info(path).pixel_size == read_pages(path).pixel_size == PixelSize(0.5, 0.5)
            np.testing.assert_array_equal(np.stack(read_pages(path).images).squeeze(), planes)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_file_of_zeiss_has_the_axes_channels_and_sizes_that_its_own_library_wrote(tmp_path: Path) -> None:
    czi = pytest.importorskip("pylibCZIrw.czi")
    pytest.importorskip("bioio_czi")
    path = tmp_path / "a.czi"
    with czi.create_czi(str(path)) as file:
        for z, c in np.ndindex(4, 2):
            file.write(data=STACK[z, c, :, :, None], plane={"Z": z, "C": c, "T": 0})
        sizes = {"scale_x": 0.325e-6, "scale_y": 0.325e-6, "scale_z": 2e-6}
        file.write_metadata(channel_names={0: "DAPI", 1: "GFP"}, **sizes)
    info = image_info(path)
    assert (info.axes, info.shape, info.channels, info.format) == ("CZYX", (2, 4), ("DAPI", "GFP"), "CZI")
    assert str(info.pixel_size) == str(SIZE)
    with selecting(Selection(channel="GFP", z=3)):
        np.testing.assert_array_equal(read_image(path), STACK[2, 1])


@pytest.mark.parametrize("suffix", [".czi", ".nd2"])
def test_files_of_microscopes_name_what_reads_them(tmp_path: Path, suffix: str) -> None:
    if find_spec(f"bioio_{suffix[1:]}"):
        pytest.skip("it is installed")
    with pytest.raises(OSError, match=rf"a{suffix}: needs bioio_.*pip install 'cvtimg\[microscopes\]'"):
        image_info(tmp_path / f"a{suffix}")


def test_channels_become_bands(micrograph: Path) -> None:
    joined = read_pages(micrograph).joined()
    assert (joined.axes, joined.shape, joined.channels) == ("Z", (4,), ("DAPI", "GFP"))
    np.testing.assert_array_equal(np.stack(joined.images), np.moveaxis(STACK, 1, -1))


def test_an_array_has_the_axes_that_are_named(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", STACK)
    with selecting(Selection(axes="ZCYX", channel="2", pixel_size=SIZE)):
        info, pages = image_info(tmp_path / "a.npy"), read_pages(tmp_path / "a.npy")
    assert (info.axes, info.frames, info.pixel_size, pages.pixel_size) == ("ZYX", 4, SIZE, SIZE)
    np.testing.assert_array_equal(np.stack(pages.images), STACK[:, 1])


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        (Selection(channel="RFP"), r"has 2 channels \(DAPI, GFP\), and no channel RFP$"),
        (Selection(channel="3"), r"has 2 channels \(DAPI, GFP\), and no channel 3$"),
        (Selection(z=5), r"has 4 planes, and no plane 5$"),
        (Selection(t=1), r"has the axes ZCYX, without T; --axes names them$"),
        (Selection(axes="ZYX"), r"has the axes ZCYX, of 4 x 2 pages; --axes ZYX must have a letter for each$"),
        (Selection(axes="CCYX"), r"; --axes CCYX must have a letter for each$"),
    ],
)
def test_what_a_stack_does_not_have_is_named(micrograph: Path, chosen: Selection, message: str) -> None:
    for read in (image_info, read_pages):
        with selecting(chosen), pytest.raises(OSError, match=message):
            read(micrograph)


def test_a_band_of_a_color_image_is_a_channel(tmp_path: Path) -> None:
    color = np.random.default_rng(1).integers(0, 256, (5, 6, 3), np.uint8)
    tifffile.imwrite(tmp_path / "a.tif", color, photometric="rgb")
    with selecting(Selection(channel="G")):
        np.testing.assert_array_equal(read_image(tmp_path / "a.tif"), color[:, :, 1])
        assert image_info(tmp_path / "a.tif").bands == ("G",)
    wrong = r"has 3 channels \(R, G, B\), and no channel 4"
    with selecting(Selection(channel="4")), pytest.raises(OSError, match=wrong):
        read_image(tmp_path / "a.tif")


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("0.325um", PixelSize(0.325, 0.325)),
        ("0.3x0.4 \u00b5m", PixelSize(0.3, 0.4)),
        ("1e-2X.02x3NM", PixelSize(0.01, 0.02, "NM", 3)),
    ],
)
def test_sizes_are_read_as_they_are_typed(text: str, size: PixelSize) -> None:
    assert PixelSize.parse(text) == size


@pytest.mark.parametrize("text", ["3", "um", "0um", "-1um", "1x2x3x4um", "nanum", "1 2um", ""])
def test_what_is_no_size_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="must be a size > 0 and a unit, such as"):
        PixelSize.parse(text)


@given(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6), st.none() | st.floats(1e-6, 1e6), st.sampled_from(["um", "nm"]))
def test_a_size_is_what_both_conventions_say_of_it(x: float, y: float, z: float | None, unit: str) -> None:
    for kind in ("imagej", "ome"):
        again = PixelSize.of(PixelSize(x, y, unit, z).scale(kind))
        assert again is not None
        assert (again.x, again.y, again.z, again.unit) == (pytest.approx(x), pytest.approx(y), z, unit)

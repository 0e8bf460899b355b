"""Claims about files for other programs: these read the same places, planes and units from them."""

from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest
import tifffile
from PIL import Image
from skimage.draw import polygon2mask

from cvtimg._shared.types import Array
from cvtimg.cli.app import main
from cvtimg.pictures import read_pages

RNG = np.random.default_rng(12)
DOWN, RIGHT = np.mgrid[:40, :60]
#: Two frames of three planes with two discs, which move.
FRAMES = np.stack(
    [
        [
            np.uint8(30 + 150 * np.any([np.hypot(DOWN - 20, RIGHT - x - t) < 9 - z for x in (15, 40)], axis=0))
            for z in range(3)
        ]
        for t in range(2)
    ]
)
SIZES = {"PhysicalSizeX": 0.325, "PhysicalSizeY": 0.325, "PhysicalSizeZ": 1.5}


@pytest.fixture(params=["imagej", "ome"])
def stack(request: pytest.FixtureRequest, here: Path) -> str:
    """Write the frames as a program does, and segment them."""
    if request.param == "imagej":
        metadata: dict[str, Any] = {"axes": "TZYX", "unit": "um", "spacing": 1.5}
        tifffile.imwrite("s.tif", FRAMES, imagej=True, resolution=(1 / 0.325,) * 2, metadata=metadata)
    else:
        tifffile.imwrite("s.tif", FRAMES, ome=True, metadata={"axes": "TZYX", **SIZES}, photometric="minisblack")
    files = ["-o", "l.tif", "--contours", "r.zip", "--masks", "m.tif"]
    assert main(["segment", "s.tif", "--objects", *files, "--quiet"]) == 0
    return str(request.param)


def labels() -> dict[tuple[int, int], Array]:
    pages = read_pages("l.tif")
    return {(at["t"], at["z"]): page for at, page in zip(pages.places, pages.images, strict=True)}


def test_fiji_gets_a_region_for_each_label_at_its_plane_and_frame(stack: str) -> None:
    roifile = pytest.importorskip("roifile")
    found: dict[Any, Array] = {}
    for region in roifile.roiread("r.zip"):
        ring = region.coordinates()
        own = polygon2mask((40, 60), ring[:, ::-1] - 0.5)
        at = (region.t_position, region.z_position)
        found[at] = found.get(at, np.zeros((40, 60), int)) + own * int(region.name.split("-")[2])
    for at, own in labels().items():
        np.testing.assert_array_equal(found[at], own)


def test_tifffile_reads_axes_and_sizes_of_labels_and_masks(stack: str) -> None:
    for name, bits in (("l.tif", 8), ("m.tif", 16)):
        with tifffile.TiffFile(name) as tiff:
            assert (tiff.series[0].axes, tiff.series[0].shape) == ("TZYX", (2, 3, 40, 60))
            assert tiff.pages.first.aspage().bitspersample == bits
            np.testing.assert_array_equal(tiff.asarray(), np.stack(list(labels().values())).reshape(2, 3, 40, 60))
            if stack == "imagej":
                assert ((tiff.imagej_metadata or {})["unit"], (tiff.imagej_metadata or {})["spacing"]) == ("um", 1.5)
                assert tiff.pages.first.aspage().get_resolution() == pytest.approx((1 / 0.325,) * 2)
            else:
                assert all(f'{name}="{size}"' in (tiff.ome_metadata or "") for name, size in SIZES.items())


@pytest.mark.filterwarnings("ignore")
def test_bioio_reads_the_axes_and_sizes_of_labels(stack: str) -> None:
    plugin = pytest.importorskip("bioio_ome_tiff" if stack == "ome" else "bioio_tifffile")
    image = pytest.importorskip("bioio").BioImage("l.tif", reader=plugin.Reader)
    assert (image.dims.order, image.shape) == ("TCZYX", (2, 1, 3, 40, 60))
    assert tuple(image.physical_pixel_sizes) == pytest.approx((1.5, 0.325, 0.325))


def test_masks_of_an_image_are_gray_levels_in_16_bits(here: Path) -> None:
    Image.fromarray(FRAMES[0, 0]).save("a.png")
    assert main(["segment", "a.png", "--objects", "--masks", "a_cp_masks.png", "-o", "l.png", "--quiet"]) == 0
    with Image.open("a_cp_masks.png") as image:
        assert image.mode.startswith("I")
        np.testing.assert_array_equal(np.array(image), np.array(Image.open("l.png")))


def test_regions_at_fractions_of_pixels_and_in_pieces(here: Path) -> None:
    roifile = pytest.importorskip("roifile")
    Image.fromarray(FRAMES[0, 0]).save("a.png")
    assert main(["segment", "a.png", "-k", "2", "--subpixel", "--contours", "a.zip", "--quiet"]) == 0
    with ZipFile("a.zip") as archive:
        assert archive.namelist() == ["00001.roi", "00002.roi", "00002-2.roi"]
    disc = roifile.roiread("a.zip")[1].coordinates()
    assert not np.array_equal(disc, np.rint(disc))
    assert disc.mean(axis=0) == pytest.approx((15.5, 20.5), abs=0.2)

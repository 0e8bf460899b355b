"""Claims about objects in volumes."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from reference import same_partition

from cvtimg import segment
from cvtimg._shared.types import Array, Bytes, Ints
from cvtimg.labels import region_table
from cvtimg.pictures import PixelSize, open_stack
from cvtimg.segmentation import count_objects, counting
from cvtimg.segmentation.files import divide_stack

RNG = np.random.default_rng(8)
#: Centers (z, y, x) and radii of balls, in pixels of a plane; the first two touch.
BALLS = [(18, 20, 18, 10), (24, 20, 35, 10), (20, 44, 50, 8)]


def balls(spacing: float, *, noise: float = 15) -> tuple[Bytes, Ints]:
    """Draw balls in planes this far apart; return the volume and their labels."""
    down = np.arange(0, 44, spacing)[:, None, None]
    y, x = np.mgrid[:60, :70]
    away = np.stack([np.sqrt((down - a) ** 2 + (y - b) ** 2 + (x - c) ** 2) / r for a, b, c, r in BALLS])
    truth = np.where(away.min(axis=0) < 1, away.argmin(axis=0) + 1, 0).astype(np.int32)
    values = 40 + 120 * (truth > 0) + RNG.normal(0, noise, truth.shape)
    return values.clip(0, 255).astype(np.uint8), truth


def agreement(found: Ints, truth: Ints) -> float:
    """Return the share of right labels, of the pixels that are in objects of either."""
    either = (found > 0) | (truth > 0)
    return same_partition(found[either], truth[either])


@pytest.mark.parametrize("spacing", [1.0, 4.0])
def test_touching_balls_are_split_however_far_planes_are_apart(spacing: float) -> None:
    volume, truth = balls(spacing)
    found = count_objects(volume, spacing=(spacing / 2, 0.5, 0.5))
    assert found.n_segments == 3
    assert agreement(found.labels, truth) > 0.9
    assert found.counting is not None
    assert found.counting.radius == pytest.approx(10, rel=0.25)


@pytest.mark.slow
def test_tiles_give_the_objects_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    volume, _ = balls(4.0)
    volume = np.tile(volume, (1, 3, 3))
    whole = count_objects(volume, spacing=(4, 1, 1))
    monkeypatch.setattr(counting, "SETTINGS", counting.Settings(tile=11 * 100**2))
    tiled = count_objects(volume, spacing=(4, 1, 1))
    assert whole.n_segments == tiled.n_segments == 27
    assert agreement(tiled.labels, whole.labels) > 0.95


def test_masked_voxels_belong_to_no_object() -> None:
    volume, _ = balls(4.0)
    mask = np.ones(volume.shape, bool)
    mask[:, :, 27:] = False
    found = count_objects(volume, spacing=(4, 1, 1), mask=mask)
    assert found.labels[:, :, :27].any()
    assert not found.labels[:, :, 27:].any()


@pytest.mark.parametrize(
    ("image", "spacing", "message"),
    [
        (np.zeros((4, 4)), (1, 1, 1), "image"),
        (np.zeros((4, 4, 4)), (1, 1), "three distances > 0"),
        (np.zeros((4, 4, 4)), (1, 1, 0), "three distances > 0"),
        (np.zeros((4, 4, 4)), (1, 1, 2), "the same along H and W"),
        (np.full((4, 4, 4), np.nan), (1, 1, 1), "at least one pixel"),
        (np.zeros((4, 4, 0)), (1, 1, 1), "image"),
    ],
)
def test_what_is_no_volume_is_refused(image: Array, spacing: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        count_objects(image, spacing=spacing)


def test_the_table_of_a_ball_is_what_geometry_says() -> None:
    _, truth = balls(1.0)
    own = (truth == 3).astype(np.int32)
    table = region_table(
        own, np.stack([own * 7, own * 9], axis=3), pixel_size=PixelSize(0.5, 0.5, z=0.5), channels="AB"
    )
    ball = BALLS[2]
    radius = ball[3] / 2
    assert table["volume_um3"] == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.03)
    assert table["surface_um2"] == pytest.approx(4 * np.pi * radius**2, rel=0.03)
    assert table["equivalent_diameter_um"] == pytest.approx(2 * radius, rel=0.02)
    center = [float(table[f"{axis}_um"][0]) for axis in "zyx"]
    assert center == pytest.approx([(at + 0.5) / 2 for at in ball[:3]], abs=0.05)
    assert (table["mean_A"].tolist(), table["mean_B"].tolist(), table["std_A"].tolist()) == ([7.0], [9.0], [0.0])
    assert [table[side][0] for side in ("front", "back", "left", "right")] == [13, 28, 43, 58]


@pytest.mark.parametrize(("radius", "apart"), [(5, 1.0), (5, 2.0), (9, 4.0), (6, 6.0), (14, 6.0)])
def test_surfaces_of_balls_have_no_bias_however_far_planes_are_apart(radius: int, apart: float) -> None:
    y, x = np.mgrid[:40, :40]
    errors = []
    for shift in np.random.default_rng(3).uniform(-0.5, 0.5, (32, 3)):
        down = np.arange(0, 48, apart)[:, None, None]
        ball = (down - 24 - apart * shift[0]) ** 2 + (y - 20 - shift[1]) ** 2 + (x - 20 - shift[2]) ** 2 < radius**2
        surface = region_table(ball.astype(int), ball, pixel_size=PixelSize(0.5, 0.5, z=apart / 2))["surface_um2"][0]
        errors.append(surface / (np.pi * radius**2) - 1)
    assert abs(np.mean(errors)) < 0.03


def test_planes_of_a_file_are_segmented_as_a_volume_if_their_distance_is_known(tmp_path: Path) -> None:
    volume, _ = balls(2.0, noise=40)
    for spacing, depth in (({"spacing": 1.0}, 2), ({}, 99)):
        metadata = {"axes": "ZYX", "unit": "um", **spacing}
        tifffile.imwrite(tmp_path / "a.tif", volume, imagej=True, resolution=(2, 2), metadata=metadata)
        stack = open_stack(tmp_path / "a.tif", frames=False)
        found = divide_stack(stack, partial(segment, n_segments=2), together=True, apart=3)
        # As one image, planes are not held as those of a volume are, and a few pixels end elsewhere.
        assert np.mean(found.labels == segment(volume, 2, spacing=(depth, 1, 1)).labels) > 0.999

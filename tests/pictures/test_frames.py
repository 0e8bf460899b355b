"""An animation that was written is the one that was given: every frame, its duration, and how often all are played."""

import itertools
import re
import struct
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import GifImagePlugin, Image, ImageSequence

from cvtimg import quantize, quantize_frames, read_image
from cvtimg._shared.types import Array
from cvtimg.pictures import Frames, read_frames, read_pages, write_frames
from cvtimg.pictures.files import write_image
from cvtimg.pictures.formats.opening import Selection, selecting
from cvtimg.pictures.frames import is_animated

SUFFIXES = [".gif", ".png", ".webp"]
DURATIONS = (40.0, 70.0, 1000.0, 10.0, 40.0)
RNG = np.random.default_rng(21)
PALETTE = RNG.integers(0, 256, (16, 3), np.uint8)


def scene(n_frames: int = 5) -> Array:
    """Return indices of a square that walks over a quiet ground, and stands still from the third frame on."""
    frames = np.tile(RNG.integers(0, 4, (12, 17)), (n_frames, 1, 1))
    for number in range(n_frames):
        at = 2 * min(number, 2)
        frames[number, at : at + 4, at + 3 : at + 7] = 9 + RNG.integers(0, 3)
    frames[3:4] = frames[2]
    return frames


def animation(plays: int = 0) -> Frames:
    return Frames(tuple(scene()), DURATIONS, plays)


def assert_same(path: Path, images: Any, durations: Any = DURATIONS, plays: int = 0) -> None:
    again = read_frames(path)
    assert again.durations == pytest.approx(durations)
    assert again.plays == plays
    assert len(again.images) == len(images)
    for got, wanted in zip(again.images, images, strict=True):
        np.testing.assert_array_equal(got, wanted)


@pytest.mark.parametrize(("plays", "sizes"), [(0, [16] * 5), (1, [16] * 5), (3, [256, 16, 255, 17, 16])])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_frame_comes_back_with_its_duration(tmp_path: Path, suffix: str, plays: int, sizes: list[int]) -> None:
    frames = animation(plays)
    palettes = [PALETTE if plays == 0 else RNG.integers(0, 256, (size, 3), np.uint8) for size in sizes]
    write_frames(tmp_path / f"a{suffix}", frames, palettes=palettes if plays else PALETTE)
    wanted = [palette[image] for palette, image in zip(palettes, frames.images, strict=True)]
    assert_same(tmp_path / f"a{suffix}", wanted, plays=plays)
    with Image.open(tmp_path / f"a{suffix}") as image:
        seen = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(image)]
    np.testing.assert_array_equal(seen, wanted)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_single_frame_is_read_by_its_number(tmp_path: Path, suffix: str) -> None:
    frames, path = animation(), tmp_path / f"a{suffix}"
    write_frames(path, frames, palettes=PALETTE)
    np.testing.assert_array_equal(read_image(path, page=2), PALETTE[frames.images[1]])
    with selecting(Selection(page=2)):
        np.testing.assert_array_equal(read_pages(path).images[0], PALETTE[frames.images[1]])
    with pytest.raises(OSError, match="has 5 pages, and no page 6"):
        read_image(path, page=6)


@pytest.mark.parametrize("suffix", [".png", ".webp"])
@pytest.mark.parametrize("channels", [(), (3,), (4,)])
def test_frames_without_palette_come_back(tmp_path: Path, suffix: str, channels: tuple[int, ...]) -> None:
    images = tuple(RNG.integers(0, 256, (6, 9, *channels), np.uint8) for _ in range(3))
    write_frames(tmp_path / f"a{suffix}", Frames(images, (33.4, 33.3, 1), 0))
    grey_as_rgb = suffix == ".webp" and not channels
    wanted = [np.dstack([image] * 3) if grey_as_rgb else image for image in images]
    durations = (33.4, 33.3, 1) if suffix == ".png" else (33, 34, 1)
    assert_same(tmp_path / f"a{suffix}", wanted, durations)


def over_green(image: Array) -> Array:
    """Return what is seen of a picture whose pixels are opaque or clear."""
    if image.shape[2] == 3:
        return image
    return np.where(image[..., 3:] > 0, image[..., :3], np.array([0, 255, 0], np.uint8))


def test_durations_that_a_gif_cannot_tell_do_not_drift(tmp_path: Path) -> None:
    images = tuple(RNG.integers(0, 16, (4, 4)) for _ in range(30))
    write_frames(tmp_path / "a.gif", Frames(images, (100 / 3,) * 30, 0), palettes=PALETTE)
    durations = read_frames(tmp_path / "a.gif").durations
    assert set(durations) == {30.0, 40.0}
    ends = np.array([*itertools.accumulate(durations)])
    assert np.abs(ends - 100 / 3 * np.arange(1, 31)).max() <= 5


@pytest.mark.parametrize("duration", [0, 65_535, 65_536, 3_600_000, 16_777_215])
@pytest.mark.parametrize("suffix", [".png", ".webp"])
def test_long_durations_are_told(tmp_path: Path, suffix: str, duration: int) -> None:
    images = tuple(RNG.integers(0, 16, (4, 4)) for _ in range(2))
    write_frames(tmp_path / f"a{suffix}", Frames(images, (duration, 10), 0), palettes=PALETTE)
    assert read_frames(tmp_path / f"a{suffix}").durations[0] == pytest.approx(duration, rel=1e-3)


def test_the_files_are_small(tmp_path: Path) -> None:
    """What stands still costs next to nothing, and pixels of a PNG are indices."""
    still = RNG.integers(0, 16, (64, 64))
    images = [still.copy() for _ in range(10)]
    for number, image in enumerate(images):
        image[number, number] = (image[number, number] + 1) % 16
    for suffix in SUFFIXES:
        write_frames(tmp_path / f"one{suffix}", Frames((still, still), (10, 10), 0), palettes=PALETTE)
        write_frames(tmp_path / f"all{suffix}", Frames(tuple(images), (10,) * 10, 0), palettes=PALETTE)
        one, ten = ((tmp_path / f"{name}{suffix}").stat().st_size for name in ("one", "all"))
        assert ten < 1.5 * one
    assert (tmp_path / "all.png").read_bytes()[24:26] == bytes([4, 3])


# --- files of other programs


@pytest.mark.parametrize("disposal", [1, 2, 3])
def test_disposal_of_a_gif_is_honoured(tmp_path: Path, disposal: int) -> None:
    """Three squares, the second in the middle of the first, over nothing."""
    squares = [np.ones((10, 10), np.uint8), np.zeros((10, 10), np.uint8), np.zeros((10, 10), np.uint8)]
    squares[1][3:7, 3:7] = 2
    squares[2][0, 0] = 3
    pictures = [Image.fromarray(square) for square in squares]
    for picture in pictures:
        picture.putpalette(bytes([0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0, 255]))
    options: dict[str, Any] = {"save_all": True, "append_images": pictures[1:], "duration": [50, 60, 70], "loop": 0}
    pictures[0].save(tmp_path / "a.gif", transparency=0, disposal=disposal, optimize=False, **options)
    frames = read_frames(tmp_path / "a.gif")
    assert frames.durations == (50, 60, 70)
    result = quantize_frames(frames, 16)
    shown, palettes = result.content
    write_frames(tmp_path / "b.gif", shown, palettes=palettes)
    write_frames(tmp_path / "b.png", shown, palettes=palettes)
    for again in (read_frames(tmp_path / "b.gif"), read_frames(tmp_path / "b.png")):
        for got, wanted in zip(again.images, frames.images, strict=True):
            np.testing.assert_array_equal(over_green(got), over_green(wanted))


def test_the_default_picture_of_an_apng_is_no_frame(tmp_path: Path) -> None:
    pictures = [Image.fromarray(PALETTE[image]) for image in scene(4)]
    options: dict[str, Any] = {"save_all": True, "append_images": pictures[1:], "duration": [50, 60, 70]}
    pictures[0].save(tmp_path / "a.png", default_image=True, **options)
    frames = read_frames(tmp_path / "a.png")
    assert len(frames.images) < 4
    np.testing.assert_array_equal(frames.images[0], np.asarray(pictures[1]))


def test_a_picture_is_one_frame(tmp_path: Path) -> None:
    write_image(tmp_path / "a.tif", RNG.integers(0, 65536, (4, 5, 3)).astype(np.uint16))
    frames = read_frames(tmp_path / "a.tif")
    np.testing.assert_array_equal(frames.images[0], read_image(tmp_path / "a.tif"))
    assert (len(frames.images), frames.durations, frames.plays) == (1, (0.0,), 1)
    assert not is_animated(tmp_path / "a.tif")


def test_pages_are_no_frames(tmp_path: Path) -> None:
    pages = [Image.fromarray(PALETTE[image]) for image in scene(3)]
    pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:])
    assert not is_animated(tmp_path / "a.tif")
    with pytest.raises(OSError, match=r"a\.tif: has 3 pages, where one image is expected"):
        read_frames(tmp_path / "a.tif")


@pytest.mark.parametrize("fraction", [0.0, 0.1, 0.5, 0.9])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_truncated_animation_is_named_with_the_reason(tmp_path: Path, suffix: str, fraction: float) -> None:
    path = tmp_path / f"a{suffix}"
    images = tuple(RNG.integers(0, 16, (40, 40)) for _ in range(5))
    write_frames(path, Frames(images, DURATIONS, 0), palettes=PALETTE)
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * fraction)])
    with pytest.raises(OSError, match=f"^{re.escape(str(path))}: is [^\n]+$"):
        read_frames(path)


# --- what does not fit


@pytest.mark.parametrize(
    ("images", "durations", "plays", "reason"),
    [
        ((), (), 0, "0 images and 0 durations must be equally many, at least one"),
        ((PALETTE,), (1, 2), 0, "1 images and 2 durations"),
        ((PALETTE, PALETTE[1:]), (1, 2), 0, r"images of shapes \[\(15, 3\), \(16, 3\)\] must have the same shape"),
        ((PALETTE,), (-1,), 0, r"durations=\(-1,\) must be finite milliseconds"),
        ((PALETTE,), (float("nan"),), 0, "must be finite milliseconds"),
        ((PALETTE,), (1,), -1, "plays=-1 must be >= 0"),
    ],
)
def test_frames_that_make_no_sense_are_refused(images: Any, durations: Any, plays: int, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        Frames(images, durations, plays)


@pytest.mark.parametrize(
    ("name", "images", "palettes", "reason"),
    [
        ("a.jpg", scene(), PALETTE, r"suffix='\.jpg' must be one of \.gif, \.png, \.webp"),
        ("a.gif", PALETTE[scene()], None, r"\.gif holds frames of at most 256 colors"),
        ("a.gif", scene(), np.full((16, 4), 128, np.uint8), r"\.gif cannot hold half transparency; use one of \.png"),
        ("a.png", scene(), PALETTE[:9], r"indices in 0\.\.\d+ must be in 0\.\.8"),
        ("a.png", scene(), [PALETTE] * 4, "4 palettes must be one for each of the 5 frames"),
        ("a.png", scene(), PALETTE[:, :2], r"palette of shape \(16, 2\)"),
        ("a.png", PALETTE[scene()].astype(np.uint16), None, "images without palettes must be"),
    ],
)
def test_what_a_format_cannot_hold_is_refused_and_leaves_nothing(
    tmp_path: Path, name: str, images: Any, palettes: Any, reason: str
) -> None:
    with pytest.raises(ValueError, match=reason):
        write_frames(tmp_path / name, Frames(tuple(images), DURATIONS, 0), palettes=palettes)
    assert list(tmp_path.iterdir()) == []


# --- in few colors


def film(photograph: Array, n_frames: int = 4) -> Frames:
    images = tuple(photograph[8 * number : 8 * number + 48, 60:124].copy() for number in range(n_frames))
    return Frames(images, tuple(range(10, 10 * n_frames + 1, 10)), 0)


def test_one_palette_is_that_of_the_frames_side_by_side(photograph: Array) -> None:
    frames = film(photograph)
    result = quantize_frames(frames, 12)
    beside = quantize(np.concatenate(frames.images), 12)
    for one in result.results:
        np.testing.assert_array_equal(one.palette, beside.palette)
    np.testing.assert_array_equal(np.concatenate([one.image for one in result.results]), beside.image)
    assert result.energy == pytest.approx(beside.energy)
    assert (result.psnr, result.n_distinct) == (pytest.approx(beside.psnr), beside.n_distinct)


def test_a_palette_for_each_frame_is_that_of_the_frame_and_has_less_error(photograph: Array) -> None:
    frames = film(photograph)
    result = quantize_frames(frames, 12, per_frame=True)
    for one, image in zip(result.results, frames.images, strict=True):
        np.testing.assert_array_equal(one.image, quantize(image, 12).image)
    assert result.energy < quantize_frames(frames, 12).energy


def test_more_than_256_colors_are_frames_without_palettes(tmp_path: Path, photograph: Array) -> None:
    result = quantize_frames(film(photograph), 300)
    shown, palettes = result.content
    assert palettes is None
    write_frames(tmp_path / "a.png", shown)
    assert_same(tmp_path / "a.png", [one.image for one in result.results], shown.durations)


@pytest.mark.parametrize("boxes", [((0, 0, 20, 10), (10, 5, 20, 10)), ((0, 0, 5, 5), (18, 8, 10, 10))])
def test_frames_that_leave_the_canvas_are_cut_at_it(tmp_path: Path, boxes: tuple[tuple[int, ...], ...]) -> None:
    content = b"GIF89a" + struct.pack("<HHBBB", 20, 10, 0xF0, 0, 0) + bytes([0, 0, 0, 255, 255, 255])
    for left, top, width, height in boxes:
        picture = Image.fromarray(np.ones((height, width), np.uint8))
        picture.putpalette([0, 0, 0, 255, 255, 255])
        content += b"".join(GifImagePlugin.getdata(picture, (left, top), include_color_table=False))
    (tmp_path / "a.gif").write_bytes(content + b";")
    frames = read_frames(tmp_path / "a.gif")
    assert [image.shape[:2] for image in frames.images] == [(10, 20)] * 2
    assert (frames.images[1][9, 19, :3] == 255).all()
    write_image(tmp_path / "b.png", frames.images[1])


def gif_of(*frames: tuple[int, tuple[int, int, int, int]]) -> bytes:
    """Return a GIF of 8 x 8 pixels of red boxes (left, top, width, height) that are disposed of in a way."""
    parts = [b"GIF89a" + struct.pack("<HHBBB", 8, 8, 0x80, 1, 0) + bytes([255, 0, 0, 0, 0, 255])]
    for disposal, box in frames:
        body = BytesIO()
        Image.fromarray(np.zeros((box[3], box[2]), np.uint8)).save(body, "GIF")
        data = body.getvalue()
        parts.append(b"!\xf9\x04" + bytes([disposal << 2, 5, 0, 0]) + b"\0")
        parts.append(b"," + struct.pack("<HHHHB", *box, 0) + data[data.index(b",") + 10 : -1])
    return b"".join(parts) + b";"


def test_what_frames_of_a_gif_do_not_cover_or_leave_is_transparent(tmp_path: Path) -> None:
    (tmp_path / "one.gif").write_bytes(gif_of((0, (1, 2, 3, 4))))
    alpha = read_image(tmp_path / "one.gif")[..., 3] > 0
    assert alpha[2:6, 1:4].all()
    assert alpha.sum() == 12
    (tmp_path / "a.gif").write_bytes(gif_of((2, (0, 0, 4, 4)), (3, (4, 4, 2, 2)), (1, (6, 6, 4, 4)), (1, (0, 0, 1, 1))))
    covered = [int((image[..., 3] > 0).sum()) for image in read_frames(tmp_path / "a.gif").images]
    assert covered == [16, 4, 4, 5]

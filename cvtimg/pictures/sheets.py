"""Sprite sheets: the frames of an animation in the cells of one image, with a description that game engines read."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_at_least, check_positive, check_that
from cvtimg.files.whole import StrPath, write_whole
from cvtimg.pictures.files import read_image, write_image
from cvtimg.pictures.formats.opening import UnfitContentError, reading
from cvtimg.pictures.frames import Frames, alike, with_channels

#: Milliseconds that a frame is shown where nothing tells.
DURATION = 100.0


def sprite_sheet(frames: Frames, *, columns: int | None = None, margin: int = 0, spacing: int = 0) -> NDArray[np.uint8]:
    """Put the frames of an animation into the cells of one image, row by row.

    Parameters
    ----------
    frames : Frames
        With uint8 images.
    columns : int, optional
        Number of cells in a row; by default as many as make the sheet about square.
    margin, spacing : int
        Transparent pixels around the sheet and between its cells.

    Returns
    -------
    (H, W), (H, W, 3) or (H, W, 4) array
        With alpha if the frames have it, or some pixels of the sheet belong to no frame.

    See Also
    --------
    cut_sheet, write_sheet

    Examples
    --------
    >>> from cvtimg.pictures import Frames, sprite_sheet
    >>> frames = Frames(tuple(np.full((8, 8), level, np.uint8) for level in (0, 10, 20, 30)), (100,) * 4, 0)
    >>> sprite_sheet(frames).shape, sprite_sheet(frames, columns=3, spacing=1).shape
    ((16, 16), (17, 26, 4))
    """
    return _filled(frames, _corners(frames, columns, margin, spacing), margin)


def cut_sheet(
    sheet: NDArray[Any], cell: tuple[int, int], *, margin: int = 0, spacing: int = 0, duration: float = DURATION
) -> Frames:
    """Cut a sprite sheet into the frames in its cells, row by row; empty cells at the end are left out.

    Parameters
    ----------
    sheet : (H, W), (H, W, 3) or (H, W, 4) array
        The image; a fourth channel is alpha.
    cell : (width, height)
        Size of a cell in pixels. The cells must fill the sheet.
    margin, spacing : int
        Pixels around the sheet and between its cells, which are left out.
    duration : float
        How long each frame is shown, in milliseconds > 0.

    Returns
    -------
    Frames

    Raises
    ------
    ValueError
        If the cells do not fill the sheet.

    See Also
    --------
    sprite_sheet, read_sheet

    Examples
    --------
    >>> from cvtimg.pictures import cut_sheet
    >>> [int(image[0, 0]) for image in cut_sheet(np.arange(128, dtype=np.uint8).reshape(8, 16), (8, 4)).images]
    [0, 8, 64, 72]
    """
    _check_gaps(margin, spacing)
    counts = []
    for size, length, name in zip(cell, sheet.shape[1::-1], ("width", "height"), strict=True):
        count, rest = divmod(length - 2 * margin + spacing, check_at_least("cell", size, 1, "in pixels") + spacing)
        if count < 1 or rest:
            gaps = f", margin={margin} and spacing={spacing}" if margin or spacing else ""
            raise ValueError(f"cell={cell[0]}x{cell[1]} must divide the {name} of the sheet, {length}{gaps}")
        counts.append(count)
    columns, rows = counts
    steps = [size + spacing for size in cell]
    corners = [(margin + x * steps[0], margin + y * steps[1]) for y in range(rows) for x in range(columns)]
    images = [sheet[y : y + cell[1], x : x + cell[0]] for x, y in corners]
    while sheet.shape[2:] == (4,) and len(images) > 1 and not images[-1][..., 3].any():
        images.pop()
    lasting = check_positive("duration", duration, "milliseconds")
    return Frames(tuple(np.array(image) for image in images), (lasting,) * len(images), 0)


def write_sheet(
    path: StrPath,
    frames: Frames,
    *,
    data: StrPath | None = None,
    columns: int | None = None,
    margin: int = 0,
    spacing: int = 0,
    overwrite: bool = False,
) -> None:
    """Write a sprite sheet, and where its frames are.

    Parameters
    ----------
    path : path
        An image file that keeps all values, such as .png.
    frames, columns, margin, spacing
        As in `sprite_sheet`.
    data : path, optional
        A .json file for the rectangles and durations of the frames, by name, as Aseprite and TexturePacker write it.
    overwrite : bool
        Replace existing files.

    See Also
    --------
    read_sheet
    """
    corners = _corners(frames, columns, margin, spacing)
    sheet = _filled(frames, corners, margin)
    write_image(path, sheet, alpha=sheet.shape[2:] == (4,), overwrite=overwrite)
    if data is not None:
        content = _described(Path(path), frames, corners, sheet.shape)
        write_whole(data, json.dumps(content, indent=1).encode(), overwrite=overwrite)


def read_sheet(path: StrPath) -> Frames:
    """Read the frames of a sprite sheet with the .json file that describes it.

    Parameters
    ----------
    path : path
        The .json file, as Aseprite and TexturePacker write it, with frames by name or in a list; it names the image.
        Frames that were trimmed get their margins back.

    Returns
    -------
    Frames
        Of 100 ms, where the file does not say.

    Raises
    ------
    OSError
        If a file cannot be read, or describes no sheet.

    See Also
    --------
    cut_sheet : Sheets of cells of one size, without a description.

    Examples
    --------
    >>> import tempfile
    >>> from cvtimg.pictures import Frames, read_sheet, write_sheet
    >>> frames = Frames(tuple(np.full((8, 8), level, np.uint8) for level in (0, 10)), (40, 60), 0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_sheet(f"{folder}/a.png", frames, data=f"{folder}/a.json")
    ...     read_sheet(f"{folder}/a.json").durations
    (40.0, 60.0)
    """
    with reading(path) as file:
        name, cels = _parsed(file.read())
    sheet = read_image(Path(path).parent / name)
    height, width = sheet.shape[:2]
    for cel in cels:
        if cel.x + cel.width > width or cel.y + cel.height > height:
            raise OSError(f"{path}: has a frame of {cel.width}x{cel.height} at {cel.x}, {cel.y}, outside {name}")
    return Frames(tuple(alike([cel.cut_from(sheet) for cel in cels])), tuple(cel.duration for cel in cels), 0)


def _check_gaps(margin: int, spacing: int) -> None:
    check_at_least("margin", margin, 0, "in pixels")
    check_at_least("spacing", spacing, 0, "in pixels")


def _corners(frames: Frames, columns: int | None, margin: int, spacing: int) -> list[tuple[int, int]]:
    """Return the x and y of the upper left corner of each frame in a sheet."""
    _check_gaps(margin, spacing)
    n_frames, (height, width) = len(frames.images), frames.images[0].shape[:2]
    if columns is None:
        columns = min(math.ceil(math.sqrt(n_frames * height / width)), n_frames)
    check_at_least("columns", columns, 1, "the cells of a row")
    places = (divmod(number, columns) for number in range(n_frames))
    return [(margin + column * (width + spacing), margin + row * (height + spacing)) for row, column in places]


def _filled(frames: Frames, corners: Sequence[tuple[int, int]], margin: int) -> NDArray[np.uint8]:
    """Return the sheet with frames at their corners."""
    check_that("frames", frames.images[0].dtype == np.uint8, "be of uint8")
    height, width = frames.images[0].shape[:2]
    right, bottom = (max(places) for places in zip(*corners, strict=True))
    shape = (bottom + height + margin, right + width + margin)
    has_gaps = shape[0] * shape[1] > len(corners) * width * height
    images = [with_channels(image, 4) if has_gaps else image for image in frames.images]
    sheet = np.zeros((*shape, *images[0].shape[2:]), np.uint8)
    for image, (x, y) in zip(images, corners, strict=True):
        sheet[y : y + height, x : x + width] = image
    return sheet


def _described(path: Path, frames: Frames, corners: Sequence[tuple[int, int]], shape: Sequence[int]) -> dict[str, Any]:
    """Return the description of a sheet."""
    height, width = frames.images[0].shape[:2]
    size = {"w": width, "h": height}
    entries = {
        f"{path.stem} {number}": {
            "frame": {"x": x, "y": y, **size},
            "rotated": False,
            "trimmed": False,
            "spriteSourceSize": {"x": 0, "y": 0, **size},
            "sourceSize": size,
            "duration": round(duration),
        }
        for number, ((x, y), duration) in enumerate(zip(corners, frames.durations, strict=True))
    }
    meta = {"app": "cvtimg", "image": path.name, "format": "RGBA8888", "size": {"w": shape[1], "h": shape[0]}}
    return {"frames": entries, "meta": {**meta, "scale": "1"}}


class _Cel(NamedTuple):
    """Where a frame is in a sheet, and its margins that are not: left, top, right and bottom."""

    x: int
    y: int
    width: int
    height: int
    margins: tuple[int, int, int, int]
    duration: float

    @classmethod
    def of(cls, entry: Mapping[str, Any]) -> _Cel:
        """Read an entry of a description."""
        x, y, width, height = (int(entry["frame"][name]) for name in "xywh")
        margins = (0, 0, 0, 0)
        if entry.get("trimmed"):
            left, top = (int(entry["spriteSourceSize"][name]) for name in "xy")
            whole = entry["sourceSize"]
            margins = left, top, int(whole["w"]) - left - width, int(whole["h"]) - top - height
        if entry.get("rotated") or min(x, y, width - 1, height - 1, *margins) < 0:
            raise UnfitContentError("has a frame that is rotated, empty, or larger than its source")
        return cls(x, y, width, height, margins, float(entry.get("duration", DURATION)))

    def cut_from(self, sheet: NDArray[Any]) -> NDArray[Any]:
        """Return the frame in its whole size."""
        part = sheet[self.y : self.y + self.height, self.x : self.x + self.width]
        left, top, right, bottom = self.margins
        return (
            np.pad(with_channels(part, 4), ((top, bottom), (left, right), (0, 0))) if any(self.margins) else part.copy()
        )


def _parsed(content: bytes) -> tuple[str, list[_Cel]]:
    """Return the name of the image and the frames of a description."""
    try:
        description = json.loads(content)
        entries = description["frames"]
        cels = [_Cel.of(entry) for entry in (entries.values() if isinstance(entries, dict) else entries)]
        name = str(description["meta"]["image"])
    except (KeyError, TypeError, AttributeError, json.JSONDecodeError, UnicodeDecodeError) as error:
        raise UnfitContentError("describes no sprite sheet: it needs frames, and an image in meta") from error
    if not cels:
        raise UnfitContentError("has no frames")
    return name, cels

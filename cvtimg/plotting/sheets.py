"""Drawings of results: palettes as strips, and grids of images with captions.

Functions take arrays and return an array; nothing is written. Whatever belongs below an image (the palette of a
quantized image, the colors of segments, a few figures) is passed in a `Panel`, which `contact_sheet` lays out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from cvtimg._shared.checks import check_count, check_image, check_labeled_image, check_labels, check_rows
from cvtimg.labels.contours import Contours
from cvtimg.labels.edges import find_edges
from cvtimg.labels.figures import region_means
from cvtimg.labels.formats import Drawing
from cvtimg.pictures.showing import limits_to_show, shown


@dataclass(frozen=True, slots=True)
class Style:
    """How sheets look: colors, and lengths in pixels."""

    background: tuple[int, int, int] = (255, 255, 255)
    mat: tuple[int, int, int] = (240, 240, 240)  # beside images that are narrower than their panel
    ink: tuple[int, int, int] = (24, 24, 24)
    pale_ink: tuple[int, int, int] = (92, 92, 92)  # lines of a caption after the first
    checkers: tuple[int, int] = (200, 232)  # seen through what is transparent
    checker_side: int = 8
    text: int = 14
    line: int = 19
    above_caption: int = 7
    above_strip: int = 5
    gap: int = 15  # between panels
    between_rows: int = 26
    margin: int = 20
    strip: int = 24  # height of a palette
    tallest: float = 1.5  # height of images by the width of panels: an upright 2:3 photograph fits
    longest: int = 1 << 15  # sides of sheets and strips, so that a slip of the pen does not fill the memory


STYLE = Style()
_font = cache(ImageFont.load_default)


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """An image in a contact sheet, with a caption and a palette below it.

    Attributes
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Of any integer or floating point type. One or two channels show the first as gray, three are RGB, four are
        RGB and alpha, of more the first three are shown.
    caption : sequence of str
        Lines below the image; those too long for the panel end in an ellipsis.
    palette : (K, D) array, optional
        Colors to draw as a strip, of the type of the image.
    """

    image: Any
    caption: Sequence[str] = ()
    palette: ArrayLike | None = None


def palette_strip(
    palette: ArrayLike, *, width: int = 300, height: int = STYLE.strip, limits: tuple[float, float] | None = None
) -> NDArray[np.uint8]:
    """Draw the colors of a palette side by side.

    All get equal room, because rare colors can matter too; many are stacked two or more to a column, so that their
    fields remain large enough to see.

    Parameters
    ----------
    palette : (K, D) array
        uint8: gray (D = 1), RGB or RGBA. Other types are stretched from the least to the greatest value. RGBA is
        shown over a gray checkerboard.
    width, height : int
        Size of the strip in pixels.
    limits : (float, float), optional
        Values to show as black and white, in types other than uint8.

    Returns
    -------
    (height, width, 3) uint8 array
        The colors in order, column by column from left to right, and down each column.

    Examples
    --------
    >>> red_blue = np.array([[255, 0, 0], [0, 0, 255]], dtype=np.uint8)
    >>> palette_strip(red_blue, width=4, height=1).tolist()
    [[[255, 0, 0], [255, 0, 0], [0, 0, 255], [0, 0, 255]]]
    """
    check_count("width", width, STYLE.longest, "the longest side")
    check_count("height", height, STYLE.longest, "the longest side")
    colors = check_rows("palette", palette)
    check_count("number of colors", len(colors), width * height, "the pixels of the strip")
    seen = shown(colors, limits_to_show([colors]) if limits is None else limits)
    return np.array(_over_checkers(Image.fromarray(seen[_fields(len(colors), width, height)])))


def contact_sheet(rows: Iterable[Sequence[Panel]], *, panel_width: int = 300) -> NDArray[np.uint8]:
    """Lay out panels as a grid: images, a palette strip below each that has a palette, and captions.

    Images wider than a panel are reduced to its width, or to one and a half times that in height. Smaller ones are
    enlarged by whole factors, so that each pixel can be seen. Transparency is shown over a gray checkerboard.

    Parameters
    ----------
    rows : iterable of sequences of Panel
        Rows may differ in their number of panels. Within a row, images, strips and captions are aligned.
    panel_width : int
        Width of a panel in pixels. Five panels of 300 make a sheet of 1600.

    Returns
    -------
    (H, W, 3) uint8 array

    Notes
    -----
    Images that are not 8-bit are stretched from black to white between the values that all but 0.1% of the samples of
    such images in their row lie between, so that images in a row can be compared and a hot pixel darkens none.

    Examples
    --------
    >>> image = np.array([[10, 200], [200, 10]], dtype=np.uint8)
    >>> sheet = contact_sheet([[Panel(image, ("2 colors",), np.array([[10], [200]], np.uint8))]], panel_width=100)
    >>> sheet.shape
    (195, 140, 3)
    """
    check_count("panel_width", panel_width, STYLE.longest, "the longest side")
    grid = [list(row) for row in rows]
    n_columns = max(map(len, grid), default=0)
    width = max(n_columns * (panel_width + STYLE.gap) - STYLE.gap, 0)
    blocks = [_draw_row(panels, panel_width) for panels in grid if panels]
    height = sum(block.height for block in blocks) + STYLE.between_rows * max(len(blocks) - 1, 0)
    sheet = Image.new("RGB", (width + 2 * STYLE.margin, height + 2 * STYLE.margin), STYLE.background)
    top = STYLE.margin
    for block in blocks:
        sheet.paste(block, (STYLE.margin, top))
        top += block.height + STYLE.between_rows
    return np.array(sheet)


def draw_edges(
    image: Any,
    labels: ArrayLike,
    *,
    color: Sequence[int] = (255, 255, 0),
    thickness: int = 1,
    ignore: int | None = None,
) -> NDArray[np.uint8]:
    """Draw the edges of segments over the segmented image.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        As in `Panel`; pixels of label 0 may be NaN.
    labels : (H, W) integer array
        Segment of each pixel.
    color : sequence of three int
        RGB color of the edges, in 0..255.
    thickness : int
        Width of the edges in pixels. An odd one is centered on inner edges, an even one on the border.
    ignore : int, optional
        Label whose borders are not edges, as in `find_edges`.

    Returns
    -------
    (H, W, 3) uint8 array
        An image that is not 8-bit is stretched from black to white over the range of all but 0.1% of its values outside
        `ignore`.

    Examples
    --------
    >>> drawn = draw_edges(np.zeros((1, 4), np.uint8), np.array([[1, 1, 2, 2]]), color=(255, 0, 0))
    >>> drawn[0, :, 0].tolist()
    [0, 0, 255, 0]
    """
    from skimage.morphology import isotropic_dilation

    segments = check_labels("labels", labels)
    check_count("thickness", thickness, STYLE.longest, "the longest side")
    values = check_labeled_image("image", image, segments)
    drawn = np.array(_over_checkers(Image.fromarray(shown(values, limits_to_show([values[segments != ignore]])))))
    edges = find_edges(segments, mode="inner" if thickness % 2 else "thick", ignore=ignore)
    radius = (thickness - 1) // 2
    if radius and edges.any():
        edges = isotropic_dilation(edges, radius)  # type: ignore[no-untyped-call]
    drawn[edges] = color
    return drawn


def shown_colors(colors: ArrayLike, image: Any, labels: ArrayLike, *, ignore: int | None = None) -> NDArray[np.uint8]:
    """Convert (K, C) colors in the units of the image to (K, 3) uint8, as `draw_edges` shows them."""
    segments = check_labels("labels", labels)
    values = check_labeled_image("image", image, segments)
    rows = np.asarray(colors)
    if values.dtype == np.uint8:
        rows = np.rint(rows).astype(np.uint8)
    return shown(rows, limits_to_show([values[segments != ignore]]))[:, :3]


def contour_drawing(contours: Contours, labels: ArrayLike, image: Any) -> Drawing:
    """Draw the contours of segments, each filled with its mean color.

    Parameters
    ----------
    contours : Contours
        From `cvtimg.find_contours`.
    labels, image
        The segments, 0 left out, and the segmented image, as in `draw_edges`.

    Returns
    -------
    Drawing
        For `cvtimg.labels.write_contours`; each polygon with the area and the mean of its segment.

    Examples
    --------
    >>> from cvtimg import find_contours
    >>> from cvtimg.plotting import contour_drawing
    >>> labels = np.array([[1, 1, 2]])
    >>> drawing = contour_drawing(find_contours(labels), labels, np.array([[10, 20, 200]], np.uint8))
    >>> len(drawing.polygons), drawing.properties[1]["area"]
    (2, 2)
    """
    segments = np.asarray(labels)
    means = np.nan_to_num(region_means(segments, image))
    areas = np.bincount(segments.ravel()).tolist()
    bands = np.asarray(image)
    seen = bands[..., :3] if bands.shape[2:] == (4,) else bands
    return Drawing(
        polygons=contours.polygons,
        size=(segments.shape[0], segments.shape[1]),
        colors=shown_colors(means[:, :3], seen, segments, ignore=0),
        properties={label: {"area": areas[label], "mean": mean} for label, mean in enumerate(means.tolist())},
    )


def _draw_row(panels: list[Panel], width: int) -> Image.Image:
    """Draw the panels of a row side by side, with their parts aligned."""
    arrays = [check_image("image", panel.image) for panel in panels]
    images = [array.reshape(*array.shape[:2], -1) for array in arrays]
    limits = limits_to_show(images)
    pictures = [_fit(shown(image, limits), width) for image in images]
    mat_height = max(picture.height for picture in pictures)
    caption_top = mat_height + STYLE.above_caption
    if any(panel.palette is not None for panel in panels):
        caption_top += STYLE.above_strip + STYLE.strip
    height = caption_top + STYLE.line * max(len(panel.caption) for panel in panels)
    block = Image.new("RGB", (len(panels) * (width + STYLE.gap) - STYLE.gap, height), STYLE.background)
    for column, (panel, picture) in enumerate(zip(panels, pictures, strict=True)):
        left = column * (width + STYLE.gap)
        block.paste(STYLE.mat, (left, 0, left + width, mat_height))
        block.paste(picture, (left + (width - picture.width) // 2, (mat_height - picture.height) // 2))
        if panel.palette is not None:
            strip = palette_strip(panel.palette, width=width, limits=limits)
            block.paste(Image.fromarray(strip), (left, mat_height + STYLE.above_strip))
        for number, line in enumerate(panel.caption):
            place = (left, caption_top + number * STYLE.line)
            _write(block, place, line, width, STYLE.pale_ink if number else STYLE.ink)
    return block


def _write(block: Image.Image, place: tuple[int, int], text: str, width: int, ink: tuple[int, int, int]) -> None:
    """Write one line, cut to `width` pixels."""
    font = _font(STYLE.text)
    line = " ".join(text.split())
    if font.getlength(line) > width:
        while line and font.getlength(line + "…") > width:
            line = line[:-1]
        line = line.rstrip() + "…"
    ImageDraw.Draw(block).text(place, line, fill=ink, font=font)


def _fit(pixels: NDArray[np.uint8], width: int) -> Image.Image:
    """Resize an image to fit a panel."""
    picture = Image.fromarray(pixels)
    room = min(width / picture.width, int(STYLE.tallest * width) / picture.height)
    scale = int(room) if room >= 1 else room
    if scale != 1:
        size = (max(round(picture.width * scale), 1), max(round(picture.height * scale), 1))
        # Hamming's window is as sharp as a bicubic filter here, and draws no halos along the edges of flat areas.
        resampling = Image.Resampling.NEAREST if scale > 1 else Image.Resampling.HAMMING
        picture = picture.resize(size, resampling, reducing_gap=3.0)
    return _over_checkers(picture)


def _over_checkers(picture: Image.Image) -> Image.Image:
    if picture.mode != "RGBA":
        return picture
    row, column = np.ogrid[: picture.height, : picture.width]
    odd = (row // STYLE.checker_side + column // STYLE.checker_side) % 2
    board = Image.fromarray(np.array(STYLE.checkers, np.uint8)[odd]).convert("RGBA")
    return Image.alpha_composite(board, picture).convert("RGB")


def _fields(n_colors: int, width: int, height: int) -> NDArray[np.intp]:
    """(height, width) index of a color for each pixel: equal fields, two or more in a column where they are many."""
    upright = int(np.sqrt(n_colors * height / width))  # most in a column that leave the fields as high as wide
    n_rows = min(max(upright, -(-n_colors // width), 1), height)
    n_columns = -(-n_colors // n_rows)
    column = np.arange(width) * n_columns // width
    first, end = column * n_colors // n_columns, (column + 1) * n_colors // n_columns
    return first + (end - first) * np.arange(height)[:, None] // height

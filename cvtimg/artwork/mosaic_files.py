"""Mosaics as drawings, as pixels and as polygons of GeoJSON."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_non_negative
from cvtimg.artwork._mosaics import label_triangles
from cvtimg.artwork.svg import drawing, hexadecimal, number, numbers, write_text
from cvtimg.colors.spaces import to_depth
from cvtimg.files.whole import StrPath
from cvtimg.labels.contours import Polygon
from cvtimg.labels.files import write_geojson
from cvtimg.pictures.files import lossless_suffixes, write_image
from cvtimg.placement import pixel_labels

if TYPE_CHECKING:
    from cvtimg.artwork.mosaics import Mosaic

#: Parts of a pixel of a drawing, each way, and the most parts of a whole drawing.
_FINE, _MOST_PARTS = 3, 1 << 26
#: Lines between tiles.
_OUTLINE = "#202020"
#: Tiles that share a border let the background shine through, as renderers smooth each edge on its own. A stroke of
#: this width, in pixels, in the color of the tile covers it.
_SEAM = 0.4
#: What vectors are written in.
VECTORS = (".svg", ".geojson")


def save_mosaic(mosaic: Mosaic, path: StrPath, outline: float, scale: float, overwrite: bool) -> None:
    """Write a mosaic in the format that the suffix names."""
    check_non_negative("outline", outline)
    suffixes = (*VECTORS, *(suffix for suffix in (*lossless_suffixes(), ".jpg", ".jpeg") if suffix != ".npy"))
    suffix = check_choice("suffix", Path(path).suffix.lower(), suffixes)
    if suffix == ".svg":
        write_text(path, _svg(mosaic, outline), overwrite=overwrite)
    elif suffix == ".geojson":
        _write_geojson(mosaic, path, overwrite)
    else:
        drawn = draw_mosaic(mosaic, scale, outline)
        write_image(path, drawn[:, :, :3] if suffix in (".jpg", ".jpeg") else drawn, overwrite=overwrite)


def _eight_bits(mosaic: Mosaic) -> NDArray[np.uint8]:
    """Return the colors of tiles as (K, 3) or (K, 4) samples of 8 bits."""
    colors = to_depth(mosaic.colors, np.dtype(np.uint8))
    n_channels = colors.shape[1]
    if n_channels > 4:
        raise ValueError(f"a mosaic of {n_channels} channels has no colors to draw")
    shown = colors[:, [0, 0, 0, 1][: n_channels + 2]] if n_channels < 3 else colors
    return np.ascontiguousarray(shown, np.uint8)


def _svg(mosaic: Mosaic, outline: float) -> Iterator[str]:
    height, width = mosaic.labels.shape
    line = f'stroke="{_OUTLINE}" stroke-width="{number(outline, 3)}"' if outline else f'stroke-width="{_SEAM}"'
    attributes = f' stroke-linejoin="round" {line}'
    return drawing(width, height, attributes=attributes, body=_svg_tiles(mosaic, bool(outline)))


def _svg_tiles(mosaic: Mosaic, outlined: bool) -> Iterator[str]:
    for polygon, color in zip(mosaic.polygons(), _eight_bits(mosaic), strict=True):
        if len(polygon) == 0 or (len(color) == 4 and color[3] == 0):
            continue
        fill = hexadecimal(color)
        stroke = "" if outlined else f' stroke="{fill}"'
        opacity = f' opacity="{number(color[3] / 255, 3)}"' if len(color) == 4 and color[3] < 255 else ""
        places = numbers(polygon.ravel(), 3)
        yield f'<path fill="{fill}"{stroke}{opacity} d="M{" ".join(places)}Z"/>\n'


def _write_geojson(mosaic: Mosaic, path: StrPath, overwrite: bool) -> None:
    colors = _eight_bits(mosaic)
    areas = np.bincount(mosaic.labels.ravel(), minlength=len(colors))
    polygons, properties = [], {}
    for tile, polygon in enumerate(mosaic.polygons()):
        if len(polygon):
            polygons.append(Polygon(tile, (np.concatenate([polygon, polygon[:1]]),)))
            color = {"fill": hexadecimal(colors[tile])}
            opacity = {"fill-opacity": round(int(colors[tile, 3]) / 255, 3)} if colors.shape[1] == 4 else {}
            properties[tile] = {**color, **opacity, "pixels": int(areas[tile])}
    write_geojson(path, polygons, properties, overwrite=overwrite)


def draw_mosaic(mosaic: Mosaic, scale: float, outline: float) -> NDArray[np.uint8]:
    """Draw a mosaic as (H, W, 3) or (H, W, 4) pixels with smooth edges."""
    height, width = (max(round(side * scale), 1) for side in mosaic.labels.shape)
    fine = int(np.clip(np.sqrt(_MOST_PARTS / (height * width)), 1, _FINE))
    shape = (height * fine, width * fine)
    factor = np.array([shape[1] / mosaic.labels.shape[1], shape[0] / mosaic.labels.shape[0]])
    if mosaic.triangles is None:
        labels = pixel_labels(shape, mosaic.points * factor)
    else:
        labels = np.zeros(shape, np.int32)
        label_triangles(mosaic.points * factor, mosaic.triangles, labels)
    colors = _eight_bits(mosaic)
    drawn = np.empty((height, width, colors.shape[1]), np.uint8)
    for row in range(height):
        parts = colors[labels[row * fine : (row + 1) * fine]].reshape(fine, width, fine, -1)
        drawn[row] = np.rint(parts.mean(axis=(0, 2), dtype=np.float32))
    return _outlined(drawn, mosaic, outline * scale) if outline else drawn


def _outlined(drawn: NDArray[np.uint8], mosaic: Mosaic, width: float) -> NDArray[np.uint8]:
    """Draw lines between tiles."""
    from PIL import Image, ImageDraw

    height, across = drawn.shape[:2]
    fine = int(np.clip(np.sqrt(_MOST_PARTS / (height * across)), 1, _FINE))
    lines = Image.new("L", (across * fine, height * fine))
    pen = ImageDraw.Draw(lines)
    factor = np.array([lines.width / mosaic.labels.shape[1], lines.height / mosaic.labels.shape[0]])
    for polygon in mosaic.polygons():
        if len(polygon):
            places = [tuple(place) for place in (np.concatenate([polygon, polygon[:1]]) * factor).tolist()]
            pen.line(places, fill=255, width=max(round(width * fine), 1), joint="curve")
    share = np.asarray(lines.reduce(fine), np.float32)[:, :, np.newaxis] / 255
    ink = np.array([*bytes.fromhex(_OUTLINE[1:]), 255][: drawn.shape[2]], np.float32)
    return np.rint(drawn + share * (ink - drawn)).astype(np.uint8)

"""Mosaics as drawings, as pixels and as polygons of GeoJSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_channels, check_choice, check_non_negative, check_positive
from cvtimg._shared.svg import drawing, hexadecimal, number, numbers
from cvtimg.artwork._artwork import label_triangles
from cvtimg.colors.spaces import to_depth
from cvtimg.files.whole import StrPath, write_text
from cvtimg.labels.contours import Polygon
from cvtimg.labels.formats.geojson import write_geojson
from cvtimg.pictures.files import lossless_suffixes, write_image
from cvtimg.placement import pixel_labels
from cvtimg.placement.cells import Polygons

#: Parts of a pixel of a drawing, each way, and the most parts of a whole drawing.
_FINE, _MOST_PARTS = 3, 1 << 26
#: Color of lines between tiles.
_LINES = "#202020"
#: Tiles that share a border let the background shine through, as renderers smooth each edge on its own. So all tiles
#: are drawn twice, below with sharp edges; a stroke in the color of the tile covers what is left.
_SEAM = 'stroke-width="0.4"'
_SHARP_BELOW = '<use href="#tiles" shape-rendering="crispEdges"/>\n'
#: Channels of gray, gray with alpha and so on as those of RGB and RGBA.
_CHANNELS = {1: [0, 0, 0], 2: [0, 0, 0, 1], 3: [0, 1, 2], 4: [0, 1, 2, 3]}
#: Formats without alpha.
_OPAQUE = (".jpg", ".jpeg")
#: What vectors are written in.
VECTORS = (".svg", ".geojson")


@dataclass(frozen=True, slots=True, eq=False)
class TileDrawing:
    """What is drawn of a `Mosaic`: points, triangles and colors are as in it."""

    points: NDArray[np.float64]
    triangles: NDArray[np.int32] | None
    polygons: Polygons  # corners of each tile
    colors: NDArray[Any]
    areas: NDArray[np.intp]  # (K,) pixels of each tile
    size: tuple[int, int]  # height and width of the image
    outline: float  # width of lines between tiles, in pixels of the image; 0 for none

    def __post_init__(self) -> None:
        check_non_negative("outline", self.outline)

    def save(self, path: StrPath, scale: float, overwrite: bool) -> None:
        """Write in the format that the suffix names."""
        suffix = check_choice("suffix", Path(path).suffix.lower(), suffixes())
        if suffix == ".svg":
            write_text(path, self._svg(), overwrite=overwrite)
        elif suffix == ".geojson":
            self._write_geojson(path, overwrite)
        else:
            drawn = self.pixels(scale)
            write_image(path, drawn[:, :, :3] if suffix in _OPAQUE else drawn, overwrite=overwrite)

    def _eight_bits(self) -> NDArray[np.uint8]:
        """Return the colors of tiles as (K, 3) or (K, 4) samples of 8 bits."""
        n_channels = self.colors.shape[1]
        check_channels("a mosaic", n_channels, (1, 2, 3, 4), "to have colors to draw")
        colors = to_depth(self.colors, np.dtype(np.uint8))
        return np.ascontiguousarray(colors[:, _CHANNELS[n_channels]])

    def _svg(self) -> Iterator[str]:
        line = f'stroke="{_LINES}" stroke-width="{number(self.outline, 3)}"' if self.outline else _SEAM
        return drawing(self.size[1], self.size[0], self._body(), attributes=f' stroke-linejoin="round" {line}')

    def _body(self) -> Iterator[str]:
        translucent = self.colors.shape[1] in (2, 4) and bool((self._eight_bits()[:, 3] < 255).any())
        if not translucent:
            yield _SHARP_BELOW
        yield '<g id="tiles">\n'
        yield from self._paths()
        yield "</g>\n"

    def _paths(self) -> Iterator[str]:
        for polygon, color in zip(self.polygons, self._eight_bits(), strict=True):
            if len(polygon) == 0 or (len(color) == 4 and color[3] == 0):
                continue
            fill = hexadecimal(color)
            stroke = "" if self.outline else f' stroke="{fill}"'
            opacity = f' opacity="{number(color[3] / 255, 3)}"' if len(color) == 4 and color[3] < 255 else ""
            yield f'<path fill="{fill}"{stroke}{opacity} d="M{" ".join(numbers(polygon.ravel(), 3))}Z"/>\n'

    def _write_geojson(self, path: StrPath, overwrite: bool) -> None:
        polygons, properties = [], {}
        colors = self._eight_bits()
        for tile, polygon in enumerate(self.polygons):
            if len(polygon):
                polygons.append(Polygon(tile, (np.concatenate([polygon, polygon[:1]]),)))
                opacity = {"fill-opacity": round(int(colors[tile, 3]) / 255, 3)} if colors.shape[1] == 4 else {}
                properties[tile] = {"fill": hexadecimal(colors[tile]), **opacity, "pixels": int(self.areas[tile])}
        write_geojson(path, polygons, properties, overwrite=overwrite)

    def pixels(self, scale: float) -> NDArray[np.uint8]:
        """Draw (H scale, W scale, 3) or (H scale, W scale, 4) pixels with smooth edges."""
        check_positive("scale", scale)
        height, width = (max(round(side * scale), 1) for side in self.size)
        fine = int(np.clip(np.sqrt(_MOST_PARTS / (height * width)), 1, _FINE))
        labels = self._labels((height * fine, width * fine))
        colors = self._eight_bits()
        drawn = np.empty((height, width, colors.shape[1]), np.uint8)
        for row in range(height):
            parts = colors[labels[row * fine : (row + 1) * fine]].reshape(fine, width, fine, -1)
            drawn[row] = np.rint(parts.mean(axis=(0, 2), dtype=np.float32))
        return self._outlined(drawn, self.outline * scale, fine) if self.outline else drawn

    def _labels(self, shape: tuple[int, int]) -> NDArray[np.int32]:
        points = self.points * (np.array(shape[::-1]) / self.size[::-1])
        if self.triangles is None:
            return pixel_labels(shape, points)
        labels = np.zeros(shape, np.int32)
        label_triangles(points, self.triangles, labels)
        return labels

    def _outlined(self, drawn: NDArray[np.uint8], width: float, fine: int) -> NDArray[np.uint8]:
        """Draw lines between tiles."""
        from PIL import Image, ImageDraw

        lines = Image.new("L", (drawn.shape[1] * fine, drawn.shape[0] * fine))
        pen = ImageDraw.Draw(lines)
        factor = np.array(lines.size) / self.size[::-1]
        for polygon in self.polygons:
            if len(polygon):
                places = [tuple(place) for place in (np.concatenate([polygon, polygon[:1]]) * factor).tolist()]
                pen.line(places, fill=255, width=max(round(width * fine), 1), joint="curve")
        share = np.asarray(lines.reduce(fine), np.float32)[:, :, np.newaxis] / 255
        ink = np.array([*bytes.fromhex(_LINES[1:]), 255][: drawn.shape[2]], np.float32)
        return np.rint(drawn + share * (ink - drawn)).astype(np.uint8)


def suffixes() -> list[str]:
    """List what mosaics can be written in."""
    return [*VECTORS, *(suffix for suffix in lossless_suffixes() if suffix != ".npy"), *_OPAQUE]

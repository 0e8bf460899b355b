"""Mosaics: an image as convex tiles of one color each, placed so that the mosaic is as like the image as can be."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import MOST_IN_MEMORY
from cvtimg._shared.checks import (
    check_at_least,
    check_channels,
    check_choice,
    check_colors,
    check_count,
    check_non_negative,
    check_positive,
)
from cvtimg._shared.choices import EffortName, Row, SpaceName
from cvtimg._shared.pixels import peak, white_of
from cvtimg._shared.progress import each, part
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.svg import drawing, hexadecimal, number, numbers
from cvtimg._shared.types import Array, Bytes, Floats, Floats32, ImageLike, Ints
from cvtimg.artwork.tilings import (
    DelaunayTiling,
    Painted,
    Tiling,
    descend_cells,
    descend_error,
    detail_density,
    find_triangles,
    paint,
    place_corners,
)
from cvtimg.artwork.tones import Picture, picture_of
from cvtimg.colors.spaces import from_space, to_space
from cvtimg.engine.tessellation import tessellate
from cvtimg.files.whole import StrPath, write_text
from cvtimg.labels.contours import Polygon
from cvtimg.labels.formats.geojson import write_geojson
from cvtimg.pictures.files import encode_image, image_suffixes, write_image
from cvtimg.pictures.showing import shown
from cvtimg.placement import pixel_labels, place_generators
from cvtimg.placement.cells import Polygons, picture_cells

#: Steps of the descent.
_STEPS = {"fast": 25, "balanced": 80, "best": 480}
#: Uniform density added to the detail for the first places of points, for flat parts need a few tiles, too. Few points
#: may all begin on one edge; they try a nearly uniform start as well.
_UNIFORM = {"cells": (0.05, 10.0), "triangles": (0.02, 10.0)}
_FEW = 64
#: Part of the time until the descent starts.
_STARTED = 0.2
SHAPES = tuple(_UNIFORM)
#: Parts of a pixel of a drawing, each way: with more, edges are smoother than 8 bits tell.
_FINE = 3
#: Color of lines between tiles.
_LINES = "#202020"
#: Tiles that share a border let the background shine through, as renderers smooth each edge on its own. So opaque
#: tiles are drawn twice, below with sharp edges; a stroke in the color of the tile covers what is left.
_SEAM = 'stroke-width="0.4"'
_SHARP_BELOW = '<use href="#tiles" shape-rendering="crispEdges"/>\n'
#: Formats without alpha.
_OPAQUE = (".jpg", ".jpeg")
#: What vectors are written in.
VECTORS = (".svg", ".geojson")


def suffixes() -> list[str]:
    """List what mosaics can be written in."""
    return [*VECTORS, *(suffix for suffix in image_suffixes() if suffix != ".npy")]


@dataclass(frozen=True, slots=True, eq=False)
class Mosaic(ReadOnly):
    """An image made of tiles of one color each.

    Attributes
    ----------
    points : (N, 2) float64 array
        Generators of the cells, or corners of the triangles: (x, y) in pixels, the first pixel covering
        [0, 1] x [0, 1].
    colors : (K, C) array
        Color of each tile, of the type of the image.
    labels : (H, W) int32 array
        The tile, in 0..K-1, of each pixel.
    triangles : (K, 3) int32 array or None
        The corners of each tile, as indices of points; None for cells.
    energy : float
        Squared error summed over pixels and channels, in the color space of the mosaic, before `palette`.
    energies : tuple of float
        Before each step on the whole image, and at the end. They may rise in between; the least is kept.
    psnr : float
        Peak signal-to-noise ratio of `image`, in decibels; infinite if it equals the image. Of images with alpha, over
        the pixels that are seen of either, in the mean of how they look on black and on white.
    limits : (float, float)
        Values that are drawn as black and as white.
    """

    points: Floats
    colors: Array
    labels: Ints
    triangles: Ints | None
    energy: float
    energies: tuple[float, ...]
    psnr: float
    limits: tuple[float, float]

    def _claims(self) -> Claims:
        yield "labels are those of tiles", (self.labels >= 0) & (self.labels < len(self.colors))

    @property
    def image(self) -> Array:
        """The mosaic as an (H, W) or (H, W, C) image."""
        image: Array = self.colors[self.labels]
        return image[:, :, 0] if image.shape[2] == 1 else image

    @property
    def shape(self) -> str:
        """The kind of tiles: "cells" or "triangles"."""
        return "cells" if self.triangles is None else "triangles"

    def polygons(self) -> Polygons:
        """Compute the (M, 2) corners of each tile in pixels, in order around it, clockwise as seen on a screen.

        There are none for a point that shares its place with another and has no cell.
        """
        if self.triangles is not None:
            return tuple(self.points[self.triangles])
        return picture_cells(self.points, (self.labels.shape[0], self.labels.shape[1]))

    def draw(self, *, scale: float = 1.0, outline: float = 0.0) -> Bytes:
        """Draw the mosaic with smooth edges, (H scale, W scale, 3 or 4) uint8, of `scale` pixels per pixel.

        Dark lines between tiles are `outline` pixels of the image wide; 0 for none.
        """
        check_non_negative("outline", outline)
        check_positive("scale", scale)
        from PIL import Image, ImageDraw

        size = np.array([max(round(side * scale), 1) for side in self.labels.shape])
        fine = int(np.clip(np.sqrt(MOST_IN_MEMORY / size.prod()), 1, _FINE))
        factors = fine * size[::-1] / self.labels.shape[::-1]
        if self.triangles is None:
            labels = pixel_labels(tuple(fine * size), factors * self.points)
        else:
            labels = find_triangles(self.points, tuple(fine * size), factors)[0]
        drawn = Image.fromarray(self._eight_bits()[labels])
        if outline:
            pen, width = ImageDraw.Draw(drawn), max(round(outline * scale * fine), 1)
            for _, polygon, _ in self._seen():
                corners = np.concatenate([polygon, polygon[:1]]) * factors
                pen.line(corners.ravel().tolist(), _LINES, width, joint="curve")
        return np.asarray(drawn.reduce(fine))

    def save(self, path: StrPath, *, outline: float = 0.0, scale: float = 1.0, overwrite: bool = False) -> None:
        """Write the mosaic; the suffix picks the format.

        .svg: drawn as by `draw`, but for the scale. .geojson: a polygon for each tile that is not clear. .png and other
        formats of pixels: what `draw` gives.
        """
        check_non_negative("outline", outline)
        suffix = check_choice("suffix", Path(path).suffix.lower(), suffixes())
        if suffix == ".svg":
            line = f'stroke="{_LINES}" stroke-width="{number(outline, 3)}"' if outline else _SEAM
            look = f' stroke-linejoin="round" {line}'
            height, width = self.labels.shape
            write_text(path, drawing(width, height, self._paths(outline), attributes=look), overwrite=overwrite)
        elif suffix == ".geojson":
            self._write_geojson(path, overwrite)
        else:
            drawn = self.draw(scale=scale, outline=outline)
            write_image(path, drawn[:, :, :3] if suffix in _OPAQUE else drawn, overwrite=overwrite)

    def _eight_bits(self) -> Bytes:
        """Return the colors of tiles as (K, 3) or (K, 4) samples of 8 bits."""
        n_channels = self.colors.shape[1]
        check_channels("a mosaic", n_channels, (1, 2, 3, 4), "to have colors to draw")
        return shown(self.colors, self.limits)

    def _seen(self) -> Iterator[tuple[int, Floats, Bytes]]:
        """Yield the number, corners and color of each tile that is not clear."""
        for tile, (polygon, color) in enumerate(zip(self.polygons(), self._eight_bits(), strict=True)):
            if len(polygon) and (len(color) == 3 or color[3]):
                yield tile, polygon, color

    def _paths(self, outline: float) -> Iterator[str]:
        clear = []
        yield f'{_SHARP_BELOW}<g id="tiles">\n'
        for _, polygon, color in self._seen():
            fill = hexadecimal(color)
            stroke = "" if outline else f' stroke="{fill}"'
            look = f'fill="{fill}"{stroke} d="M{" ".join(numbers(polygon.ravel(), 3))}Z"/>\n'
            if len(color) == 4 and color[3] < 255:
                clear.append(f'<path opacity="{number(color[3] / 255, 3)}" {look}')
            else:
                yield f"<path {look}"
        yield from ("</g>\n", *clear)

    def _write_geojson(self, path: StrPath, overwrite: bool) -> None:
        polygons, properties = [], {}
        areas = np.bincount(self.labels.ravel(), minlength=len(self.colors))
        for tile, polygon, color in self._seen():
            polygons.append(Polygon(tile, (np.concatenate([polygon, polygon[:1]]),)))
            opacity = {"fill-opacity": round(int(color[3]) / 255, 3)} if len(color) == 4 else {}
            properties[tile] = {"fill": hexadecimal(color), **opacity, "pixels": int(areas[tile])}
        write_geojson(path, polygons, properties, overwrite=overwrite)

    def _repr_png_(self) -> bytes:
        return encode_image(".png", self.draw())

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        return {
            "n": len(self.colors),
            "energy": self.energy,
            "psnr": self.psnr if np.isfinite(self.psnr) else None,
            "n_iter": len(self.energies) - 1,
        }

    def __repr__(self) -> str:
        height, width = self.labels.shape
        return f"Mosaic({len(self.colors)} {self.shape} in {width} x {height}, energy={self.energy:.4g})"


def mosaic(
    image: ImageLike,
    n_cells: int,
    *,
    shape: str = "cells",
    space: SpaceName = "rgb",
    palette: int | ArrayLike | None = None,
    effort: EffortName = "balanced",
    callback: Callable[[int, float], None] | None = None,
) -> Mosaic:
    """Compose an image of convex tiles, each of one color.

    The tiles are Voronoi cells or Delaunay triangles. Their points begin where the image changes most, and descend
    the squared error of the mosaic itself, so that borders of tiles settle on edges of the image; wide cells do so on
    smaller images first.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Of 2 or 4 channels the last is alpha; if it is nowhere between clear and opaque, tiles are the one or the
        other, by which most of their pixels are. White is the largest integer of the type, or 1 for floating point;
        integers of wide types that would be nearly black, but fit in 8 or 16 bits, are taken as those. Measurements,
        which leave this range or are nearly black all the same, are taken in the range that they fill, with a warning;
        only colors of tiles have their own unit. NaN and masked values are clear.
    n_cells : int
        Number of tiles, in 1..pixels; of triangles 2 or more, and not more than pixels.
    shape : {"cells", "triangles"}
        Voronoi cells, or triangles ("low poly").
    space : {"rgb", "linear", "lab", "oklab"}
        Color space in which colors are averaged and errors are measured.
    palette : int or (P, C) array, optional
        Number of colors that tiles may have, found by their energy, or the colors themselves. Alpha is not restricted.
    effort : {"fast", "balanced", "best"}
        25, 80 or 480 steps.
    callback : callable, optional
        Called as ``callback(step, energy)`` before each step.

    Returns
    -------
    Mosaic

    References
    ----------
    Q. Du, V. Faber, M. Gunzburger, Centroidal Voronoi tessellations: Applications and algorithms, SIAM Review 41
    (1999) 637-676, doi 10.1137/S0036144599352836.

    Examples
    --------
    >>> from cvtimg import mosaic
    >>> image = np.full((20, 40), 30, np.uint8)
    >>> image[:, 25:] = 200
    >>> result = mosaic(image, 2)
    >>> sorted(result.colors.ravel().tolist())
    [30, 200]
    """
    check_choice("shape", shape, SHAPES)
    check_choice("effort", effort, _STEPS)
    picture = _with_clear(picture_of(image))
    height, width = picture.samples.shape[:2]
    n_cells = check_count("n_cells", n_cells, height * width, "the number of pixels")
    least = 2 if shape == "triangles" else 1
    n_cells = check_at_least("n_cells", n_cells, least, "because a rectangle has at least two triangles")
    samples = picture.samples if picture.of_shades else picture.shares()
    bands, has_alpha = _bands(samples, space)
    on_step = callback or (lambda step, energy: None)
    starts = each(_UNIFORM[shape][: 2 if n_cells <= _FEW else 1])
    ends = [_descended(bands, n_cells, shape, uniform, _STEPS[effort], on_step) for uniform in starts]
    tiling, points, energies = min(ends, key=lambda end: min(end[2]))
    painted = paint(bands, tiling.labels(points), tiling.n_tiles)
    triangles = tiling.triangles if isinstance(tiling, DelaunayTiling) else None
    middles = points if triangles is None else points[triangles].mean(axis=1)
    is_sharp = has_alpha and bool(np.isin(samples[..., -1], (0, peak(samples.dtype))).all())
    colors = _colors(_means(painted, bands, middles), space, samples.dtype, has_alpha, is_sharp)
    unit = _unit(samples.dtype, space)
    if not picture.of_shades:
        colors, unit = _in_own_unit(colors, picture), np.ptp(picture.limits) if space == "rgb" else unit
    if palette is not None:
        colors = _restricted(colors, painted.areas, palette, has_alpha)
    history = tuple(float(unit**2 * energy) for energy in energies)
    drawn = replace(picture, samples=colors[np.newaxis]).shares()[0]
    psnr = _psnr(drawn[painted.labels], picture.shares() if picture.of_shades else samples, has_alpha)
    energy = float(unit**2 * painted.energy)
    return Mosaic(points, colors, painted.labels, triangles, energy, history, psnr, picture.limits)


def _with_clear(picture: Picture) -> Picture:
    """Make pixels without data clear."""
    if picture.known is None:
        return picture
    samples, n_colors = picture.samples, picture.n_colors
    check_channels("an image", samples.shape[2], (1, 2, 3, 4), "where pixels have no data")
    alpha = samples[..., -1] if n_colors < samples.shape[2] else white_of(samples.dtype)
    return replace(picture, samples=np.dstack([samples[..., :n_colors], alpha * picture.known]), known=None)


def _in_own_unit(colors: Array, picture: Picture) -> Array:
    """Bring shares of the range of measurements, (K, C), back to their unit and type; alpha to its own."""
    (low, high), dtype = picture.limits, picture.samples.dtype
    scaled = colors.astype(np.float64)
    scaled[:, : picture.n_colors] = low + scaled[:, : picture.n_colors] * (high - low)
    scaled[:, picture.n_colors :] *= peak(dtype)
    return from_space(scaled, "rgb", dtype)


def _psnr(drawn: Floats32, image: Floats32, has_alpha: bool) -> float:
    """Compare shares of white, (H, W, C), where anything is seen; those with alpha as they look on black and white."""
    if not has_alpha:
        error = float(np.mean((drawn - image) ** 2, dtype=np.float64))
    else:
        seen = (drawn[..., -1] > 0) | (image[..., -1] > 0)
        if not seen.any():
            return np.inf
        pixels = drawn[seen], image[seen]
        inks, alphas = zip(*((each[:, :-1] * each[:, -1:], each[:, -1:]) for each in pixels), strict=True)
        on_black, clearer = inks[0] - inks[1], alphas[1] - alphas[0]
        error = float(np.mean((on_black**2 + (on_black + clearer) ** 2) / 2, dtype=np.float64))
    return float(-10 * np.log10(error)) if error else np.inf


def _descended(
    bands: Floats32, n_cells: int, shape: str, uniform: float, n_steps: int, on_step: Callable[[int, float], None]
) -> tuple[Tiling, Floats, list[float]]:
    """Start from the detail of the image and a uniform share, and descend."""
    density = detail_density(bands, n_cells, uniform)
    with part(0, _STARTED):
        if shape == "cells":
            points = place_generators(None, n_cells, density=density, effort="fast").points
        else:
            points = place_corners(density, n_cells)
    with part(_STARTED, 1):
        if shape == "cells":
            return descend_cells(bands, points, n_steps, on_step)
        tiling = DelaunayTiling((bands.shape[0], bands.shape[1]), points)
        return tiling, *descend_error(tiling, bands, points, n_steps, on_step)


def _bands(samples: Array, space: SpaceName) -> tuple[Floats32, bool]:
    """Return what colors are averaged in, (H, W, C) and whether the last is alpha; others are then times alpha."""
    has_alpha = samples.shape[2] in (2, 4)
    rows = samples.reshape(-1, samples.shape[2])
    colors = np.ascontiguousarray(rows[:, : rows.shape[1] - has_alpha])
    bands = (to_space(colors, space) / _unit(samples.dtype, space)).astype(np.float32)
    if has_alpha:
        opacity = (rows[:, -1:] / peak(samples.dtype)).astype(np.float32)
        # Alpha counts as much as white does.
        bands = np.concatenate([bands * opacity, opacity * _white(space)], axis=1)
    return np.ascontiguousarray(bands.reshape(*samples.shape[:2], -1)), has_alpha


def _unit(dtype: np.dtype[np.generic], space: SpaceName) -> float:
    """Return what coordinates are divided by, so that samples of all types are the same bands."""
    return peak(dtype) if space == "rgb" else 1.0


def _white(space: SpaceName) -> np.float32:
    """Return the largest coordinate of white as bands have it."""
    return np.float32(to_space(np.ones((1, 1)), space)[0, 0])


def _means(painted: Painted, bands: Floats32, middles: Floats) -> Floats:
    """Return the mean of each tile; for one between the centers of pixels, the color of the pixel that it lies in."""
    empty, means = painted.areas == 0, painted.colors.copy()
    x, y = np.clip(middles[empty], 0, np.array(bands.shape[1::-1]) - 1).astype(np.intp).T
    means[empty] = bands[y, x]
    return means


def _colors(means: Floats, space: SpaceName, dtype: np.dtype[np.generic], has_alpha: bool, is_sharp: bool) -> Array:
    """Return the means of tiles as colors of a type, clear or opaque ones if alpha is sharp."""
    unit = _unit(dtype, space)
    if not has_alpha:
        return from_space(means * unit, space, dtype)
    opacity = means[:, -1:] / _white(space)
    colors = from_space(means[:, :-1] * unit / np.maximum(opacity, 1e-6), space, dtype)
    opacity = np.rint(opacity) if is_sharp else opacity
    return np.concatenate([colors, from_space(opacity * peak(dtype), "rgb", dtype)], axis=1)


def _restricted(colors: Array, areas: Floats, palette: int | ArrayLike, has_alpha: bool) -> Array:
    """Replace colors by those of a palette, which is found or given."""
    shown = colors[:, : colors.shape[1] - has_alpha]
    if isinstance(palette, int | np.integer):
        density = np.where(areas > 0, areas, areas[areas > 0].min())
        n_distinct = len(np.unique(shown, axis=0))
        count = check_count("palette", int(palette), 1 << 31, "or an array of colors")
        means_of_tiles = tessellate(shown, min(count, n_distinct), density=density).generators
        chosen = from_space(means_of_tiles, "rgb", colors.dtype)
    else:
        chosen = check_colors("palette", palette, colors.dtype)
        check_channels("palette", chosen.shape[1], (shown.shape[1],), "as the image has without alpha")
    from scipy.spatial import cKDTree

    nearest = cKDTree(chosen.astype(np.float64)).query(shown.astype(np.float64))[1]
    return np.concatenate([chosen[nearest], colors[:, shown.shape[1] :]], axis=1)

"""The value that stippling returns: dots, and what is drawn of them, for plotters, printers and screens; and tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cvtimg._shared.budgets import MOST_IN_MEMORY
from cvtimg._shared.checks import check_choice, check_non_negative, check_positive, check_that
from cvtimg._shared.choices import Row
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.svg import LAYERED, drawing, hexadecimal, layer, number, numbers
from cvtimg._shared.threads import in_stripes
from cvtimg._shared.types import Bytes, Floats, Floats32, Indices, Ints
from cvtimg.artwork.tilings import ranges
from cvtimg.artwork.tones import TABLE_SIZE
from cvtimg.colors.spaces import from_space, to_space
from cvtimg.files.whole import StrPath, write_csv, write_text
from cvtimg.labels.contours import Polygon
from cvtimg.labels.formats.geojson import write_geojson
from cvtimg.pictures.files import Metadata, encode_image, image_suffixes, write_image
from cvtimg.pictures.formats.pixel_size import INCHES
from cvtimg.placement.cells import Polygons, picture_cells

#: Lines in a row of pixels by which its coverage is measured.
_FINE = 8
#: Pixels between dots in a drawing by default: with more, it is larger and no clearer.
_SPACING = 8.0
MARKS = ("disks", "circles", "points", "line")
FILLS = ("solid", "spiral")
#: Widths of the lines of circles, where none is given, and of cells, in millimeters.
_LINE, _CELL_LINE = 0.3, 0.1
#: How far a polygon in place of an arc may be off, in millimeters.
_OFF = 0.02
#: Half a diagonal of points, in widths of the pen: a pen that goes no way at all may make no dot.
_POINT = 0.05
#: Widths and heights of sheets in millimeters, upright: those of ISO 216, and American ones.
PAPERS = {f"a{n}": (1000 // 2 ** (n / 2 + 1 / 4), 1000 // 2 ** (n / 2 - 1 / 4)) for n in range(2, 7)} | {
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
}
#: Width of a drawing where neither it nor the paper is known, and the margin on paper, in millimeters.
USUAL_WIDTH, USUAL_MARGIN = 200.0, 10.0


def suffixes() -> list[str]:
    """List what dots can be written in."""
    return [".svg", *(suffix for suffix in image_suffixes() if suffix != ".npy"), ".csv"]


def _marks(marks: str, places: Floats, radii: Floats, line: float, fill: str = "solid") -> Iterator[str]:
    half = _POINT * line
    if marks == "line":
        if len(places) > 1:
            yield f'<path d="M{" ".join(numbers(places.ravel(), 3))}"/>\n'
        return
    if marks == "disks" and fill == "spiral":
        # Each ends towards the next, so that the pen travels from there only.
        ways = np.diff(places, axis=0, append=places[-1:])
        for place, radius, way in zip(places, radii.tolist(), np.arctan2(*ways.T[::-1]).tolist(), strict=True):
            turns = place + _spiral(max(radius - line / 2, half), line, way)
            yield f'<path d="M{" ".join(numbers(turns.ravel(), 3))}"/>\n'
        return
    if marks == "points":
        # Loops have corners: viewers leave a hole in a round one that is smaller than its line is wide.
        r = number(half, 4)
        starts = zip(numbers(places[:, 0] - half, 3), numbers(places[:, 1], 3), strict=True)
        yield from (f'<path d="M{x} {y}l{r}-{r} {r} {r}-{r} {r}z"/>\n' for x, y in starts)
        return
    if marks == "circles":
        radii = np.maximum(radii - line / 2, half)
    marked = zip(numbers(places[:, 0], 3), numbers(places[:, 1], 3), numbers(radii, 4), strict=True)
    yield from (f'<circle cx="{x}" cy="{y}" r="{r}"/>\n' for x, y, r in marked)


def _spiral(radius: float, line: float, end: float) -> Floats:
    """(N, 2) points of a spiral from the middle, of turns a line apart, to a whole turn at a radius, up to an angle."""
    turns = radius / line
    step = min(np.pi / 4, np.sqrt(8 * _OFF / radius))  # straight steps are off an arc by `_OFF`
    angles = np.arange(0, 2 * np.pi * (turns + 1) + step, step)
    reach = np.minimum(angles / (2 * np.pi) * line, radius)
    angles += end - angles[-1]
    return reach[:, np.newaxis] * np.column_stack([np.cos(angles), np.sin(angles)])


def _write_svg(path: StrPath, sheet: Sheet, layers: Iterable[str], overwrite: bool) -> None:
    """Write a drawing in millimeters, with a layer for each pen."""
    write_text(path, drawing(*sheet.size, layers, unit="mm", attributes=LAYERED), overwrite=overwrite)


def draw_dots(points: Floats, radii: Floats, shape: tuple[int, int], scale: float = 1.0) -> Floats32:
    """Compute the share of each pixel that dots cover, by 8 lines in each row; where they overlap they cover once.

    Points (N, 2) and radii are in pixels of an image of a shape (H, W), drawn at `scale` as many.
    """
    height, width = (max(round(side * scale), 1) for side in shape)
    centers, sizes = points * scale, radii * scale
    tops, ends = centers[:, 1] - sizes, centers[:, 1] + sizes

    def cover(rows: slice) -> Floats32:
        met = (tops < rows.stop) & (ends > rows.start)
        return _covered(centers[met] - [0, rows.start], sizes[met], rows.stop - rows.start, width)

    return np.concatenate(in_stripes(cover, height, 64.0 * height * width))


def _covered(centers: Floats, radii: Floats, height: int, width: int) -> Floats32:
    """Add up the chords of disks along lines, each without what an earlier one of its line covers."""
    x, y = centers.T
    disk, line = ranges(*np.clip(np.stack([y - radii, y + radii]) * _FINE, 0, height * _FINE))
    half = np.sqrt(np.maximum(radii[disk] ** 2 - ((line + 0.5) / _FINE - y[disk]) ** 2, 0))
    chords = np.clip([x[disk] - half, x[disk] + half], 0, width) + (width + 1) * line  # line after line
    chords = chords[:, np.argsort(chords[0])]
    covered = np.maximum.accumulate(chords[1])
    chords[0, 1:] = np.maximum(chords[0, 1:], covered[:-1])
    chords[1] = np.maximum(chords[1], chords[0])
    # Each end of a chord changes how much is covered of its pixel by a part, and of all that follow by the rest.
    pixel = chords.astype(np.int64)
    row, column = np.divmod(pixel, width + 1)
    later, n_pixels = chords - pixel, height * (width + 1)
    at, changes = row // _FINE * (width + 1) + column, np.zeros(n_pixels + 1)
    for end, sign in ((0, 1), (1, -1)):
        changes[:n_pixels] += sign * np.bincount(at[end], 1 - later[end], n_pixels)
        changes[1:] += sign * np.bincount(at[end], later[end], n_pixels)
    share = changes[:n_pixels].reshape(height, width + 1).cumsum(axis=1)[:, :width] / _FINE
    return np.clip(share, 0, 1).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A sheet of paper with a drawing in its middle."""

    size: tuple[float, float]  # width and height
    corner: Floats  # (2,): where the upper left corner of the drawing lies
    scale: float  # millimeters per pixel

    @classmethod
    def of(
        cls,
        pixels: tuple[int, int],
        *,
        width: float | None = None,
        height: float | None = None,
        paper: str | tuple[float, float] | None = None,
        landscape: bool = False,
        margin: float | None = None,
    ) -> Sheet:
        """Fit a drawing of a height and width in pixels.

        Parameters are as in `Stipples.save`. Without paper, the sheet is as large as the drawing and its margin.
        """
        side = np.array(pixels[::-1], np.float64)
        sides = {"width": width, "height": height}
        wanted = np.array([np.inf if at is None else check_positive(name, at, "in mm") for name, at in sides.items()])
        border = check_non_negative("margin", (USUAL_MARGIN if paper else 0.0) if margin is None else margin)
        if paper is None:
            check_that("landscape", not landscape, "have a paper")
            scale = float(np.min((wanted if np.isfinite(wanted).any() else [USUAL_WIDTH, np.inf]) / side))
            sheet = scale * side + 2 * border
        else:
            named = PAPERS[check_choice("paper", paper.lower(), PAPERS)] if isinstance(paper, str) else paper
            sheet = np.array([check_positive("paper", at, "in mm") for at in named])
            sheet = np.sort(sheet)[::-1] if landscape else sheet
            check_that(f"margin={border:g}", 2 * border < sheet.min(), f"leave room on {sheet[0]:g} x {sheet[1]:g} mm")
            scale = float((np.minimum(wanted, sheet - 2 * border) / side).min())
        return cls((float(sheet[0]), float(sheet[1])), (sheet - scale * side) / 2, scale)


@dataclass(frozen=True, slots=True, eq=False)
class Stipples(ReadOnly):
    """Dots that reproduce the tones of an image.

    Attributes
    ----------
    points : (N, 2) float64 array
        Centers (x, y) in pixels of the image, the first of which covers [0, 1] x [0, 1]; x to the right, y down.
    radii : (N,) float64 array
        In pixels.
    masses : (N,) float64 array
        The ink, as area in pixels, that the cell of each dot asks for.
    layers : (N,) int32 array
        The pen of each dot: an index of `colors`. Dots of one layer follow each other.
    order : (N,) integer array
        A short tour through the dots, layer by layer.
    colors : (L, 3) uint8 array
        Color of each pen.
    names : tuple of str
        Name of each pen.
    paper : (3,) uint8 array
        Color of the paper: white, or black if inverted.
    size : (int, int)
        Height and width of the image.
    max_ink : float
        Coverage of what is black in the image; all tones are scaled by it.
    bleed : bool
        Whether the frame of the image may cut dots.
    energy : float
        Integral of the ink times the squared distance to the dot of the cell, summed over layers.
    """

    points: Floats
    radii: Floats
    masses: Floats
    layers: Ints
    order: Indices
    colors: Bytes
    names: tuple[str, ...]
    paper: Bytes
    size: tuple[int, int]
    max_ink: float
    energy: float
    bleed: bool = False

    def _claims(self) -> Claims:
        yield "the tour visits each dot once", np.sort(self.order) == np.arange(len(self))
        reach = (0 if self.bleed else 1) * self.radii[:, np.newaxis] - 1e-9 * max(self.size)
        gaps = np.minimum(self.points, np.array(self.size[::-1]) - self.points)
        yield "dots are in the frame", gaps >= reach

    def __len__(self) -> int:
        return len(self.points)

    @property
    def ink(self) -> float:
        """Summed area of the dots, as a share of the paper."""
        return float((self.radii**2).sum() * np.pi / (self.size[0] * self.size[1]))

    def cells(self) -> Polygons:
        """Compute the (M, 2) corners of the cell of each dot among those of its layer, within the image.

        They are in pixels, in order around the cell, clockwise as seen on a screen; none for one of two dots in the
        same place.
        """
        cells: list[Floats] = [np.empty((0, 2))] * len(self)
        for pen in np.unique(self.layers):
            dots_of_pen = np.flatnonzero(self.layers == pen)
            for dot, cell in zip(dots_of_pen, picture_cells(self.points[dots_of_pen], self.size), strict=True):
                cells[dot] = cell
        return tuple(cells)

    def coverage(self, layer: int, scale: float = 1.0) -> Floats32:
        """Compute the share of each pixel that the dots of a layer cover, (H scale, W scale)."""
        in_layer = self.layers == layer
        return draw_dots(self.points[in_layer], self.radii[in_layer], self.size, scale)

    def draw(self, *, scale: float | None = None) -> Bytes:
        """Draw the dots with smooth edges, mixed in linear light as the eye does, with `scale` pixels per pixel.

        By default dots are 8 pixels apart, if that makes no drawing of more than 32 megapixels. The drawing is uint8,
        (H scale, W scale) for one black or white pen, else (H scale, W scale, 3).
        """
        factor = self.default_scale() if scale is None else check_positive("scale", scale)
        channels = 1 if len(self.colors) == 1 and np.ptp(self.colors) == 0 else 3
        paper = to_space(self.paper[np.newaxis, :channels], "linear")[0].astype(np.float32)
        inks = to_space(self.colors[:, :channels], "linear").astype(np.float32)
        height, width = (max(round(side * factor), 1) for side in self.size)
        light = np.full((height, width, channels), paper, np.float32)
        for pen, ink in enumerate(inks):
            covered = self.coverage(pen, factor)[:, :, np.newaxis]
            if paper.all():  # inks on white paper let light through; others hide what is below
                light *= 1 - covered * (1 - ink / paper)
            else:
                light += covered * (ink - light)
        # A table in place of powers of each pixel: 12 bits of light tell 8-bit levels apart where edges are.
        levels = from_space(np.linspace(0, 1, TABLE_SIZE)[:, np.newaxis], "linear", np.dtype(np.uint8))[:, 0]
        drawn: Bytes = levels[np.rint(light * (TABLE_SIZE - 1)).astype(np.uint16)]
        return drawn[:, :, 0] if channels == 1 else drawn

    def default_scale(self) -> float:
        """Pixels of a drawing per pixel of the image, so that dots can be told apart."""
        area = self.size[0] * self.size[1]
        spacing = np.sqrt(area / max(len(self), 1))
        return float(min(max(_SPACING / spacing, 1.0), max(np.sqrt((MOST_IN_MEMORY // 2) / area), 1.0)))

    def save(
        self,
        path: StrPath,
        *,
        width: float | None = None,
        height: float | None = None,
        paper: str | tuple[float, float] | None = None,
        landscape: bool = False,
        margin: float | None = None,
        marks: str = "disks",
        fill: str = "solid",
        pen_width: float | None = None,
        scale: float | None = None,
        overwrite: bool = False,
    ) -> None:
        """Write the dots; the suffix picks the format.

        Parameters
        ----------
        path : str or path-like
            .svg: a drawing in millimeters with one layer per pen. .png and other formats of pixels: what `draw` gives.
            .csv: a line for each dot, with places and radii in pixels.
        width, height : float, optional
            Greatest width and height of the drawing in millimeters, for .svg and .png; without paper it is 200 wide by
            default.
        paper : str or (float, float), optional
            "a2" to "a6", "letter", "legal", "tabloid", or width and height in millimeters. The drawing is fitted into
            its margins, and centered.
        landscape : bool
            Turn the paper so that it is wide.
        margin : float, optional
            Around the drawing, in millimeters; by default 10 on paper, else 0.
        marks : {"disks", "circles", "points", "line"}
            For .svg: disks; their outlines; tiny loops that a pen makes dots of; or one line through the dots of each
            layer, which does not cross itself.
        fill : {"solid", "spiral"}
            What disks are filled with: a color, or a spiral of the pen's line.
        pen_width : float, optional
            Width of the pen's line in millimeters, for .svg. By default such that points cover what the dots of a layer
            do; 0.3 for the others.
        scale : float, optional
            As for `draw`.
        overwrite : bool
            Replace an existing file.
        """
        check_choice("marks", marks, MARKS)
        check_choice("fill", fill, FILLS)
        fitted = {"width": width, "height": height, "paper": paper, "landscape": landscape, "margin": margin}
        sheet = Sheet.of(self.size, **fitted)  # type: ignore[arg-type]
        pen = None if pen_width is None else check_positive("pen_width", pen_width, "in millimeters")
        suffix = check_choice("suffix", Path(path).suffix.lower(), suffixes())
        if suffix == ".svg":
            _write_svg(path, sheet, self._marked_layers(sheet, marks, fill, pen), overwrite)
        elif suffix == ".csv":
            columns = (*self.points.T, self.radii, self.masses, self.layers)
            rows = zip(*(column[self.order].tolist() for column in columns), strict=True)
            write_csv(path, ("x", "y", "radius", "mass", "layer"), rows, overwrite=overwrite)
        else:
            drawn = self.draw(scale=scale)
            per_mm = drawn.shape[1] / (self.size[1] * sheet.scale)
            whole = np.rint(np.array(sheet.size[::-1]) * per_mm).astype(int) - drawn.shape[:2]
            around = [(int(more) // 2, int(more) - int(more) // 2) for more in np.maximum(whole, 0)]
            page = np.pad(drawn, [*around, (0, 0)][: drawn.ndim], constant_values=int(self.paper[0]))
            metadata = Metadata(dpi=(per_mm / INCHES["mm"],) * 2)
            write_image(path, page, metadata=metadata, overwrite=overwrite)

    def save_cells(self, path: StrPath, *, overwrite: bool = False, **fitted: Any) -> None:
        """Write the cells of the dots as polygons: lines in millimeters (.svg), or in pixels (.geojson).

        The drawing is fitted by `width`, `height`, `paper`, `landscape` and `margin`, as in `save`.
        """
        if check_choice("suffix", Path(path).suffix.lower(), (".svg", ".geojson")) == ".svg":
            sheet = Sheet.of(self.size, **fitted)
            _write_svg(path, sheet, self._cell_layers(sheet), overwrite)
            return
        cells = self.cells()
        polygons: list[Polygon] = []
        properties: dict[int, dict[str, float | str]] = {}
        for dot in self.order.tolist():
            if len(cells[dot]):
                about = {"radius": float(self.radii[dot]), "mass": float(self.masses[dot])}
                x, y = self.points[dot].tolist()
                properties[len(polygons)] = {"x": x, "y": y, **about, "pen": self.names[self.layers[dot]]}
                polygons.append(Polygon(len(polygons), (np.concatenate([cells[dot], cells[dot][:1]]),)))
        write_geojson(path, polygons, properties, overwrite=overwrite)

    def _marked_layers(self, sheet: Sheet, marks: str, fill: str, pen_width: float | None) -> Iterator[str]:
        if not self.paper.all():
            yield f'<rect width="100%" height="100%" fill="{hexadecimal(self.paper)}"/>\n'
        for pen, name in enumerate(self.names):
            dots_of_pen = self.order[self.layers[self.order] == pen]
            radii, ink = self.radii[dots_of_pen] * sheet.scale, hexadecimal(self.colors[pen])
            # By default points cover what the dots do.
            covered = np.pi / 4 + 2**1.5 * _POINT + 2 * _POINT**2  # by a point, in squared widths of the pen
            suiting = radii.mean() * np.sqrt(np.pi / covered) if marks == "points" and len(dots_of_pen) else _LINE
            line = suiting if pen_width is None else pen_width
            look = f'fill="none" stroke="{ink}" stroke-width="{number(line, 4)}"'
            look += ' stroke-linecap="round" stroke-linejoin="round"'
            look = f'fill="{ink}"' if marks == "disks" and fill == "solid" else look
            # Inks on white paper let the light of others through.
            blend = ' style="mix-blend-mode:multiply"' if len(self.names) > 1 and self.paper.all() else ""
            # The line of a pen, too, is whole within the frame.
            reach = 0.0 if self.bleed or marks == "disks" else min(line, min(self.size) * sheet.scale) / 2
            frame = np.array(self.size[::-1]) * sheet.scale
            places = np.clip(self.points[dots_of_pen] * sheet.scale, reach, frame - reach) + sheet.corner
            yield from layer(pen + 1, name, look + blend, _marks(marks, places, radii, line, fill))

    def _cell_layers(self, sheet: Sheet) -> Iterator[str]:
        cells = self.cells()
        for pen, name in enumerate(self.names):
            look = f'fill="none" stroke="{hexadecimal(self.colors[pen])}" stroke-width="{_CELL_LINE}"'
            dots_of_pen = self.order[self.layers[self.order] == pen]
            rings = (cells[dot] * sheet.scale + sheet.corner for dot in dots_of_pen if len(cells[dot]))
            outlines = (f'<path d="M{" ".join(numbers(ring.ravel(), 3))}Z"/>\n' for ring in rings)
            yield from layer(pen + 1, name, f'{look} stroke-linejoin="round"', outlines)

    def _repr_png_(self) -> bytes:
        return encode_image(".png", self.draw())

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        return {
            "n": len(self),
            "layers": list(self.names),
            "radius": float(self.radii.mean()) if len(self) else None,
            "max_ink": self.max_ink,
            "ink": self.ink,
            "energy": self.energy,
        }

    def __repr__(self) -> str:
        height, width = self.size
        layers = f" in {len(self.colors)} layers" if len(self.colors) > 1 else ""
        radii = f", radius {self.radii.mean():.3g}" if len(self) else ""
        return f"Stipples({len(self)} dots{layers} on {width} x {height}{radii}, max_ink={self.max_ink:.3g})"

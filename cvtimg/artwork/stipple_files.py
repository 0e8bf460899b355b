"""Dots on disk: drawings for plotters and printers, pixels, and tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_positive
from cvtimg._shared.svg import LAYERED, drawing, hexadecimal, layer, number, numbers
from cvtimg.files.arrays import save_arrays
from cvtimg.files.text_tables import write_csv
from cvtimg.files.whole import StrPath, whole_file, write_text
from cvtimg.labels.contours import Polygon
from cvtimg.labels.formats.geojson import write_geojson
from cvtimg.pictures.files import lossless_suffixes
from cvtimg.placement.cells import Polygons

MARKS = ("disks", "circles", "points", "lines")
#: Formats of dots beside those of pixels.
TABLES = (".csv", ".npy", ".npz")
#: Width of the line of circles, in millimeters, where none is given.
_LINE = 0.3
#: Half a diagonal of points, and half the length of lines, in widths of the pen: a pen that goes no way at all may make
#: no dot.
_POINT = 0.05
#: Area that the pen covers for a dot, in squared widths of the pen.
_COVERED = {"points": np.pi / 4 + 2**1.5 * _POINT + 2 * _POINT**2, "lines": np.pi / 4 + 2 * _POINT}
#: Width of the lines of cells, in millimeters.
_CELL_LINE = 0.1


@dataclass(frozen=True, slots=True)
class Paper:
    """How dots come onto paper."""

    width: float  # of the drawing, in millimeters
    marks: str  # what stands for a dot
    pen_width: float | None  # in millimeters; None for what suits the dots

    def __post_init__(self) -> None:
        check_choice("marks", self.marks, MARKS)
        for name, value in (("width", self.width), ("pen_width", self.pen_width)):
            if value is not None:
                check_positive(name, value, "in millimeters")


@dataclass(frozen=True, slots=True, eq=False)
class PenDots:
    """The dots of one pen, in the order in which they are drawn."""

    name: str
    color: NDArray[np.uint8]
    points: NDArray[np.float64]  # (N, 2), in pixels
    radii: NDArray[np.float64]  # (N,), in pixels
    masses: NDArray[np.float64]
    cells: Polygons = ()  # empty if they are not asked for


def suffixes() -> list[str]:
    """List what dots can be written in."""
    pixels = [suffix for suffix in lossless_suffixes() if suffix not in TABLES]
    return [".svg", *pixels, ".jpg", ".jpeg", *TABLES]


def write_table(path: StrPath, pens: Sequence[PenDots], *, overwrite: bool) -> None:
    """Write dots as text, or as arrays of NumPy."""
    points, radii, masses = (
        np.concatenate([getattr(pen, name) for pen in pens]) for name in ("points", "radii", "masses")
    )
    layers = np.repeat(np.arange(len(pens)), [len(pen.radii) for pen in pens])
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        columns = (points[:, 0], points[:, 1], radii, masses, layers)
        rows = zip(*(column.tolist() for column in columns), strict=True)
        write_csv(path, ("x", "y", "radius", "mass", "layer"), rows, overwrite=overwrite)
        return
    if suffix == ".npz":
        colors = np.stack([pen.color for pen in pens])
        arrays = {"points": points, "radii": radii, "masses": masses, "layers": layers, "colors": colors}
        save_arrays(path, "stipples", arrays, overwrite=overwrite)
        return
    with whole_file(path, overwrite=overwrite) as file:
        np.save(file, np.column_stack([points, radii, layers]))


def write_svg(
    path: StrPath,
    pens: Sequence[PenDots],
    size: tuple[int, int],
    ground: NDArray[np.uint8],
    paper: Paper,
    *,
    overwrite: bool,
) -> None:
    """Write dots as a drawing in millimeters, with a layer for each pen."""
    scale = paper.width / size[1]
    body = _layers(pens, ground, paper, scale)
    write_text(path, drawing(paper.width, size[0] * scale, body, unit="mm", attributes=LAYERED), overwrite=overwrite)


def _layers(pens: Sequence[PenDots], ground: NDArray[np.uint8], paper: Paper, scale: float) -> Iterator[str]:
    if not ground.all():
        yield f'<rect width="100%" height="100%" fill="{hexadecimal(ground)}"/>\n'
    for place, pen in enumerate(pens, 1):
        radii = pen.radii * scale
        line = _suiting_line(paper.marks, radii) if paper.pen_width is None else paper.pen_width
        ink = hexadecimal(pen.color)
        look = f'fill="none" stroke="{ink}" stroke-width="{number(line, 4)}"'
        look += ' stroke-linecap="round" stroke-linejoin="round"'
        attributes = f'fill="{ink}"' if paper.marks == "disks" else look
        # Inks on white paper let the light of others through.
        blend = ' style="mix-blend-mode:multiply"' if len(pens) > 1 and ground.all() else ""
        yield from layer(place, pen.name, attributes + blend, _marks(paper.marks, pen.points * scale, radii, line))


def _suiting_line(marks: str, radii: NDArray[np.float64]) -> float:
    """Choose a width of the pen: for marks that it dots, so that they cover what the dots do."""
    if marks not in _COVERED or not len(radii):
        return _LINE
    return float(radii.mean() * np.sqrt(np.pi / _COVERED[marks]))


def _marks(marks: str, places: NDArray[np.float64], radii: NDArray[np.float64], line: float) -> Iterator[str]:
    half = _POINT * line
    if marks in _COVERED:
        # Loops have corners: viewers leave a hole in a round one that is smaller than its line is wide.
        r = number(half, 4)
        way = f"h{number(2 * half, 4)}" if marks == "lines" else f"l{r}-{r} {r} {r}-{r} {r}z"
        starts = zip(numbers(places[:, 0] - half, 3), numbers(places[:, 1], 3), strict=True)
        yield from (f'<path d="M{x} {y}{way}"/>\n' for x, y in starts)
        return
    if marks == "circles":
        radii = np.maximum(radii - line / 2, half)
    marked = zip(numbers(places[:, 0], 3), numbers(places[:, 1], 3), numbers(radii, 4), strict=True)
    yield from (f'<circle cx="{x}" cy="{y}" r="{r}"/>\n' for x, y, r in marked)


def write_cells(
    path: StrPath, pens: Sequence[PenDots], size: tuple[int, int], width: float, *, overwrite: bool
) -> None:
    """Write the cells of dots as lines, or as polygons with what is known of each dot."""
    if check_choice("suffix", Path(path).suffix.lower(), (".svg", ".geojson")) == ".geojson":
        _write_geojson(path, pens, overwrite)
        return
    scale = Paper(width, "lines", None).width / size[1]
    body = _cell_layers(pens, scale)
    write_text(path, drawing(width, size[0] * scale, body, unit="mm", attributes=LAYERED), overwrite=overwrite)


def _cell_layers(pens: Sequence[PenDots], scale: float) -> Iterator[str]:
    for place, pen in enumerate(pens, 1):
        look = f'fill="none" stroke="{hexadecimal(pen.color)}" stroke-width="{_CELL_LINE}" stroke-linejoin="round"'
        yield from layer(place, pen.name, look, _outlines(pen.cells, scale))


def _outlines(cells: Iterable[NDArray[np.float64]], scale: float) -> Iterator[str]:
    for cell in cells:
        if len(cell):
            yield f'<path d="M{" ".join(numbers(cell.ravel() * scale, 3))}Z"/>\n'


def _write_geojson(path: StrPath, pens: Sequence[PenDots], overwrite: bool) -> None:
    polygons: list[Polygon] = []
    properties: dict[int, dict[str, float | str]] = {}
    for pen in pens:
        values = zip(*pen.points.T.tolist(), pen.radii.tolist(), pen.masses.tolist(), pen.cells, strict=True)
        for x, y, radius, mass, cell in values:
            if len(cell):
                polygons.append(Polygon(len(polygons), (np.concatenate([cell, cell[:1]]),)))
                properties[len(properties)] = {"x": x, "y": y, "radius": radius, "mass": mass, "pen": pen.name}
    write_geojson(path, polygons, properties, overwrite=overwrite)

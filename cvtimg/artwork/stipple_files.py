"""Dots on disk: drawings for plotters and printers, pixels, and tables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice
from cvtimg.artwork.svg import drawing, hexadecimal, layer, number, numbers, write_text
from cvtimg.files.text_tables import write_csv
from cvtimg.files.whole import StrPath, whole_file
from cvtimg.labels.contours import Polygon
from cvtimg.labels.files import write_geojson
from cvtimg.pictures.files import Metadata, lossless_suffixes, write_image

if TYPE_CHECKING:
    from cvtimg.artwork.stipples import Stipples

MARKS = ("disks", "circles", "points", "lines")
#: Formats of dots beside those of pixels.
TABLES = (".csv", ".npy", ".npz")
#: Width of the line of circles, in millimeters, where none is given.
_LINE = 0.3
#: Radius of points, and length of lines, in widths of the pen: a pen that goes no way at all may make no dot.
_POINT = 0.1
#: Width of the lines of cells, in millimeters.
_CELL_LINE = 0.1
_INCH = 25.4


@dataclass(frozen=True, slots=True)
class Paper:
    """How dots come onto paper.

    Attributes
    ----------
    width : float
        Of the drawing in millimeters.
    marks : {"disks", "circles", "points", "lines"}
        What stands for a dot.
    pen_width : float or None
        In millimeters; None for what suits the dots.
    tour : bool
        Whether dots are in the order of the tour.
    """

    width: float
    marks: str
    pen_width: float | None
    tour: bool

    def __post_init__(self) -> None:
        check_choice("marks", self.marks, MARKS)
        for name, value in (("width", self.width), ("pen_width", self.pen_width)):
            if value is not None and not 0 < value < np.inf:
                raise ValueError(f"{name}={value} must be a finite number > 0, in millimeters")


def save_stipples(stipples: Stipples, path: StrPath, paper: Paper, *, scale: float | None, overwrite: bool) -> None:
    """Write dots in the format that the suffix names."""
    pixels = [suffix for suffix in (*lossless_suffixes(), ".jpg", ".jpeg") if suffix not in TABLES]
    suffix = check_choice("suffix", Path(path).suffix.lower(), (".svg", *pixels, *TABLES))
    order = stipples.order if paper.tour else np.arange(len(stipples))
    if suffix == ".svg":
        write_text(path, _svg(stipples, order, paper), overwrite=overwrite)
    elif suffix == ".csv":
        columns = (stipples.points[:, 0], stipples.points[:, 1], stipples.radii, stipples.masses)
        rows = zip(*(column[order].tolist() for column in columns), stipples.layers[order].tolist(), strict=True)
        write_csv(path, ("x", "y", "radius", "mass", "layer"), rows, overwrite=overwrite)
    elif suffix in TABLES:
        _write_arrays(stipples, order, path, suffix, overwrite)
    else:
        drawn = stipples.draw(scale=scale)
        dpi = drawn.shape[1] / paper.width * _INCH
        write_image(path, drawn, metadata=Metadata(dpi=(dpi, dpi)), overwrite=overwrite)


def _write_arrays(stipples: Stipples, order: NDArray[np.intp], path: StrPath, suffix: str, overwrite: bool) -> None:
    points, radii, layers = stipples.points[order], stipples.radii[order], stipples.layers[order]
    with whole_file(path, overwrite=overwrite) as file:
        if suffix == ".npy":
            np.save(file, np.column_stack([points, radii, layers]))
        else:
            arrays = {"points": points, "radii": radii, "masses": stipples.masses[order], "layers": layers}
            np.savez(file, **arrays, colors=stipples.colors, size=np.array(stipples.size))


def _svg(stipples: Stipples, order: NDArray[np.intp], paper: Paper) -> Iterator[str]:
    height, width = stipples.size
    scale = paper.width / width
    return drawing(paper.width, height * scale, unit="mm", body=_layers(stipples, order, paper, scale))


def _layers(stipples: Stipples, order: NDArray[np.intp], paper: Paper, scale: float) -> Iterator[str]:
    if not stipples.paper.all():
        yield f'<rect width="100%" height="100%" fill="{hexadecimal(stipples.paper)}"/>\n'
    for pen, (color, name) in enumerate(zip(stipples.colors, stipples.names, strict=True)):
        own = order[stipples.layers[order] == pen]
        radii = stipples.radii[own] * scale
        suits = _LINE if paper.marks == "circles" else 2 * float(radii.mean() if len(own) else 1)
        line = suits if paper.pen_width is None else paper.pen_width
        ink = hexadecimal(color)
        look = f'fill="none" stroke="{ink}" stroke-width="{number(line, 4)}" stroke-linecap="round"'
        attributes = f'fill="{ink}"' if paper.marks == "disks" else look
        # Inks on white paper let the light of others through.
        blend = ' style="mix-blend-mode:multiply"' if len(stipples.colors) > 1 and stipples.paper.all() else ""
        marks = _marks(paper.marks, stipples.points[own] * scale, radii, line)
        yield from layer(pen + 1, name, attributes + blend, marks)


def _marks(marks: str, places: NDArray[np.float64], radii: NDArray[np.float64], line: float) -> Iterator[str]:
    xs, ys = numbers(places[:, 0], 3), numbers(places[:, 1], 3)
    if marks == "lines":
        length = number(_POINT * line, 4)
        yield from (f'<path d="M{x} {y}h{length}"/>\n' for x, y in zip(xs, ys, strict=True))
        return
    if marks == "circles":
        radii = np.maximum(radii - line / 2, _POINT * line)
    elif marks == "points":
        radii = np.full_like(radii, _POINT * line)
    sizes = numbers(radii, 4)
    yield from (f'<circle cx="{x}" cy="{y}" r="{r}"/>\n' for x, y, r in zip(xs, ys, sizes, strict=True))


def save_cells(stipples: Stipples, path: StrPath, width: float, *, overwrite: bool) -> None:
    """Write the cells of dots as lines, or as polygons with what is known of each dot."""
    suffix = check_choice("suffix", Path(path).suffix.lower(), (".svg", ".geojson"))
    cells = stipples.cells()
    if suffix == ".geojson":
        drawn = [Polygon(dot, (np.concatenate([cell, cell[:1]]),)) for dot, cell in enumerate(cells) if len(cell)]
        properties = {
            dot: {"x": x, "y": y, "radius": radius, "mass": mass, "layer": pen}
            for dot, (x, y, radius, mass, pen) in enumerate(
                zip(
                    *stipples.points.T.tolist(),
                    stipples.radii.tolist(),
                    stipples.masses.tolist(),
                    stipples.layers.tolist(),
                    strict=True,
                )
            )
        }
        write_geojson(path, drawn, properties, overwrite=overwrite)
        return
    scale = Paper(width, "lines", None, tour=True).width / stipples.size[1]
    body = _cell_layers(stipples, cells, scale)
    write_text(path, drawing(width, stipples.size[0] * scale, unit="mm", body=body), overwrite=overwrite)


def _cell_layers(stipples: Stipples, cells: tuple[NDArray[np.float64], ...], scale: float) -> Iterator[str]:
    for pen, (color, name) in enumerate(zip(stipples.colors, stipples.names, strict=True)):
        look = f'fill="none" stroke="{hexadecimal(color)}" stroke-width="{_CELL_LINE}" stroke-linejoin="round"'
        own = (cells[dot] for dot in stipples.order if stipples.layers[dot] == pen and len(cells[dot]))
        yield from layer(
            pen + 1, name, look, (f'<path d="M{" ".join(numbers(cell.ravel() * scale, 3))}Z"/>\n' for cell in own)
        )

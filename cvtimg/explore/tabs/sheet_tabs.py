"""Tabs that need no picture: Sphere, grids of a globe that turns, and Design, points in each pair of their axes."""

import shlex
from collections.abc import Sequence
from html import escape
from itertools import combinations
from typing import Any, ClassVar

import numpy as np

from cvtimg._shared.choices import Json, Options
from cvtimg._shared.svg import drawing
from cvtimg.designs import Design, Factor
from cvtimg.explore.controls import Choice, Control, Entry, Number, Settings, Table, UnfitRequestError, controls_of
from cvtimg.explore.layers import Drawing, Globe, Layer
from cvtimg.explore.outcomes import Code, Line, Outcome, Output, call, evaluated
from cvtimg.explore.tabs.base import Request, Tab
from cvtimg.plotting.charts import MOST_AXES
from cvtimg.sphere import Refinement, SphereGrid, WidthCircle

#: Width of the sheet, its margin, and the gap between panels.
_SIZE, _MARGIN, _GAP = 1000, 56, 14
_FILES = {
    ".nc": "MPAS mesh (.nc)",
    ".ugrid.nc": "UGRID (.ugrid.nc)",
    ".scrip.nc": "SCRIP (.scrip.nc)",
    ".graph.info": "Graph for METIS (.graph.info)",
    ".vtu": "VTK (.vtu)",
    ".geojson": "Cells, GeoJSON",
    ".csv": "Points, CSV",
}


def _column(name: str, label: str, default: float, low: float, high: float, unit: str, suffix: str = "") -> Number:
    return Number(name=name, label=label, default=default, low=low, high=high, step=0.01, unit=unit, suffix=suffix)


_CENTER = (_column("lon", "Lon", 0.0, -180, 180, "°"), _column("lat", "Lat", 0.0, -90, 90, "°"))
_CIRCLE = (*_CENTER, _column("radius", "Radius", 20.0, 0.1, 179, "°"), _column("ratio", "Times finer", 4, 1, 16, ""))
_WIDTH = _column("width", "Width", 240.0, 5, 5000, "km", "km")
_CIRCLE_KM = (*_CENTER, _column("radius", "Radius", 2000.0, 10, 20_000, "km", "km"), _WIDTH)
_CIRCLES: Json = {
    "label": "Finer in",
    "flag": "--refine",
    "adds": "Add a circle",
    "about": "Click the globe to add a circle; drag its middle to move it, its rim to resize it.",
}
_AXIS = (Entry(name="name", label="Name", default="x"), Entry(name="values", label="Values", default="0, 1"))


class SphereTab(Tab):
    about = "Cells of equal or chosen size on the globe, for models of oceans and atmospheres. Needs no image."
    sheet = (1000, 1000)
    tool = "globe"
    most_drafted = 2562
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "sphere",
        Choice(name="by", label="Sizes by", choices={"n": "number of points", "width": "width of cells"}),
        ("number", {"name": "n", "when": {"by": ["n"]}}),
        ("cell_width", {"when": {"by": ["width"]}}),
        Table(name="circles", columns=_CIRCLE, when={"by": ["n"]}, **_CIRCLES),
        Table(name="circles_km", columns=_CIRCLE_KM, when={"by": ["width"]}, **_CIRCLES),
        "effort",
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        outputs = []
        for suffix, label in _FILES.items():
            command = shlex.join([*self.words(request), "-o", f"globe{suffix}"])
            history = {"attributes": {"history": command}} if suffix.endswith(".nc") else {}
            outputs.append(Output(label, "-o", f"globe{suffix}", keywords=history))
        return outputs

    def lines(self, request: Request) -> list[Line]:
        settings = request.settings
        _n_points(settings)  # are they too many?
        return [Line("result", self._call(settings, *([settings["n"]] if settings["by"] == "n" else [])))]

    def _call(self, settings: Settings, *number: int) -> Code:
        density = {"density": made} if (made := _density(settings)) else {}
        return call("cvtimg.sphere_grid", *number, **self.keywords(settings), **density)

    def draft(self, request: Request) -> Outcome | None:
        settings = {**request.settings, "effort": "fast"}
        code = self._call(settings, min(_n_points(settings), self.most_drafted))
        return Outcome(*self.seen(request, {"result": evaluated(code, {})}))

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: SphereGrid = values["result"]
        cells, measures, widths = result.cells(), result.measures(), result.widths()
        obtuse = f"{measures.n_obtuse} obtuse triangles" if measures.n_obtuse else "no obtuse triangle"
        low, middle, high = np.quantile(widths, (0, 0.5, 1)).tolist()
        about = f"Widths {low:.0f} to {high:.0f} km, median {middle:.0f}."
        about = f"Least angle {measures.least_angle:.1f}°, {obtuse}. {about}"
        ends = np.stack([cells.corners, np.roll(cells.corners, -1)], axis=1)
        ends[cells.offsets[1:] - 1, 1] = cells.corners[cells.offsets[:-1]]
        once = ends[ends[:, 0] < ends[:, 1]]  # each edge belongs to two cells, which walk it in opposite ways
        layer = Globe(cells.vertices.astype(np.float32), once.astype(np.uint32))
        return layer, {"k": len(result.points), "noun": "cells", "about": about}


class DesignTab(Tab):
    about = "Place points for experiments evenly in a box. Needs no image."
    sheet = (_SIZE, _SIZE)
    most_drafted = 200
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "design",
        ("number", {"name": "n"}),
        Choice(name="box", label="Box", choices={"cube": "unit cube", "axes": "named axes"}),
        ("dimensions", {"when": {"box": ["cube"]}}),
        Table(
            name="axes",
            label="Axes",
            default=(("speed", "0, 30"), ("heat", "20, 90"), ("alloy", "A | B | C")),
            columns=_AXIS,
            most=64,
            adds="Add an axis",
            flag="--axis",
            always=True,
            when={"box": ["axes"]},
            about="Values: a range as 0, 30; whole numbers as 1, 4, integer; or levels as A | B | C.",
        ),
        "latin",
        ("criterion", {"when": {"latin": [True]}}),
        "periodic",
        "effort",
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        ends = (".csv",) if any(factor.levels for factor in _factors(request.settings)) else (".csv", ".npy")
        return [Output(f"Points, {end[1:].upper()}", "-o", f"design{end}") for end in ends]

    def lines(self, request: Request) -> list[Line]:
        settings = request.settings
        box = _factors(settings) or settings["dimensions"]
        return [Line("result", call("cvtimg.design", settings["n"], box, **self.keywords(settings)))]

    def scaled(self, request: Request) -> Settings:
        return {**Tab.scaled(self, request), "n": min(request.settings["n"], self.most_drafted)}

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: Design = values["result"]
        n_points, n_axes = result.points.shape
        shown = f"the first {MOST_AXES} of " if n_axes > MOST_AXES else ""
        about = f"In each pair of {shown}{n_axes} axes. Mean squared distance to the nearest {result.energy:.4g}."
        layer = Drawing(_drawn(result, result.factors[:MOST_AXES]))
        return layer, {"k": n_points, "noun": "points", "about": about}


def _density(settings: Settings) -> Any:
    """Return what says how cells vary; nothing for cells of one size."""
    if settings["by"] == "width":
        circles = [WidthCircle(*row) for row in settings["circles_km"]]
        return call("cvtimg.sphere.CellWidth", settings["cell_width"], *([circles] if circles else []))
    return [Refinement(*row) for row in settings["circles"]]


def _n_points(settings: Settings) -> int:
    if settings["by"] == "n":
        return int(settings["n"])
    n_points: int = evaluated(_density(settings), {}).n_points
    (most,) = (control.high for control in SphereTab.controls if isinstance(control, Number) and control.name == "n")
    if n_points > most:
        allowed = f"the page shows up to {most:,}, the command line makes more"
        raise UnfitRequestError(f"these widths take {n_points:,} points; {allowed}")
    return n_points


def _factors(settings: Settings) -> list[Factor]:
    if settings["box"] == "cube":
        return []
    try:
        factors = [Factor.parse(f"{name},{values}") for name, values in settings["axes"]]
    except ValueError as error:
        raise UnfitRequestError(f"Axes: {error}") from error
    if not factors:
        raise UnfitRequestError("Axes: add one")
    return factors


def _drawn(design: Design, factors: Sequence[Factor]) -> bytes:
    """Draw the points in each pair of axes, with names on the diagonal."""
    n_axes = len(factors)
    side = (_SIZE - 2 * _MARGIN - (n_axes - 1) * _GAP) / n_axes
    places = design.unit_points
    radius = float(np.clip(side / 3 / np.sqrt(len(places)), 1.2, 6))
    body = ['<rect width="100%" height="100%" fill="#fff"/><g font-family="sans-serif" font-size="15" fill="#333">']
    starts = [_MARGIN + axis * (side + _GAP) for axis in range(n_axes)]
    for factor, start in zip(factors, starts, strict=True):
        body.append(_frame(start, start, side))
        body.append(f'<text x="{start + 8:.1f}" y="{start + 20:.1f}" font-weight="600">{escape(factor.header)}</text>')
        ends = (factor.levels[0], factor.levels[-1]) if factor.levels else (f"{factor.low:g}", f"{factor.high:g}")
        for text, x, anchor in zip(ends, (start, start + side), ("start", "end"), strict=True):
            body.append(f'<text x="{x:.1f}" y="{_SIZE - _MARGIN + 20}" text-anchor="{anchor}">{escape(text)}</text>')
    for right, down in combinations(range(n_axes), 2):
        body.append(_frame(starts[right], starts[down], side))
        across, up = starts[right] + side * places[:, right], starts[down] + side * (1 - places[:, down])
        path = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in zip(across.tolist(), up.tolist(), strict=True))
        body.append(f'<path d="{path}" stroke="#0b5fc4" stroke-width="{2 * radius:.2f}" stroke-linecap="round"/>')
    return "".join(drawing(_SIZE, _SIZE, [*body, "</g>"])).encode()


def _frame(x: float, y: float, side: float) -> str:
    return f'<rect x="{x:.1f}" y="{y:.1f}" width="{side:.1f}" height="{side:.1f}" fill="none" stroke="#ccc"/>'

"""Sphere: grids of the globe, seen on a globe that turns."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from cvtimg._shared.choices import Json, Options
from cvtimg.explore.calls import Code, Line, call, evaluated
from cvtimg.explore.controls import Choice, Control, Number, Settings, Table, UnfitRequestError, controls_of
from cvtimg.explore.layers import Globe, Layer
from cvtimg.explore.outcomes import Outcome, Output
from cvtimg.explore.tabs.base import Request, Tab
from cvtimg.sphere import Refinement, SphereGrid, WidthCircle

#: Points that the page shows at most.
_MOST = 163_842
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
_CIRCLES: Json = {
    "label": "Finer in",
    "flag": "--refine",
    "adds": "Add a circle",
    "about": "Click the globe to add a circle; drag its middle to move it, its rim to resize it.",
}


class SphereTab(Tab):
    name = "sphere"
    about = "Cells of equal or chosen size on the globe, for models of oceans and atmospheres. Needs no image."
    verb = "sphere"
    sheet = (1000, 1000)
    tool = "globe"
    most_drafted = 2562
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "sphere",
        Choice(name="by", label="Sizes by", default="n", choices={"n": "number of points", "width": "width of cells"}),
        ("number", {"name": "n", "when": {"by": ["n"]}}),
        ("cell_width", {"when": {"by": ["width"]}}),
        Table(
            name="circles",
            columns=(
                *_CENTER,
                _column("radius", "Radius", 20.0, 0.1, 179, "°"),
                _column("ratio", "Times finer", 4, 1, 16, ""),
            ),
            when={"by": ["n"]},
            **_CIRCLES,
        ),
        Table(
            name="circles_km",
            columns=(
                *_CENTER,
                _column("radius", "Radius", 2000.0, 10, 20_000, "km", "km"),
                _column("width", "Width", 240.0, 5, 5000, "km", "km"),
            ),
            when={"by": ["width"]},
            **_CIRCLES,
        ),
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
        facts = {
            "k": len(result.points),
            "noun": "cells",
            "about": f"Least angle {measures.least_angle:.1f}°, {obtuse}. "
            f"Widths {low:.0f} to {high:.0f} km, median {middle:.0f}.",
        }
        ends = np.stack([cells.corners, np.roll(cells.corners, -1)], axis=1)
        ends[cells.offsets[1:] - 1, 1] = cells.corners[cells.offsets[:-1]]
        once = ends[ends[:, 0] < ends[:, 1]]  # each edge belongs to two cells, which walk it in opposite ways
        return Globe(cells.vertices.astype(np.float32), once.astype(np.uint32)), facts


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
    if n_points > _MOST:
        raise UnfitRequestError(
            f"these widths take {n_points:,} points; the page shows up to {_MOST:,}, the command line makes more"
        )
    return n_points

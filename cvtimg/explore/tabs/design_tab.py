"""Design: points for experiments, seen in each pair of their axes."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import combinations
from typing import ClassVar

import numpy as np

from cvtimg._shared.choices import Json, Options
from cvtimg._shared.svg import drawing
from cvtimg.designs import Design, Factor
from cvtimg.explore.calls import Line, call
from cvtimg.explore.controls import Choice, Control, Entry, Settings, Table, UnfitRequestError, controls_of
from cvtimg.explore.layers import Drawing, Layer
from cvtimg.explore.outcomes import Output
from cvtimg.explore.tabs.base import Request, Tab

#: Axes that are drawn.
_MOST_AXES = 8
#: Width of the sheet, its margin, and the gap between panels.
_SIZE, _MARGIN, _GAP = 1000, 56, 14


class DesignTab(Tab):
    name = "design"
    about = "Place points for experiments evenly in a box. Needs no image."
    verb = "design"
    sheet = (_SIZE, _SIZE)
    most_drafted = 200
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "design",
        ("number", {"name": "n"}),
        Choice(name="box", label="Box", default="cube", choices={"cube": "unit cube", "axes": "named axes"}),
        ("dimensions", {"when": {"box": ["cube"]}}),
        Table(
            name="axes",
            label="Axes",
            default=(("speed", "0, 30"), ("heat", "20, 90"), ("alloy", "A | B | C")),
            columns=(
                Entry(name="name", label="Name", default="x"),
                Entry(name="values", label="Values", default="0, 1"),
            ),
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
        return {**request.settings, "effort": "fast", "n": min(request.settings["n"], self.most_drafted)}

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: Design = values["result"]
        n_points, n_axes = result.points.shape
        shown = f"the first {_MOST_AXES} of " if n_axes > _MOST_AXES else ""
        about = f"In each pair of {shown}{n_axes} axes. Mean squared distance to the nearest {result.energy:.4g}."
        layer = Drawing(_drawn(result, result.factors[:_MOST_AXES]))
        return layer, {"k": n_points, "noun": "points", "about": about}


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

"""Mosaic: the picture as convex tiles of one color each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from cvtimg._shared.choices import Json, Options
from cvtimg.artwork import Mosaic
from cvtimg.explore.calls import Line, call
from cvtimg.explore.controls import Choice, Control, Settings, controls_of
from cvtimg.explore.layers import Drawing, Layer
from cvtimg.explore.outcomes import Output, written_as
from cvtimg.explore.tabs.base import IMAGE, Request, Tab, reading


class MosaicTab(Tab):
    name = "mosaic"
    about = "Turn the image into tiles of one color each, whose borders follow its edges."
    verb = "mosaic"
    pace = 1.6
    most_drafted = 1 << 16
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "mosaic",
        ("number", {"name": "n_cells", "keyword": "", "room": 16}),
        "shape",
        Choice(name="limit", label="Colors", default="all", choices={"all": "one for each tile", "few": "only a few"}),
        ("palette", {"when": {"limit": ["few"]}, "always": True}),
        "outline",
        "space",
        "effort",
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        outline = request.settings["outline"]
        drawn = {"outline": outline} if outline else {}
        return [
            Output("Drawing, SVG", "-o", "{}-mosaic.svg", keywords=drawn),
            Output("Pixels, PNG", "-o", "{}-mosaic.png", keywords=drawn),
            *([] if outline else [Output("Polygons, GeoJSON", "-o", "{}-mosaic.geojson")]),
        ]

    def lines(self, request: Request) -> list[Line]:
        keywords = self.keywords(request.settings)
        return [reading(request), Line("result", call("cvtimg.mosaic", IMAGE, request.settings["n_cells"], **keywords))]

    def scaled(self, request: Request) -> Settings:
        number = min(request.settings["n_cells"], max(1, math.prod(request.size) // 64))
        return {**Tab.scaled(self, request), "n_cells": number, "effort": "fast"}

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: Mosaic = values["result"]
        svg = written_as("drawing.svg", lambda path: result.save(path, outline=request.settings["outline"]))
        return Drawing(svg), {"k": len(result.colors), "noun": "tiles"}

"""Mosaic: the picture as convex tiles of one color each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

from cvtimg.artwork import Mosaic
from cvtimg.explore.calls import Call, Line
from cvtimg.explore.controls import Choice, Control, controls_of
from cvtimg.explore.layers import Drawing, Layer
from cvtimg.explore.outcomes import Outcome, Output, written_as
from cvtimg.explore.tabs.base import IMAGE, Request, Tab, reading


class MosaicTab(Tab):
    """Mosaics."""

    name = "mosaic"
    title = "Mosaic"
    about = "Turn the image into tiles of one color each, whose borders follow its edges."
    verb = "mosaic"
    most_drafted = 1 << 16
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "mosaic",
        ("number", {"name": "n_cells", "keyword": ""}),
        "shape",
        Choice(name="limit", label="Colors", default="all", choices={"all": "one for each tile", "few": "only a few"}),
        ("palette", {"when": {"limit": ["few"]}, "always": True}),
        "outline",
        "space",
        "effort",
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        outline = request.settings["outline"]
        drawn = Call("save", (), {"outline": outline} if outline else {}, "result")
        return [
            Output("Drawing, SVG", "-o", "{}-mosaic.svg", drawn),
            Output("Pixels, PNG", "-o", "{}-mosaic.png", drawn),
            *([] if outline else [Output("Polygons, GeoJSON", "-o", "{}-mosaic.geojson")]),
        ]

    def lines(self, request: Request) -> list[Line]:
        keywords = self.keywords(request.settings)
        call = Call("mosaic", (IMAGE, request.settings["n_cells"]), keywords)
        return [reading(request), Line("result", call)]

    def draft(self, request: Request) -> Outcome | None:
        step = request.picture.whole(self.most_drafted).step
        settings = {**request.settings, "effort": "fast", "outline": request.settings["outline"] / step}
        settings["n_cells"] = min(settings["n_cells"], self.most_drafted // 64)
        return self.quick(replace(request, settings=settings, step=step))

    def seen(self, request: Request, values: Mapping[str, Any]) -> tuple[Layer, dict[str, Any]]:
        result: Mosaic = values["result"]
        svg = written_as("drawing.svg", lambda path: result.save(path, outline=request.settings["outline"]))
        return Drawing(svg), {"k": len(result.colors), "noun": "tiles"}

"""Mosaic: the picture as convex tiles of one color each."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from cvtimg.artwork import Mosaic
from cvtimg.explore.calls import Call, literal
from cvtimg.explore.controls import Choice, Control, Settings, controls_of
from cvtimg.explore.layers import Drawing, Window
from cvtimg.explore.outcomes import Outcome, Output, Recipe, written_as
from cvtimg.explore.tabs.base import Request, Tab, reading

#: Pixels of a draft.
_DRAFT = 1 << 16


class MosaicTab(Tab):
    """Mosaics."""

    name = "mosaic"
    title = "Mosaic"
    about = "Turn the image into tiles of one color each, whose borders follow its edges."
    verb = "mosaic"
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "mosaic",
        ("number", {"name": "n_cells", "keyword": ""}),
        "shape",
        Choice(name="limit", label="Colors", default="all", choices={"all": "one for each tile", "few": "only a few"}),
        ("palette", {"when": {"limit": ["few"]}, "keyword": ""}),
        "outline",
        "space",
        "effort",
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        """Return the drawing, pixels, and polygons."""
        outline = request.settings["outline"]
        more = f", outline={literal(outline)}" if outline else ""
        write, lines = partial(_save, outline=outline), f"result.save({{}}{more})"
        plain = partial(_save, outline=0.0), "result.save({})"
        return [
            Output("Drawing, SVG", "-o", "{}-mosaic.svg", write, lines),
            Output("Pixels, PNG", "-o", "{}-mosaic.png", write, lines),
            *([] if outline else [Output("Polygons, GeoJSON", "-o", "{}-mosaic.geojson", *plain)]),
        ]

    def recipe(self, request: Request) -> Recipe:
        """Return the command and the lines of Python."""
        text = self._call(request.settings).text()
        return Recipe(self.words(request), f"{reading(request.picture)}\nresult = {text}")

    def _call(self, settings: Settings) -> Call:
        keywords = self.keywords(settings)
        if settings["limit"] == "few":
            keywords["palette"] = settings["palette"]
        return Call("mosaic", (settings["n_cells"],), keywords)

    def draft(self, request: Request) -> Outcome | None:
        """Compose the picture in a small size."""
        window = request.picture.whole(_DRAFT)
        settings = {**request.settings, "effort": "fast", "outline": request.settings["outline"] / window.step}
        settings["n_cells"] = min(settings["n_cells"], _DRAFT // 64)
        return self._outcome(request, settings, window)

    def exact(self, request: Request) -> Outcome:
        """Compose the picture."""
        return self._outcome(request, request.settings, request.picture.whole(1 << 62), self.outputs(request))

    def _outcome(self, request: Request, settings: Settings, window: Window, outputs: Sequence[Output] = ()) -> Outcome:
        image = request.picture.array[window.rows, window.columns]  # an array of a file with alpha says so
        result: Mosaic = self._call(settings).run(image)
        svg = written_as("drawing.svg", lambda path: result.save(path, outline=settings["outline"]))
        facts: dict[str, Any] = {"k": len(result.colors), "noun": "tiles"}
        return Outcome(result, Drawing(svg), facts, outputs, request.picture.stem)


def _save(result: Mosaic, path: Path, outline: float) -> None:
    result.save(path, outline=outline)

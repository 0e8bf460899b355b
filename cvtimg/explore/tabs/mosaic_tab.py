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
from cvtimg.explore.tabs.base import Ask, Tab, reading

#: Pixels of a draft.
_DRAFT = 1 << 16


class MosaicTab(Tab):
    """Mosaics."""

    name = "mosaic"
    title = "Mosaic"
    about = "Compose the picture of tiles of one color each, whose borders follow its edges."
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

    def outputs(self, ask: Ask) -> Sequence[Output]:
        """Return the drawing, pixels, and polygons."""
        outline = ask.settings["outline"]
        more = f", outline={literal(outline)}" if outline else ""
        write, lines = partial(_save, outline=outline), f"result.save({{}}{more})"
        plain = partial(_save, outline=0.0), "result.save({})"
        return [
            Output("Drawing, SVG", "-o", "{}-mosaic.svg", write, lines),
            Output("Pixels, PNG", "-o", "{}-mosaic.png", write, lines),
            *([] if outline else [Output("Polygons, GeoJSON", "-o", "{}-mosaic.geojson", *plain)]),
        ]

    def recipe(self, ask: Ask) -> Recipe:
        """Return the command and the lines of Python."""
        text = self._call(ask.settings).text()
        return Recipe(self.words(ask), f"{reading(ask.picture)}\nresult = {text}")

    def _call(self, settings: Settings) -> Call:
        keywords = self.keywords(settings)
        if settings["limit"] == "few":
            keywords["palette"] = settings["palette"]
        return Call("mosaic", (settings["n_cells"],), keywords)

    def draft(self, ask: Ask) -> Outcome | None:
        """Compose the picture in a small size."""
        window = ask.picture.whole(_DRAFT)
        settings = {**ask.settings, "effort": "fast", "outline": ask.settings["outline"] / window.step}
        settings["n_cells"] = min(settings["n_cells"], _DRAFT // 64)
        return self._outcome(ask, settings, window)

    def exact(self, ask: Ask) -> Outcome:
        """Compose the picture."""
        return self._outcome(ask, ask.settings, ask.picture.whole(1 << 62), self.outputs(ask))

    def _outcome(self, ask: Ask, settings: Settings, window: Window, outputs: Sequence[Output] = ()) -> Outcome:
        image = ask.picture.array[window.rows, window.columns]  # an array of a file with alpha says so
        result: Mosaic = self._call(settings).run(image, **_heard(ask))
        svg = written_as("drawing.svg", lambda path: result.save(path, outline=settings["outline"]))
        facts: dict[str, Any] = {"k": len(result.colors), "noun": "tiles"}
        return Outcome(result, Drawing(svg), facts, outputs, ask.picture.stem)


def _heard(ask: Ask) -> dict[str, Any]:
    def listen(step: int, energy: float) -> None:
        ask.watch(step, energy)

    return {"callback": listen}


def _save(result: Mosaic, path: Path, outline: float) -> None:
    result.save(path, outline=outline)

"""Stipple and Mosaic: the tones of the picture as dots, and the picture as convex tiles of one color each."""

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

from cvtimg._shared.choices import Json, Options
from cvtimg.artwork import Mosaic, Stipples
from cvtimg.artwork.stipples import Sheet
from cvtimg.explore.controls import Choice, Control, Settings, Switch, active, controls_of, number
from cvtimg.explore.layers import Drawing, Layer
from cvtimg.explore.outcomes import Code, Line, Output, call, evaluated, written_as
from cvtimg.explore.tabs.base import IMAGE, Request, Tab, reading

#: Settings of the drawing, not of the dots: options of `Stipples.save`.
_DRAWN = ("width", "height", "paper", "landscape", "margin", "marks", "fill", "pen_width")
_LIMITED: Json = {"flag": "", "keyword": "", "when": {"limited": [True]}}
_GREATEST: Json = {"name": "greatest", "label": "Greatest radius", "default": 4.0, "slider": (0.1, 20), **_LIMITED}


class StippleTab(Tab):
    about = "Reproduce the tones of the image with dots, for pen plotters and print."
    pace = 0.6
    most_drafted = 1 << 16
    arguments: ClassVar[Mapping[str, str]] = {"radius_range": "limited"}
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "stipple",
        Choice(name="by", label="Dots by", choices={"n": "their number", "pen": "the width of the pen"}),
        ("number", {"name": "n_dots", "always": False, "when": {"by": ["n"]}}),
        ("pen", {"when": {"by": ["pen"]}, "always": True, "keyword": ""}),
        ("dots", {"when": {"by": ["n"]}}),  # those of a pen are of one size
        Switch(name="limited", label="Limit radii", when={"dots": ["sized"]}),
        ("radius_range", {"name": "least", **_LIMITED}),
        ("radius_range", _GREATEST),
        "tones",
        "max_ink",
        "white_cutoff",
        "layers",
        Switch(name="colored", label="Pens of other colors", when={"layers": ["one"]}),
        ("pens", {"when": {"layers": ["one"], "colored": [True]}, "always": True}),
        ("invert", {"when": {"layers": ["one"], "colored": [False]}}),
        "bleed",
        "marks",
        ("fill", {"when": {"marks": ["disks"]}}),
        "paper",
        "landscape",
        ("width", {"when": {"paper": ["none"]}}),
        "height",
        "margin",
        ("pen_width", {"always": False, "when": {"by": ["n"]}}),
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        drawing = _drawing(self, request.settings)
        kinds = {".svg": "Drawing, SVG", ".png": "Pixels, PNG", ".csv": "Dots, CSV"}
        return [Output(label, "-o", f"{{}}-stippled{suffix}", keywords=drawing) for suffix, label in kinds.items()]

    def words(self, request: Request, *more: str) -> list[str]:
        settings = request.settings
        if "least" in self.in_effect(settings):
            more += ("--radius-range", f"{settings['least']:g}", f"{settings['greatest']:g}")
        return Tab.words(self, request, *more)

    def pasted(self, flag: str, text: str) -> Json:
        if flag != "--radius-range":
            return {}
        least, greatest = map(number, text.split(" "))
        return {"limited": True, "least": least, "greatest": greatest}

    def lines(self, request: Request) -> list[Line]:
        settings = request.settings
        keywords = self.keywords(settings)
        if settings["by"] == "pen":
            is_wide = settings["paper"] == "none" and settings["height"] == "auto"
            scale = f"{settings['width']} * image.shape[1]" if is_wide else f"{self._scale(request)}"
            keywords["dot_diameter"] = Code(f"{settings['pen']} / {scale}")
        if "least" in self.in_effect(settings):
            keywords["radius_range"] = (settings["least"], settings["greatest"])
        number = (settings["n_dots"],) if settings["by"] == "n" and settings["n_dots"] != "auto" else ()
        return [reading(request), Line("result", call("cvtimg.stipple", IMAGE, *number, **keywords))]

    def _scale(self, request: Request) -> float:
        """Return the millimeters of a pixel of the picture."""
        drawn = _drawing(self, request.settings)
        fitted = {name: drawn[name] for name in ("width", "height", "paper", "landscape", "margin") if name in drawn}
        return Sheet.of(request.picture.size, **fitted).scale

    def scaled(self, request: Request) -> Settings:
        number, most = request.settings["n_dots"], max(1, math.prod(request.size) // 16)
        return {**Tab.scaled(self, request), "by": "n", "n_dots": most if number == "auto" else min(number, most)}

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: Stipples = values["result"]
        svg = written_as("drawing.svg", lambda path: evaluated(self.outputs(request)[0].writing(path), values))
        facts: Json = {"k": len(result), "noun": "dots"}
        if len(result):
            scale = self._scale(request) * request.picture.size[1] / request.size[1]
            facts["about"] = f"mean radius {float(result.radii.mean()) * scale:.3g} mm"
        return Drawing(svg), facts


class MosaicTab(Tab):
    about = "Turn the image into tiles of one color each, whose borders follow its edges."
    pace = 1.6
    most_drafted = 1 << 16
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "mosaic",
        ("number", {"name": "n_cells", "keyword": "", "room": 16}),
        "shape",
        Choice(name="limit", label="Colors", choices={"all": "one for each tile", "few": "only a few"}),
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

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: Mosaic = values["result"]
        svg = written_as("drawing.svg", lambda path: result.save(path, outline=request.settings["outline"]))
        return Drawing(svg), {"k": len(result.colors), "noun": "tiles"}


def _drawing(tab: StippleTab, settings: Settings) -> Json:
    """Return the options of `Stipples.save` that are not the default."""
    said = [control.name for control in active(tab.controls, settings) if control.says(settings[control.name])]
    changed = {name: settings[name] for name in said if name in _DRAWN}
    if settings["by"] == "pen":
        changed["pen_width"] = settings["pen"]
    return changed

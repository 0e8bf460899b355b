"""Palette: colors of the picture, of well-known machines, of a file, or by hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from cvtimg._shared.choices import Json, Options
from cvtimg._shared.types import Bytes
from cvtimg.explore.calls import Code, Line, call, evaluated
from cvtimg.explore.controls import (
    Choice,
    Colors,
    Control,
    Files,
    Settings,
    Swatches,
    UnfitRequestError,
    controls_of,
    words_of,
)
from cvtimg.explore.layers import Indexed, Layer
from cvtimg.explore.opened import SMALL
from cvtimg.explore.outcomes import Output, Recipe
from cvtimg.explore.tabs.base import IMAGE, Request, Tab, reading
from cvtimg.explore.tabs.colors_tab import N_PIXELS, PALETTE, PALETTES, palette_files, read_as, rgb
from cvtimg.quantization import Quantized

_FOUND = {"start": ["image", "main"]}
_GIVEN = {"start": ["given", "hand"]}


class PaletteTab(Tab):
    name = "palette"
    about = "Find, take or make a palette. Drag its colors to sort them; choose one to edit, lock or remove it."
    verb = "palette"
    verbs = ("quantize",)
    most_drafted = SMALL
    controls: ClassVar[tuple[Control, ...]] = (
        *controls_of(
            "palette",
            Choice(
                name="start",
                label="Colors",
                default="image",
                choices={
                    "image": "of the image, least error",
                    "main": "of the image, main ones",
                    "given": "built-in, or of a file",
                    "hand": "by hand",
                },
            ),
            ("number", {"name": "k", "when": _FOUND, "label": "Number", "keyword": ""}),
            Files(name="palette", label="Palette", of="palettes", default=("pico-8",), when={"start": ["given"]}),
            ("sort", {"when": _FOUND}),
            ("space", {"when": {"start": ["image"]}}),
            Colors(
                name="locked",
                label="Locked colors",
                flag="--lock",
                when=_FOUND,
                about="Kept as they are; the others are found around them.",
            ),
            Swatches(name="colors", label="Colors", when={"start": ["hand"]}),
        ),
        *controls_of("quantize", ("ramp", {"when": _GIVEN}), ("dither", {"when": _GIVEN})),
    )

    def pasted(self, flag: str, text: str) -> Json:
        if flag == "--main":
            return {"start": "main"}
        if flag != "--palette":
            return {}
        colors = text.split(",")
        return {"start": "hand", "colors": colors} if text[:1] == "#" else {"start": "given", "palette": [text]}

    def outputs(self, request: Request) -> Sequence[Output]:
        """Return the palette in all formats, and the picture in it where the command makes that, too."""
        if _is_found(request.settings):
            return palette_files(PALETTES, Code("result.palette[order]"), Code("n_pixels[order]"))
        return palette_files(PALETTES, PALETTE, N_PIXELS)

    def recipe(self, request: Request) -> Recipe:
        settings, lines = request.settings, self.lines(request)
        if _is_found(settings):
            main = ["--main"] if settings["start"] == "main" else []
            return Recipe(self.words(request, *main), lines, for_many=False)
        words = ["cvtimg", "quantize", *request.picture.words, "--palette", _given(request)[0]]
        return Recipe([*words, *words_of(self.controls, settings)], lines, always="{}-quantized.png")

    def lines(self, request: Request) -> list[Line]:
        """Return the lines of Python that find a palette and its order, or map the picture to one."""
        settings, array = request.settings, request.picture.array
        keywords, lines = self.keywords(settings), [reading(request)]
        if not _is_found(settings):
            lines += [read_as(*_given(request), array.dtype)]
            return [*lines, Line("result", call("cvtimg.quantize", IMAGE, palette=Code("palette"), **keywords))]
        if array.dtype != np.uint8:
            lines += [Line("image", call("cvtimg.colors.to_depth", IMAGE, "uint8"))]
        keywords |= {"locked": rgb(settings["locked"])} if settings["locked"] else {}
        if settings["start"] == "main":
            lines += [Line("main", call("cvtimg.quantization.main_palette", IMAGE, settings["k"], **keywords))]
            find = call("cvtimg.quantization.map_to_palette", IMAGE, Code("main.colors"), space="oklab")
        else:
            find = call("cvtimg.quantize", IMAGE, settings["k"], **keywords)
        return [*lines, Line("result", find), *_order_lines(settings)]

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: Quantized = values["result"]
        counts = evaluated(N_PIXELS, values)
        order = values.get("order", np.arange(len(counts)))
        indices = np.argsort(order).astype(np.uint32)[result.indices]
        psnr = result.psnr if np.isfinite(result.psnr) else None
        facts = {"k": len(order), "psnr": psnr, "counts": counts[order].tolist()}
        return Indexed(indices, request.picture.colors_seen(result.palette, alpha=result.alpha)[order]), facts


def _order_lines(settings: Settings) -> list[Line]:
    """Return the lines that sort a palette; one that is given keeps its order."""
    if not _is_found(settings):
        return []
    order = call("cvtimg.palettes.color_order", PALETTE, settings["sort"], density=Code("n_pixels"))
    return [Line("n_pixels", N_PIXELS), Line("order", order)]


def _is_found(settings: Settings) -> bool:
    return settings["start"] in ("image", "main")


def _given(request: Request) -> tuple[str, Bytes]:
    """Return name and colors of the palette that is chosen or made."""
    settings = request.settings
    if settings["start"] == "given":
        return request.store.palette(settings["palette"])
    if not settings["colors"]:
        raise UnfitRequestError("the palette is empty; add a color")
    return ",".join(settings["colors"]), rgb(settings["colors"])

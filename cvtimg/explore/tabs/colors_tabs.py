"""Colors and Palette: the picture in the palette that represents it with the least error, or in a chosen one."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any, ClassVar

import numpy as np

from cvtimg import find_palette, read_palette
from cvtimg._shared.budgets import ENOUGH_SAMPLES, ROWS_AT_ONCE
from cvtimg._shared.choices import Json, Options
from cvtimg._shared.types import Array, Bytes
from cvtimg.colors import to_depth
from cvtimg.colors.places import from_places
from cvtimg.elbow.rules import TargetMissedError
from cvtimg.explore import controls as kinds
from cvtimg.explore.controls import Control, Settings, UnfitRequestError, controls_of, number, words_of
from cvtimg.explore.layers import Indexed, Layer
from cvtimg.explore.outcomes import Code, Line, Outcome, Output, Recipe, call, evaluated
from cvtimg.explore.tabs.base import BRUSH, IMAGE, MASK, Request, Tab, all_of, missing, reading
from cvtimg.options.common import color_bits
from cvtimg.palettes.files import known_palettes
from cvtimg.pictures import Frames
from cvtimg.quantization import Quantized, QuantizedSeries, map_to_palette
from cvtimg.quantization.dithering import STRENGTH

PALETTE = Code("result.palette")
N_PIXELS = Code("numpy.bincount(result.indices.ravel(), minlength=len(result.palette))")
N_PIXELS_OF_ALL = Code("sum(numpy.bincount(one.indices.ravel(), minlength=len(one.palette)) for one in result.results)")
#: Formats of palettes, with their labels; after a picture, the first are offered.
PALETTES = {
    ".gpl": "Palette for GIMP, Inkscape, Krita",
    ".css": "Palette as CSS variables",
    ".ase": "Palette for Adobe (.ase)",
    ".json": "Palette as JSON, with shares",
    ".hex": "Palette as a list, Lospec (.hex)",
    ".scss": "SCSS variables",
    ".act": "Photoshop color table (.act)",
    ".pal": "JASC (.pal)",
    ".txt": "paint.net (.txt)",
    ".svg": "Drawing of swatches, SVG",
    ".png": "Image of swatches, PNG",
}
_PALETTES = dict(islice(PALETTES.items(), 5))
#: Pixels of drafts, by the method of dithering; those that are not named are ordered.
_DITHERED = {"floyd-steinberg": 500_000, "edge-aware": 1 << 17}
#: The format of pages, with its label.
_PAGES = {"Pages, TIFF": ".tif"}
_AIMS = {
    "k": "number of colors",
    "auto": "elbow of the energy",
    "psnr": "quality",
    "max_bytes": "size of the file",
    "palette": "given palette",
}
_SEARCHED = {"aim": ["k", "auto", "psnr", "max_bytes"]}
_FILES = "One of these, or a .gpl, .ase, .css, .json, .hex, .act, .pal or .txt file, or an image."
_LOCKED = "Kept in the palette as they are. Pick them in the image, or lock colors of the palette."
_STARTS = {
    "image": "of the image, least error",
    "main": "of the image, main ones",
    "given": "built-in, or of a file",
    "hand": "by hand",
}
_KEPT = "Kept as they are; the others are found around them."
_FOUND = {"start": ["image", "main"]}
_GIVEN = {"start": ["given", "hand"]}


class ColorsTab(Tab):
    about = "Reduce the image to few colors, with the least error."
    verb = "quantize"
    for_frames = True
    compared = IMAGE
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "quantize",
        kinds.Choice(name="aim", label="Choose by", choices=_AIMS),
        ("number", {"name": "k", "when": {"aim": ["k"]}, "auto": False, "keyword": ""}),
        ("psnr", {"when": {"aim": ["psnr"]}}),
        ("max_bytes", {"when": {"aim": ["max_bytes"]}, "to": lambda kilobytes: 1000 * kilobytes}),
        kinds.Files(name="palette", label="Palette", of="palettes", when={"aim": ["palette"]}, about=_FILES),
        "space",
        "dither",
        ("dither_strength", {"name": "strength", "default": STRENGTH, "always": False, "flag": "", "keyword": ""}),
        kinds.Colors(name="locked", label="Locked colors", flag="--lock", when=_SEARCHED, about=_LOCKED),
        ("color_bits", {"when": _SEARCHED}),
        ("palette_per_frame", {"name": "per_frame", "when": {"aim": ["k", "psnr"]}, "only": "animations"}),
        ("effort", {"when": _SEARCHED}),
        replace(BRUSH, label="Mask, weights", only="images"),
        MASK,
        kinds.Brushed(
            name="weights",
            label="Weights",
            flag="--weight-map",
            modes={"add": "More", "erase": "Less", "paint": "As usual"},
            values={"add": 255, "erase": 1, "paint": 16},
            base=16,
            when={**_SEARCHED, "brushes": [True]},
            about="Errors count up to 16 times, or a sixteenth.",
        ),
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        """Return the picture, as PNG where that holds its samples, and its palette in several formats."""
        if request.source.frames:
            is_film = isinstance(request.source.frames, Frames)
            ends = {f"Animation, {end[1:].upper()}": end for end in (".gif", ".png", ".webp")} if is_film else _PAGES
            images = [Output(label, "-o", "{}-quantized" + end) for label, end in ends.items()]
            has_one = not request.settings["per_frame"]
            return [*images, *(palette_files(_PALETTES, PALETTE, N_PIXELS_OF_ALL) if has_one else [])]
        shape, dtype = request.picture.array.shape, request.picture.array.dtype
        in_png = dtype in (np.uint8, np.uint16) and (len(shape) == 2 or shape[2] in (1, 3, 4))
        suffixes = [".png", ".webp", ".gif"][: None if dtype == np.uint8 else 1] if in_png else [".npy"]
        images = [Output(f"Image, {end[1:].upper()}", "-o", "{}-quantized" + end) for end in suffixes]
        return [*images, *palette_files(_PALETTES, PALETTE, N_PIXELS), *self.map_files(request)]

    def recipe(self, request: Request) -> Recipe:
        has_pages = request.source.frames and not isinstance(request.source.frames, Frames)
        always = "{}-quantized.tif" if has_pages else ""
        return Recipe(self.words(request), self.lines(request), always=always)

    def words(self, request: Request, *more: str) -> list[str]:
        request = _fitting(request)
        settings = request.settings
        if settings["aim"] == "auto":
            more = ("-k", "auto")
        elif settings["aim"] == "palette":
            more = ("--palette", request.store.palette(settings["palette"])[0])
        if "dither_strength" in (keywords := self.keywords(settings)):
            more += ("--dither-strength", f"{keywords['dither_strength']:g}")
        return Tab.words(self, request, *more)

    def pasted(self, flag: str, text: str) -> Json:
        if flag == "--dither-strength":
            return {"strength": number(text)}
        if flag == "--palette" and text in known_palettes():
            return {"aim": "palette", "palette": [text], "strength": 1.0}
        return {"aim": "auto"} if (flag, text) == ("-k", "auto") else {}

    def keywords(self, settings: Settings) -> Json:
        """Return the keyword arguments; there is no usual strength of dithering for given palettes."""
        keywords = Tab.keywords(self, settings)
        usual = 1.0 if settings["aim"] == "palette" else STRENGTH
        if settings["dither"] != "none" and settings["strength"] != usual:
            keywords["dither_strength"] = settings["strength"]
        return keywords

    def lines(self, request: Request) -> list[Line]:
        request = _fitting(request)
        settings, picture, frames = request.settings, request.picture, request.source.frames
        keywords, maps = self.keywords(settings), self.maps(request)
        if frames:
            is_film = isinstance(frames, Frames)
            read = call("cvtimg.pictures.read_frames", request.source.name) if is_film else request.source.pages_code
            lines = [Line("frames", read, frames)]
        else:
            lines = [reading(request)]
        lines += maps
        keywords |= {line.name: Code(line.name) for line in maps}
        if known := missing(picture):
            lines += all_of([*known, *(Code("mask > 0") for line in maps if line.name == "mask")])
            keywords["mask"] = Code("known")
        number: tuple[Any, ...] = ()
        palette = self._palette(request)
        if palette and "weights" not in keywords:
            lines += [palette]
            keywords["palette"] = Code("palette")
            keywords.pop("effort", None)
        else:
            if settings["locked"]:
                keywords["locked"] = to_depth(rgb(settings["locked"]), picture.array.dtype)
            number = {"k": (settings["k"],), "auto": ("auto",)}.get(settings["aim"], ())
        quantize = ("cvtimg.quantize_frames", Code("frames")) if frames else ("cvtimg.quantize", IMAGE)
        return [*lines, Line("result", call(*quantize, *number, **keywords))]

    def _palette(self, request: Request) -> Line | None:
        """Return the palette that is given, or that of an indexed picture of few colors, which it keeps."""
        settings, picture = request.settings, request.picture
        if settings["aim"] == "palette":
            return read_as(*request.store.palette(settings["palette"]), picture.array.dtype)
        keeps = settings["aim"] == "k" and not settings["locked"] and not _bits(settings)
        if not keeps or picture.header.mode != "P" or request.source.frames:
            return None
        colors = picture.kept("own palette", lambda: read_palette(picture.path))
        fits = len(colors) <= settings["k"] and colors.shape[1:] == picture.array.shape[2:]
        return read_as(picture.name, colors, np.dtype(np.uint8)) if fits else None

    def draft_pixels(self, settings: Settings) -> int:
        """Return as many pixels as are mapped in a tenth of a second."""
        return _DITHERED.get(settings["dither"], 1 << 18) if settings["dither"] != "none" else ROWS_AT_ONCE

    def draft(self, request: Request) -> Outcome | None:
        """Map the window to a palette that is at hand, or quickly found."""
        settings, picture = request.settings, request.picture
        palette = None if self.brushed(request) else self._quick_palette(request)
        if palette is None:
            return None
        dither = None if settings["dither"] == "none" else settings["dither"]
        strength, samples = settings["strength"] if dither else 1.0, picture.samples_in(request.window)
        result = map_to_palette(samples, palette, space=settings["space"], dither=dither, dither_strength=strength)
        return Outcome(*self.seen(request, {"result": result}), drawn=request.window)

    def _quick_palette(self, request: Request) -> Array | None:
        """Return a palette near the one that the exact result will have; None if none is found quickly."""
        settings, picture = request.settings, request.picture
        if settings["aim"] == "palette":
            return to_depth(request.store.palette(settings["palette"])[1], picture.array.dtype)
        curve = None if picture.has_alpha else picture.curve(settings["space"], wait=False)
        number = settings["k"]
        if settings["aim"] != "k":
            if curve is None or settings["aim"] == "max_bytes":
                return None
            try:
                number = curve.elbow() if settings["aim"] == "auto" else curve.elbow("psnr", settings["psnr"])
            except (TargetMissedError, ValueError):  # more colors than the curve has; or a space without PSNR
                return None
        if curve is not None and not settings["locked"] and not _bits(settings) and number <= curve.n_max:
            places = from_places(curve.generators[number - 1], settings["space"], picture.array.dtype, False)
            colors = np.unique(places, axis=0)
            return colors[np.argsort(colors.sum(axis=1, dtype=np.float64), kind="stable")]
        locked = to_depth(rgb(settings["locked"]), picture.array.dtype) if settings["locked"] else None
        samples = picture.samples_in(picture.whole(ENOUGH_SAMPLES))
        how = {"space": settings["space"], "locked": locked, "effort": "fast", **_bits(settings)}
        return find_palette(samples, number, **how).colors

    def exact(self, request: Request) -> Outcome:
        outcome = Tab.exact(self, request)
        if isinstance(result := outcome.values["result"], QuantizedSeries):
            outcome.frames = [self.seen(request, {"result": frame}) for frame in result.results]
        return outcome

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: Quantized = values["result"]
        if isinstance(result, QuantizedSeries):
            result = result.results[0]
        colors, indices = request.picture.colors_seen(result.palette, alpha=result.alpha), result.indices
        counts = np.bincount(indices.ravel(), minlength=len(colors))
        if result.inside is not None:
            indices = np.where(result.inside, indices, len(colors)).astype(np.uint32)
            counts[0] -= np.count_nonzero(~result.inside)
            colors = np.append(colors, np.zeros((1, 4), np.uint8), axis=0)
        psnr = result.psnr if math.isfinite(result.psnr) else None
        return Indexed(indices, colors), {"k": len(result.palette), "psnr": psnr, "counts": counts.tolist()}


class PaletteTab(Tab):
    about = "Find, take or make a palette. Drag its colors to sort them; choose one to edit, lock or remove it."
    verbs = ("quantize",)
    most_drafted = ENOUGH_SAMPLES
    controls: ClassVar[tuple[Control, ...]] = (
        *controls_of(
            "palette",
            kinds.Choice(name="start", label="Colors", choices=_STARTS),
            ("number", {"name": "k", "when": _FOUND, "label": "Number", "keyword": ""}),
            kinds.Files(name="palette", label="Palette", of="palettes", default=("pico-8",), when={"start": ["given"]}),
            ("sort", {"when": _FOUND}),
            ("space", {"when": {"start": ["image"]}}),
            kinds.Colors(name="locked", label="Locked colors", flag="--lock", when=_FOUND, about=_KEPT),
            kinds.Swatches(name="colors", label="Colors", when={"start": ["hand"]}),
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
        order = call("cvtimg.palettes.color_order", PALETTE, settings["sort"], density=Code("n_pixels"))
        return [*lines, Line("result", find), Line("n_pixels", N_PIXELS), Line("order", order)]

    def seen(self, request: Request, values: Options) -> tuple[Layer, Json]:
        result: Quantized = values["result"]
        counts = evaluated(N_PIXELS, values)
        order = values.get("order", np.arange(len(counts)))
        indices = np.argsort(order).astype(np.uint32)[result.indices]
        psnr = result.psnr if np.isfinite(result.psnr) else None
        facts = {"k": len(order), "psnr": psnr, "counts": counts[order].tolist()}
        return Indexed(indices, request.picture.colors_seen(result.palette, alpha=result.alpha)[order]), facts


def _bits(settings: Settings) -> Json:
    """Return the bits per channel that the colors may have, as an argument."""
    return {} if settings["color_bits"] == "any" else {"color_bits": color_bits(settings["color_bits"])}


def rgb(colors: Sequence[str]) -> Bytes:
    """(K, 3) colors that are written as #rrggbb."""
    return np.array([list(bytes.fromhex(color[1:])) for color in colors], np.uint8)


def _fitting(request: Request) -> Request:
    """Return a request without what single pictures, or animations, do not have."""
    settings = request.settings
    if not request.source.frames:
        return replace(request, settings={**settings, "per_frame": False})
    if settings["aim"] in ("auto", "max_bytes"):
        raise UnfitRequestError(f"{request.source.noun}s: choose by number of colors, quality or a given palette")
    if request.source.header.kind == "pages" and request.picture.known is not None:
        raise UnfitRequestError("Pages with missing values are left to the command line")
    return replace(request, settings={**settings, "brushes": False})


def read_as(name: str, colors: Array, dtype: np.dtype[np.generic]) -> Line:
    """Return the line that reads the palette of a file or a name, in the depth of the picture."""
    read = call("cvtimg.read_palette", name)
    code = read if dtype == np.uint8 else call("cvtimg.colors.to_depth", read, dtype.name)
    return Line("palette", code, to_depth(colors, dtype))


def palette_files(labels: Mapping[str, str], palette: Code, n_pixels: Code) -> list[Output]:
    """Return a palette in all formats, with the number of pixels of each color."""
    write = ("cvtimg.write_palette", (palette,), {"density": n_pixels})
    return [Output(label, "--save-palette", "{}-palette" + end, *write) for end, label in labels.items()]


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

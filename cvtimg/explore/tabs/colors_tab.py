"""Colors: the picture in the palette that represents it with the least error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cvtimg import find_palette, read_palette, write_palette
from cvtimg.colors import to_depth
from cvtimg.colors.places import from_places
from cvtimg.elbow.rules import TargetMissedError
from cvtimg.explore.calls import Call, Named
from cvtimg.explore.controls import (
    Brushed,
    Choice,
    Colors,
    Control,
    Files,
    Number,
    Settings,
    UnfitRequestError,
    controls_of,
)
from cvtimg.explore.layers import Indexed
from cvtimg.explore.opened import N_CURVE, Picture
from cvtimg.explore.outcomes import Outcome, Output, Recipe, quoted
from cvtimg.explore.tabs.base import MASK, SAVED, Request, Tab, brushes, reading, saved
from cvtimg.options.common import color_bits
from cvtimg.pictures import Frames
from cvtimg.quantization import Quantized, QuantizedSeries, map_to_palette
from cvtimg.quantization.dithering import STRENGTH

#: Formats of palettes that are offered, with their labels.
_PALETTES = {
    ".gpl": "Palette for GIMP, Inkscape, Krita",
    ".css": "Palette as CSS variables",
    ".ase": "Palette for Adobe (.ase)",
    ".json": "Palette as JSON, with shares",
    ".hex": "Palette as a list (.hex)",
}
#: Pixels of drafts, by the method of dithering; those that are not named are ordered.
_DITHERED = {"floyd-steinberg": 500_000, "edge-aware": 1 << 17}
#: The format of pages, with its label.
_PAGES = {"Pages, TIFF": ".tif"}
_SEARCHED = ("k", "auto", "psnr", "max_bytes")
_KILO = 1000


class ColorsTab(Tab):
    """Quantization."""

    name = "colors"
    title = "Colors"
    about = "Reduce the image to few colors, with the least error."
    verb = "quantize"
    for_frames = True
    controls: ClassVar[tuple[Control, ...]] = controls_of(
        "quantize",
        Choice(
            name="aim",
            label="Choose by",
            default="k",
            choices={
                "k": "number of colors",
                "auto": "elbow of the energy",
                "psnr": "quality",
                "max_bytes": "size of the file",
                "palette": "given palette",
            },
        ),
        ("number", {"name": "k", "when": {"aim": ["k"]}, "auto": False, "keyword": ""}),
        ("psnr", {"when": {"aim": ["psnr"]}}),
        Number(
            name="max_bytes",
            label="File at most",
            default=100,
            low=1,
            high=10**6,
            slider=(4, 4000),
            log=True,
            unit="kB",
            suffix="kB",
            flag="--max-bytes",
            always=True,
            when={"aim": ["max_bytes"]},
        ),
        Files(
            name="palette",
            label="Palette",
            of="palettes",
            when={"aim": ["palette"]},
            about="One of these, or a .gpl, .ase, .css, .json, .hex, .act, .pal or .txt file, or an image.",
        ),
        "space",
        "dither",
        ("dither_strength", {"name": "strength", "default": STRENGTH, "always": False, "flag": "", "keyword": ""}),
        Colors(
            name="locked",
            label="Locked colors",
            flag="--lock",
            when={"aim": list(_SEARCHED)},
            about="Kept in the palette as they are. Pick them in the image, or lock colors of the palette.",
        ),
        ("color_bits", {"when": {"aim": list(_SEARCHED)}, "keyword": ""}),
        ("palette_per_frame", {"name": "per_frame", "when": {"aim": ["k", "psnr"]}, "only": "animations"}),
        ("effort", {"when": {"aim": list(_SEARCHED)}}),
        replace(brushes("Mask, weights"), only="images"),
        MASK,
        Brushed(
            name="weights",
            label="Weights",
            flag="--weight-map",
            modes={"add": "More", "erase": "Less", "paint": "As usual"},
            values={"add": 255, "erase": 1, "paint": 16},
            base=16,
            pattern="{}-weights.png",
            when={"aim": list(_SEARCHED), "brushes": [True]},
            about="Errors count up to 16 times, or a sixteenth.",
        ),
    )

    def outputs(self, request: Request) -> Sequence[Output]:
        """Return the picture, as PNG where that holds its samples, and its palette in several formats."""
        if request.source.frames:
            is_film = isinstance(request.source.frames, Frames)
            ends = {f"Animation, {end[1:].upper()}": end for end in (".gif", ".png", ".webp")} if is_film else _PAGES
            images = [Output(label, "-o", "{}-quantized" + end, saved, SAVED) for label, end in ends.items()]
            if request.settings["per_frame"]:
                return images
            return [*images, *(_palette_output(end, label, _COUNTED_FRAMES) for end, label in _PALETTES.items())]
        suffix = _suffix(request.picture)
        suffixes = [suffix] if suffix != ".png" else [".png", ".webp", ".gif"]
        images = [Output(f"Image, {end[1:].upper()}", "-o", "{}-quantized" + end, saved, SAVED) for end in suffixes]
        palettes = [_palette_output(end, label) for end, label in _PALETTES.items()]
        return [*images, *palettes, *self.map_outputs(request)]

    def recipe(self, request: Request) -> Recipe:
        """Return the command and the lines of Python."""
        request = _fitting(request)
        settings, picture = request.settings, request.picture
        call = self._call(request)
        known = _KNOWN if picture.header.nodata is not None and picture.known is not None else ""
        words = ["-k", "auto"] if settings["aim"] == "auto" else []
        if settings["aim"] == "palette":
            words = ["--palette", request.files.palette(settings["palette"])[0]]
        if settings["dither"] != "none" and settings["strength"] != _usual_strength(settings):
            words += ["--dither-strength", f"{settings['strength']:g}"]
        if request.source.frames:
            is_film, name = isinstance(request.source.frames, Frames), quoted(request.source.name)
            read = f"read_frames({name})" if is_film else f"read_pages({name}).joined()"
            lines = f"import cvtimg\n\nframes = cvtimg.pictures.{read}\nresult = {call.text('frames')}"
            return Recipe(self.words(request, *words), lines, always="" if is_film else "{}-quantized.tif")
        start = reading(picture) + known.format(picture.header.nodata) + self.map_lines(request)
        return Recipe(self.words(request, *words), f"{start}\nresult = {call.text()}")

    def _call(self, request: Request) -> Call:
        settings, picture = request.settings, request.picture
        keywords = self._mapping(settings)
        if picture.header.nodata is not None and picture.known is not None:
            keywords["mask"] = Named("known", picture.known)
        maps = self.maps(request)
        if (mask := maps.pop("mask", None)) is not None:
            known = keywords.get("mask")
            keywords["mask"] = Named("known & (mask > 0)", known.value & (mask > 0)) if known else Named("mask", mask)
        keywords |= {name: Named(name, image) for name, image in maps.items()}
        dtype = picture.array.dtype
        function = "quantize_frames" if request.source.frames else "quantize"
        if settings["per_frame"]:
            keywords["per_frame"] = True
        if settings["aim"] == "palette":
            name, colors = request.files.palette(settings["palette"])
            text = f"cvtimg.read_palette({quoted(name)})"
            if dtype != np.uint8:
                text = f"cvtimg.colors.to_depth({text}, image.dtype)"
            return Call(function, (), {"palette": Named(text, to_depth(colors, dtype)), **keywords})
        if (own := self._own_palette(request)) is not None and "weights" not in keywords:
            return Call(function, (), {"palette": own, **keywords})
        if settings["locked"]:
            keywords["locked"] = to_depth(rgb(settings["locked"]), dtype)
        keywords |= _bits(settings)
        if settings["effort"] != "balanced":
            keywords["effort"] = settings["effort"]
        if settings["aim"] == "psnr":
            return Call(function, (), {"psnr": settings["psnr"], **keywords})
        if settings["aim"] == "max_bytes":
            return Call(function, (), {"max_bytes": settings["max_bytes"] * _KILO, **keywords})
        n_colors = settings["k"] if settings["aim"] == "k" else "auto"
        return Call(function, (n_colors,), keywords)

    def _own_palette(self, request: Request) -> Named | None:
        """Return the palette of an indexed picture of few colors, which it keeps."""
        settings, picture = request.settings, request.picture
        found = settings["aim"] == "k" and not settings["locked"] and not _bits(settings)
        if not found or picture.header.mode != "P" or request.source.frames:
            return None
        colors = picture.kept("own palette", lambda: read_palette(picture.path))
        fits = len(colors) <= settings["k"] and colors.shape[1:] == picture.array.shape[2:]
        return Named(f"cvtimg.read_palette({quoted(picture.name)})", colors) if fits else None

    def _mapping(self, settings: Settings) -> dict[str, Any]:
        """Return how pixels get their colors."""
        keywords = {} if settings["space"] == "rgb" else {"space": settings["space"]}
        if settings["dither"] != "none":
            keywords["dither"] = settings["dither"]
            if settings["strength"] != _usual_strength(settings):
                keywords["dither_strength"] = settings["strength"]
        return keywords

    def draft_pixels(self, settings: Settings) -> int:
        """Return as many pixels as are mapped in a tenth of a second."""
        return _DITHERED.get(settings["dither"], 1 << 18) if settings["dither"] != "none" else 1 << 20

    def draft(self, request: Request) -> Outcome | None:
        """Map the window to a palette that is at hand, or quickly found."""
        settings, picture = request.settings, request.picture
        palette = None if self.maps(request) else self._quick_palette(request)
        if palette is None:
            return None
        dither = None if settings["dither"] == "none" else settings["dither"]
        result = map_to_palette(
            picture.samples_in(request.window),
            palette,
            space=settings["space"],
            dither=dither,
            dither_strength=settings["strength"] if dither else 1.0,
        )
        return replace(self._outcome(picture, result), drawn=request.window)

    def _quick_palette(self, request: Request) -> NDArray[Any] | None:
        """Return a palette near the one that the exact result will have; None if none is found quickly."""
        settings, picture = request.settings, request.picture
        if settings["aim"] == "palette":
            return to_depth(request.files.palette(settings["palette"])[1], picture.array.dtype)
        curve = None if picture.has_alpha else picture.curve(settings["space"], wait=False)
        number = settings["k"]
        if settings["aim"] != "k":
            if curve is None or settings["aim"] == "max_bytes":
                return None
            try:
                number = curve.elbow() if settings["aim"] == "auto" else curve.elbow("psnr", settings["psnr"])
            except (TargetMissedError, ValueError):  # more colors than the curve has; or a space without PSNR
                return None
        if curve is not None and not settings["locked"] and not _bits(settings) and number <= N_CURVE:
            found = from_places(
                curve.generators[min(number, curve.n_max) - 1], settings["space"], picture.array.dtype, False
            )
            colors = np.unique(found, axis=0)
            return colors[np.argsort(colors.sum(axis=1, dtype=np.float64), kind="stable")]
        locked = to_depth(rgb(settings["locked"]), picture.array.dtype) if settings["locked"] else None
        samples = picture.small_samples
        how = {"space": settings["space"], "locked": locked, "effort": "fast", **_bits(settings)}
        return find_palette(samples, number, **how).colors

    def exact(self, request: Request) -> Outcome:
        """Quantize the picture."""
        request = _fitting(request)
        call, outputs = self._call(request), self.outputs(request)
        if request.source.frames:
            return self._animated(request, call.run(request.source.frames), outputs)
        result: Quantized = call.run(request.picture.array)
        return self._outcome(request.picture, result, outputs)

    def _animated(self, request: Request, result: QuantizedSeries, outputs: Sequence[Output]) -> Outcome:
        seen = [self._outcome(request.picture, one) for one in result.results]
        frames = [(one.layer, one.facts) for one in seen]
        return Outcome(result, seen[0].layer, seen[0].facts, outputs, request.stem, frames=frames)

    def _outcome(self, picture: Picture, result: Quantized, outputs: Sequence[Output] = ()) -> Outcome:
        colors = picture.colors_seen(result.palette, alpha=result.alpha)
        indices = result.indices
        counts = np.bincount(indices.ravel(), minlength=len(colors))
        if result.inside is not None:
            indices = np.where(result.inside, indices, len(colors)).astype(np.uint32)
            counts[0] -= np.count_nonzero(~result.inside)
            colors = np.append(colors, np.zeros((1, 4), np.uint8), axis=0)
        facts = {
            "k": len(result.palette),
            "psnr": result.psnr if math.isfinite(result.psnr) else None,
            "counts": counts.tolist(),
        }
        return Outcome(result, Indexed(indices, colors), facts, outputs, picture.stem)


_KNOWN = """
known = (image.reshape(*image.shape[:2], -1) != {}).any(axis=2)"""


def _suffix(picture: Picture) -> str:
    """Return the suffix of a format that holds the samples of a picture."""
    shape, dtype = picture.array.shape, picture.array.dtype
    deep = dtype in (np.uint8, np.uint16) and (len(shape) == 2 or shape[2] in (1, 3, 4))
    return ".png" if deep else ".npy"


def _bits(settings: Settings) -> dict[str, Any]:
    """Return the bits per channel that the colors may have, as an argument."""
    return {} if settings["color_bits"] == "any" else {"color_bits": color_bits(settings["color_bits"])}


def _usual_strength(settings: Settings) -> float:
    return 1.0 if settings["aim"] == "palette" else STRENGTH


def rgb(colors: Sequence[str]) -> NDArray[np.uint8]:
    """(K, 3) colors that are written as #rrggbb."""
    return np.array([list(bytes.fromhex(color[1:])) for color in colors], np.uint8)


def _fitting(request: Request) -> Request:
    """Return a request without what single pictures, or animations, do not have."""
    settings = request.settings
    if not request.source.frames:
        return replace(request, settings={**settings, "per_frame": False})
    if settings["aim"] in ("auto", "max_bytes"):
        raise UnfitRequestError(f"{request.source.noun}s: choose by number of colors, quality or a given palette")
    if request.source.header.has_pages and request.picture.known is not None:
        raise UnfitRequestError("Pages with missing values are left to the command line")
    return replace(request, settings={**settings, "brushes": False})


_COUNTED = "n_pixels = numpy.bincount(result.indices.ravel(), minlength=len(result.palette))"
_COUNTED_FRAMES = (
    "n_pixels = sum(numpy.bincount(one.indices.ravel(), minlength=len(one.palette)) for one in result.results)"
)


def _palette_output(suffix: str, label: str, counted: str = _COUNTED) -> Output:
    lines = f"import numpy\n\n{counted}\ncvtimg.write_palette({{}}, result.palette, density=n_pixels)"
    return Output(label, "--save-palette", "{}-palette" + suffix, _save_palette, lines)


def _save_palette(result: Quantized | QuantizedSeries, path: Path) -> None:
    results = result.results if isinstance(result, QuantizedSeries) else (result,)
    n_pixels: Any = sum(np.bincount(one.indices.ravel(), minlength=len(one.palette)) for one in results)
    write_palette(path, result.palette, density=n_pixels)

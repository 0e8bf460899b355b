"""Palette: colors of the picture, of well-known machines, of a file, or by hand."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvtimg import find_palette, write_palette
from cvtimg._shared.choices import SpaceName
from cvtimg.colors import to_depth
from cvtimg.explore.calls import Call, Named
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
from cvtimg.explore.layers import Indexed
from cvtimg.explore.opened import Picture
from cvtimg.explore.outcomes import Outcome, Output, Recipe, quoted
from cvtimg.explore.tabs.base import Request, Tab, reading
from cvtimg.explore.tabs.colors_tab import rgb
from cvtimg.palettes import color_order
from cvtimg.quantization import Quantized, main_palette, map_to_palette

_FORMATS = {
    ".gpl": "GIMP, Inkscape, Krita (.gpl)",
    ".ase": "Adobe (.ase)",
    ".aseprite": "Aseprite (.aseprite)",
    ".act": "Photoshop color table (.act)",
    ".css": "CSS variables",
    ".scss": "SCSS variables",
    ".hex": "List, Lospec (.hex)",
    ".json": "JSON, with shares",
    ".pal": "JASC (.pal)",
    ".txt": "paint.net (.txt)",
    ".svg": "Drawing of swatches, SVG",
    ".png": "Image of swatches, PNG",
}
_FOUND = {"start": ["image", "main"]}
_GIVEN = {"start": ["given", "hand"]}
_COUNTED = """
import numpy

n_pixels = numpy.bincount(result.indices.ravel(), minlength=len(result.palette))
"""


class Sorted(NamedTuple):
    """A palette in its order, the pixels that each color has, and the picture in its colors."""

    colors: NDArray[Any]
    n_pixels: NDArray[np.int64]
    result: Quantized


class PaletteTab(Tab):
    """Palettes."""

    name = "palette"
    title = "Palette"
    about = "Find, take or make a palette. Drag its colors to sort them; choose one to edit, lock or remove it."
    verb = "palette"
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
            ("space", {"when": {"start": ["image"]}, "keyword": ""}),
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

    def outputs(self, request: Request) -> Sequence[Output]:
        """Return the palette in all formats, and the picture in it where the command makes that, too."""
        order = (
            f"order = cvtimg.palettes.color_order(result.palette, {quoted(request.settings['sort'])}, density=n_pixels)"
        )
        lines = (
            f"{_COUNTED}{order}\ncvtimg.write_palette({{}}, result.palette[order], density=n_pixels[order])"
            if _is_found(request.settings)
            else f"{_COUNTED}cvtimg.write_palette({{}}, result.palette, density=n_pixels)"
        )
        return [
            Output(label, "--save-palette", f"{{}}-palette{suffix}", _save_palette, lines)
            for suffix, label in _FORMATS.items()
        ]

    def recipe(self, request: Request) -> Recipe:
        """Return the command and the lines of Python."""
        settings, picture = request.settings, request.picture
        start = reading(picture)
        if not _is_found(settings):
            words = ["cvtimg", "quantize", *picture.words, "--palette", _given(request)[0]]
            words += words_of(self.controls, settings)
            return Recipe(words, f"{start}\nresult = {self._call(request).text()}", always="{}-quantized.png")
        main = ["--main"] if settings["start"] == "main" else []
        if picture.array.dtype != np.uint8:
            start += '\nimage = cvtimg.colors.to_depth(image, "uint8")'
        call = self._call(request)
        if settings["start"] == "main":
            start += f"\nmain = {call.text()}.colors"
            call = _IN_MAIN
        return Recipe(self.words(request, *main), f"{start}\nresult = {call.text()}", for_many=False)

    def _call(self, request: Request) -> Call:
        """Return the call that finds a palette, or maps the picture to one."""
        settings = request.settings
        if not _is_found(settings):
            name, colors = _given(request)
            text, dtype = f"cvtimg.read_palette({quoted(name)})", request.picture.array.dtype
            if dtype != np.uint8:
                text = f"cvtimg.colors.to_depth({text}, image.dtype)"
            return Call("quantize", (), {"palette": Named(text, to_depth(colors, dtype)), **self.keywords(settings)})
        keywords: dict[str, Any] = {"locked": rgb(settings["locked"])} if settings["locked"] else {}
        if settings["start"] == "main":
            return Call("quantization.main_palette", (settings["k"],), keywords)
        keywords |= {} if settings["space"] == "rgb" else {"space": settings["space"]}
        return Call("quantize", (settings["k"],), keywords)

    def draft(self, request: Request) -> Outcome | None:
        """Map the window to the palette of the picture in a small size."""
        settings, picture = request.settings, request.picture
        space: SpaceName = {"image": settings["space"], "main": "oklab"}.get(settings["start"], "rgb")
        if not _is_found(settings):
            if settings["dither"] != "none" or settings["ramp"]:
                return None
            colors = to_depth(_given(request)[1], picture.array.dtype)
        else:
            locked = to_depth(rgb(settings["locked"]), picture.array.dtype) if settings["locked"] else None
            finds = main_palette if settings["start"] == "main" else partial(find_palette, space=space)
            colors = finds(picture.small_samples, settings["k"], locked=locked, effort="fast").colors
        return self._outcome(request, map_to_palette(picture.samples_in(request.window), colors, space=space), False)

    def exact(self, request: Request) -> Outcome:
        """Find the palette, and map the picture to it."""
        image, call = request.picture.array, self._call(request)
        if _is_found(request.settings):
            image = to_depth(image, np.dtype(np.uint8))
        found = call.run(image)
        if request.settings["start"] == "main":
            found = map_to_palette(image, found.colors, space="oklab")
        return self._outcome(request, found, True)

    def _outcome(self, request: Request, result: Quantized, is_exact: bool) -> Outcome:
        counts = np.bincount(result.indices.ravel(), minlength=len(result.palette))
        order = np.arange(len(counts))
        if _is_found(request.settings):
            order = color_order(result.palette, request.settings["sort"], density=counts)
        indices = np.argsort(order).astype(np.uint32)[result.indices]
        shown = _seen(request.picture, result)[order]
        facts = {
            "k": len(order),
            "psnr": result.psnr if np.isfinite(result.psnr) else None,
            "counts": counts[order].tolist(),
        }
        value = Sorted(result.palette[order], counts[order], result)
        if not is_exact:
            return Outcome(None, Indexed(indices, shown), facts, drawn=request.window)
        return Outcome(value, Indexed(indices, shown), facts, self.outputs(request), request.stem)


_IN_MAIN = Call("quantization.map_to_palette", (Named("main", None),), {"space": "oklab"})


def _is_found(settings: Settings) -> bool:
    """Whether the palette is found in the picture."""
    return settings["start"] in ("image", "main")


def _given(request: Request) -> tuple[str, NDArray[np.uint8]]:
    """Return name and colors of the palette that is chosen or made."""
    settings = request.settings
    if settings["start"] == "given":
        return request.files.palette(settings["palette"])
    if not settings["colors"]:
        raise UnfitRequestError("the palette is empty; add a color")
    return ",".join(settings["colors"]), rgb(settings["colors"])


def _seen(picture: Picture, result: Quantized) -> NDArray[np.uint8]:
    """(K, 4) colors to show, of a result in the depth of the picture or in eight bits."""
    if result.palette.dtype == picture.array.dtype:
        return picture.colors_seen(result.palette, alpha=result.alpha)
    colors = result.palette if result.palette.shape[1] > 2 else result.palette[:, [0, 0, 0]]
    rgba = np.full((len(colors), 4), 255, np.uint8)
    rgba[:, : min(colors.shape[1], 4)] = colors[:, :4]
    return rgba


def _save_palette(found: Sorted, path: Path) -> None:
    write_palette(path, found.colors, density=found.n_pixels)

"""What is written is what is read: pictures, labels, palettes and contours; outputs are inputs that change no more."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from relations.relation import Relation, equal, quick_and_wide
from relations.test_pictures import color_picture, gray_picture

import cvtimg
from cvtimg._shared.types import Array, Bytes, Floats32, Ints


def again(write: Callable[[Path, Any], None], read: Callable[[Path], Any], name: str) -> Callable[[Array], Array]:

    def result(content: Array) -> Array:
        with tempfile.TemporaryDirectory() as folder:
            write(Path(folder) / name, content)
            return np.asarray(read(Path(folder) / name))

    return result


def deep(rng: np.random.Generator) -> NDArray[np.uint16]:
    return color_picture(rng).astype(np.uint16) * np.uint16(211) + np.uint16(7)


def measured(rng: np.random.Generator) -> Floats32:
    """Return seven bands of floating point, some below 0; one row could be bands to a .npy file, and is refused."""
    sides = rng.integers(2, 40, 2)
    return rng.normal(0, 1e3, (*sides, 7)).astype(np.float32)


def see_through(rng: np.random.Generator) -> Bytes:
    """Return a picture of which a part is transparent."""
    return np.dstack([color_picture(rng), gray_picture(rng)])


def labels(rng: np.random.Generator) -> Ints:
    """Return labels, some above 255."""
    return (gray_picture(rng).astype(np.int32) // 40) * int(rng.integers(1, 60))


def colors(rng: np.random.Generator) -> Bytes:
    return cvtimg.find_palette(color_picture(rng), int(rng.integers(1, 30))).colors


def quantized(rng: np.random.Generator) -> Bytes:
    return cvtimg.quantize(color_picture(rng), 8).image


_PICTURES = {
    ".png": (color_picture, gray_picture, deep, see_through),
    ".webp": (color_picture, see_through),
    ".tif": (color_picture, gray_picture, deep, measured),
    ".npy": (color_picture, gray_picture, deep, measured),
    ".bmp": (color_picture, gray_picture),
    ".ppm": (color_picture,),
    ".pgm": (gray_picture,),
}
_PALETTES = (".gpl", ".json", ".hex", ".act", ".ase", ".css", ".scss", ".svg", ".pal", ".txt", ".png")
_FILES: list[tuple[str, str, Any, Any]] = [
    ("read_image", f"{suffix}, {inputs.__name__}", inputs, again(cvtimg.write_image, cvtimg.read_image, f"a{suffix}"))
    for suffix, kinds in _PICTURES.items()
    for inputs in kinds
]
_FILES += [
    ("read_labels", suffix, labels, again(cvtimg.write_labels, cvtimg.read_labels, f"a{suffix}"))
    for suffix in (".png", ".tif", ".tiff", ".npy")
]
_FILES += [
    ("read_palette", suffix, colors, again(cvtimg.write_palette, cvtimg.read_palette, f"a{suffix}"))
    for suffix in _PALETTES
]
_FILES += [("quantize", "its own output", quantized, lambda image: cvtimg.quantize(image, 8).image)]
RELATIONS = [
    Relation(verb, change, inputs, lambda content: content, lambda content: content, equal, "2026-11-28", rival=result)
    for verb, change, inputs, result in _FILES
]
test_what_is_written_is_read, test_whatever_is_written_is_read = quick_and_wide(RELATIONS)

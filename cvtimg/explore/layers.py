"""Pictures as the page shows them, cut to a window, and packed for the way to the browser."""

from __future__ import annotations

import json
import math
import struct
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.choices import Json, Options
from cvtimg._shared.types import Array, Bytes, Floats32
from cvtimg.explore.controls import UnfitRequestError, is_number


class Window(NamedTuple):
    """Part of a picture: columns left..right, rows top..bottom, every step-th pixel of them."""

    left: int
    top: int
    right: int
    bottom: int
    step: int

    @classmethod
    def of(cls, view: object, size: tuple[int, int], most: int) -> Window:
        """Return the window for what a page sees of a picture of (height, width), with at most `most` pixels.

        `view` is [left, top, right, bottom] in pixels; None for all. Parts of the picture beside it are included as
        far as the pixels allow, so that small moves need no new window.
        """
        height, width = size
        if height * width <= most or view is None:
            return cls(0, 0, width, height, _step(height * width, most))
        if not isinstance(view, list) or len(view) != 4 or not all(map(is_number, view)):
            raise UnfitRequestError("view must be four numbers")
        left, right = sorted(min(max(value, 0), width) for value in view[::2])
        top, bottom = sorted(min(max(value, 0), height) for value in view[1::2])
        step = _step(int((right - left + 1) * (bottom - top + 1)), most)
        spare = math.sqrt(most * step**2 / max((right - left + 1) * (bottom - top + 1), 1))
        across, down = ((spare - 1) / 2 * length for length in (right - left, bottom - top))
        left, top = (max(int(value) // step * step, 0) for value in (left - across, top - down))
        return cls(left, top, min(math.ceil(right + across), width), min(math.ceil(bottom + down), height), step)

    def of_array(self, array: Array) -> Array:
        """Cut the window from an array (H, W, ...)."""
        return np.ascontiguousarray(array[self.top : self.bottom : self.step, self.left : self.right : self.step])


def _step(n_pixels: int, most: int) -> int:
    return max(1, math.ceil(math.sqrt(n_pixels / most)))


@dataclass(frozen=True, slots=True, eq=False)
class Indexed:
    """(H, W) indices of (K, 4) uint8 colors."""

    indices: Array
    colors: Bytes

    def cut(self, window: Window) -> tuple[Json, Sequence[bytes]]:
        indices = window.of_array(self.indices)
        # Counts of labels are 32-bit; few pixels are sent, as bytes where they fit.
        smallest = next(size for size in (1, 2, 4) if len(self.colors) <= 256**size)
        indices = indices.astype(f"<u{smallest}", copy=False)
        about = {"kind": "indexed", "width": indices.shape[1], "height": indices.shape[0], "colors": len(self.colors)}
        return {**about, "size": smallest}, [self.colors.tobytes(), indices.tobytes()]


@dataclass(frozen=True, slots=True, eq=False)
class Pixels:
    """(H, W, 3) or (H, W, 4) uint8 pixels."""

    pixels: Bytes

    def cut(self, window: Window) -> tuple[Json, Sequence[bytes]]:
        pixels = window.of_array(self.pixels)
        rgba = np.full((*pixels.shape[:2], 4), 255, np.uint8)
        rgba[..., : pixels.shape[2]] = pixels
        return {"kind": "pixels", "width": rgba.shape[1], "height": rgba.shape[0]}, [rgba.tobytes()]


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """A drawing in SVG of the whole picture; `over` says whether the picture is seen below it."""

    svg: bytes
    over: bool = False

    def cut(self, window: Window) -> tuple[Json, Sequence[bytes]]:
        return {"kind": "svg", "over": self.over}, [self.svg]


@dataclass(frozen=True, slots=True, eq=False)
class Globe:
    """Edges (E, 2) uint32 between (V, 3) float32 unit vectors, seen from any side."""

    vertices: Floats32
    edges: NDArray[np.uint32]

    def cut(self, window: Window) -> tuple[Json, Sequence[bytes]]:
        about = {"kind": "globe", "corners": len(self.vertices)}
        return about, [self.vertices.astype("<f4").tobytes(), self.edges.astype("<u4").tobytes()]


#: What is seen of a result. `cut` returns what describes it in a window, and its bytes; drawings and globes are whole.
Layer: TypeAlias = Indexed | Pixels | Drawing | Globe


def packed(number: int, about: Options, layer: Layer, window: Window, part: Window | None = None) -> bytes:
    """Pack a reply: the number of the request, the length of the description, the description, the layer.

    The layer is cut to the window, or is that of a `part` of the picture and taken whole.
    Both numbers are 32-bit, little-endian. The description is JSON, filled with spaces so that colors and indices begin
    at a multiple of four.
    """
    described, content = layer.cut(window if part is None else Window(0, 0, sys.maxsize, sys.maxsize, 1))
    text = json.dumps({**about, **described, "window": part or window}, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return b"".join([struct.pack("<II", number, len(text)), text, *content])

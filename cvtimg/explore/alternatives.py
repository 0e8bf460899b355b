"""Lossy files beside those of a result, each as small as a quality allows, and how alike to the image files look."""

from __future__ import annotations

from bisect import bisect_left
from functools import cache
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, features

from cvtimg._shared.types import Array
from cvtimg.explore.controls import Control, controls_of
from cvtimg.looks.similarity import Qualities

#: Lossy formats of Pillow by the ends of their names; it may be built without some.
_FORMATS = {"jpg": "JPEG", "webp": "WEBP", "avif": "AVIF"}
LOSSY = [end for end, name in _FORMATS.items() if features.check({"JPEG": "jpg"}.get(name, name.lower()))]
#: Pixels, in the middle of the image, on which the setting of a format is searched.
_SEARCHED = 1 << 19
#: The quality that is wanted; its option is that of `cvtimg quantize`.
WANTED: Control = controls_of("quantize", "quality")[0]


def fitting(image: Array | None) -> list[str]:
    """Return the ends of names of the lossy formats that hold an image; nothing for none."""
    if image is None or image.dtype != np.uint8 or image.shape[2:] not in ((), (3,), (4,)):
        return []
    return [end for end in LOSSY if end != "jpg" or image.shape[2:] != (4,)]


def lossy(image: Any, end: str, quality: float) -> bytes:
    """Return the file of the least setting of Pillow that reaches a quality in the middle, or else of the highest."""
    step = max(1.0, (image.shape[0] * image.shape[1] / _SEARCHED) ** 0.5)
    sides = [int(side / step) for side in image.shape[:2]]
    down, right = ((whole - side) // 2 for whole, side in zip(image.shape, sides, strict=False))
    middle = np.ascontiguousarray(image[down : down + sides[0], right : right + sides[1]])
    measure = Qualities(middle).content
    reached = cache(lambda setting: measure(_decoded(_encoded(middle, end, setting), middle)))
    return _encoded(image, end, 1 + bisect_left(range(1, 100), quality, key=reached))


def seen_quality(image: Any, content: bytes) -> float:
    """Return how alike to an image the content of a file looks, as `content_quality`."""
    return Qualities(image).content(_decoded(content, image))


def _encoded(image: Array, end: str, setting: int) -> bytes:
    stream = BytesIO()
    Image.fromarray(image).save(stream, _FORMATS[end], quality=setting)
    return stream.getvalue()


def _decoded(content: bytes, image: Array) -> NDArray[np.uint8]:
    """Return the pixels of a file, with as many bands as an image."""
    mode = "L" if image.ndim == 2 else {3: "RGB", 4: "RGBA"}[image.shape[2]]
    return np.asarray(Image.open(BytesIO(content)).convert(mode))

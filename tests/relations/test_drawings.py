"""Relations of stipples and mosaics: dots in the frame, and changes of the picture that nobody can see."""

from typing import Any

import numpy as np
from relations.relation import Relation, close, quick_and_wide

from cvtimg import stipple
from cvtimg._shared.types import Array

Image = Array


def drawing(rng: np.random.Generator) -> tuple[Image, dict[str, Any]]:
    """Return a smooth drawing with dark parts at its frame, and what to make of it."""
    height, width = np.maximum(rng.integers(-8, 90, 2), 1)
    rows, columns = np.mgrid[:height, :width]
    light = np.full((height, width), 250.0)
    for _ in range(5):
        row, column = rng.choice([0, height - 1, rng.uniform(0, height)]), rng.choice([0, width - 1])
        light -= rng.uniform(40, 250) * np.exp(-((rows - row) ** 2 + (columns - column) ** 2) / rng.uniform(4, 900))
    if rng.random() < 0.4:
        light[:, -2:] = 0  # a frame
    if rng.random() < 0.2:
        light[:] = 255 * (rng.random(light.shape) < 0.98)  # specks
    image = light.clip(0, 255).astype(np.uint8)
    kinds: list[dict[str, Any]] = [{}, {"dots": "sized"}, {"layers": "cmyk"}, {"tones": "true"}, {"invert": True}]
    most = 5 if rng.random() < 0.01 else 3.7  # of 100,000, which take seconds, a few
    return image, {"n_dots": int(10 ** rng.uniform(0, most)), **kinds[rng.integers(len(kinds))]}


def of_dots(given: tuple[Image, dict[str, Any]]) -> tuple[bool, bool, bool]:
    """Whether dots are whole in the frame, each with a cell of its own, and as many as asked for, or none in white."""
    image, how = given
    result = stipple(image, **how)
    gaps = np.minimum(result.points, np.array(image.shape[::-1]) - result.points)
    own = all(
        len(np.unique(result.points[result.layers == pen], axis=0)) == np.sum(result.layers == pen) for pen in (0, 3)
    )
    return bool((gaps >= result.radii[:, None] - 1e-6).all()), own, len(result) in (0, how["n_dots"])


def drawings(rng: np.random.Generator) -> list[Any]:
    return [drawing(rng) for _ in range(20)]


def of_all(several: list[Any]) -> tuple[bool, ...]:
    return tuple(map(all, zip(*map(of_dots, several), strict=True)))


def as_wanted(before: Any, after: tuple[bool, bool, bool]) -> None:
    assert after == (True, True, True), "whole dots, a cell for each, the number"


def gray(rng: np.random.Generator) -> Image:
    return drawing(rng)[0]


def ink(image: Image) -> float:
    return stipple(image, 100).ink


_WHY = "radii are limited by the frame"
RELATIONS = [
    Relation("stipple", "dots within the frame", drawings, of_all, lambda given: given, as_wanted, "2026-11-27"),
    Relation("stipple", "mirrored", gray, ink, lambda image: image[:, ::-1], close(1e-3), "2026-11-27", _WHY),
]
test_a_drawing_follows_its_picture, test_a_drawing_follows_any_picture = quick_and_wide(RELATIONS)

"""Segments of an image that is held in another way, lies in a wider frame, or has other values of the same kind."""

from collections.abc import Callable
from typing import Any

import numpy as np
from reference import of_three_threads, same_partition
from relations.relation import Relation, close, equal, quick_and_wide
from relations.remembering import beside, remembered
from relations.test_pictures import color_picture, gray_picture

from cvtimg import segment, superpixels
from cvtimg._shared.types import Array

Image = Array
#: The frame that is put around images.
_AROUND = ((5, 70), (40, 3))


def noisy_picture(rng: np.random.Generator) -> Image:
    """Return gray patches of 16 bits under noise, in which segments start from a blurred image."""
    image = gray_picture(rng, (41, 41)).astype(float)
    return np.clip(257 * (image + rng.normal(0, 60, image.shape)), 0, 65535).astype(np.uint16)


@remembered
def labels_of(image: Image) -> tuple[Image, float]:
    """Segment an image."""
    result = segment(image, 4)
    return result.labels, result.energies[-1]


def in_variances(image: Image) -> float:
    """Segment an image, and return the energy in units of its variance."""
    return labels_of(image)[1] / float(np.var(image.astype(float)))


def volume(rng: np.random.Generator) -> Image:
    return np.stack([gray_picture(rng, (18, 18)) for _ in range(6)])


def divided(volume: Image) -> tuple[Image, float]:
    """Segment a volume."""
    result = segment(volume, 3, spacing=(1.5, 1, 1))
    return result.labels, result.energies[-1]


of_volume = remembered(divided)


def of_padded(image: Image) -> tuple[Image, float]:
    """Segment what counts in a wider frame."""
    known = np.zeros([sum(ends) + side for ends, side in zip(_AROUND, image.shape[:2], strict=True)], bool)
    (top, bottom), (left, right) = _AROUND
    known[top:-bottom, left:-right] = True
    wide = np.full((*known.shape, *image.shape[2:]), 99, image.dtype)
    wide[known] = image.reshape(-1, *image.shape[2:])
    result = segment(wide, 4, mask=known)
    assert not result.labels[~known].any()
    return result.labels[top:-bottom, left:-right], result.energies[-1]


def same(back: Callable[[Image], Image]) -> Callable[[Any, Any], None]:
    """Return the relation of labels that are those of the first image when they are turned back."""

    def follows(before: tuple[Image, float], after: tuple[Image, float]) -> None:
        np.testing.assert_array_equal(back(after[0]), before[0])
        np.testing.assert_allclose(after[1], before[1], rtol=1e-9)

    return follows


def with_empty_bands(image: Image) -> Image:
    """Add bands of 0 until there are five; the last one of two or four would be an alpha."""
    bands = image.reshape(*image.shape[:2], -1)
    return np.pad(bands, ((0, 0), (0, 0), (0, 5 - bands.shape[2])))


def energy(before: float, after: float) -> None:
    """Assert that energies are about the same: a rounding can lead the descent to another end."""
    np.testing.assert_allclose(after, before, rtol=0.1)


def drawing(rng: np.random.Generator) -> tuple[int, Image]:
    """Return the segments of a picture, each in a gray of its own, and their number."""
    sides = tuple(int(side) for side in rng.integers(24, 90, 2))
    labels = segment(np.dstack([gray_picture(rng, sides) for _ in range(3)]), int(rng.integers(2, 7))).labels
    _, places = np.unique(labels, return_inverse=True)
    n = int(places.max()) + 1
    return n, (places.reshape(labels.shape) * (255 // n)).astype(np.uint8)


def hardly_fewer(drawn: Image, labels: Image) -> None:
    """Assert that segments are those that were drawn, but for small ones that are not worth their edge."""
    assert same_partition(drawn, labels) >= 0.9


def twenty(image: Image) -> Image:
    return superpixels(image, 20).labels


def turned_alike(before: Image, after: Image) -> None:
    assert same_partition(before, np.rot90(after, -1)) == 1


_HELD: dict[str, tuple[Callable[[Image], Image], Callable[[Image], Image]]] = {
    "mirrored": (lambda image: image[:, ::-1], lambda labels: labels[:, ::-1]),
    "upside down": (lambda image: image[::-1], lambda labels: labels[::-1]),
    "turned": (np.rot90, lambda labels: np.rot90(labels, -1)),
    "transposed": (lambda image: image.swapaxes(0, 1), lambda labels: labels.swapaxes(0, 1)),
}
_PICTURES = (gray_picture, color_picture, noisy_picture)
_TOLD: dict[str, Any] = {"since": "2026-11-27"}
_CHANGES: list[tuple[str, Any, Callable[[Image], Image], Callable[[Any, Any], None], Any]] = [
    *((name, labels_of, change, same(back), None) for name, (change, back) in _HELD.items()),
    ("in a wider frame that does not count", labels_of, lambda image: image, same(lambda labels: labels), of_padded),
    ("floats in 0..1", lambda a: labels_of(a)[0], lambda a: a / np.iinfo(a.dtype).max, equal, None),
    ("floats / 2^40", lambda a: segment(a.astype(float), "auto").n_segments, lambda a: a * 2.0**-40, close(0.3), None),
    ("empty bands", lambda a: labels_of(a)[0], with_empty_bands, equal, None),
    ("an offset and a scale", in_variances, lambda a: 7 + a.astype(np.uint32) * np.uint32(1000), energy, None),
]

RELATIONS = [
    *(
        Relation("segment", f"{name}, {inputs.__name__}", inputs, result, change, follows, rival=rival, **_TOLD)
        for inputs in _PICTURES
        for name, result, change, follows, rival in _CHANGES
    ),
    *(
        Relation(
            "segment",
            f"a volume with its {name} turned over",
            volume,
            of_volume,
            lambda volume, axis=axis: np.flip(volume, axis),  # type: ignore[misc]
            same(lambda labels, axis=axis: np.flip(labels, axis)),  # type: ignore[misc]
            **_TOLD,
        )
        for axis, name in enumerate(("planes", "rows", "columns"))
    ),
    beside("segment", "a volume in three threads", volume, of_volume, of_three_threads(divided), same(np.array)),
    beside(
        "segment",
        "its own output",
        drawing,
        lambda drawn: drawn[1],
        lambda drawn: segment(drawn[1], drawn[0]).labels,
        hardly_fewer,
    ),
    Relation("superpixels", "turned", color_picture, twenty, np.rot90, turned_alike, **_TOLD),
]
test_segments_follow_their_image, test_segments_follow_any_image = quick_and_wide(RELATIONS)

"""Relations of trees of regions and of the edges that people draw: changes of the picture that must not matter."""

from typing import Any

import numpy as np
from relations.relation import Relation, close, equal, quick_and_wide
from relations.remembering import remembered
from skimage.filters import gaussian

from cvtimg import segment_hierarchy
from cvtimg._shared.types import Array, Bools, Floats32

Image = Array


def picture(rng: np.random.Generator) -> Image:
    """Return patches of color in 2..255, 96 x 128 pixels, whose least value is not 0."""
    patches = gaussian(rng.normal(size=(96, 128, 3)), 9, channel_axis=2)
    span = np.ptp(patches, axis=(0, 1))
    return np.rint(2 + 253 * ((patches - patches.min(axis=(0, 1))) / span).round(1)).astype(np.uint8)


def chances(image: Any, mask: Any = None) -> Floats32:
    return segment_hierarchy(image, n_leaves=150, mask=mask).find_edges(strength=True)


def in_a_frame(image: Image) -> tuple[Image, Bools]:
    """Put a picture into a larger one of white, which is masked."""
    frame = [(12, 30), (40, 20)]
    return np.pad(image, [*frame, (0, 0)], constant_values=255), np.pad(np.ones(image.shape[:2], bool), frame)


def of_picture(framed: Any) -> Any:
    """Return the sum of the chances in a picture, or in the unmasked part of one."""
    return chances(*framed).sum() if isinstance(framed, tuple) else all_chances(framed).sum()


all_chances = remembered(chances)


def _row(change: str, changed: Any, result: Any = all_chances, follows: Any = equal, because: str = "") -> Relation:
    return Relation("find_edges", change, picture, result, changed, follows, "2026-11-27", because)


RELATIONS = [
    _row("float32 by /255", lambda image: (image / 255).astype(np.float32)),
    _row("floats by /255", lambda image: image / 255),
    _row("16 bits", lambda image: image * np.uint16(257)),
    _row("integers of 64 bits", lambda image: image.astype(np.int64)),
    _row("heights around 0", lambda image: 40.0 * image - 5000, of_picture, close(0.1), "stretched to their range"),
    _row("an alpha that is opaque", lambda image: np.dstack([image, np.full(image.shape[:2], 255, np.uint8)])),
    _row(
        "mirrored",
        lambda image: image[:, ::-1],
        of_picture,
        close(0.1),
        "superpixels begin on a grid from the upper left",
    ),
    _row("a masked margin", in_a_frame, of_picture, close(0.15), "superpixels begin on a grid of the whole"),
]
test_edges_follow_their_picture, test_edges_follow_any_picture = quick_and_wide(RELATIONS)

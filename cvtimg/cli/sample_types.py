"""Types of samples that formats cannot hold."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["as_stored"]


def as_stored(image: NDArray[Any], path: Path) -> tuple[NDArray[Any], list[str]]:
    """Return an image in the type in which a format holds its samples, and a note where that is another.

    Integers keep their values: those of types that only .tif and .npy hold become uint16 for other formats.
    """
    import numpy as np

    from cvtimg.pictures.formats.encoding import SUFFIXES_OF_ANY_TYPE

    odd = image.dtype.kind in "iu" and image.dtype not in (np.uint8, np.uint16)
    if not odd or path.suffix.lower() in SUFFIXES_OF_ANY_TYPE:
        return image, []
    low, high = int(image.min()), int(image.max())
    if low < 0 or high > 65535:
        able = " or ".join(SUFFIXES_OF_ANY_TYPE)
        raise ValueError(f"has {image.dtype} samples in {low}..{high}, which {path.suffix} cannot hold; write {able}")
    note = f"{image.dtype} samples are written as uint16 with the same values, as {path.suffix} cannot hold their type"
    return image.astype(np.uint16), [note]

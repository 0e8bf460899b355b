"""Layers taken apart into planes, and results put together as layers that lie where their images lie."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from napari.layers import Image, Labels
from numpy.typing import NDArray

#: What a layer of a result takes over from the layer of its image.
_PLACE = ("scale", "translate", "rotate", "shear", "affine", "units", "axis_labels")
#: And an image in one channel besides.
_LOOK = ("colormap", "contrast_limits", "gamma")


@dataclass(frozen=True, slots=True, eq=False)
class Planes:
    """The planes of a layer along the axes before its last two, such as time and z.

    Attributes
    ----------
    arrays : tuple of (H, W) or (H, W, C) arrays
    axes : tuple of int
        Lengths of the axes that the planes are taken from; none for a single plane.
    """

    arrays: tuple[NDArray[Any], ...]
    axes: tuple[int, ...]

    @classmethod
    def of(cls, layer: Image | Labels) -> Planes:
        """Read the planes of a layer, at its full resolution."""
        data = layer.data[0] if layer.multiscale else layer.data
        shape = tuple(data.shape)
        n_plane = 3 if getattr(layer, "rgb", False) else 2
        axes = shape[: len(shape) - n_plane]
        return cls(tuple(np.asarray(data[at]) for at in np.ndindex(*axes)), axes)

    def put_together(self, planes: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Return an array of a plane for each plane of the layer."""
        return np.stack(planes).reshape(*self.axes, *planes[0].shape)

    @property
    def one_below_the_other(self) -> NDArray[Any]:
        """All planes as one image, (planes x H, W) or (planes x H, W, C)."""
        return np.concatenate(self.arrays)


def number_apart(planes: Iterable[NDArray[np.int32]]) -> list[NDArray[np.int32]]:
    """Give the segments of each plane labels that no other plane has; 0 stays."""
    apart, last = [], 0
    for labels in planes:
        apart.append(np.where(labels > 0, labels + last, 0).astype(np.int32))
        last = max(last, int(apart[-1].max()))
    return apart


def shown_part(image: NDArray[Any], mask: NDArray[Any] | None) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """Separate colors from alpha; return them, and the pixels that are in the mask and not transparent."""
    known = None if mask is None else mask > 0
    if image.ndim == 3 and image.shape[2] == 4:
        opaque = image[:, :, 3] > 0
        return image[:, :, :3], opaque if known is None else opaque & known
    return image, known


def placed(layer: Image | Labels, word: str, kind: str, n_dropped: int = 0, **found: Any) -> dict[str, Any]:
    """Return the attributes of a layer that shows what was found in another.

    Parameters
    ----------
    layer : Image or Labels
    word : str
        Follows the name of the layer.
    kind : {"image", "labels"}
        Type of the new layer.
    n_dropped : int
        Leading axes that the new layer does not have.
    found
        Figures for the metadata, under "cvtimg".
    """
    names = _PLACE if n_dropped == 0 else ("scale", "translate", "units", "axis_labels")
    attributes = {name: getattr(layer, name)[n_dropped:] if n_dropped else getattr(layer, name) for name in names}
    if kind == "image" and layer.rgb:
        attributes["rgb"] = True
    elif kind == "image":
        attributes |= {name: getattr(layer, name) for name in _LOOK}
    attributes["name"] = f"{layer.name} {word}"
    attributes["metadata"] = {**layer.metadata, "cvtimg": found}
    return attributes

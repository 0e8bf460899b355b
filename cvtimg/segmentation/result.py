"""The result of a segmentation: labels, and what is measured of each segment on the original pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.records import ReadOnly
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.engine.tessellation import Tessellation
from cvtimg.files.whole import StrPath
from cvtimg.labels.figures import painted
from cvtimg.labels.files import write_labels
from cvtimg.pictures.files import encode_image
from cvtimg.pictures.showing import shown
from cvtimg.segmentation.edge_weight import EdgeWeighted
from cvtimg.segmentation.hierarchy.tree import RegionHierarchy
from cvtimg.segmentation.values import PictureValues, dark_to_bright, in_order

Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Counting:
    """What was measured on an image to count its objects.

    Attributes
    ----------
    dark : bool
        Whether objects are darker than the background.
    blur : float
        Standard deviation of the Gaussian that takes out noise, in pixels.
    radius : float
        Radius of the usual object, in pixels.
    least_size : float
        Smallest object that counts, in pixels.
    """

    dark: bool
    blur: float
    radius: float
    least_size: float


@dataclass(frozen=True, slots=True, eq=False)
class Segmentation(ReadOnly):
    """Segments of an image.

    Attributes
    ----------
    labels : (H, W) int32 array
        Labels start at 1; 0 marks pixels outside the mask and, with `objects`, the background. Segments are sorted by
        the brightness of their generators, the sum of the bands, from dark to bright. Ties are broken by the bands in
        turn, then by reading order.
    generators : (K, C) float64 array
        Mean of each segment, in the units of the image; row ``label - 1`` belongs to a label. K can be less than the
        number requested.
    masses : (K,) float64 array
        Number of pixels in each segment.
    energy : float
        Sum over the pixels of the squared distance to their generator, in squared units of the image or, if the space
        is not "rgb", of that space.
    energies : tuple of float
        Energy before each iteration and at the end, in the same units: of the edge-weighted descent if there was one,
        otherwise of the tessellation. It never rises.
    edge_weight : float
        The edge weight used; for "auto", the one that was found.
    converged : bool
        Whether the iteration converged.
    curve : EnergyCurve or None
        The energy curve that picked the number of segments, if that was "auto".
    hierarchy : RegionHierarchy or None
        The tree of which the segments are a cut, if they are one.
    counting : Counting or None
        What `count_objects` measured, if that found them.
    """

    labels: NDArray[np.int32]
    generators: NDArray[np.float64]
    masses: NDArray[np.float64]
    energy: float
    energies: tuple[float, ...]
    edge_weight: float
    converged: bool
    curve: EnergyCurve | None = None
    hierarchy: RegionHierarchy | None = None
    counting: Counting | None = None

    @property
    def n_segments(self) -> int:
        """Number of segments, K."""
        return len(self.generators)

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the labels to a .png, .tif or .npy file, as `write_labels` does."""
        write_labels(path, np.asarray(self.labels), overwrite=overwrite)

    def draw(self) -> NDArray[np.uint8]:
        """Draw each segment in its mean color, stretched to 8 bits from the least to the greatest value.

        Returns
        -------
        (H, W) or (H, W, 3) uint8 array
            In color if there are three bands or more, of which the first three are shown; otherwise in gray. Pixels
            of label 0 are black.
        """
        means = self.generators[:, : 3 if self.generators.shape[1] >= 3 else 1]
        colors = shown(means, (means.min(), means.max()))[:, : means.shape[1]] if self.n_segments else means
        return painted(np.asarray(self.labels), colors.astype(np.uint8))

    def _repr_png_(self) -> bytes:
        return encode_image(".png", self.draw())

    def __repr__(self) -> str:
        size = " x ".join(map(str, self.labels.shape[::-1]))
        ending = "converged" if self.converged else "not converged"
        return (
            f"Segmentation({self.n_segments} segments of {size} pixels, energy={self.energy:.6g}, "
            f"edge_weight={self.edge_weight:.4g}, {ending})"
        )


def from_tessellation(values: PictureValues, cells: Tessellation) -> Segmentation:
    """Carry a tessellation of the distinct colors to the pixels, without computing anything per pixel."""
    generators = values.to_picture(cells.generators * values.scale)
    new_label = dark_to_bright(generators, cells.masses)
    order = in_order(new_label)
    unit = (values.scale / values.unit) ** 2
    return Segmentation(
        labels=values.to_pixels(new_label[cells.labels][values.samples.inverse[0]]),
        generators=generators[order],
        masses=cells.masses[order],
        energy=cells.energy * unit,
        energies=tuple(energy * unit for energy in cells.energies),
        edge_weight=0.0,
        converged=cells.converged,
    )


def from_cut(
    hierarchy: RegionHierarchy, image: NDArray[Any], n_regions: int | None = None, threshold: float | None = None
) -> Segmentation:
    """Cut the tree of an image, and measure the regions on the image itself; the cut is that of `hierarchy.cut`."""
    return measured(hierarchy.cut(n_regions, threshold=threshold), image, hierarchy=hierarchy)


def measured(labels: NDArray[np.int32], image: NDArray[Any], **more: Any) -> Segmentation:
    """Measure regions on their image, and keep their labels; `more` are attributes of the result."""
    inside = labels > 0
    own, rows = labels[inside] - 1, image.reshape(*labels.shape, -1)[inside]
    masses = np.bincount(own).astype(np.float64)
    means = per_mass(sum_by_label(own, rows), masses)
    rest = rows - means[own]
    energy = float(np.einsum("nd,nd->", rest, rest))
    return Segmentation(labels, means, masses, energy, (energy,), 0.0, True, **more)


def from_labels(
    values: PictureValues,
    field: Floats,
    labels: NDArray[np.int32],
    iteration: EdgeWeighted | Tessellation,
    edge_weight: float,
) -> Segmentation:
    """Measure segments on the original pixels, the `field`, and sort them."""
    inside = labels > 0
    own, rows = labels[inside] - 1, field[inside]
    masses = np.bincount(own).astype(np.float64)
    sums = sum_by_label(own, rows)
    means = per_mass(sums, masses)
    squares = np.einsum("nd,nd->", rows, rows, dtype=np.float64)
    energy = max(float(squares - np.einsum("kd,kd->", means, sums)), 0.0)
    generators = values.to_picture(means + values.center)
    new_label = dark_to_bright(generators, masses)
    order = in_order(new_label)
    return Segmentation(
        labels=np.append(np.int32(0), new_label)[labels],
        generators=generators[order],
        masses=masses[order],
        energy=energy / values.unit**2,
        energies=tuple(energy / values.unit**2 for energy in iteration.energies),
        edge_weight=edge_weight,
        converged=iteration.converged,
    )

"""The result of a segmentation: labels, and what is measured of each segment on the original pixels."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cvtimg._shared.choices import Row
from cvtimg._shared.records import Claims, ReadOnly, equals, never_rises
from cvtimg._shared.sums import take_rows
from cvtimg._shared.types import Array, Bytes, Floats, Floats32, Ints
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.engine.tessellation import Tessellation
from cvtimg.files.whole import StrPath
from cvtimg.labels.components import connected_pieces
from cvtimg.labels.figures import painted
from cvtimg.labels.files import write_labels
from cvtimg.pictures.files import encode_image
from cvtimg.pictures.showing import shown
from cvtimg.segmentation.edge_weight import EdgeWeighted, moments_of
from cvtimg.segmentation.hierarchy.tree import RegionHierarchy
from cvtimg.segmentation.values import PictureValues, dark_to_bright


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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Segments(ReadOnly):
    """What is known of segments, wherever their labels are: see `Segmentation`."""

    generators: Floats
    masses: Floats
    energy: float
    energies: tuple[float, ...]
    edge_weight: float
    converged: bool

    def _claims(self) -> Claims:
        yield "masses and generators are as long", len(self.masses) == len(self.generators)
        yield "energies never rise", never_rises(self.energies)

    @property
    def n_segments(self) -> int:
        """Number of segments, K."""
        return len(self.generators)

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        return {
            "k": self.n_segments,
            "edge_weight": self.edge_weight,
            "energy": self.energy,
            "n_iter": len(self.energies) - 1,
            "converged": self.converged,
        }


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SegmentedFile(Segments):
    """The result of segmenting an image on disk.

    Attributes
    ----------
    generators, masses, energy, energies, edge_weight, converged
        As in `Segmentation`.
    shape : tuple of int
        Shape of the image: (H, W) or (H, W, C).
    exact : bool
        Whether all distinct colors of the image were told apart. Of more than 2^22, similar ones are merged.
    """

    shape: tuple[int, ...]
    exact: bool

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        left_out = self.shape[0] * self.shape[1] - int(self.masses.sum())
        return {"left_out": left_out, "exact": self.exact, **Segments.summary(self)}

    def __repr__(self) -> str:
        size = " x ".join(map(str, self.shape[1::-1]))
        return f"SegmentedFile({self.n_segments} segments of {size} pixels, energy={self.energy:.6g})"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Segmentation(Segments):
    """Segments of an image.

    Attributes
    ----------
    labels : (H, W) or, of a volume, (Z, H, W) int32 array
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

    labels: Ints
    curve: EnergyCurve | None = None
    hierarchy: RegionHierarchy | None = None
    counting: Counting | None = None

    def _claims(self) -> Claims:
        yield from Segments._claims(self)
        counts = np.bincount(self.labels.ravel(), minlength=self.n_segments + 1)[1:]
        yield "masses are numbers of pixels", equals(self.masses, counts)

    def summary(self) -> Row:
        """Return what a table says of the result, by column."""
        elbow = self.curve.elbows() if self.curve else None
        return {**Segments.summary(self), "elbow": elbow, **(asdict(self.counting) if self.counting else {})}

    @property
    def n_regions(self) -> int:
        """Number of connected pieces of segments: pixels touch by their sides, in each plane of a volume."""
        planes = self.labels.reshape(-1, *self.labels.shape[-2:])
        return sum(int(connected_pieces(plane).max()) for plane in planes)

    @property
    def edge_length(self) -> int:
        """Sides of pixels between two labels, in each plane of a volume."""
        return sum(int(np.count_nonzero(np.diff(self.labels, axis=axis))) for axis in (-2, -1))

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write the labels to a .png, .tif or .npy file, as `write_labels` does."""
        write_labels(path, np.asarray(self.labels), overwrite=overwrite)

    def draw(self) -> Bytes:
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
        figures = f"energy={self.energy:.6g}, edge_weight={self.edge_weight:.4g}"
        return f"Segmentation({self.n_segments} segments of {size} pixels, {figures}, {ending})"


def measured(labels: Ints, image: Array, **more: Any) -> Segmentation:
    """Measure regions on their image, and keep their labels; `more` are attributes of the result."""
    rows = labels.reshape(-1, labels.shape[-1])  # planes below each other
    values, inside = image.reshape(*rows.shape, -1), (rows > 0)[..., None]
    center = values.sum(axis=(0, 1), dtype=np.float64, where=inside) / max(np.count_nonzero(inside), 1)
    moments = moments_of(np.where(inside, values - center, 0).astype(np.float32), rows)
    energy = float(moments.energies.sum())
    return Segmentation(
        labels=labels,
        generators=moments.means[1:] + center,
        masses=moments.masses[1:, 0].copy(),
        energy=energy,
        energies=(energy,),
        edge_weight=0.0,
        converged=True,
        **more,
    )


def from_labels(
    values: PictureValues,
    field: Floats32,
    labels: Ints,
    iteration: EdgeWeighted | Tessellation,
    edge_weight: float,
    curve: EnergyCurve | None = None,
) -> Segmentation:
    """Measure segments on the original pixels, the `field`, and sort them."""
    moments = moments_of(field, labels)
    means, masses = moments.means[1:], moments.masses[1:, 0]
    new_label, ends = sorted_ends(values, means, masses, float(moments.energies.sum()), iteration.energies)
    return Segmentation(
        labels=take_rows(np.append(np.int32(0), new_label), labels),
        edge_weight=edge_weight,
        converged=iteration.converged,
        curve=curve,
        **ends,
    )


def sorted_ends(
    values: PictureValues, means: Floats, masses: Floats, energy: float, energies: Sequence[float]
) -> tuple[Ints, dict[str, Any]]:
    """Return the new label of each segment, from dark to bright, and attributes of the result in units of the image."""
    generators = values.to_picture(means + values.center)
    new_label = dark_to_bright(generators, masses)
    order = np.argsort(new_label, kind="stable")[np.count_nonzero(new_label == 0) :]
    unit = np.square(values.unit)
    of_energy = {"energy": energy / unit, "energies": tuple(each / unit for each in energies)}
    return new_label, {"generators": generators[order], "masses": masses[order], **of_energy}

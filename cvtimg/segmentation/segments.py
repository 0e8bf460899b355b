"""Segmentation: the tessellation of the colors of a picture carried to its pixels, for clean and for noisy pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_count, check_non_negative
from cvtimg.colors.spaces import SPACES
from cvtimg.elbow.curves import EnergyCurve, energy_curve
from cvtimg.elbow.rules import CHORD_ENDS
from cvtimg.engine.tessellation import Tessellation, tessellate
from cvtimg.labels.components import absorb_small, connected_pieces, join_regions
from cvtimg.segmentation.averaging import Averaging, as_averaging, average_segments, averaged
from cvtimg.segmentation.curves import curve_of_segments
from cvtimg.segmentation.edge_weight import EdgeWeighted, descend, length_cost
from cvtimg.segmentation.noise import noise_covariance
from cvtimg.segmentation.values import PictureValues, picture_values

#: The edge weight "auto" is this times the variance of the noise, at a radius of 3: of three shapes under noise of a
#: quarter to all of their contrast most pixels are right from 0.3 to 0.4.
_AUTO_WEIGHT = 0.35
_RADIUS_OF_AUTO = 3
#: The descent starts from segments of a picture averaged until the noise is this part of what else varies.
_NOISE_AT_START = 0.25
_LARGEST_START = 5.0
_MAX_SEGMENTS = 1 << 16
_BESIDE_BORDERS = Averaging("before", "gaussian", 1.0)
#: Curves start from a picture that is averaged as for so many segments.
_SEGMENTS_AT_START = 4


@dataclass(frozen=True, slots=True, eq=False)
class Segmentation:
    """Segments of a picture.

    Attributes
    ----------
    labels : (H, W) int32 array
        From 1, and 0 outside of the mask. Segments are in the order of the brightness of their generators, the sum
        of its bands; on a tie in that of the bands, then in reading order.
    generators : (K, C) float64 array
        The mean of each segment, by its label less 1, in the units of the picture. K can be less than was asked for.
    masses : (K,) float64 array
        Pixels of each segment.
    energy : float
        Sum over the pixels of the squared distance to the generator: in squared units of the picture, or, if the
        space is not "rgb", of that space.
    energies : tuple of float
        In the same units, of the iteration: of the edge-weighted descent if there was one, else of the tessellation.
        They never rise.
    edge_weight : float
        What was asked for, or found if that was "auto".
    converged : bool
        Whether that iteration came to rest.
    curve : EnergyCurve or None
        What picked the number of segments, where it was "auto".
    """

    labels: NDArray[np.int32]
    generators: NDArray[np.float64]
    masses: NDArray[np.float64]
    energy: float
    energies: tuple[float, ...]
    edge_weight: float
    converged: bool
    curve: EnergyCurve | None = None

    def __post_init__(self) -> None:
        for array in (self.labels, self.generators, self.masses):
            array.flags.writeable = False

    @property
    def n_segments(self) -> int:
        """Number of segments, K."""
        return len(self.generators)


def segment(
    image: Any,
    n_segments: int | Literal["auto"],
    *,
    space: str = "rgb",
    averaging: str | Averaging | None = None,
    edge_weight: float | str = 0,
    edge_radius: int = 3,
    volume_power: float = 0,
    components: bool = False,
    min_size: int = 0,
    border_price: float = 0,
    mask: ArrayLike | None = None,
    effort: str = "balanced",
    rng: int | np.random.Generator = 0,
) -> Segmentation:
    """Divide a picture into segments of similar color.

    Labels depend neither on the type of the picture nor on its scale: a picture of 8 bits, the same in 16 bits and
    in floating point have the same segments. Weights and prices are in squared levels of 8 bits: they count as if
    white, which is 65535 in 16 bits and 1 in floating point, were 255 in any space.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        uint8, uint16 or floating point, any number of bands. A pixel with NaN or infinity in any band is left out.
    n_segments : int or "auto"
        K; a picture with fewer distinct colors has as many segments as these. "auto" takes the elbow of
        `segment_curve`, which the result then has.
    space : {"rgb", "linear", "lab", "oklab"}
        Where distances are measured; other than "rgb" for 1 or 3 bands.
    averaging : {"before", "after"} or Averaging, optional
        For noisy or irregular pictures: average the picture, or the segments.
    edge_weight : float or "auto"
        What a pair of near pixels in different segments costs: long and ragged edges vanish. "auto" follows the
        noise of the picture, and is next to nothing for a clean one.
    edge_radius : int
        Pixels are near each other up to this distance.
    volume_power : float
        How segments count by their size, as in `tessellate`.
    components : bool
        Make each connected piece of a segment a segment of its own. `n_segments` is then the number of colors.
    min_size : int
        Pieces of fewer pixels are absorbed by the neighbor with which the energy rises least. None remains but those
        that the mask parts from all others.
    border_price : float
        With `components`: join neighbors as long as their joint squared distances rise by less than this for each
        pixel of the border between them. Where the picture shades, the step across the border counts and not the
        difference of the means.
    mask : (H, W) array, optional
        Pixels where it is not 0 are segmented; the others have label 0 and no influence.
    effort, rng
        As in `tessellate`.

    Returns
    -------
    Segmentation

    Raises
    ------
    TypeError, ValueError
        If an argument is not what is said here; the message names it.

    References
    ----------
    Q. Du, M. Gunzburger, L. Ju, X. Wang, J. Math. Imaging Vision 24 (2006) 177-194, doi 10.1007/s10851-005-3620-4.
    J. Wang, L. Ju, X. Wang, IEEE Transactions on Image Processing 18 (2009) 1844-1858: edge weight.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import segment
    >>> picture = np.array([[10, 12, 200], [11, 202, 201]], dtype=np.uint8)
    >>> result = segment(picture, 2)
    >>> result.labels.tolist(), result.generators.ravel().tolist()
    ([[1, 1, 2], [1, 2, 2]], [11.0, 201.0])
    """
    if n_segments == "auto":
        curve = segment_curve(
            image,
            space=space,
            averaging=averaging,
            edge_weight=edge_weight,
            edge_radius=edge_radius,
            volume_power=volume_power,
            mask=mask,
            rng=rng,
        )
        same = {"averaging": averaging, "edge_weight": edge_weight, "edge_radius": edge_radius, "mask": mask}
        how = {"components": components, "min_size": min_size, "border_price": border_price, "effort": effort}
        options: dict[str, Any] = {**same, **how, "volume_power": volume_power, "space": space, "rng": rng}
        return replace(segment(image, curve.elbow(), **options), curve=curve)
    check_count("n_segments", n_segments, _MAX_SEGMENTS, "the most colors of segments")
    check_count("edge_radius", edge_radius, 30, "the largest disc")
    weight = edge_weight if edge_weight == "auto" else check_non_negative("edge_weight", weight_number(edge_weight))
    price = check_non_negative("border_price", border_price)
    least = int(check_non_negative("min_size", min_size))
    if price and not components:
        raise ValueError("border_price needs components=True")
    values = picture_values(image, check_choice("space", space, SPACES), mask)
    colors = _Colors(values, min(n_segments, values.samples.n_colors), effort, volume_power, rng)
    average = as_averaging(averaging)
    if average is None and not weight and not components and not least:
        return _plain(colors)
    field = values.field()
    data = averaged(field, average, values.inside) if average and average.when == "before" else field
    noise = noise_covariance(field, values.inside) if weight else np.zeros((1, 1))
    if weight == "auto":
        gain = average.noise_gain if average and average.when == "before" else 1.0
        weight = auto_weight(noise, edge_radius) * gain
    labels, tessellation = colors.start(field, data, noise, average)
    if average and average.when == "after":
        labels = average_segments(field, labels, colors.n_segments, average)
    descent = None
    if weight:
        descent = descend(
            data, labels, colors.n_segments, edge_weight=float(weight), radius=edge_radius, volume_power=volume_power
        )
        labels = descent.labels
    if components or least:
        labels = _regions(labels, data, components, least, price, float(weight) * length_cost(edge_radius))
    return finished(values, labels, field, descent or tessellation, float(weight))


def segment_curve(
    image: Any,
    n_max: int = CHORD_ENDS,
    *,
    space: str = "rgb",
    averaging: str | Averaging | None = None,
    edge_weight: float | str = 0,
    edge_radius: int = 3,
    volume_power: float = 0,
    mask: ArrayLike | None = None,
    rng: int | np.random.Generator = 0,
) -> EnergyCurve:
    """Compute the energies of 1, 2, .. n_max segments, of averaged pictures and with what edges cost.

    Parameters
    ----------
    image, space, averaging, edge_weight, edge_radius, volume_power, mask, rng
        As in `segment`.
    n_max : int
        The greatest number.

    Returns
    -------
    EnergyCurve
        In squared levels of 8 bits; see `energy_curve`.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg.segmentation import segment_curve
    >>> picture = np.repeat(np.array([[0, 90, 200]], np.uint8), 12, axis=0).repeat(12, axis=1)
    >>> segment_curve(picture, edge_weight=1).elbow()
    3
    """
    values = picture_values(image, check_choice("space", space, SPACES), mask)
    average = as_averaging(averaging)
    if average is None and not edge_weight:
        return energy_curve(values.samples, n_max, volume_power=volume_power, rng=rng)
    field = values.field()
    data = averaged(field, average, values.inside) if average and average.when == "before" else field
    noise = noise_covariance(field, values.inside) if edge_weight else np.zeros((1, 1))
    gain = average.noise_gain if average and average.when == "before" else 1.0
    weight = auto_weight(noise, edge_radius) * gain if edge_weight == "auto" else weight_number(edge_weight)
    blur = blur_at_start(_variance(field, values.inside), noise, _SEGMENTS_AT_START) if average is None else 0
    start = averaged(field, Averaging("before", "gaussian", blur), values.inside) if blur else data
    return curve_of_segments(
        data,
        start,
        values.inside,
        n_max,
        average=average,
        edge_weight=check_non_negative("edge_weight", float(weight)),
        edge_radius=edge_radius,
        volume_power=volume_power,
        rng=rng,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Colors:
    """The tessellation of the colors of a picture, still to be computed."""

    values: PictureValues
    n_segments: int
    effort: str
    volume_power: float
    rng: int | np.random.Generator

    def tessellate(self, samples: Any) -> Tessellation:
        return tessellate(samples, self.n_segments, effort=self.effort, volume_power=self.volume_power, rng=self.rng)

    def start(
        self,
        field: NDArray[np.float32],
        data: NDArray[np.float32],
        noise: NDArray[np.float64],
        average: Averaging | None,
    ) -> tuple[NDArray[np.int32], Tessellation]:
        """(H, W) labels of the averaged picture, where it is averaged or so noisy that it had better be."""
        inside = self.values.inside
        if data is field and average is None:
            blur = blur_at_start(_variance(field, inside), noise, self.n_segments)
            if blur:
                data = averaged(field, Averaging("before", "gaussian", blur), inside)
        if data is field:
            tessellation = self.tessellate(self.values.samples)
            own = tessellation.labels[self.values.samples.inverse[0]]
        else:
            tessellation = self.tessellate(data[inside])
            own = tessellation.labels
        return self.values.spread(own + np.int32(1)), tessellation


def weight_number(edge_weight: float | str) -> float:
    """Refuse words but "auto", which has been dealt with."""
    if isinstance(edge_weight, str):
        raise ValueError(f"edge_weight={edge_weight!r} must be a number >= 0 or 'auto'")
    return edge_weight


def auto_weight(noise: NDArray[np.float64], radius: int) -> float:
    """Follow the noise in the direction where there is most, at the same cost of length for each radius."""
    variance = max(float(np.linalg.eigvalsh(noise)[-1]), 0.0)
    return _AUTO_WEIGHT * variance * length_cost(_RADIUS_OF_AUTO) / length_cost(radius)


def _variance(field: NDArray[np.float32], inside: NDArray[np.bool_]) -> float:
    return float(field[inside].var(axis=0, dtype=np.float64).sum())


def blur_at_start(variance: float, noise: NDArray[np.float64], n_segments: int) -> float:
    """Return the standard deviation of a Gaussian that lets the noise not hide the segments; 0 if none is needed."""
    noisy = float(np.trace(noise))
    signal = max(variance - noisy, 1e-3 * noisy)
    if noisy == 0:
        return 0.0
    # A Gaussian of standard deviation s leaves 1 / (2 s sqrt(pi)) of white noise. Levels of K segments are as many
    # times nearer to each other than those of two.
    blur = np.sqrt(noisy / signal) * n_segments / 2 / (2 * np.sqrt(np.pi) * _NOISE_AT_START)
    return 0.0 if blur < 0.5 else float(min(blur, _LARGEST_START))


def _regions(
    labels: NDArray[np.int32],
    data: NDArray[np.float32],
    components: bool,
    min_size: int,
    border_price: float,
    length_price: float,
) -> NDArray[np.int32]:
    """Absorb small pieces, and make pieces segments of their own if `components`."""
    pieces = connected_pieces(labels)
    kept = absorb_small(pieces, data, min_size, max(length_price, border_price))
    if components:
        return join_regions(kept, averaged(data, _BESIDE_BORDERS, labels > 0), border_price) if border_price else kept
    label_of = np.zeros(int(pieces.max()) + 1, np.int32)
    label_of[pieces] = labels
    return label_of[kept]


def _plain(colors: _Colors) -> Segmentation:
    """Carry the tessellation to the pixels: nothing is computed pixel by pixel."""
    values = colors.values
    end = colors.tessellate(values.samples)
    generators = values.to_picture(end.generators * values.scale)
    new_label = dark_to_bright(generators, end.masses)
    labels = values.spread(new_label[end.labels][values.samples.inverse[0]])
    order = np.argsort(new_label, kind="stable")[np.count_nonzero(new_label == 0) :]
    unit = (values.scale / values.unit) ** 2
    energies = tuple(energy * unit for energy in end.energies)
    return Segmentation(labels, generators[order], end.masses[order], end.energy * unit, energies, 0.0, end.converged)


def finished(
    values: PictureValues,
    labels: NDArray[np.int32],
    field: NDArray[np.float32],
    iteration: EdgeWeighted | Tessellation,
    edge_weight: float,
) -> Segmentation:
    """Measure segments on the original pixels, and put them in order."""
    inside = values.inside
    own = labels[inside]
    masses = np.bincount(own)[1:].astype(np.float64)
    rows = field[inside]
    sums = np.stack([np.bincount(own, column)[1:] for column in rows.T], axis=1)
    means = sums / np.maximum(masses, 1)[:, None]
    squares = np.einsum("nd,nd->", rows, rows, dtype=np.float64)
    energy = max(float(squares - np.einsum("kd,kd->", means, sums)), 0.0)
    generators = values.to_picture(means + values.center)
    new_label = dark_to_bright(generators, masses)
    order = np.argsort(new_label, kind="stable")[np.count_nonzero(new_label == 0) :]
    return Segmentation(
        labels=np.append(np.int32(0), new_label)[labels],
        generators=generators[order],
        masses=masses[order],
        energy=energy / values.unit**2,
        energies=tuple(energy / values.unit**2 for energy in iteration.energies),
        edge_weight=edge_weight,
        converged=iteration.converged,
    )


def dark_to_bright(generators: NDArray[np.float64], masses: NDArray[np.float64]) -> NDArray[np.int32]:
    """(K,) new labels from 1, by the sum of the bands; 0 for segments without pixels."""
    order = np.lexsort((*generators.T[::-1], generators.sum(axis=1)))
    order = order[masses[order] > 0]
    labels = np.zeros(len(generators), np.int32)
    labels[order] = np.arange(1, len(order) + 1)
    return labels

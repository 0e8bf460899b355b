"""Numbers of the hierarchies of photographs, set by hand on 60 training pictures of the Berkeley data set."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from cvtimg.segmentation._segments import N_LEVELS

_RGB = ((0, 255), (0, 255), (0, 255))


@dataclass(frozen=True, slots=True)
class Settings:
    """The defaults of a hierarchy; values are those of pixels, where white is 255."""

    # what is seen of pixels
    most_pixels: int = 5 << 18  # larger images are reduced: discs of a few pixels see little of them but grain
    enough_pixels: int = 1 << 12  # smaller images are not looked at from farther away
    ranges: Mapping[str, tuple[tuple[int, int], ...]] = field(  # least and greatest value of each channel
        default_factory=lambda: {
            "rgb": _RGB,
            "linear": _RGB,
            "lab": ((0, 255), (-186, 242), (-186, 242)),
            "oklab": ((0, 255), (-140, 140), (-160, 110)),
        }
    )
    extremes: tuple[float, float] = (0.1, 99.9)  # percentiles of the first channel that are black and white
    harmless_noise: float = 6.0  # standard deviation; more is blurred
    blurs: tuple[float, float] = (0.5, 3.0)  # least blur that is worth it, and the largest, in pixels
    texton_scales: tuple[float, ...] = (1.0, 2.0)  # widths of the filters, in pixels
    texton_contrast: float = 0.03  # responses halfway between weak ones and strong ones, whose logarithm counts
    texton_samples: int = 40_000  # pixels of which textons are found, at most ...
    texton_step: int = 7  # ... pixels from one to the next
    # leaves
    compactness: float = 5.0  # least penalty for near pixels in different leaves, in squared values
    speck: int = 12  # leaves smaller than the mean size divided by this join a neighbor
    sweeps: int = 2  # over the borders of a whole image, for each pixel that those of the reduced one may be off
    # strengths of borders
    radii: tuple[int, ...] = (2, 3, 5, 10)  # of the discs, in pixels
    radius_weights: tuple[float, ...] = (1 / 3, 1 / 3, 1 / 3, 1 / 6)
    color_weights: tuple[float, ...] = (1.0, 1.2, 1.2)  # of lightness and the two other channels
    texton_weight: float = 0.3
    n_angles: int = 16  # of borders
    straight: float = 5.0  # pixels along a border in which its direction is looked for
    smoothing: float = 0.1 * N_LEVELS  # of histograms, in bins
    n_vectors: int = 16  # slow vibrations of the springs between leaves
    softness: float = 0.3  # strength that weakens a spring by e
    least_spring: float = 1e-6  # no spring is weaker
    other_view: float = 0.6  # weight of steps of vibrations across a border, and of the image at half its size
    # merges: how much regions differ
    color: float = 0.5  # weight of the chi-square distance of their histograms in each channel of color
    texture: float = 0.8  # the same of textons
    shared: float = 0.3  # ... decrease for the share of the border in the shorter perimeter
    size_power: float = 0.17  # power of n_a n_b / ((n_a + n_b) n), n_a and n_b pixels of n: small regions merge first
    # edges that people draw: powers, surround, inhibition and the last two as benchmarks/hierarchy.py chooses them
    view_powers: tuple[float, ...] = (0.3, 0.4, 0.3)  # of the altitude, the strength, and the altitude from afar
    least_view: float = 1e-3  # no view alone rules a border out
    drawing_accuracy: float = 0.0075  # how far from edges people draw them, in parts of the diagonal
    surround: float = 1 / 32  # how far around a border others make it count less, in parts of the root of the area ...
    inhibition: float = 0.3  # ... by this power of their mean strength
    least_surround: float = 0.05  # strength: a faint line in flat ground counts no more for less around it
    usual_surround: float = 0.25  # strength around that changes nothing
    half_drawn: float = 0.522  # half of the people draw borders of this evidence
    drawn_power: float = 2.91  # how fast more of them do above
    # where trees are cut by default
    threshold: float = 0.5  # the best single one against regions that people drew
    least_threshold: float = 0.25  # noise stays below this
    hardly_any: float = 0.15  # share of the power of borders above the threshold: with less, it is lowered ...
    most: float = 2 / 3  # ... until they have this share, unless leaves explain less of the variance: noise or texture


#: Those of `segment_hierarchy`.
SETTINGS = Settings()

"""Stippling: an image as dots whose ink adds up to its tones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_excluded,
    check_in_range,
    check_needs,
    check_positive,
    check_that,
    hints_at_keywords,
)
from cvtimg.artwork.dot_layers import DOTS, DotLayer, place_dots, place_pens
from cvtimg.artwork.stipples import Stipples
from cvtimg.artwork.tones import PROCESS_COLORS, TONES, disk_area, ink_coverage, process_coverages
from cvtimg.artwork.tours import find_tour
from cvtimg.placement.pictures import enlarge

#: Dots by default: enough for faces.
_USUAL_DOTS = 20_000
#: Least diameter of dots in pixels, finer than which an image is enlarged, to so many pixels at most.
_FINEST, _MOST_PIXELS = 1.25, 1 << 28
#: Coverage of black by default: dots nearly touch there, and hardly overlap.
MAX_INK = 0.9


@hints_at_keywords
def stipple(
    image: Any,
    n_dots: int | None = None,
    *,
    dots: str = "equal",
    max_ink: float = MAX_INK,
    white_cutoff: float = 0.0,
    dot_diameter: float | None = None,
    radius_range: tuple[float, float] | None = None,
    layers: str | None = None,
    invert: bool = False,
    tones: str = "light",
) -> Stipples:
    """Reproduce the tones of an image by dots.

    Dots are the generators of a centroidal Voronoi tessellation whose density is the square of the ink that each
    pixel asks for, in linear light and corrected for the overlap of dots: their number in any area is then
    proportional to the ink.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Gray or sRGB, with alpha or without. Integers have white at 255, or 65535 for 16 bits; floating point is in
        0..1. What is transparent or masked is paper.
    n_dots : int, optional
        Number of dots, in 1..pixels; by default 20,000, or a quarter of the pixels of images with fewer than 80,000. An
        image without ink has none.
    dot_diameter : float, optional
        Diameter of dots in pixels, such as that of a pen, in place of their number, which follows from the ink. A pen
        of 0.4 mm on a drawing 200 mm wide has ``0.4 / 200 * image.shape[1]``. Not for "sized".
    dots : {"equal", "sized"}
        "equal": dots of one size. "sized": each as large as the ink of its cell, for print.
    max_ink : float
        Share of the paper that black covers, in (0, 1]; lighter tones in proportion. Dots overlap beyond 0.907.
    white_cutoff : float
        Coverage in 0..1 up to which paper stays free.
    radius_range : (float, float), optional
        Least and greatest radius in pixels, for "sized": dark tones get large dots. Tones are right if `n_dots` such
        dots can hold the ink of the image.
    layers : {"cmyk"}, optional
        Draw in color, with a layer for each pen: cyan, magenta, yellow and black, whose dots keep apart as far as there
        is room. `n_dots` is the number of all together.
    invert : bool
        Draw light on dark paper.
    tones : {"light", "true"}
        "light": a drawing that is easy on the eye, whose tones follow lightness: what is lightest is paper, and ink is
        thinned, in the shades between white and black, where it would cover more than about a third. "true": from a
        distance as bright as the image, but for `max_ink` and `white_cutoff`; photographs become nearly black.

    Returns
    -------
    Stipples

    See Also
    --------
    cvtimg.mosaic, cvtimg.placement.place_in_picture

    References
    ----------
    A. Secord, Weighted Voronoi stippling, NPAR (2002) 37-43, doi 10.1145/508530.508537.
    Q. Du, V. Faber, M. Gunzburger, SIAM Review 41 (1999) 637-676, doi 10.1137/S0036144599352836.

    Examples
    --------
    >>> import numpy as np
    >>> from cvtimg import stipple
    >>> ramp = np.tile(np.linspace(0, 255, 200).astype(np.uint8), (100, 1))
    >>> result = stipple(ramp, 500)
    >>> result.points.shape
    (500, 2)
    >>> bool((result.points[:, 0] < 100).mean() > 0.6)
    True
    """
    check_choice("dots", dots, DOTS)
    check_choice("tones", tones, TONES)
    check_in_range("white_cutoff", white_cutoff, 0 <= white_cutoff <= 1, "in 0..1")
    check_in_range("max_ink", max_ink, 0 < max_ink <= 1, "> 0 and <= 1")
    if radius_range is not None:
        _check_radii(radius_range, dots)
    if dot_diameter is not None:
        check_positive("dot_diameter", dot_diameter, "in pixels")
        check_excluded("dot_diameter", True, n_dots=n_dots, radius_range=radius_range)
        check_needs("dot_diameter", True, 'dots of one size, not "sized"', dots != "sized")
    count = _Count(n_dots, dot_diameter)
    if layers is not None:
        check_choice("layers", layers, ("cmyk",))
        check_needs("invert=True", invert, "layers=None: inks darken the paper", False)
        return _in_colors(image, count, dots, max_ink, white_cutoff, radius_range, tones)
    coverage = ink_coverage(image, white_cutoff=white_cutoff, invert=invert, tones=tones)
    coverage *= np.float32(max_ink)
    area = disk_area(count.enlarged(coverage))
    layer = place_dots(area, count.of(area), dots, radius_range)
    ink, paper = ([255] * 3, [0] * 3) if invert else ([0] * 3, [255] * 3)
    about = _Drawn(["white" if invert else "black"], [ink], paper, coverage.shape, max_ink)
    return _together([layer], about, count.factor)


def _in_colors(
    image: Any,
    count: _Count,
    dots: str,
    max_ink: float,
    white_cutoff: float,
    radius_range: tuple[float, float] | None,
    tones: str,
) -> Stipples:
    """Stipple with the pens of process colors."""
    coverages = process_coverages(image, white_cutoff, max_ink, tones)
    inks = [disk_area(count.enlarged(coverage)) for coverage in coverages]
    counts = _divide(count.of(np.stack(inks)), np.array([ink.sum(dtype=np.float64) for ink in inks]))
    placed = place_pens(inks, counts.tolist(), dots, radius_range)
    about = _Drawn(list(PROCESS_COLORS), list(PROCESS_COLORS.values()), [255] * 3, coverages[0].shape, max_ink)
    return _together(placed, about, count.factor)


@dataclass(frozen=True, slots=True)
class _Count:
    """How many dots there are to be: their number, or what follows from their diameter; by default the usual one."""

    n_dots: int | None
    diameter: float | None

    def of(self, area: NDArray[np.float32]) -> int:
        """Return the number of dots for the area of disks that each pixel asks for, (H, W), or (L, H, W) of pens."""
        n_pixels = area.shape[-2] * area.shape[-1]
        if self.n_dots is not None:
            check_count("n_dots", self.n_dots, n_pixels, "the number of pixels")
        if not area.any():
            return 0
        if self.diameter is None:
            return self.n_dots or max(1, min(_USUAL_DOTS, n_pixels // 4))
        return max(1, round(float(area.sum(dtype=np.float64)) / (np.pi / 4 * (self.factor * self.diameter) ** 2)))

    @property
    def factor(self) -> int:
        """How much the image is enlarged, so that dots are not smaller than its pixels."""
        return 1 if self.diameter is None else max(1, math.ceil(_FINEST / self.diameter))

    def enlarged(self, coverage: NDArray[np.float32]) -> NDArray[np.float32]:
        """Enlarge the coverage (H, W) of each pixel."""
        if self.factor == 1:
            return coverage
        fits = coverage.size * self.factor**2 <= _MOST_PIXELS
        least = _FINEST / math.isqrt(_MOST_PIXELS // coverage.size)
        check_that(
            f"dot_diameter={self.diameter:.3g}", fits, f"be at least {least:.2g} pixels of an image of this size"
        )
        return enlarge(coverage, self.factor) * np.float32(self.factor**2)


def _divide(n_dots: int, inks: NDArray[np.float64]) -> NDArray[np.intp]:
    """Divide dots among pens by their ink; all pens have dots of about one size."""
    if not inks.any():
        return np.zeros(len(inks), np.intp)
    ends = np.rint(np.cumsum(inks) / inks.sum() * n_dots).astype(np.intp)
    return np.diff(ends, prepend=0)


def _check_radii(radius_range: tuple[float, float], dots: str) -> None:
    check_needs(f"radius_range={radius_range}", True, f'dots="sized", not {dots!r}', dots == "sized")
    least, greatest = radius_range
    ordered = 0 < least <= greatest < np.inf
    check_in_range("radius_range", radius_range, ordered, "two finite numbers > 0, the least first")


class _Drawn(NamedTuple):
    """What `Stipples` says beside its dots."""

    names: list[str]
    colors: ArrayLike
    paper: ArrayLike
    size: tuple[int, ...]
    max_ink: float


def _together(layers: list[DotLayer], about: _Drawn, factor: int) -> Stipples:
    """Put layers, found on an image enlarged by a factor, into one value, and find a tour through each."""
    counts = [len(layer.points) for layer in layers]
    starts = np.cumsum([0, *counts])
    tours = [find_tour(layer.points) + start for layer, start in zip(layers, starts, strict=False) if len(layer.points)]

    def joined(name: str) -> NDArray[np.float64]:
        return np.concatenate([getattr(layer, name) for layer in layers])

    return Stipples(
        points=joined("points") / factor,
        radii=joined("radii") / factor,
        masses=joined("masses") / factor**2,
        layers=np.repeat(np.arange(len(layers), dtype=np.int32), counts),
        order=np.concatenate(tours) if tours else np.empty(0, np.intp),
        colors=np.asarray(about.colors, np.uint8),
        names=tuple(about.names),
        paper=np.asarray(about.paper, np.uint8),
        size=(about.size[0], about.size[1]),
        max_ink=about.max_ink,
        energy=sum(layer.energy for layer in layers) / factor**4,
    )

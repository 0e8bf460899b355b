"""Stippling: an image as dots whose ink adds up to its tones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cvtimg._shared.budgets import MOST_POINTS
from cvtimg._shared.checks import (
    check_choice,
    check_count,
    check_excluded,
    check_in_range,
    check_needs,
    check_positive,
    check_that,
)
from cvtimg._shared.types import Floats32, ImageLike
from cvtimg.artwork.dot_layers import DOTS, Dots, place_pens
from cvtimg.artwork.stipples import Stipples
from cvtimg.artwork.tones import PROCESS_COLORS, TONES, disk_area, ink_coverage, pen_coverages, process_coverages
from cvtimg.artwork.tours import find_tour
from cvtimg.placement.pictures import enlarge

#: Dots by default: enough for faces.
_USUAL_DOTS = 20_000
#: Colors of pens, of which mixtures of three are looked at.
_MOST_PENS = 12
#: Least diameter of dots in pixels, finer than which an image is enlarged, and the most pixels that it then has.
_FINEST = 1.25


def stipple(
    image: ImageLike,
    n_dots: int | None = None,
    *,
    dots: str = "equal",
    max_ink: float = 0.9,
    white_cutoff: float = 0.0,
    dot_diameter: float | None = None,
    radius_range: tuple[float, float] | None = None,
    layers: str | None = None,
    pens: Sequence[str] | None = None,
    invert: bool = False,
    tones: str = "light",
    bleed: bool = False,
) -> Stipples:
    """Reproduce the tones of an image by dots.

    Dots are the generators of a centroidal Voronoi tessellation whose density is the square of the ink that each
    pixel asks for, in linear light and corrected for the overlap of dots: their number in any area is then
    proportional to the ink.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array, or Pillow image
        Gray or sRGB, with alpha or without. White is the largest integer of the type, or 1 for floating point;
        integers of wide types that would be nearly black, but fit in 8 or 16 bits, are taken as those. Measurements,
        which leave this range or are nearly black all the same, are stretched to the range that they fill, with a
        warning. What is transparent, masked or NaN is paper.
    n_dots : int, optional
        Number of dots; by default 20,000, or a quarter of the pixels of images with fewer than 80,000. An image without
        ink has none. One with fewer pixels of ink than dots is enlarged, to 2^28 pixels at most.
    dot_diameter : float, optional
        Diameter of dots in pixels, such as that of a pen, in place of their number, which follows from the ink. A pen
        of 0.4 mm on a drawing 200 mm wide has ``0.4 / 200 * image.shape[1]``. Not for "sized".
    dots : {"equal", "sized"}
        "equal": dots of one size. "sized": each as large as the ink of its cell, for print.
    max_ink : float
        Share of the paper that black covers, in (0, 1]; lighter tones in proportion. Dots overlap beyond 0.907, so
        that by default they nearly touch.
    white_cutoff : float
        Coverage in 0..1 up to which paper stays free.
    radius_range : (float, float), optional
        Least and greatest radius in pixels, for "sized": dark tones get large dots. Tones are right if `n_dots` such
        dots can hold the ink of the image.
    layers : {"cmyk"}, optional
        Draw in color, with a layer for each pen: cyan, magenta, yellow and black, whose dots keep apart as far as there
        is room. `n_dots` is the number of all together.
    pens : sequence of str, optional
        Draw with pens of up to 12 colors, such as ``["#000", "#e4002b", "navy"]``, in place of those of `layers`. The
        mixture of dots and paper whose light is nearest is drawn, with the least ink.
    invert : bool
        Draw light on dark paper.
    tones : {"light", "true"}
        "light": a drawing that is easy on the eye, whose tones follow lightness: what is lightest is paper, and ink is
        thinned, in the shades between white and black, where it would cover more than about a third. "true": from a
        distance as bright as the image, but for `max_ink` and `white_cutoff`; photographs become nearly black.
    bleed : bool
        Let the frame of the image cut dots. By default all are whole, and no larger than the frame.

    Returns
    -------
    Stipples

    References
    ----------
    A. Secord, Weighted Voronoi stippling, NPAR (2002) 37-43, doi 10.1145/508530.508537.
    Q. Du, V. Faber, M. Gunzburger, SIAM Review 41 (1999) 637-676, doi 10.1137/S0036144599352836.

    Examples
    --------
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
        check_needs(f"radius_range={radius_range}", True, f'dots="sized", not {dots!r}', dots == "sized")
        ordered = 0 < radius_range[0] <= radius_range[1] < np.inf
        check_in_range("radius_range", radius_range, ordered, "two finite numbers > 0, the least first")
    if dot_diameter is not None:
        check_positive("dot_diameter", dot_diameter, "in pixels")
        check_excluded("dot_diameter", True, n_dots=n_dots, radius_range=radius_range)
        check_needs("dot_diameter", True, 'dots of one size, not "sized"', dots != "sized")
    paper = np.full(3, 0 if invert else 255, np.uint8)
    if pens is not None:
        check_excluded("pens", True, layers=layers)
        inked = _colors_of(pens)
        coverages = pen_coverages(image, np.array([*inked.values()], np.uint8), white_cutoff, max_ink, tones)
    elif layers is not None:
        check_choice("layers", layers, ("cmyk",))
        coverages, inked = process_coverages(image, white_cutoff, max_ink, tones), _colors_of(PROCESS_COLORS)
    else:
        coverages = [ink_coverage(image, white_cutoff=white_cutoff, invert=invert, tones=tones) * np.float32(max_ink)]
        inked = {"white": (255, 255, 255)} if invert else {"black": (0, 0, 0)}
    has_pens = layers is not None or pens is not None
    check_needs("invert=True", invert, "neither layers nor pens: inks darken the paper", not has_pens)
    count = _Count.of_ink(coverages, n_dots, dot_diameter)
    inks = [disk_area(count.enlarged(coverage)) for coverage in coverages]
    # All pens have dots of about one size.
    ends = np.cumsum([0, *(ink.sum(dtype=np.float64) for ink in inks)])
    counts = np.diff(np.rint(ends / (ends[-1] or 1) * count.of(np.stack(inks))).astype(np.intp))
    factor = count.factor
    sizes = None if radius_range is None else (factor * radius_range[0], factor * radius_range[1])
    placed = place_pens(inks, counts.tolist(), Dots(dots, sizes, bleed))
    starts = np.cumsum([0, *counts])
    tours = [find_tour(layer.points) + start for layer, start in zip(placed, starts, strict=False) if len(layer.points)]
    return Stipples(
        points=np.concatenate([layer.points for layer in placed]) / factor,
        radii=np.concatenate([layer.radii for layer in placed]) / factor,
        masses=np.concatenate([layer.masses for layer in placed]) / factor**2,
        layers=np.repeat(np.arange(len(placed), dtype=np.int32), counts),
        order=np.concatenate(tours) if tours else np.empty(0, np.intp),
        energy=sum(layer.energy for layer in placed) / factor**4,
        names=tuple(inked),
        colors=np.array(list(inked.values()), np.uint8),
        paper=paper,
        size=coverages[0].shape,
        max_ink=max_ink,
        bleed=bleed,
    )


def _colors_of(pens: Sequence[str]) -> dict[str, tuple[int, int, int]]:
    """Return the color of each pen by its name, as it was given."""
    from PIL import ImageColor

    check_that("pens", not isinstance(pens, str) and 1 <= len(pens) <= _MOST_PENS, f"be 1 to {_MOST_PENS} colors")
    colors: dict[str, tuple[int, int, int]] = {}
    for pen in pens:
        try:
            red, green, blue, *_ = ImageColor.getrgb(pen)
        except ValueError as error:
            raise ValueError(f"pens: {pen!r} must be a color such as '#e4002b' or 'navy'") from error
        check_that(f"pens: {pen!r}", (red, green, blue) != (255, 255, 255), "not be white, as the paper is")
        colors[pen] = red, green, blue
    check_that("pens", len(set(colors.values())) == len(pens), "be different colors")
    return colors


@dataclass(frozen=True, slots=True)
class _Count:
    """How many dots there are to be: their number, or what follows from their diameter; by default the usual one."""

    n_dots: int | None
    diameter: float | None
    factor: int  # how much the image is enlarged, so that dots are not smaller than its pixels

    @classmethod
    def of_ink(cls, coverages: Sequence[Floats32], n_dots: int | None, diameter: float | None) -> _Count:
        """Find how much the image must be enlarged for these dots."""
        size, largest = coverages[0].size, max(1, math.isqrt(MOST_POINTS // coverages[0].size))
        n_inked = sum(int(np.count_nonzero(coverage)) for coverage in coverages) or size
        if diameter is not None:
            factor = max(1, math.ceil(_FINEST / diameter))
            least = f"be at least {_FINEST / largest:.2g} pixels of an image of this size"
            check_that(f"dot_diameter={diameter:.3g}", factor <= largest, least)
            return cls(None, diameter, factor)
        if n_dots is not None:
            n_dots = check_count("n_dots", n_dots, n_inked * largest**2, "for the ink of an image of this size")
        return cls(n_dots, None, math.ceil(math.sqrt((n_dots or 1) / n_inked)))

    def of(self, area: Floats32) -> int:
        """Return the number of dots for the area of disks that each pixel asks for, (H, W), or (L, H, W) of pens."""
        if not area.any():
            return 0
        if self.diameter is None:
            return self.n_dots or max(1, min(_USUAL_DOTS, area.shape[-2] * area.shape[-1] // 4))
        return max(1, round(float(area.sum(dtype=np.float64)) / (np.pi / 4 * (self.factor * self.diameter) ** 2)))

    def enlarged(self, coverage: Floats32) -> Floats32:
        return coverage if self.factor == 1 else enlarge(coverage, self.factor) * np.float32(self.factor**2)

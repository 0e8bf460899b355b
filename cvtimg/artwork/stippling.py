"""Stippling: an image as dots whose ink adds up to its tones."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.checks import check_choice, check_count, check_in_range, check_needs, hints_at_keywords
from cvtimg.artwork.dot_layers import DOTS, DotLayer, place_dots, place_pens, share_dots
from cvtimg.artwork.stipples import Stipples
from cvtimg.artwork.tones import PROCESS_COLORS, disk_area, ink_coverage, palette_coverages, process_coverages
from cvtimg.artwork.tours import find_tour

#: Dots by default: enough for faces.
_USUAL_DOTS = 20_000
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
    radius_range: tuple[float, float] | None = None,
    layers: str | int | None = None,
    invert: bool = False,
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
    dots : {"equal", "equal-mass", "sized"}
        "equal": dots of one size. "equal-mass": dots of one size, each for exactly the same ink, so that tones are
        right to the last dot; for one pen. "sized": each as large as the ink of its cell, for print.
    max_ink : float
        Share of the paper that black covers, in (0, 1]; lighter tones in proportion. Dots overlap beyond 0.907.
    white_cutoff : float
        Coverage in 0..1 up to which paper stays free.
    radius_range : (float, float), optional
        Least and greatest radius in pixels, for "sized": dark tones get large dots. Tones are right if `n_dots` such
        dots can hold the ink of the image.
    layers : "cmyk" or int, optional
        Draw in color, with a layer for each pen. "cmyk": cyan, magenta, yellow and black, whose dots keep apart as far
        as there is room. A number: so many colors of the image's own palette, whose dots lie side by side. `n_dots` is
        the number of all together.
    invert : bool
        Draw light on dark paper.

    Returns
    -------
    Stipples

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid; the message names it.

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
    check_in_range("white_cutoff", white_cutoff, 0 <= white_cutoff <= 1, "in 0..1")
    check_in_range("max_ink", max_ink, 0 < max_ink <= 1, "> 0 and <= 1")
    if radius_range is not None:
        _check_radii(radius_range, dots)
    if layers is not None:
        check_needs("invert=True", invert, "layers=None: inks darken the paper", False)
        return _in_colors(image, layers, n_dots, dots, max_ink, white_cutoff, radius_range)
    coverage = ink_coverage(image, white_cutoff=white_cutoff, invert=invert)
    n_dots = _number(n_dots, coverage.size)
    coverage *= np.float32(max_ink)
    layer = place_dots(disk_area(coverage), n_dots if coverage.any() else 0, dots, radius_range)
    ink, paper = (255, 0) if invert else (0, 255)
    return _together([layer], [[ink] * 3], ["white" if invert else "black"], [paper] * 3, coverage.shape, max_ink)


def _in_colors(
    image: Any,
    layers: str | int,
    n_dots: int | None,
    dots: str,
    max_ink: float,
    white_cutoff: float,
    radius_range: tuple[float, float] | None,
) -> Stipples:
    """Stipple with several pens."""
    white = [255] * 3
    if isinstance(layers, str):
        check_choice("layers", layers, ("cmyk",))
        coverages = process_coverages(image, white_cutoff, max_ink)
        inks = [disk_area(coverage) for coverage in coverages]
        n_dots = _number(n_dots, inks[0].size)
        counts = _divide(n_dots, np.array([ink.sum(dtype=np.float64) for ink in inks]))
        placed = place_pens(inks, counts.tolist(), dots, radius_range)
        colors, names = list(PROCESS_COLORS.values()), list(PROCESS_COLORS)
        return _together(placed, colors, names, white, inks[0].shape, max_ink)
    n_pens = check_count("layers", layers, 64, "or 'cmyk'")
    coverages, pens = palette_coverages(image, n_pens, white_cutoff)
    n_dots = _number(n_dots, coverages[0].size)
    coverages = [coverage * np.float32(max_ink) for coverage in coverages]
    total = np.minimum(np.sum(coverages, axis=0, dtype=np.float32), 1)
    together = place_dots(disk_area(total), n_dots if total.any() else 0, dots, radius_range)
    tour = find_tour(together.points) if len(together.points) else np.empty(0, np.intp)
    shared = share_dots(together, coverages, tour)
    return _together(shared, pens, [f"#{pen.tobytes().hex()}" for pen in pens], white, total.shape, max_ink)


def _number(n_dots: int | None, n_pixels: int) -> int:
    if n_dots is None:
        return max(1, min(_USUAL_DOTS, n_pixels // 4))
    return check_count("n_dots", n_dots, n_pixels, "the number of pixels")


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


def _together(
    layers: list[DotLayer], colors: ArrayLike, names: list[str], paper: ArrayLike, size: tuple[int, ...], max_ink: float
) -> Stipples:
    """Put layers into one value, and find a tour through each."""
    counts = [len(layer.points) for layer in layers]
    starts = np.cumsum([0, *counts])
    tours = [find_tour(layer.points) + start for layer, start in zip(layers, starts, strict=False) if len(layer.points)]

    def joined(name: str) -> NDArray[np.float64]:
        return np.concatenate([getattr(layer, name) for layer in layers])

    return Stipples(
        points=joined("points"),
        radii=joined("radii"),
        masses=joined("masses"),
        weights=joined("weights"),
        layers=np.repeat(np.arange(len(layers), dtype=np.int32), counts),
        order=np.concatenate(tours) if tours else np.empty(0, np.intp),
        colors=np.asarray(colors, np.uint8),
        names=tuple(names),
        paper=np.asarray(paper, np.uint8),
        size=(size[0], size[1]),
        max_ink=max_ink,
        energy=sum(layer.energy for layer in layers),
    )

"""From the samples of an image to the share of the paper that ink must cover, with one pen or several.

Eyes average light, so coverage is computed in linear light: ink that covers a share t of white paper leaves 1 - t of
its light. Paper is whatever is white, transparent or masked.
"""

from dataclasses import dataclass, replace
from itertools import chain, combinations
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_channels, check_image, check_in_range
from cvtimg._shared.messages import warn
from cvtimg._shared.pixels import array_of, narrowed, peak
from cvtimg._shared.types import Array, Bools, Bytes, Floats, Floats32, ImageLike
from cvtimg.colors.spaces import to_space
from cvtimg.pictures.showing import limits_of_measurements

#: Luminance of linear sRGB, Rec. ITU-R BT.709.
_LUMINANCE = (0.2126, 0.7152, 0.0722)
#: Summed area of the disks of a hexagonal lattice, per area, that leaves no paper between them.
COVERING = 2 * np.pi / np.sqrt(27)
#: Steps of tables of tones.
TABLE_SIZE = 4096
#: Steps of each channel in tables of mixtures, and what ink costs there, in squared light: less than any error counts.
_GRID, _LEAST_INK = 33, 1e-4
#: Ways to come from an image to the tones of a drawing.
TONES = ("light", "true")
#: What makes a drawing of a photograph easy on the eye: the share of the pixels that are darker than what becomes
#: paper; the range of lightness with less than which tones are left as they are; and the most ink on average, and the
#: greatest power that thins it down to that.
_PAPER, _LEAST_RANGE, _MOST_INK, _STEEPEST = 0.98, 0.05, 0.38, 2.0
#: Pens of process colors.
PROCESS_COLORS = ("cyan", "magenta", "yellow", "black")


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """An image to draw."""

    samples: Array  # (H, W, C)
    limits: tuple[float, float]  # values of black and white
    known: Bools | None  # (H, W) pixels that have data, None for all

    @property
    def n_colors(self) -> int:
        """Channels without alpha, which is the last of 2 or 4."""
        n_channels = self.samples.shape[2]
        return n_channels - (n_channels in (2, 4))

    @property
    def of_shades(self) -> bool:
        """Whether black and white are those of the type."""
        return self.limits == (0, peak(self.samples.dtype))

    def shares(self) -> Floats32:
        """Return the samples as floating point, black 0 and white 1; alpha is in 0..1 as well."""
        if self.of_shades:
            return np.divide(self.samples, np.float32(self.limits[1]), dtype=np.float32)
        low, high = self.limits
        shares = (self.samples.astype(np.float64) - low) / (high - low or 1.0)
        if self.n_colors < shares.shape[2]:
            shares[..., -1] = self.samples[..., -1] / peak(self.samples.dtype)
        return shares.astype(np.float32)


def picture_of(image: Any) -> Picture:
    """Check an image to draw; wide integers that would be nearly black become 8 or 16 bits if they fit.

    Measurements, which are no shades of a screen, have black and white at the ends of the range that they fill, with a
    warning. NaN, infinity and masked values are no data.
    """
    array, known = array_of(np.ma.filled(image, 0) if np.ma.isMaskedArray(image) else image), None
    unknown = np.ma.getmask(image) | (~np.isfinite(array) if array.dtype.kind == "f" else np.False_)
    if np.any(unknown):
        array, known = np.where(unknown, 0, array), ~unknown.any(axis=tuple(range(2, array.ndim)))
    samples = narrowed(check_image("image", array))
    samples = samples.reshape(*samples.shape[:2], -1)
    picture = Picture(samples, (0.0, peak(samples.dtype)), known)
    colors = samples[..., : picture.n_colors]
    seen = colors if known is None else colors[known]
    if (limits := limits_of_measurements(seen)) is None:
        return picture
    extent = limits[1] - limits[0]
    check_in_range("the range of image", extent, bool(np.isfinite(extent)), "finite")
    warn("measurements, not shades of a screen: black and white are the ends of the range that they fill")
    return replace(picture, limits=limits)


def linear_light(image: Any) -> tuple[Floats32, Floats32 | None]:
    """Decode an image to linear light.

    Return the light, (H, W, 1) or (H, W, 3) in 0..1, and the opacity (H, W) in 0..1, None if nothing is transparent or
    without data.
    """
    picture = picture_of(image)
    samples, n_colors = picture.samples, picture.n_colors
    check_channels("image", samples.shape[2], (1, 2, 3, 4), "gray or RGB, perhaps with alpha")
    if samples.dtype.kind == "u" and picture.of_shades:
        levels = np.arange(int(peak(samples.dtype)) + 1, dtype=samples.dtype)
        light = to_space(levels[:, np.newaxis], "linear").astype(np.float32)[samples[:, :, :n_colors], 0]
    else:  # by rows, for the sake of memory
        rows = (replace(picture, samples=row).shares()[..., :n_colors].clip(0, 1) for row in samples[:, np.newaxis])
        light = np.stack([to_space(row[0], "linear").astype(np.float32) for row in rows])
    opaque = samples[:, :, -1] / peak(samples.dtype) if n_colors < samples.shape[2] else None
    opacity = None if opaque is None else opaque.astype(np.float32)
    if picture.known is not None:
        known = picture.known.astype(np.float32)
        opacity = known if opacity is None else opacity * known
    return light, opacity


def luminance(light: Floats32) -> Floats32:
    """Add linear light up to luminance, (H, W)."""
    if light.shape[2] == 1:
        return np.ascontiguousarray(light[:, :, 0])
    return np.minimum(np.einsum("hwc,c->hw", light, np.array(_LUMINANCE, np.float32)), 1)


def light_tones(
    luminance: Floats32, opacity: Floats32 | None, *, invert: bool = False, colors: bool = False
) -> Floats32:
    """Choose white and ink for a light drawing; return the luminance (H, W) that it has.

    Photographs are dark: half of their light is a third of their lightness, which eyes see. So coverage follows
    lightness, from the lightest parts, which are paper, to the darkest; and where it comes to more than a third of the
    paper, it is raised to a power, which lightens shades in between and leaves white and black as they are. Inverted,
    light is the ink; of colors, only white is paper.
    """
    counts = slice(None) if opacity is None else opacity > 0.5
    # CIE lightness, of which the linear part near black would change next to nothing.
    lightness = np.cbrt(luminance)
    seen = lightness[counts]
    if not seen.size:
        return luminance
    dark, light = seen.min(), 1.0 if colors else float(np.quantile(seen, _PAPER))
    if light - dark < _LEAST_RANGE:
        return luminance
    ink = np.clip((lightness - dark) / (light - dark), 0, 1, dtype=np.float32)
    if not invert:
        np.subtract(1, ink, out=ink)
    from scipy.optimize import brentq

    shares, edges = np.histogram(ink[counts], TABLE_SIZE, (0, 1))

    def excess(power: float) -> float:
        return float(np.average(edges[1:] ** power, weights=shares)) - _MOST_INK

    if excess(1) > 0:
        ink **= np.float32(_STEEPEST if excess(_STEEPEST) > 0 else brentq(excess, 1, _STEEPEST))
    return ink if invert else np.subtract(1, ink, out=ink)


def ink_coverage(image: ImageLike, *, white_cutoff: float = 0.0, invert: bool = False, tones: str = "true") -> Floats32:
    """Compute the share of each pixel that black ink must cover, (H, W) float32 in 0..1.

    Parameters are as in `cvtimg.stipple`.

    Examples
    --------
    Middle gray, 188 of 255, has half the light of white.

    >>> ink_coverage(np.array([[255, 188, 0]], np.uint8)).round(2).tolist()
    [[0.0, 0.5, 1.0]]
    """
    light, opacity = linear_light(image)
    ink = luminance(light)
    if tones == "light":
        ink = light_tones(ink, opacity, invert=invert)
    if not invert:
        np.subtract(1, ink, out=ink)
    return as_coverage(ink, opacity, white_cutoff)


def as_coverage(ink: Floats32, opacity: Floats32 | None, white_cutoff: float) -> Floats32:
    """Leave paper free where the image is transparent, and where there is next to no ink; overwrites `ink`."""
    if opacity is not None:
        ink *= opacity
    # Rounding leaves a little of the white of three channels.
    ink[ink <= max(white_cutoff, 1e-6)] = 0
    return ink


def disk_area(coverage: Floats32) -> Floats32:
    """Compute the summed area of disks, per area, that covers this share of the paper where they overlap.

    Dots of a centroidal Voronoi tessellation lie nearly on a hexagonal lattice, whose disks overlap beyond a coverage
    of 0.907; at 1 their areas add up to 1.209.
    """
    areas, table = coverage.copy(), np.linspace(0, COVERING, TABLE_SIZE)
    radius = np.maximum(np.sqrt(table * np.sqrt(3) / (2 * np.pi)), 0.5)  # in distances of the lattice, if they overlap
    lens = 2 * radius**2 * np.arccos(0.5 / radius) - 0.5 * np.sqrt(4 * radius**2 - 1)
    covered = np.minimum(table - lens * (3 * 2 / np.sqrt(3)), 1)  # three lenses a disk
    overlaps = coverage > covered[covered == table][-1]
    areas[overlaps] = np.interp(coverage[overlaps], covered, table)
    return areas


def process_coverages(image: ImageLike, white_cutoff: float, max_ink: float, tones: str = "true") -> list[Floats32]:
    """Compute the coverage of cyan, magenta, yellow and black, in this order, for tones scaled by `max_ink`.

    Black takes all that the three have in common. Ink c and black k leave 1 - c - k + q c k of the light of a channel:
    q is 1 for dots that fall on each other by chance (Demichel), and 0 for dots that never do. Dots here keep apart as
    far as there is room, which black takes: q is k, which drawings bear out.
    """
    light, opacity = _light_to_draw(image, max_ink, tones)
    lightest = light.max(axis=2)
    black = 1 - lightest
    share = np.maximum(1 - black * black, np.float32(1e-6))
    inks = [(lightest - light[:, :, channel]) / share for channel in range(3)]
    return [as_coverage(ink, opacity, white_cutoff * max_ink) for ink in (*inks, black)]


def pen_coverages(
    image: ImageLike, pens: Bytes, white_cutoff: float, max_ink: float, tones: str = "true"
) -> list[Floats32]:
    """Compute the coverage of pens of any colors, (L, 3), on white paper, for tones scaled by `max_ink`.

    Dots keep apart, so that the light of a pixel is the mean of the paper and the pens by what they cover. Of all
    mixtures the one is taken whose light is nearest, and of several the one with the least ink.
    """
    from scipy.ndimage import map_coordinates

    light, opacity = _light_to_draw(image, max_ink, tones)
    places = np.sqrt(light.transpose(2, 0, 1)) * (_GRID - 1)
    axis = (np.arange(_GRID) / (_GRID - 1)) ** 2
    colors = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    inks = to_space(pens, "linear").astype(np.float64)
    table = _mixtures(colors, inks).reshape(_GRID, _GRID, _GRID, -1).astype(np.float32)
    shares = [map_coordinates(table[..., pen], places, order=1, mode="nearest") for pen in range(len(pens))]
    return [as_coverage(ink, opacity, white_cutoff * max_ink) for ink in shares]


def _mixtures(colors: Floats, inks: Floats) -> Floats:
    """(N, L) shares of inks (L, 3) in the mixtures with white paper that are nearest to colors (N, 3), all linear."""
    seen = np.stack([2 * np.array(_LUMINANCE), np.array([0.5, -0.5, 0.0]), np.array([-0.25, -0.25, 0.5])])
    ends, wanted = np.concatenate([np.ones((1, 3)), inks]) @ seen.T, colors @ seen.T
    shares, least = np.zeros((len(colors), len(ends))), np.full(len(colors), np.inf)
    # The nearest point of a convex hull lies in a simplex of its corners.
    for chosen in chain.from_iterable(combinations(range(len(ends)), n) for n in range(1, 5)):
        first, *others = chosen
        edges = ends[others] - ends[first]
        if np.linalg.matrix_rank(edges) < len(others):
            continue
        parts = (wanted - ends[first]) @ np.linalg.pinv(edges)
        weights = np.column_stack([1 - parts.sum(axis=1), parts])
        off = np.square(weights @ ends[list(chosen)] - wanted).sum(axis=1)
        ink = 1 - (weights[:, 0] if first == 0 else 0)
        score = np.where(weights.min(axis=1) >= -1e-9, off + _LEAST_INK * ink, np.inf)
        better = score < least
        least[better], shares[better] = score[better], 0
        shares[np.ix_(np.flatnonzero(better), np.array(chosen))] = weights[better]
    return np.maximum(shares[:, 1:], 0)


def _light_to_draw(image: ImageLike, max_ink: float, tones: str) -> tuple[Floats32, Floats32 | None]:
    """Return the light (H, W, 3) that a drawing in color is to have, and the opacity."""
    light, opacity = linear_light(image)
    if tones == "light":
        before = luminance(light)
        after = light_tones(before, opacity, colors=True)
        apart = light - before[:, :, np.newaxis]
        # As colorful as before, as far as no channel is lighter than paper.
        least = np.float32(1e-6)
        most = (1 - after) / np.maximum(apart.max(axis=2), least)
        apart *= np.minimum(after / np.maximum(before, least), most)[:, :, np.newaxis]
        light = np.clip(after[:, :, np.newaxis] + apart, 0, 1)
    light = np.repeat(light, 3, axis=2) if light.shape[2] == 1 else light
    return 1 - np.float32(max_ink) * (1 - light), opacity

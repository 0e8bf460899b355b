"""Palettes that represent samples of colors with the least error."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.budgets import MAX_COLORS
from cvtimg._shared.checks import check_at_least, check_colors, check_count, check_keywords, refuse
from cvtimg._shared.choices import EffortName, InitName, MethodName, SpaceName
from cvtimg._shared.iteration import Callback, Stopping, iterate
from cvtimg._shared.pixels import peak
from cvtimg._shared.records import Claims, ReadOnly
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg._shared.threads import pairwise_sum
from cvtimg._shared.types import Array, Bytes, Floats, Indices
from cvtimg.colors.counting import add_samples, coarser, count_picture
from cvtimg.colors.places import CLEAR, OPAQUE, PARTLY, agree, from_places, kinds_of, middle, to_places, with_alpha
from cvtimg.colors.samples import ColorSamples, color_samples
from cvtimg.elbow.curves import EnergyCurve
from cvtimg.engine.methods import Method
from cvtimg.engine.tessellation import Tessellation, tessellate
from cvtimg.files.whole import StrPath
from cvtimg.quantization.hardware import REST, check_color_bits, hardware_colors, rounded, suited
from cvtimg.quantization.remapping import map_samples, nearest_of_kind, tones_of

#: Colors shown in a notebook.
_SHOWN = 256
#: Side of the cubes of Oklab in which colors count together, the power of their number that counts, how much lightness
#: counts, and the chroma that is added before colors are compared, so that grays count, too.
_CUBE, _POWER, _LIGHTNESS, _COLORLESS = 0.05, 0.3, 0.6, 0.15
#: Distance in Oklab from which a main color is lacking.
_LACKING = 0.12
#: Places of which colors of a palette are chosen; the error of 4096 is that of all within a few percent.
_MOST_PLACES = 4096
#: Moves to the means of cells would undo the effect of their weights.
_AT_ONCE = Stopping(tolerance=1e-4, max_iterations=0)


class EngineOptions(TypedDict, total=False):
    """Options of `tessellate` that functions which find palettes accept."""

    method: MethodName | Method | None
    init: InitName | ArrayLike
    effort: EffortName
    volume_power: float
    rng: int | np.random.Generator
    callback: Callback | None


@dataclass(frozen=True, slots=True, eq=False)
class Palette(ReadOnly):
    """The colors that represent an image.

    Attributes
    ----------
    colors : (K, C) array of the type of the samples
        Distinct colors in the units of the samples: transparent ones first, then from dark to bright.
    tessellation : Tessellation or None
        The tessellation that they were rounded from, in the coordinates of the color space; None if the samples have
        so few colors that the palette holds all of them.
    alpha : bool
        Whether the last channel is alpha.
    tones : (K,) array of the type of the samples, or None
        The lightness of the pixels that each color stands for, if it is not the color that counts.
    """

    colors: Array
    tessellation: Tessellation | None
    alpha: bool = False
    tones: Array | None = None

    def _claims(self) -> Claims:
        if self.tessellation is not None:  # given ones may be equal
            yield "colors are distinct", len(np.unique(self.colors, axis=0)) == len(self.colors)

    def __repr__(self) -> str:
        """Tell the number of colors, and the first of them, in one line."""
        shown = " ".join(_name(color, self.colors.dtype, self.alpha) for color in self.colors[:8])
        return f"Palette({len(self.colors)} colors: {shown}{' ...' if len(self.colors) > 8 else ''})"

    def _repr_html_(self) -> str:
        """Show the colors as swatches, for notebooks."""
        names = [_name(color, self.colors.dtype, self.alpha) for color in self.colors[:_SHOWN]]
        box = "display:inline-block;width:1.5em;height:1.5em"
        swatches = "".join(f"<span title='{name}' style='{box};background:{name}'></span>" for name in names)
        more = f" ... {len(self.colors)} colors" if len(self.colors) > _SHOWN else ""
        return f"<div style='line-height:0'>{swatches}</div>{more}"

    def save(self, path: StrPath, *, overwrite: bool = False) -> None:
        """Write a palette file, as `cvtimg.write_palette` does; the suffix selects the format."""
        from cvtimg.palettes.files import write_palette

        write_palette(path, self.colors, overwrite=overwrite)


def find_palette(
    samples: ColorSamples | ArrayLike,
    n_colors: int,
    *,
    space: SpaceName = "rgb",
    locked: ArrayLike | None = None,
    color_bits: int | Sequence[int] | None = None,
    **engine: Unpack[EngineOptions],
) -> Palette:
    """Find the palette that represents samples with the least error: of one image, or of several merged ones.

    Parameters
    ----------
    samples : ColorSamples, or (H, W) or (H, W, C) array
        An image, its samples from `color_samples`, or from `merge_samples` for one palette of several images or frames.
    n_colors : int
        Size of the palette, in 1..65536. This includes the locked colors and, if a sample is fully transparent, the
        transparent color.
    space : {"rgb", "linear", "lab", "oklab"}
        Color space in which distances are measured and means taken.
    locked : (L, C) array, optional
        Colors that the palette must contain, in the units of the samples.
    color_bits : int or three ints, optional
        Bits per channel of the hardware that shows the colors, in 1..8, such as 5 or (5, 6, 5): the palette has only
        colors that it can show. For images of unsigned integers. See Notes.
    method, init, effort, volume_power, rng, callback
        As in `tessellate`. Initial colors, if given, are in the coordinates of the space. An exception that
        `callback` raises ends the search.

    Returns
    -------
    Palette

    Notes
    -----
    A channel of few bits becomes one of the image by repeating its bits, as emulators do: of 5 bits, abcde becomes
    abcdeabc, so that 31 becomes 255. Rounding comes before the last steps of the search, not after it: colors that
    become equal are merged, those set free are used where the error is largest, and the rest move to the hardware
    colors nearest to the means of their cells. Alpha is not rounded.

    Examples
    --------
    >>> from cvtimg import find_palette
    >>> from cvtimg.colors import color_samples
    >>> image = np.array([[10, 12, 200], [11, 202, 201]], dtype=np.uint8)
    >>> find_palette(color_samples(image), 2).colors.ravel().tolist()
    [11, 201]
    """
    check_keywords(find_palette, engine, EngineOptions.__annotations__)
    if not isinstance(samples, ColorSamples):
        samples = color_samples(samples)
    if color_bits is not None:
        bits = check_color_bits(color_bits)
        samples, fixed, least = fixed_colors(suited(samples, bits), locked)
        n_colors = check_room(n_colors, least)
        nearest = _in_order(np.concatenate([fixed, rounded(samples.colors, bits, space)]), samples.alpha)
        if len(nearest) <= n_colors:
            return Palette(nearest, None, samples.alpha)
        palette = find_palette(samples, n_colors, space=space, locked=locked, **engine)
        colors = hardware_colors(samples, palette.colors, fixed, n_colors, space, bits)
        return Palette(_in_order(colors, samples.alpha), palette.tessellation, samples.alpha)
    samples, fixed, least = fixed_colors(samples, locked)
    n_colors = check_room(n_colors, least)
    kinds = kinds_of(samples.colors, samples.alpha)
    samples = _visible(samples, kinds)
    if samples.alpha and samples.n_colors and (kinds[kinds != CLEAR] == OPAQUE).all():
        # Alpha plays no part: transparent colors are locked, and all others are opaque.
        opaque = kinds_of(fixed, True) == OPAQUE
        seen = replace(samples, rows=np.ascontiguousarray(samples.colors[:, :-1]), alpha=False)
        given = fixed[opaque, :-1] if opaque.any() else None
        palette = find_palette(seen, n_colors - int(np.count_nonzero(~opaque)), space=space, locked=given, **engine)
        colors = np.concatenate([fixed[~opaque], with_alpha(palette.colors)])
        return Palette(_in_order(colors, True), palette.tessellation, True)
    if samples.n_colors <= n_colors:
        all_colors = _in_order(np.concatenate([fixed, samples.colors]), samples.alpha)
        if len(all_colors) <= n_colors:
            return Palette(all_colors, None, samples.alpha)
    if len(fixed) == n_colors:
        return Palette(_in_order(fixed, samples.alpha), None, samples.alpha)
    colors, density, alpha = samples.colors, samples.density, samples.alpha
    if samples.n_colors < n_colors:  # the engine needs as many samples as generators, locked ones included
        colors, density = np.concatenate([colors, fixed]), np.append(density, np.zeros(len(fixed)))
    places, in_place = to_places(colors, space, alpha), to_places(fixed, space, alpha)
    tessellation = tessellate(replace(samples, rows=places, density=density), n_colors, locked=in_place, **engine)
    generators = tessellation.generators
    if alpha:
        end = middle(fixed.shape[1] - 1, space, fixed.dtype)[1]
        rest = _AT_ONCE if engine.get("volume_power") else REST
        ends = kinds_of(colors, True), kinds_of(fixed, True)
        generators = _keep_opaque(places, density, ends, tessellation, end, rest)
    colors = from_places(generators, space, fixed.dtype, alpha)
    colors[: len(fixed)] = fixed
    return Palette(_in_order(colors, alpha), tessellation, alpha)


def main_palette(
    image: ColorSamples | ArrayLike,
    n_colors: int = 6,
    *,
    locked: ArrayLike | None = None,
    **engine: Unpack[EngineOptions],
) -> Palette:
    """Find the few colors that stand out in an image, as a designer would pick them.

    Small vivid parts count, which the palette of least error leaves out: pixels of similar colors, in the same cube of
    Oklab, count together as the power 0.3 of their number, and hue counts more than lightness. Each cell is shown by a
    color of the image, from a cube that has many pixels or much color, and not by its mean, which would be dull.

    Parameters
    ----------
    image, n_colors, locked, method, init, effort, volume_power, rng, callback
        As in `find_palette`.

    Returns
    -------
    Palette
        The locked colors, and colors of the image.

    Examples
    --------
    A red spot of 0.3 % of the pixels, in front of many tones of green:

    >>> from cvtimg import find_palette
    >>> from cvtimg.quantization import main_palette
    >>> image = np.zeros((50, 100, 3), np.uint8)
    >>> image[:, :, 1] = np.linspace(100, 220, 100)
    >>> image[:4, :4] = 220, 20, 30
    >>> [bool((colors[:, 0] > 200).any()) for colors in (find_palette(image, 3).colors, main_palette(image, 3).colors)]
    [False, True]
    """
    samples = image if isinstance(image, ColorSamples) else color_samples(image)
    samples, fixed, least = fixed_colors(samples, locked)
    n_colors = check_room(n_colors, least)
    samples = _visible(samples, kinds_of(samples.colors, samples.alpha))
    given, alpha = fixed[kinds_of(fixed, samples.alpha) != CLEAR], samples.alpha
    n_cells = n_colors - len(fixed) + len(given)
    cubes, means, masses = _in_cubes(to_places(samples.colors, "oklab", alpha), samples.density, _CUBE)
    if samples.n_colors <= n_cells or n_cells == len(given) or len(means) < n_cells:
        return find_palette(samples, n_colors, space="oklab", locked=fixed if len(fixed) else None, **engine)
    scales = np.array([_LIGHTNESS, *[1] * (means.shape[1] - 1)])
    in_place = scales * to_places(given, "oklab", alpha)
    labels = tessellate(means * scales, n_cells, density=masses**_POWER, locked=in_place, **engine).labels
    chroma = np.linalg.norm(means[:, 1:3], axis=1) if means.shape[1] > 2 else np.zeros(len(means))
    standing_out = np.sqrt(masses) * (_COLORLESS + chroma)
    shown = [np.argmax(np.where(labels == cell, standing_out, -1)) for cell in range(len(given), n_cells)]
    distances = ((to_places(samples.colors, "oklab", alpha) - means[cubes]) ** 2).sum(axis=1)
    nearest = [np.argmin(np.where(cubes == cube, distances, np.inf)) for cube in shown]
    return Palette(_in_order(np.concatenate([fixed, samples.colors[nearest]]), alpha), None, alpha)


def keeping_main_colors(samples: ColorSamples, curve: EnergyCurve, n_colors: int, space: SpaceName) -> int:
    """Return the least number of colors, from `n_colors` on, of a curve that lacks no main color of an image."""
    dtype = samples.colors.dtype
    if dtype not in (np.uint8, np.uint16) or samples.colors.shape[1] - samples.alpha != 3:
        return n_colors
    from scipy.spatial import cKDTree

    main = to_places(main_palette(samples).colors, "oklab", samples.alpha)
    for number in range(n_colors, curve.n_max):
        colors = from_places(curve.generators[number - 1], space, dtype, samples.alpha)
        if cKDTree(to_places(colors, "oklab", samples.alpha)).query(main)[0].max() <= _LACKING:
            return number
    return curve.n_max


def best_of(samples: ColorSamples, palette: ArrayLike, n_colors: int, space: SpaceName) -> Palette:
    """Choose the colors of a palette that represent samples with the least error, in the order of the palette.

    They are added one by one, and then exchanged as long as that lowers the error (M. B. Teitz, P. Bart, Operations
    Research 16 (1968) 955-961).
    """
    from scipy.spatial.distance import cdist

    given = check_colors("palette", palette, samples.colors.dtype)
    n_colors = check_count("n_colors", n_colors, len(given), "the number of colors of the palette")
    samples, colors = agree(samples, given)
    if n_colors == len(given):
        return Palette(colors, None, samples.alpha)
    if len(given) > _MOST_PLACES:
        raise ValueError(f"palette must have at most {_MOST_PLACES} colors to choose from, not {len(given)}")
    few = coarser(samples.some(samples.density > 0), _MOST_PLACES)
    places, ends = (to_places(some, space, samples.alpha).astype(float) for some in (few.colors, colors))
    errors = few.density[:, None] * cdist(places, ends, "sqeuclidean")
    chosen: list[int] = []
    least = np.full(few.n_colors, np.inf)
    for _ in range(n_colors):
        sums = np.minimum(least[:, None], errors).sum(axis=0)
        sums[chosen] = np.inf
        chosen.append(int(sums.argmin()))
        least = np.minimum(least, errors[:, chosen[-1]])
    left_out = 0
    while left_out < n_colors:  # none of the last exchanges helped
        others = errors[:, chosen[1:]].min(axis=1, initial=np.inf)
        sums = np.minimum(others[:, None], errors).sum(axis=0)
        sums[chosen[1:]] = np.inf
        best = int(sums.argmin())
        left_out = left_out + 1 if sums[best] >= sums[chosen[0]] else 0
        chosen = [*chosen[1:], best if not left_out else chosen[0]]
    return Palette(colors[sorted(chosen)], None, samples.alpha)


def ramp_of(samples: ColorSamples, palette: ArrayLike) -> Palette:
    """Let the colors of a palette, from dark to light, stand for as many tones that represent the samples best."""
    samples, colors = agree(samples, check_colors("palette", palette, samples.colors.dtype))
    alpha, visible = samples.alpha, kinds_of(samples.colors, samples.alpha) != CLEAR
    if not visible.all() and CLEAR not in kinds_of(colors, alpha):
        colors = np.concatenate([np.zeros_like(colors[:1]), colors])
    if map_samples(samples, colors, "rgb", None, 1.0).energy == 0:
        return Palette(colors, None, alpha)
    ramp = np.flatnonzero(kinds_of(colors, alpha) != CLEAR)
    ramp = ramp[np.argsort(tones_of(colors[ramp], alpha), kind="stable")]
    grays = color_samples(tones_of(samples.colors[visible], alpha)[np.newaxis])
    levels = find_palette(grays.weighted(samples.density[visible][np.newaxis]), len(ramp)).colors[:, 0]
    tones = np.zeros(len(colors))  # images of fewer tones use the ends of the ramp
    tones[ramp] = np.interp(np.linspace(0, len(levels) - 1, len(ramp)), np.arange(len(levels)), levels)
    return Palette(colors, None, alpha, tones.astype(colors.dtype))


def _in_cubes(places: Floats, density: Array, size: float) -> tuple[Indices, Floats, Floats]:
    """Return the cube of each place, and the means and masses of cubes."""
    steps = np.floor(places / size).astype(np.int64)
    steps -= steps.min(axis=0)
    numbers = np.ravel_multi_index(tuple(steps.T), tuple(steps.max(axis=0) + 1))
    cubes = np.unique(numbers, return_inverse=True)[1].reshape(-1)
    masses = sum_by_label(cubes, density)
    return cubes, per_mass(sum_by_label(cubes, places, weights=density), masses), masses


def shared_palette(
    images: Iterable[StrPath | ArrayLike],
    n_colors: int,
    *,
    space: SpaceName = "rgb",
    locked: ArrayLike | None = None,
    **engine: Unpack[EngineOptions],
) -> Palette:
    """Find the palette that represents all pixels of many images with the least error.

    The densities of the images are added exactly: the result is that of one image with all their pixels, bit for bit,
    in any order. `map_to_palette` then maps each image to the palette.

    Parameters
    ----------
    images : iterable of paths or (H, W) or (H, W, C) arrays
        Read one after the other: memory holds only the distinct colors of all, at most 2^24 of 8-bit RGB. Gray becomes
        RGB if there is color, opaque images get alpha if some have transparency, and 8 bits become 16 if some have
        16; floating point, and bands that are not colors, cannot be combined with other images.
    n_colors, space, locked, method, init, effort, volume_power, rng, callback
        As in `find_palette`.

    Returns
    -------
    Palette

    Examples
    --------
    >>> from cvtimg.quantization import shared_palette
    >>> shared_palette([np.array([[10, 12]], np.uint8), np.array([[200, 202]], np.uint8)], 2).colors.tolist()
    [[11], [201]]
    """
    check_keywords(shared_palette, engine, EngineOptions.__annotations__)
    samples = pairwise_sum((count_picture(image) for image in images), add_samples)
    if samples is None:
        refuse("images", [], "at least one")
    return find_palette(samples, n_colors, space=space, locked=locked, **engine)


class Merged(NamedTuple):
    """Energies of a palette whose neighbors are merged, two at a time, and starts for searches of so few colors."""

    energies: Sequence[float]
    starts: Sequence[Floats]
    n_pixels: float


def merged_colors(palette: Palette, n_colors: int, fixed: Array, samples: ColorSamples | None = None) -> Merged:
    """Merge where the energy rises least (J. H. Ward, J. Am. Stat. Assoc. 58 (1963) 236-244); `fixed` ones stay.

    A palette that has all colors is merged by the samples that it is of.
    """
    tessellation = palette.tessellation
    if tessellation is None:
        if samples is None:
            return Merged([0.0], (), 1.0)
        samples, fixed = agree(samples, fixed)
        kinds = kinds_of(samples.colors, samples.alpha)
        free = (kinds != CLEAR) & ~(samples.colors[:, None] == fixed).all(axis=2).any(axis=1)
        opaque = samples.alpha and not (kinds == PARTLY).any()  # whose alpha is no coordinate
        rows = np.ascontiguousarray(samples.colors[free, : samples.colors.shape[1] - opaque])
        places, masses = to_places(rows, "oklab", samples.alpha and not opaque), samples.density[free].astype(float)
        energy, n_pixels = 0.0, samples.density.sum()
    else:
        n_fixed = max(0, len(fixed) + len(tessellation.generators) - n_colors)  # clear ones are no generators
        places, masses = tessellation.generators[n_fixed:].copy(), tessellation.masses[n_fixed:].copy()
        energy, n_pixels = tessellation.energy, tessellation.masses.sum()
    energies, starts, left = [energy], [places.copy()], np.ones(len(places), np.bool_)

    def rises(some: Indices) -> Floats:
        shares = masses[some, None] * masses / np.maximum(masses[some, None] + masses, np.finfo(float).tiny)
        costs = shares * ((places[some, None] - places) ** 2).sum(axis=2)
        costs[:, ~left] = costs[np.arange(len(some)), some] = np.inf
        return costs

    costs = rises(np.arange(len(places))) if len(places) else places
    while len(starts) < len(places):
        pair = divmod(int(costs.argmin()), len(places))
        (kept, other), both = pair, list(pair)
        energies.append(energies[-1] + costs[pair])
        places[kept] = np.average(places[both], axis=0, weights=np.maximum(masses[both], np.finfo(float).tiny))
        masses[kept] += masses[other]
        left[other] = False
        costs[other] = costs[:, other] = np.inf
        costs[kept] = costs[:, kept] = rises(np.array([kept]))
        starts.append(places[left])
    starts = starts if places.shape[1] > 1 else []  # grays are best searched as a whole
    return Merged(energies, starts, float(n_pixels))


def fixed_colors(samples: ColorSamples, locked: ArrayLike | None) -> tuple[ColorSamples, Array, int]:
    """Return samples, the colors that must be in their palette, of the same channels, and its least size."""
    fixed = samples.colors[:0] if locked is None else check_colors("locked", locked, samples.colors.dtype)
    samples, fixed = agree(samples, fixed)
    # np.unique would import numpy.ma.
    kinds = (kinds_of(colors, samples.alpha) for colors in (samples.colors, fixed))
    needed, there = (set(np.flatnonzero(np.bincount(some)).tolist()) for some in kinds)
    if CLEAR in needed - there:
        fixed = np.concatenate([fixed, np.zeros_like(samples.colors[:1])])
    return samples, fixed, max(1, len(fixed) + (OPAQUE in needed - there))


def check_room(n_colors: int, least: int) -> int:
    """Return the size of a palette; refuse one beyond the largest, or below the number of colors that must be in it."""
    check_count("n_colors", n_colors, MAX_COLORS, "the size of the largest palette")
    return check_at_least("n_colors", n_colors, least, "for locked colors, opaque and transparent pixels")


def _visible(samples: ColorSamples, kinds: Bytes) -> ColorSamples:
    """Leave out colors that are invisible or have no weight; opaque ones without weight still need one color."""
    opaque, density = kinds == OPAQUE, samples.density
    if opaque.any() and not density[opaque].any():
        density = np.where(opaque, 1e-12 * density.max(), density)
        samples = replace(samples, density=density)
    chosen = (density > 0) & (kinds != CLEAR)
    return samples if chosen.all() else samples.some(chosen)


def _keep_opaque(
    places: Floats, density: Floats, kinds: tuple[Bytes, Bytes], tessellation: Tessellation, end: float, rest: Stopping
) -> Floats:
    """Make the generators of mostly opaque cells opaque, and move all generators until they converge."""
    # `kinds` are those of the places and of the locked generators, which come first. Opaque places belong to the
    # nearest opaque generator, whose last coordinate is `end`. No step raises the energy.
    generators, labels = tessellation.generators.copy(), tessellation.labels
    n_generators, n_locked = len(generators), len(kinds[1])
    free = np.arange(n_generators) >= n_locked
    masses = np.bincount(labels, density * (kinds[0] == OPAQUE), n_generators)
    opaque = free & (masses > 0) & (masses >= tessellation.masses / 2)
    if OPAQUE in kinds[0] and not (opaque.any() or OPAQUE in kinds[1]):
        opaque[n_locked + np.argmax(masses[n_locked:])] = True
    ends = np.where(opaque, OPAQUE, PARTLY).astype(np.uint8)
    ends[:n_locked] = kinds[1]
    generators[opaque, -1] = end
    labels = nearest_of_kind(places, kinds[0], generators, ends)

    def energy() -> float:
        return float(np.einsum("n,nd->", density, (places - generators[labels]) ** 2))

    def step() -> float:
        nonlocal labels
        masses = sum_by_label(labels, density, n_generators)
        moved = free & (masses > 0)
        generators[moved] = per_mass(sum_by_label(labels, places, n_generators, density), masses)[moved]
        generators[opaque, -1] = end
        labels = nearest_of_kind(places, kinds[0], generators, ends)
        return energy()

    iterate(energy(), step, rest)
    return generators


def _name(color: Array, dtype: np.dtype[np.generic], alpha: bool) -> str:
    """Return "#rrggbb", with alpha if there is any."""
    eight = [round(min(max(float(value) / peak(dtype), 0), 1) * 255) for value in color]
    if len(eight) - alpha not in (1, 3) or (dtype.kind in "iu" and dtype.itemsize > 2):
        return str(tuple(color.tolist()))
    return "#" + bytes(eight[:1] * 3 + eight[1:] if len(eight) < 3 else eight).hex()


def _in_order(colors: Array, alpha: bool) -> Array:
    """Sort distinct colors: transparent ones first, as files have it, then by the sum of their channels."""
    totals = colors.sum(axis=1, dtype=np.float64)
    ordered = colors[np.lexsort((*colors.T[::-1], totals, kinds_of(colors, alpha) == OPAQUE))]
    is_new = np.append(True, (ordered[1:] != ordered[:-1]).any(axis=1))
    return ordered[is_new]

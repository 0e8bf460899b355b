"""Colors that hardware with few bits per channel can show, and palettes of them.

A value of n bits becomes one of an image by repeating its bits, as emulators show it: of 5 bits, abcde is abcdeabc.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np

from cvtimg._shared.checks import check_channels, check_in_range, refuse_type
from cvtimg._shared.choices import SpaceName
from cvtimg._shared.iteration import Stopping, iterate
from cvtimg._shared.sums import per_mass, sum_by_label
from cvtimg._shared.types import Array, Floats, Ints, Ints64
from cvtimg.colors.places import from_places, kinds_of, to_places, widen_samples
from cvtimg.colors.samples import ColorSamples, color_samples
from cvtimg.colors.spaces import to_space
from cvtimg.quantization.remapping import nearest_of_kind

_Bits = tuple[int, int, int]
REST = Stopping(tolerance=1e-4, max_iterations=100)


def check_color_bits(color_bits: int | Sequence[int]) -> _Bits:
    """Return the bits of red, green and blue; one number stands for all."""
    bits = tuple(color_bits) if isinstance(color_bits, Sequence) else (color_bits,) * 3
    are_bits = all(isinstance(n, (int, np.integer)) and 1 <= n <= 8 for n in bits)
    check_in_range("color_bits", color_bits, len(bits) == 3 and are_bits, "a number of bits in 1..8, or three of them")
    return int(bits[0]), int(bits[1]), int(bits[2])


def suited(samples: ColorSamples, bits: _Bits) -> ColorSamples:
    """Return samples that can be rounded: gray becomes RGB if the channels of RGB are rounded differently."""
    dtype, n_seen = samples.colors.dtype, samples.colors.shape[1] - samples.alpha
    if dtype.kind != "u":
        refuse_type("color_bits with an image", dtype, "unsigned integers, such as 8 bits")
    check_channels("an image", n_seen, (1, 3), "with color_bits")
    return widen_samples(samples, 3, samples.alpha) if n_seen == 1 and len(set(bits)) > 1 else samples


def rounded(colors: Array, bits: _Bits, space: SpaceName = "rgb") -> Array:
    """Return, for each of (N, C) colors, the nearest in a space of the hardware colors around it; alpha stays."""
    n_seen = colors.shape[1] - (colors.shape[1] in (2, 4))
    levels = [_levels(n_bits, colors.dtype) for n_bits in bits[:n_seen]]
    channels = list(zip(levels, colors.T, strict=False))
    below = [some[np.searchsorted(some, channel, side="right") - 1] for some, channel in channels]
    above = [some[np.searchsorted(some, channel)] for some, channel in channels]
    places = to_space(np.ascontiguousarray(colors[:, :n_seen]), space).astype(np.float64)
    result, least = colors.copy(), np.full(len(colors), np.inf)
    for corner in product(*zip(below, above, strict=True)):
        ends = np.stack(corner, axis=1).astype(colors.dtype)
        steps = places - to_space(ends, space)
        errors = np.einsum("nd,nd->n", steps, steps)
        nearer = errors < least
        result[nearer, :n_seen], least[nearer] = ends[nearer], errors[nearer]
    return result


def _levels(n_bits: int, dtype: np.dtype[np.generic]) -> Ints64:
    """Return the values of a type that the values of n bits stand for, in order."""
    values, width = np.arange(1 << n_bits), 8 * dtype.itemsize
    n_copies = -(-width // n_bits)
    copies = np.sum([values << n_bits * place for place in range(n_copies)], axis=0)
    return np.asarray(copies >> (n_bits * n_copies - width))


def hardware_colors(
    samples: ColorSamples, start: Array, fixed: Array, n_colors: int, space: SpaceName, bits: _Bits
) -> Array:
    """Return the (K, C) hardware colors, K <= `n_colors`, that represent samples with little error.

    From a palette, `start`, this is Lloyd's method with rounded means, and no step raises the error. Colors that become
    equal are merged, and those that this sets free go where the error falls most. `fixed` colors are kept.
    """
    for color, shown in zip(fixed.tolist(), rounded(fixed, bits).tolist(), strict=True):
        check_in_range("locked", color, color == shown, f"{shown}, the nearest color of color_bits={bits}")
    fixed = _distinct(fixed)
    alpha, density, dtype = samples.alpha, samples.density, samples.colors.dtype
    places, kinds = to_places(samples.colors, space, alpha).astype(np.float64), kinds_of(samples.colors, alpha)
    near = color_samples(rounded(samples.colors, bits, space)[np.newaxis], alpha=alpha)
    cells = near.inverse.reshape(-1)

    def errors(ends: Floats, labels: Array) -> Floats:
        steps = places - ends[labels]
        return density * np.einsum("nd,nd->n", steps, steps)

    least = errors(to_places(near.colors, space, alpha).astype(np.float64), cells)

    def assigned(colors: Array) -> tuple[Array, Ints, Floats]:
        ends = to_places(colors, space, alpha).astype(np.float64)
        labels = nearest_of_kind(places, kinds, ends, kinds_of(colors, alpha))
        return colors, labels, errors(ends, labels)

    def filled(colors: Array) -> tuple[Array, Ints, Floats]:
        plain = assigned(colors)
        gains = np.bincount(cells, np.maximum(plain[2] - least, 0))
        best = np.argsort(-gains, kind="stable")[: n_colors - len(colors)]
        best = best[gains[best] > 0]
        return assigned(_distinct(colors, near.colors[best])) if len(best) else plain

    colors, labels, error = filled(_distinct(fixed, rounded(start, bits, space)))

    def step() -> float | None:
        nonlocal colors, labels, error
        masses = sum_by_label(labels, density, len(colors))
        free = np.flatnonzero(masses[len(fixed) :] > 0) + len(fixed)
        means = per_mass(sum_by_label(labels, places, len(colors), density), masses)[free]
        moved = from_places(means, space, dtype, alpha)
        if alpha:
            moved[:, -1] = colors[free, -1]
        after = filled(_distinct(fixed, rounded(moved, bits, space)))
        if after[2].sum() >= error.sum():
            return None
        colors, labels, error = after
        return float(error.sum())

    iterate(float(error.sum()), step, REST)
    return colors


def _distinct(*several: Array) -> Array:
    """Return the distinct rows of arrays, in their order."""
    rows = np.concatenate(several)
    return rows[np.sort(np.unique(rows, axis=0, return_index=True)[1])]

"""Dithering: colors of a palette mixed from pixel to pixel, so that areas keep the color of the original."""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import cvtimg.quantization._dithering as _dithering
from cvtimg._shared.checks import check_choice, check_in_range
from cvtimg._shared.choices import DitherName
from cvtimg._shared.threads import in_parts
from cvtimg._shared.types import Array, Bools, Bytes, Floats32, Ints
from cvtimg.engine.points import Frame, scale_for_float32
from cvtimg.looks.rate import COMPARISONS, usual_step

#: What rounding to float32 may change of a place on a line, per unit of the largest coordinate.
_DOUBT = 1e-5

#: Strength for palettes that were made for the image: most of the grain comes from the last tenth. Up to this strength
#: errors are limited to the usual step between entries.
STRENGTH = 0.9
#: At strength 1 errors are limited to this many times the widest gap; colors that the palette can mix stay below.
_WIDEST_GAPS = 3


class _Clean(NamedTuple):
    """What "edge-aware" takes for text, drawings and flat areas, which stay clean."""

    large: int = 25  # pixels of pieces in which the steps of a smooth transition are tiny: at most
    tiny: float = 1 / 24  # of the range of the image
    rim: int = 4  # pixels around a flat area that stay clean with it


_CLEAN = _Clean()


class Job(NamedTuple):
    """The arguments of a dithering method."""

    places: Floats32  # (M, 4) place of each color, from 0 up
    kinds: Bytes  # (M,) which entries each color may take
    inverse: Ints  # (H, W) color of each pixel
    entries: Floats32  # (K, 4) places of the palette
    finder: _dithering.Finder  # of nearest entries
    ranks: NDArray[np.uint16]  # (K,) of the entries along the main axis of the palette, usually that of brightness
    strengths: Floats32  # (n_kinds,) fraction of the error handed on
    step: float  # usual distance from an entry to the nearest other one
    longest: float  # longest error handed on
    clean: Bools  # (H, W) pixels that take no part in the diffusion of errors


def dither(
    places: Array,
    inverse: Ints,
    palette: Array,
    method: DitherName = "floyd-steinberg",
    strength: float = STRENGTH,
    kinds: ArrayLike | None = None,
    allowed: ArrayLike | None = None,
    inside: Bools | None = None,
) -> Ints:
    """Choose (H, W) entries of a palette so that the mean of an area is that of the image; the first on a tie."""
    # Colors are (M, D) places, D in 1..4, with the (H, W) index of each pixel among them, and entries (K, D) places. A
    # color of each of the (M,) kinds may take the entries `allowed`, (n_kinds, K). Errors are handed on between the
    # pixels `inside`. At strength 1 no error is lost unless the palette cannot mix a color; errors beyond three times
    # the widest gap, which only such colors reach, are shortened to that. Up to 0.9 the limit is the usual step between
    # entries.
    # Sources: R. W. Floyd, L. Steinberg, Proc. Society for Information Display 17 (1976) 75-77; R. Ulichney, Proc. SPIE
    # 1913 (1993) 332-343, doi 10.1117/12.152707 (blue noise); T. Knoll, US patent 6606166, expired (mixing of entries).
    chosen = DITHERS[check_choice("method", method, DITHERS)]
    check_in_range("strength", strength, 0 <= strength <= 1, "in 0..1")
    kinds = np.zeros(len(places), np.uint8) if kinds is None else np.asarray(kinds, np.uint8)
    allowed = np.ones((1, len(palette)), bool) if allowed is None else np.asarray(allowed, bool)
    strengths = np.where(allowed.sum(axis=1) > 1, strength, 0).astype(np.float32)
    colors, entries = _to_kernels(places, palette)
    step = longest = usual_step(entries)
    if strength > STRENGTH:
        caution = (1 - strength) / (1 - STRENGTH)
        longest = max(step, caution * step + (1 - caution) * _WIDEST_GAPS * _widest_gap(entries))
    finder, ranks = _finder(entries, allowed, doubt=_DOUBT * float(max(colors.max(), entries.max())))
    clean = np.zeros(inverse.shape, bool) if inside is None else ~inside
    return chosen(Job(colors, kinds, inverse, entries, finder, ranks, strengths, step, longest, clean))


def _edge_aware(job: Job) -> Ints:
    """Diffuse errors in smooth transitions alone; connected pixels of one color are dithered together or not at all."""
    # Most borders of such a piece are small steps in a smooth transition. In large pieces these must be tiny: others
    # are flat areas of text and drawings. What touches a flat area, as the smoothed rims of letters do, stays clean
    # with it.
    from cvtimg.labels.components import connected_pieces

    pieces = connected_pieces(job.inverse + np.int32(1))
    sizes = np.bincount(pieces.ravel())
    tiny = min(job.step, float(job.places.max()) * _CLEAN.tiny)
    limits = np.where(sizes > _CLEAN.large, tiny, job.step).astype(np.float32) ** 2
    n_borders, n_small = np.zeros((2, len(sizes)))
    neighbors = []
    for ends in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        first, second = (pieces[end] for end in ends)
        border = first != second
        squares = np.square(np.subtract(*(job.places[job.inverse[end][border]] for end in ends))).sum(axis=1)
        neighbors.append((first[border], second[border]))
        for side in neighbors[-1]:
            n_borders += np.bincount(side, minlength=len(sizes))
            n_small += np.bincount(side, squares <= limits[side], len(sizes))
    clean = (2 * n_small < n_borders) | (n_borders == 0)
    flat = clean & (sizes > _CLEAN.large)
    for _ in range(_CLEAN.rim):
        rim = np.zeros_like(flat)
        for first, second in neighbors:
            rim[first[flat[second]]] = rim[second[flat[first]]] = True
        flat |= rim & (sizes <= _CLEAN.large)
    return _diffuse(job, (clean | flat)[pieces] | job.clean)


def _diffuse(job: Job, clean: Bools) -> Ints:
    """Hand the error of pixels that are not clean on: 7/16 ahead, and 3/16, 5/16 and 1/16 to the next row."""
    labels = np.empty(job.inverse.shape, np.int32)
    _dithering.diffuse(
        job.places, job.kinds, job.inverse, job.finder, job.strengths, job.longest, clean.view(np.uint8), labels
    )  # fmt: skip
    return labels


def _ordered(job: Job, mask: Callable[[], Bytes]) -> Ints:
    """Mix entries for each color, and let a mask pick one of them: the same wherever the color is at that place."""
    turns = mask()
    mixtures = np.empty((len(job.places), int(turns.max()) + 1), np.uint16)

    def mix(start: int, stop: int) -> None:
        some = slice(start, stop)
        _dithering.mix(
            job.places[some], job.kinds[some], job.finder, job.strengths, job.longest, job.ranks, mixtures[some]
        )  # fmt: skip

    in_parts(mix, len(job.places), work=32 * mixtures.size)
    n_rows, n_columns = (-(-n // len(turns)) for n in job.inverse.shape)
    places = np.tile(turns, (n_rows, n_columns))[: job.inverse.shape[0], : job.inverse.shape[1]]
    return mixtures[job.inverse, places].astype(np.int32)


@cache
def bayer_mask() -> Bytes:
    """Return the Bayer matrix of 8 x 8 turns: smaller ones show bands, and a larger one a coarser pattern."""
    # B. E. Bayer, IEEE International Conference on Communications 1 (1973) 26.11-26.15.
    mask = np.zeros((1, 1), np.int64)
    while len(mask) < 8:
        mask = np.block([[4 * mask, 4 * mask + 2], [4 * mask + 3, 4 * mask + 1]])
    return mask.astype(np.uint8)


@cache
def blue_noise_mask() -> Bytes:
    """Return a (64, 64) mask of 16 turns without low frequencies, made by ``docs/make_blue_noise.py``."""
    mask = np.load(Path(__file__).parent / "blue_noise.npy")
    return (mask.astype(np.int64) * 16 // mask.size).astype(np.uint8)


#: The registry of methods: the values of `dither` and ``--dither``, besides "compact", which is in `looks`.
DITHERS: dict[str, Callable[[Job], Ints]] = {
    "floyd-steinberg": lambda job: _diffuse(job, job.clean),
    "edge-aware": _edge_aware,
    "blue-noise": partial(_ordered, mask=blue_noise_mask),
    "bayer": partial(_ordered, mask=bayer_mask),
}


def _widest_gap(palette: Floats32) -> float:
    """Return the longest distance from the middle between two entries to the nearest entry."""
    first, second = np.triu_indices(min(len(palette), 1 << 11), 1)
    if len(palette) > 1 << 6:
        n_pairs = max(1, min(1 << 12, COMPARISONS // len(palette)))
        first, second = np.random.default_rng(0).integers(0, len(palette), (2, n_pairs))
    if not len(first):
        return 0.0
    middles = (palette[first] + palette[second]) / 2
    return float(np.sqrt(((middles[:, None] - palette) ** 2).sum(axis=2, dtype=np.float64).min(axis=1).max()))


def _finder(palette: Floats32, allowed: Bools, *, doubt: float) -> tuple[_dithering.Finder, NDArray[np.uint16]]:
    """Return what finds nearest entries, and their (K,) ranks: by the main axis, usually that of brightness."""
    steps = palette - palette.mean(axis=0, dtype=np.float64)
    axis = np.linalg.eigh(np.einsum("kc,kd->cd", steps, steps))[1][:, -1].astype(np.float32)
    along = np.einsum("kd,d->k", palette, axis)
    order = np.argsort(along, kind="stable")
    ranks = np.empty(len(palette), np.uint16)
    ranks[order] = np.arange(len(palette))
    of_kinds = [order[some[order]] for some in allowed]
    names, ends = np.concatenate(of_kinds), np.cumsum([0, *map(len, of_kinds)], dtype=np.int32)
    return _dithering.Finder(palette, axis, along[names], names.astype(np.uint16), ends, doubt), ranks


def _to_kernels(*arrays: Array) -> list[Floats32]:
    """Bring (n, D) places to four coordinates, from 0 up, in a frame that suits float32."""
    n_dims = arrays[0].shape[1]
    if n_dims > _dithering.DIMS:
        raise ValueError(f"places must have at most {_dithering.DIMS} coordinates to be dithered, not {n_dims}")
    low = np.min([array.min(axis=0) for array in arrays], axis=0).astype(np.float64)
    size = float((np.max([array.max(axis=0) for array in arrays], axis=0) - low).max())
    frame = Frame(low, scale_for_float32(size))
    wide = ((0, 0), (0, _dithering.DIMS - n_dims))
    return [np.pad(frame.inward(array), wide).astype(np.float32) for array in arrays]

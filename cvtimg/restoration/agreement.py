"""Which versions to leave out at a pixel: what was added to one of them, or what hides an object in it.

Versions of one picture differ by noise alone, except where something was added to one of them (a cosmic ray, dust, a
passer-by) or painted over in it. There a version departs from what it is compared with by more than its noise: at a
single pixel by far, or on the mean of a small window by a little. Everything is measured against the noise, so nothing
is left out where there is no evidence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg.restoration.versions import Floats, Versions

_Bools = NDArray[np.bool_]

#: Standard deviations of a Gaussian that noise exceeds at about one of 100,000 pixels.
_RARE = 4.3
#: Sides of the windows on whose mean a version may depart; 1 is the pixel itself.
_SIDES = (1, 3, 5)
#: Windows are judged if they hold at least this share of known pixels.
_FULL_ENOUGH = 0.3
#: A pixel departs if more than this share of the known pixels of the 3 x 3 about it do.
_MOST = 0.6
#: Side of the windows of which no more than this share may depart from the first version, where motion is left out.
_AROUND, _SOME = 7, 0.2
#: Moved versions may differ by this part of the range of the pixels about.
_SLACK = 0.5
#: Pixels that are compared at once.
_CHUNK = 1 << 18
#: Boxes per channel in which colors are counted to find the background.
_BOXES = 16
#: Part of the standard deviation of noise that remains about the median of three or more versions.
_ABOUT_MEDIAN = 0.88
#: Rows of each of the bands of a large picture from which the usual departure is taken, and how many pixels.
_SAMPLED_ROWS, _SAMPLED_PIXELS = 32, 1 << 20


def without_outliers(versions: Versions, noise: NDArray[np.float64], *, moved: bool = False) -> Versions:
    """Leave out each version where it departs from the median of all, which the majority decides."""
    # Versions that were `moved` show what is finer than the pixels differently, each at its place: where the median
    # varies from pixel to pixel, so may they.
    # Only pixels that three or more versions know can be judged. Where all depart, as where two versions stand against
    # two, nothing is left out. `noise`, (S,), is the standard deviation of the noise of each version, > 0.
    if versions.n_versions < 3 or versions.coverage.max() < 3:
        return versions
    sample = _sample(versions)
    scales = _scales(sample, sample.median, sample.known.sum(axis=0) >= 3, noise)

    def kept(part: _Part) -> _Bools:
        departing = part.departing(part.median, scales, moved=moved) & (part.known.sum(axis=0) >= 3)
        outvoted: _Bools = departing & (part.known & ~departing).any(axis=0)
        return part.known & ~outvoted

    return _in_bands(versions, kept)


def without_motion(versions: Versions, noise: NDArray[np.float64], *, moved: bool = False) -> Versions:
    """Leave out each version where it departs from the first, as it does where something moved by itself."""
    from scipy.ndimage import uniform_filter

    sample = _sample(versions)
    scales = _scales(sample, sample.values[0], sample.known[0], np.hypot(noise, noise[0]))

    def kept(part: _Part) -> _Bools:
        departing = part.departing(part.values[0], scales, moved=moved) & part.known[0]
        # What moves agrees with what is behind it at some pixels, by chance.
        share = uniform_filter(departing.astype(np.float32), (0, _AROUND, _AROUND), mode="constant")
        return part.known & ~(departing | (share > _SOME))

    return _in_bands(versions, kept)


def _relief(image: Floats) -> Floats:
    """(H, W, C) range of the pixels of an image within 3 x 3; 0 where one is unknown."""
    from scipy.ndimage import maximum_filter, minimum_filter

    sides = (3, 3, 1)
    return np.nan_to_num(maximum_filter(image, sides) - minimum_filter(image, sides))


def without_background(versions: Versions, noise: NDArray[np.float64], *, moved: bool = False) -> Versions:
    """Leave out each version that shows the background where another shows something else."""
    # Everything that any version shows is then kept, even if others hide it: the union of all. The background is the
    # most frequent color.
    background = _commonest_color(versions)
    n_bands = len(background)
    scales = np.repeat((noise[:, None] / _SIDES)[:, :, None], n_bands, axis=2).astype(np.float32)

    def kept(part: _Part) -> _Bools:
        shown = np.stack([part.departs(part.values[s] - background, s, scales[s]) for s in range(len(scales))])
        hiding: _Bools = part.known & ~shown & (part.known & shown).any(axis=0)
        return part.known & ~hiding

    return _in_bands(versions, kept)


#: The registry: names for `hidden` and ``--hidden``; none keeps all that is known.
HIDDEN: dict[str, Callable[..., Versions]] = {
    "outliers": without_outliers,
    "background": without_background,
    "motion": without_motion,
    "none": lambda versions, noise, *, moved=False: versions,
}


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """Some rows of all versions: (S, h, W, C) values, and (S, h, W) which of them are known."""

    values: Floats
    known: _Bools

    @property
    def median(self) -> Floats:
        """(h, W, C) median of what is known of each pixel; NaN where nothing is."""
        ordered = np.sort(np.where(self.known[..., None], self.values, np.float32(np.nan)), axis=0)
        count = self.known.sum(axis=0)[None, :, :, None]
        low, high = np.maximum((count - 1) // 2, 0), np.minimum(count // 2, len(ordered) - 1)
        return (np.take_along_axis(ordered, low, 0) + np.take_along_axis(ordered, high, 0))[0] / 2

    def departing(self, reference: Floats, scales: Floats, *, moved: bool) -> _Bools:
        """(S, h, W) where each version departs from a reference, (h, W, C)."""
        slack = _SLACK * _relief(reference) if moved else np.zeros(1, np.float32)
        residuals = (values - reference for values in self.values)
        residuals = (residual - np.clip(residual, -slack, slack) for residual in residuals)
        return np.stack([self.departs(residual, s, scales[s]) for s, residual in enumerate(residuals)])

    def departs(self, residual: Floats, version: int, scales: Floats) -> _Bools:
        """(h, W) where a version departs by a residual, (h, W, C), by more than noise would."""
        # `scales` are (sides, C) standard deviations of the noise of the mean in windows of these sides.
        from scipy.ndimage import uniform_filter

        known = self.known[version] & np.isfinite(residual[..., 0])
        residual = np.where(known[..., None], residual, np.float32(0))
        rare = _largest_by_chance(residual.shape[2])
        alone = np.square(residual / scales[0]).sum(axis=2)
        found = alone > rare
        for side, scale in zip(_SIDES[1:], scales[1:], strict=True):
            share = uniform_filter(known.astype(np.float32), side, mode="constant")
            sums = uniform_filter(residual, (side, side, 0), mode="constant")
            mean = np.divide(sums, share[..., None], out=sums, where=share[..., None] > 0)
            # Beside what was added the mean departs too: the pixel itself must be likelier with it than without.
            likelier = np.square((residual - mean) / scales[0]).sum(axis=2) < alone
            found |= (share * np.square(mean / scale).sum(axis=2) > rare) & likelier & (share >= _FULL_ENOUGH)
        # A pixel among those that depart is taken to depart too: noise alone has brought it back.
        around = uniform_filter(found.astype(np.float32), 3, mode="constant")
        found |= around > _MOST * uniform_filter(known.astype(np.float32), 3, mode="constant")
        return found & known


def _in_bands(versions: Versions, kept: Callable[[_Part], _Bools]) -> Versions:
    """Judge bands of rows, each with the rows around it that windows reach."""
    height, width = versions.known.shape[:2]
    halo, step = max(_SIDES) // 2 + 1 + _AROUND // 2, max(1, _CHUNK // (width * versions.n_versions))
    known = versions.known.copy()
    for first in range(0, height, step):
        last = min(first + step, height)
        above, below = max(first - halo, 0), min(last + halo, height)
        part = _Part(_stacked(versions, slice(above, below)), np.moveaxis(versions.known[above:below], 2, 0))
        known[first:last] = np.moveaxis(kept(part)[:, first - above : last - above], 0, 2)
    return versions.knowing(known)


def _stacked(versions: Versions, rows: slice | NDArray[np.intp]) -> Floats:
    """(S, h, W, C) values of some rows."""
    return np.stack([versions.bands(version, rows) for version in range(versions.n_versions)])


def _sample(versions: Versions) -> _Part:
    """Return rows that tell the usual departure."""
    rows = _sampled_rows(versions)
    return _Part(_stacked(versions, rows), np.moveaxis(versions.known[rows], 2, 0))


def _scales(part: _Part, reference: Floats, judged: _Bools, noise: NDArray[np.float64]) -> Floats:
    """(S, sides, C) standard deviations by which the means of versions in windows depart from a reference anyway."""
    # That is its noise, or more where versions differ all over: in exposure, or because they do not line up.
    from scipy.ndimage import uniform_filter

    scales = np.empty((len(part.values), len(_SIDES), part.values.shape[3]), np.float32)
    for version, values in enumerate(part.values):
        seen = judged & part.known[version]
        residual = np.where(seen[..., None], values - reference, np.float32(0))
        for number, side in enumerate(_SIDES):
            means = uniform_filter(residual, (side, side, 0)) if side > 1 else residual
            known = means[seen]
            usual = np.median(np.abs(known), axis=0) / (0.6745 * _ABOUT_MEDIAN) if len(known) else 0.0
            scales[version, number] = np.maximum(noise[version] / side, usual)
    return scales


def _sampled_rows(versions: Versions) -> NDArray[np.intp]:
    """Rows that tell the usual departure: all, or bands of a large picture."""
    height, width = versions.known.shape[:2]
    n_rows: int = min(max(_SAMPLED_PIXELS // (width * versions.n_versions), _SAMPLED_ROWS), height)
    if n_rows == height:
        return np.arange(height, dtype=np.intp)
    tops = np.linspace(0, height - _SAMPLED_ROWS, n_rows // _SAMPLED_ROWS).astype(np.intp)
    return (tops[:, None] + np.arange(_SAMPLED_ROWS)).ravel()


def _largest_by_chance(n_dims: int) -> float:
    """Return the square of white noise in `n_dims` dimensions, exceeded as rarely as `_RARE` deviations in one."""
    # E. Wilson, M. Hilferty, PNAS 17 (1931) 684-688, doi 10.1073/pnas.17.12.684.
    part = 2 / (9 * n_dims)
    return float(n_dims * (1 - part + _RARE * np.sqrt(part)) ** 3)


def _commonest_color(versions: Versions) -> Floats:
    """(C,) mean of the fullest of 16 boxes per channel, over all that is known."""
    n_bands = min(int(np.count_nonzero(versions.version_of == 0)), 3)
    rows = np.concatenate([versions.bands(s)[versions.known[:, :, s]] for s in range(versions.n_versions)])
    low, high = rows.min(axis=0), rows.max(axis=0)
    boxes = np.minimum((rows - low) * (_BOXES / np.maximum(high - low, 1e-30)), _BOXES - 1).astype(np.int64)
    number = boxes[:, :n_bands] @ [_BOXES**band for band in range(n_bands)]
    return rows[number == np.bincount(number).argmax()].mean(axis=0)

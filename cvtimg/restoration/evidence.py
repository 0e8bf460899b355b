"""What is known about an image from its versions: their values in place, and how far each is to be trusted where."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg._shared.progress import part
from cvtimg.restoration.agreement import HIDDEN, Suspicion
from cvtimg.restoration.alignment import Alignment
from cvtimg.restoration.alignment import align as align_versions
from cvtimg.restoration.exposure import equalized, exposures
from cvtimg.restoration.fitting import fitting
from cvtimg.restoration.noise import bend_of, mean_noise, noise_of_bands, shared_noise
from cvtimg.restoration.shared import SharedNoise
from cvtimg.restoration.versions import Versions, disagreement, trust_in, usual_noise

_Doubles = NDArray[np.float64]

#: Part of the noise below which what JPEG has rounded away is not added to it.
_HEARD = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """The noise of versions."""

    #: (S,): standard deviation of the noise of each version, NaN where too little is known; and by band, (C,) each
    levels: _Doubles
    bands: list[_Doubles]
    shared: SharedNoise | None  # what pixels share of the noise of weight 1; None if it is white
    unit: float  # noise, in levels, for noise of one where versions are bent
    is_seen: bool  # whether any version has noise that can be seen, or that was given

    @classmethod
    def of(
        cls, versions: Versions, bands: list[_Doubles], *, in_place: bool, level: float | None, white: bool
    ) -> Noise:
        """Find what else there is to noise of bands; `white`: nothing; `level` is its standard deviation, if given."""
        levels, shared = mean_noise(bands), None
        unit = versions.bend.unit(versions.bands(0)) if versions.bend else 1.0
        is_seen = bool((levels * unit > versions.unseen).any())
        if not white:
            shared = shared_noise(versions, in_place=in_place)
            if not in_place or versions.n_versions == 1:  # what versions in place differ by has it already
                shared = _with_rounding(shared, versions, levels, unit)
        if level is not None:
            levels = np.full_like(levels, level / unit)
        elif shared:
            usual = np.sqrt(np.nanmean(levels**2)) if np.isfinite(levels).any() else 1.0
            levels = np.sqrt(shared.variance) * (levels / usual if usual else np.ones_like(levels))
        if shared:  # the level of white noise tells little of its bands
            bands = [np.sqrt(np.diag(shared.bands))] * versions.n_versions
        return cls(levels, bands, shared, unit, is_seen or shared is not None or level is not None)


def _with_rounding(shared: SharedNoise | None, versions: Versions, levels: _Doubles, unit: float) -> SharedNoise | None:
    """Add to noise what versions have lost as JPEG files, a mean over them, if it is heard."""
    pairs = zip(versions.roundings, versions.stack, strict=False)
    found = [lost for rounding, values in pairs if rounding and (lost := rounding.lost(values)) is not None]
    if not found:
        return shared
    total = np.sum([SharedNoise.of(lost / unit).autocovariance for lost in found], axis=0) / versions.n_versions
    white = float(np.nanmean(levels**2)) if np.isfinite(levels).any() else 0.0
    before = shared.autocovariance if shared else SharedNoise.white(white, total.shape[2]).autocovariance
    if SharedNoise(total).variance < _HEARD * SharedNoise(before).variance:
        return shared
    return SharedNoise(total + before)


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Versions with the weight of each."""

    given: Versions
    placed: Versions  # all that is known, in place; and what is left of it where versions disagree
    versions: Versions
    alignment: Alignment  # how each version was moved
    misfits: _Doubles  # (S,): misfit of each version, in place, with the one that most fit
    noise: Noise
    trust: _Doubles  # (S,): weight of each version, with mean 1
    suspicion: Suspicion | None  # how often versions hold additions; None if nothing else is to be left out
    channels: bool  # whether versions share segments but no colors
    aligned: bool  # whether versions were put in place

    def variances(self, data: Versions) -> list[float]:
        """Variances of a value of weight 1, as far as known: of the noise, and of the disagreement of versions."""
        known = np.isfinite(self.noise.levels)
        found = [float((self.trust * self.noise.levels**2)[known].mean())] if known.any() else []
        apart = np.nan if self.channels else disagreement(data, self.trust)
        return [*found, apart] if np.isfinite(apart) else found or [0.0]


def prepare(
    given: Versions,
    weights: ArrayLike | None,
    *,
    align: str | None,
    hidden: str,
    level: float | None,
    channels: bool = False,
    white: bool = True,
) -> Evidence:
    """Measure the noise of versions, put them in place, and leave out where they disagree; options as in `restore`."""
    # Noise is measured before any interpolation, which smooths it.
    if align and given.n_versions == 1:
        warnings.warn(f"align={align!r} has nothing to align: there is one version", UserWarning, stacklevel=3)
    with part(0, 0.4):
        placed, alignment = align_versions(given, align) if align else (given, Alignment.none(given.n_versions))
    if align and not channels:
        tones = exposures(placed)
        given, placed = (equalized(one, tones) for one in (given, placed))
    with part(0.4, 0.7):
        bands, in_place = noise_of_bands(given, alike=not channels), align is None
    is_seen = not white and (mean_noise(bands) > given.unseen).all()  # False where it is unknown
    if is_seen and (bend := bend_of(given, in_place=in_place)):
        given, placed = (replace(one, bend=bend) for one in (given, placed))
        bands = noise_of_bands(given, alike=not channels)
    with part(0.7, 1):
        noise = Noise.of(given, bands, in_place=in_place, level=level, white=white)
    versions, suspicion, apart = placed, None, np.full(given.n_versions, np.nan)
    if not channels:
        usual = usual_noise(placed, noise.levels)
        versions, apart = fitting(placed, usual, noise.shared, aligned=bool(align), hidden=hidden)
        versions = HIDDEN[hidden](versions, usual, moved=bool(align))
        suspicion = Suspicion.of(placed, versions, usual) if hidden == "outliers" else None
    trust = trust_in(given, weights, noise.levels)
    return Evidence(given, placed, versions, alignment, apart, noise, trust, suspicion, channels, bool(align))


def without_copies(versions: Versions) -> Versions:
    """Warn of versions that are copies of one before, and leave them out: their noise is not independent."""
    copies, known = [], versions.known.copy()
    sums = [versions.bands(number).sum(dtype=np.float64) for number in range(versions.n_versions)]
    for one, other in combinations(range(versions.n_versions), 2):
        same = sums[one] == sums[other] and np.array_equal(versions.known[:, :, one], versions.known[:, :, other])
        if same and known[:, :, other].any() and np.array_equal(versions.bands(one), versions.bands(other)):
            copies.append(f"images[{other}] is a copy of images[{one}]")
            known[:, :, other] = False
    if copies:
        warnings.warn(f"{', '.join(copies)} and counts once", UserWarning, stacklevel=3)
    return versions.knowing(known) if copies else versions

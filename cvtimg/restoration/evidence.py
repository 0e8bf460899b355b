"""What is known about an image from its versions: their values in place, and how far each is to be trusted where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg.restoration.agreement import HIDDEN
from cvtimg.restoration.alignment import align as align_versions
from cvtimg.restoration.noise import noise_of
from cvtimg.restoration.suspicion import Suspicion
from cvtimg.restoration.versions import Versions, disagreement, trust_in, usual_noise


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Versions with the weight of each."""

    placed: Versions  # all that is known, in place; and what is left of it where versions disagree
    versions: Versions
    shifts: NDArray[np.float64]  # (S, 2): pixels by which each version was moved
    #: (S,): standard deviation of the noise of each version, NaN where too little is known; and its weight
    noise: NDArray[np.float64]
    trust: NDArray[np.float64]
    suspicion: Suspicion | None  # how often versions hold additions; None if nothing else is to be left out
    channels: bool  # whether versions share segments but no colors

    def variances(self, data: Versions, gain: float = 1.0) -> list[float]:
        """Variances of a value of weight 1, as far as known: of the noise, and of the disagreement of versions.

        The data are the versions, averaged so that this part of the variance of the noise, `gain`, is left.
        """
        known = np.isfinite(self.noise)
        found = [float((self.trust * self.noise**2)[known].mean()) * gain] if known.any() else []
        apart = np.nan if self.channels else disagreement(data, self.trust)
        if np.isfinite(apart):
            found.append(apart)
        return found or [0.0]


def prepare(given: Versions, weights: ArrayLike | None, *, align: bool, hidden: str, channels: bool) -> Evidence:
    """Measure the noise of versions, put them in place, and leave out where they disagree; options as in `restore`."""
    noise = noise_of(given, alike=not channels)  # before any interpolation, which smooths it
    trust = trust_in(given, weights, noise)
    placed, shifts = align_versions(given) if align else (given, np.zeros((given.n_versions, 2)))
    versions, suspicion = placed, None
    if not channels:
        usual = usual_noise(placed, noise)
        versions = HIDDEN[hidden](placed, usual)
        suspicion = (Suspicion.of(placed, versions, usual) or None) if hidden == "outliers" else None
    return Evidence(placed, versions, shifts, noise, trust, suspicion, channels)

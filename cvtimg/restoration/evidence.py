"""What is known about an image from its versions: their values in place, and how far each is to be trusted where."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvtimg.restoration.agreement import HIDDEN
from cvtimg.restoration.alignment import align as align_versions
from cvtimg.restoration.fitting import MOST_MISFIT, misfits
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
        """Variances of a value of weight 1, as far as known: of the noise, and of the disagreement of versions."""
        # The data are the versions, averaged so that this part of the variance of the noise, `gain`, is left.
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
        versions = HIDDEN[hidden](_fitting(placed, usual, aligned=align, leaves_out=hidden != "none"), usual)
        suspicion = (Suspicion.of(placed, versions, usual) or None) if hidden == "outliers" else None
    return Evidence(placed, versions, shifts, noise, trust, suspicion, channels)


def _fitting(versions: Versions, noise: NDArray[np.float64], *, aligned: bool, leaves_out: bool) -> Versions:
    """Warn of versions that do not fit the one that most fit, the first of these, and leave them out if asked for."""
    apart = misfits(versions, noise)
    reference = int(np.argmax((apart <= MOST_MISFIT).sum(axis=1)))
    is_out = apart[reference] > MOST_MISFIT
    if not is_out.any():
        return versions
    numbers = np.flatnonzero(is_out).tolist()
    names = ", ".join(f"images[{number}]" for number in numbers)
    values = ", ".join(f"{apart[reference, number]:.2f}" for number in numbers)
    done = ("is" if len(numbers) == 1 else "are") + " left out" if leaves_out else "may spoil the result"
    why = "align=True only shifts them" if aligned else "align=True shifts them into place"
    warnings.warn(
        f"{names} cannot be laid over images[{reference}] and {done}: misfit {values}, at most {MOST_MISFIT}; {why}",
        UserWarning,
        stacklevel=4,
    )
    return versions.knowing(versions.known & ~is_out) if leaves_out else versions

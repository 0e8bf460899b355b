"""What is known about an image from its versions: their values in place, and how far each is to be trusted where."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from cvtimg._shared.checks import check_choice, check_positive
from cvtimg._shared.choices import AlignName, SpaceName
from cvtimg._shared.messages import warn
from cvtimg._shared.progress import part
from cvtimg._shared.threads import side_by_side
from cvtimg._shared.types import Floats
from cvtimg.restoration.agreement import HIDDEN, Suspicion
from cvtimg.restoration.alignment import MODELS, Alignment
from cvtimg.restoration.alignment import align as align_versions
from cvtimg.restoration.defects import Defects, without_defects
from cvtimg.restoration.fitting import equalized, exposures, fitting
from cvtimg.restoration.noise import Noise
from cvtimg.restoration.versions import Versions, disagreement, trust_in, usual_noise


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Versions with the weight of each."""

    given: Versions
    placed: Versions  # all that is known, in place; and what is left of it where versions disagree
    versions: Versions
    alignment: Alignment  # how each version was moved
    misfits: Floats  # (S,): misfit of each version, in place, with the one that most fit
    noise: Noise
    trust: Floats  # (S,): weight of each version, with mean 1
    suspicion: Suspicion | None  # how often versions hold additions; None if nothing else is to be left out
    channels: bool  # whether versions share segments but no colors
    aligned: bool  # whether versions were put in place
    defects: Defects  # impulses and stripes that were taken out of versions

    def variances(self, data: Versions) -> list[float]:
        """Variances of a value of weight 1, as far as known: of the noise, and of the disagreement of versions."""
        known = np.isfinite(self.noise.levels)
        of_noise = [float((self.trust * self.noise.levels**2)[known].mean())] if known.any() else []
        apart = np.nan if self.channels else disagreement(data, self.trust)
        return [*of_noise, apart] if np.isfinite(apart) else of_noise or [0.0]

    @property
    def noise_lines(self) -> Floats | None:
        """(C, 2) constant and slope of the variance of noise of weight 1 in each band; None where it is even."""
        if self.noise.lines is None:
            return None
        squares = np.mean(np.square(self.noise.bands), axis=0)
        return self.variances(self.placed)[0] * (squares / squares.mean())[:, None] * self.noise.lines


def prepare(
    given: Versions,
    weights: ArrayLike | None,
    *,
    align: bool | AlignName = False,
    hidden: str | None = None,
    level: float | None = None,
    space: SpaceName = "rgb",
    channels: bool = False,
    white: bool = True,
) -> Evidence:
    """Measure the noise of versions, put them in place, and leave out where they disagree; options as in `restore`."""
    rule = HIDDEN[check_choice("hidden", hidden or "none", HIDDEN)]
    model = check_choice("align", "auto" if align is True else align, ("auto", *MODELS)) if align else None
    level = None if level is None else check_positive("noise", level) * given.level(space)
    if model and given.n_versions == 1:
        warn(f"align={model!r} has nothing to align: there is one version")
    defects = Defects(np.zeros(given.n_versions), np.zeros((given.n_versions, 2)))
    if rule is not HIDDEN["none"] and not channels:
        given, defects = without_defects(given)
    with part(0, 0.4):
        placed, alignment = align_versions(given, model) if model else (given, Alignment.none(given.n_versions))
    if model and not channels:
        tones = exposures(placed)
        given, placed = side_by_side(partial(equalized, tones=tones), (given, placed))
    with part(0.4, 1):  # noise of what was given: interpolation smooths it
        noise_of = partial(Noise.of, level=level, white=white, in_place=model is None and not channels)
        noise = noise_of(given)
    versions, suspicion, apart = placed, None, np.full(given.n_versions, np.nan)
    if not channels:
        usual = usual_noise(placed, noise.levels)
        versions, apart = fitting(placed, usual, noise.shared, aligned=bool(model), hidden=hidden or "none")
        if (told := versions.known.any(axis=(0, 1))).sum() < placed.known.any(axis=(0, 1)).sum():
            noise = noise_of(replace(given, known=given.known & told))  # what others differ from is no noise
    whitening = noise.whitening(given.rounding)
    given, placed, versions = (
        replace(each, lines=noise.lines, whitening=whitening) for each in (given, placed, versions)
    )
    if not channels:
        usual = usual_noise(placed, noise.levels)
        versions = rule(versions, usual, moved=bool(model))
        suspicion = Suspicion.of(placed, versions, usual) if hidden == "outliers" else None
    trust = trust_in(given, weights, noise.levels)
    return Evidence(given, placed, versions, alignment, apart, noise, trust, suspicion, channels, bool(model), defects)


def that_tell(versions: Versions, *, quietly: bool = False) -> Versions:
    """Warn of versions that are copies of one before, or of one color where others are not, and leave them out."""
    # The noise of copies is not independent; what is of one color, as through a covered lens, seems to have none.
    reasons, known, seen = [], versions.known.copy(), dict[int, int]()
    for number, values in enumerate(versions.stack):
        inside = versions.known[:, :, number]
        if not inside.any():
            continue
        told = hash((versions.bands(number).tobytes(), inside.tobytes()))
        if (first := seen.setdefault(told, number)) != number:
            reasons.append(f"images[{number}] is a copy of images[{first}] and counts once")
        elif not np.ptp(values[inside], axis=0).any() and any(
            np.ptp(other[inside & versions.known[:, :, s]], axis=0).any()
            for s, other in enumerate(versions.stack)
            if (inside & versions.known[:, :, s]).any()
        ):
            reasons.append(f"images[{number}] is of one color where others are not and is left out")
        else:
            continue
        known[:, :, number] = False
    if reasons and not quietly:
        warn("; ".join(reasons))
    return replace(versions, known=known) if reasons else versions

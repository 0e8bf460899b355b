"""Versions merged into flat segments: cells of stacked values, and one color for each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.choices import EffortName, SpaceName
from cvtimg._shared.pixels import white_of
from cvtimg._shared.progress import each
from cvtimg.colors.spaces import to_space
from cvtimg.elbow.curves import auto_count
from cvtimg.engine.tessellation import tessellate
from cvtimg.restoration.evidence import Evidence
from cvtimg.restoration.masked import MaskedCells, average_masked, masked_cells, masked_means
from cvtimg.restoration.renormalization import RENORMALIZATIONS, Levels
from cvtimg.restoration.result import Found
from cvtimg.restoration.suspicion import first_estimate
from cvtimg.restoration.versions import Floats, Versions, averaged_versions, fuse
from cvtimg.segmentation.averaging import Averaging
from cvtimg.segmentation.edge_weight import EdgeWeighted, descend

#: The edge weight "auto" as a multiple of the variance of the noise. Half or twice as much serves nearly as well.
_EDGE_WEIGHT_PER_VARIANCE = 0.5
#: For "auto" segments: the elbow of up to this many, in an image with this blur.
_AUTO_MAX, _AUTO_BLUR = 32, 1.5
#: Blurs, in pixels, of the images in which the search for segments begins; the lowest end is kept.
_BLURS = {"fast": (1.0,), "balanced": (0.0, 1.5), "best": (0.0, 0.75, 1.5, 3.0)}

_Doubles = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Merging:
    """How to merge versions: checked options of `restore`, by their names; an edge weight of None is "auto"."""

    averaging: Averaging | None
    edge_weight: float | None
    volume_power: float
    renormalize: str
    effort: EffortName
    space: SpaceName


def merge_versions(evidence: Evidence, n_generators: int | None, how: Merging) -> Found:
    """Find segments of pixels whose stacked values are alike, and one color for each; None picks their number."""
    versions, trust = evidence.versions, evidence.trust
    if evidence.suspicion and versions.n_versions > 2:  # of two, neither has a majority: both count
        versions = evidence.suspicion.kept(versions, first_estimate(fuse(versions, trust)[0]))
    before = how.averaging if how.averaging and how.averaging.when == "before" else None
    data = averaged_versions(versions, before) if before else versions
    unit, cost = level_of(versions, how.space) ** 2, how.edge_weight
    if cost is None:
        cost = _EDGE_WEIGHT_PER_VARIANCE * max(evidence.variances(data, before.noise_gain if before else 1.0)) / unit
    after = None if before else how.averaging
    search = _Search(versions, data, trust, after, cost * unit, how.volume_power, evidence.channels)
    if n_generators is None:
        n_generators = auto_count(search.fused_rows(_AUTO_BLUR), _AUTO_MAX)[0]
    return search.segments(n_generators, how, cost)


def level_of(versions: Versions, space: SpaceName) -> float:
    """Return an 8-bit level in the units of the first version's color space."""
    white = np.array([[white_of(versions.dtype)]], versions.dtype)
    return float(to_space(white, space)[0, 0]) / 255


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """Versions as they came; the data to segment, which are the same or averaged; and what lowers the energy."""

    versions: Versions
    data: Versions
    trust: _Doubles
    average_after: Averaging | None
    edge_weight: float
    volume_power: float
    channels: bool

    def segments(self, n_generators: int, how: Merging, cost: float) -> Found:
        """Find the segments of lowest energy; `cost` is the edge weight in 8-bit levels."""
        values, weights = self.data.values, self.data.weights(self.trust)
        values = values - np.float32(values[weights > 0].mean(dtype=np.float64))  # so that float32 is precise enough
        ends = (
            self._settle(values, weights, self._start(blur, n_generators, how.effort), n_generators)
            for blur in each(_BLURS[how.effort])
        )
        end = min(ends, key=lambda end: end.energies[-1])
        generators, masses = measured(self.versions, self.trust, end.labels, n_generators)

        def alone(version: int) -> tuple[_Doubles, _Doubles]:
            own = self.versions.version_of == version
            settled = self._settle(values[:, :, own], weights[:, :, own], end.labels, n_generators)
            means, loads = measured(self.versions, self.trust, settled.labels, n_generators)
            return means[:, own], loads[:, own]

        seen = range(1 if self.channels else self.versions.n_versions)
        bands = [self.versions.version_of == version for version in seen]
        levels = Levels(
            values=[self.versions.bands(version) for version in seen],
            known=[self.versions.known[:, :, version] for version in seen],
            labels=end.labels,
            generators=np.stack([generators[:, own] for own in bands]),
            masses=np.stack([masses[:, own] for own in bands]),
            alone=alone,
        )
        colors = RENORMALIZATIONS[how.renormalize](levels)
        used = self.versions.coverage
        return Found(end.labels, generators, masses, colors, end.energies, used, cost, end.converged)

    def _start(self, blur: float, n_generators: int, effort: EffortName) -> NDArray[np.int32]:
        """(H, W) cells, from 1, of the colors of the versions fused and blurred, where nothing is missing."""
        cells = tessellate(self.fused_rows(blur), n_generators, effort=effort)
        return (cells.labels + 1).reshape(self.data.known.shape[:2])

    def fused_rows(self, blur: float) -> Floats:
        """(N, C) colors of the versions fused and blurred; channels side by side."""
        looks = [(self.data, self.trust)]
        if self.channels:
            looks = [(self.data.only(number), self.trust[[number]]) for number in range(self.data.n_versions)]
        parts = [fuse(look, trust, blur)[0] * np.float32(np.sqrt(trust.mean())) for look, trust in looks]
        picture = np.concatenate(parts, axis=2)
        return picture.reshape(-1, picture.shape[2])

    def _settle(
        self, values: Floats, weights: Floats, labels: NDArray[np.int32], n_generators: int
    ) -> EdgeWeighted | MaskedCells:
        """Lower the energy from initial labels until they rest."""
        average, power = self.average_after, self.volume_power
        if self.edge_weight:
            if average:
                labels = average_masked(values, weights, labels, n_generators, average).labels
            return descend(
                values, labels, n_generators, edge_weight=self.edge_weight, weights=weights, volume_power=power
            )
        end = masked_cells(values, weights, labels, n_generators, volume_power=power)
        return average_masked(values, weights, end.labels, n_generators, average) if average else end


def measured(
    versions: Versions, trust: _Doubles, labels: NDArray[np.int32], n_generators: int
) -> tuple[_Doubles, _Doubles]:
    """(K, D) means of segments in versions, and (K, D) the weight behind them."""
    found = []
    for version, share in enumerate(trust):
        rows = versions.bands(version).reshape(labels.size, -1)
        loads = np.broadcast_to(versions.known[:, :, version].reshape(-1, 1) * share, rows.shape)
        found.append(masked_means(rows, loads, labels.ravel(), np.zeros((n_generators, rows.shape[1]))))
    means, masses = zip(*found, strict=True)
    return np.concatenate(means, axis=1), np.concatenate(masses, axis=1)

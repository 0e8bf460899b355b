"""Evidence about an image from its versions, and the two ways to restore it: flat segments, or patches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.checks import check_choice, check_count
from cvtimg._shared.choices import EffortName
from cvtimg.elbow.curves import auto_count
from cvtimg.engine.tessellation import tessellate
from cvtimg.restoration.detail import restore_detail
from cvtimg.restoration.masked import MaskedCells, average_masked, masked_cells, masked_means
from cvtimg.restoration.renormalization import RENORMALIZATIONS, Levels
from cvtimg.restoration.result import Found
from cvtimg.restoration.suspicion import Suspicion
from cvtimg.restoration.versions import Floats, Versions, fuse
from cvtimg.segmentation.averaging import Averaging
from cvtimg.segmentation.edge_weight import EdgeWeighted, descend

#: For "auto": this many cells of patches; or the elbow of up to this many, in an image with this blur.
_AUTO_DETAIL, _AUTO_MAX, _AUTO_BLUR = 32, 32, 1.5
#: Blurs, in pixels, of the images in which the search for segments begins; the lowest end is kept.
_BLURS = {"fast": (1.0,), "balanced": (0.0, 1.5), "best": (0.0, 0.75, 1.5, 3.0)}

_Doubles = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Versions with the weight of each, and how segments of them are found.

    Attributes
    ----------
    versions : Versions
        As they came, in place.
    data : Versions
        The values to segment: the same, or averaged.
    trust : (S,) float64 array
        Weight of each version.
    average_after : Averaging or None
        How to average segments once they are found.
    edge_weight : float
        In squared units of the values.
    volume_power : float
    channels : bool
        Whether versions share segments but no colors.
    suspicion : Suspicion or None
        How often versions hold additions; None if nothing else is to be left out.
    """

    versions: Versions
    data: Versions
    trust: _Doubles
    average_after: Averaging | None
    edge_weight: float
    volume_power: float
    channels: bool
    suspicion: Suspicion | None

    def count(self, n_generators: int | str, detail: bool) -> int:
        """Check the number of generators, or find it."""
        if not isinstance(n_generators, str):
            return check_count("n_generators", n_generators, self.versions.known[:, :, 0].size, "the number of pixels")
        check_choice("n_generators", n_generators, ("auto",))
        return _AUTO_DETAIL if detail else auto_count(self._fused_rows(_AUTO_BLUR), _AUTO_MAX)[0]

    def segments(self, n_generators: int, rule: str, effort: EffortName) -> Found:
        """Find segments of pixels whose stacked values are alike, and one color for each."""
        values, weights = self.data.values, self.data.weights(self.trust)
        values = values - np.float32(values[weights > 0].mean(dtype=np.float64))  # so that float32 is precise enough
        starts = (self._start(blur, n_generators, effort) for blur in _BLURS[effort])
        end = min((self._settle(values, weights, start, n_generators) for start in starts), key=_last_energy)
        generators, masses = self._measured(end.labels, n_generators)

        def alone(version: int) -> tuple[_Doubles, _Doubles]:
            own = self.versions.version_of == version
            settled = self._settle(values[:, :, own], weights[:, :, own], end.labels, n_generators)
            means, loads = self._measured(settled.labels, n_generators)
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
        colors = RENORMALIZATIONS[rule](levels)
        return Found(end.labels, generators, masses, colors, end.energies, end.converged)

    def patches(self, n_generators: int, effort: EffortName, variance: float, rng: np.random.Generator) -> Found:
        """Find kinds of patches, and filter groups of them; `variance` is that of the noise of a value of weight 1."""
        found, kept = restore_detail(self.versions, self.trust, variance, self.suspicion, n_generators, effort, rng)
        labels = found.labels + 1
        generators, masses = self._measured(labels, n_generators)
        rows = found.image.reshape(labels.size, -1)
        nothing = np.zeros((n_generators, rows.shape[1]))
        colors, _ = masked_means(rows, np.ones_like(rows), labels.ravel(), nothing)
        return Found(labels, generators, masses, colors, (found.energy,), image=found.image, used=kept.coverage)

    def _measured(self, labels: NDArray[np.int32], n_generators: int) -> tuple[_Doubles, _Doubles]:
        """(K, D) means of segments in the versions as they came, and (K, D) the weight behind them."""
        rows = self.versions.values.reshape(labels.size, -1)
        loads = self.versions.weights(self.trust).reshape(rows.shape)
        return masked_means(rows, loads, labels.ravel(), np.zeros((n_generators, rows.shape[1])))

    def _start(self, blur: float, n_generators: int, effort: EffortName) -> NDArray[np.int32]:
        """(H, W) cells, from 1, of the colors of the versions fused and blurred, where nothing is missing."""
        cells = tessellate(self._fused_rows(blur), n_generators, effort=effort)
        return (cells.labels + 1).reshape(self.data.known.shape[:2])

    def _fused_rows(self, blur: float) -> Floats:
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


def _last_energy(end: EdgeWeighted | MaskedCells) -> float:
    return end.energies[-1]

"""Values, averages and edge weight, computed once for any number of segments, and the energy curve of these."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log
from typing import Any

import numpy as np

from cvtimg._shared.checks import check_count, check_edge_weight, check_in_range, check_non_negative
from cvtimg._shared.choices import EffortName
from cvtimg._shared.types import Floats, Floats32, Ints
from cvtimg.elbow.curves import EnergyCurve, energy_curve
from cvtimg.elbow.rules import Scale
from cvtimg.engine.points import assign, pack
from cvtimg.segmentation.edge_weight import RADIUS, EdgeWeighted, Planes, descend, length_cost
from cvtimg.segmentation.noise import averaged, noise_covariance, noise_gain
from cvtimg.segmentation.values import PictureValues

#: Variances of noise, the least edge weight "auto" at a radius of 3; more rounds shapes off, less leaves specks: for
#: three shapes under noise of a quarter to all of their contrast, the most pixels are right from 0.3 to 0.4.
_AUTO_WEIGHT = 0.35
#: A region averages the noise of its pixels: its edge weight need be but this part of theirs. An edge is described in
#: ln 3 nats for each pixel of its length, as by a chain code, and these cost 36 edge weights, in units of 2 variances.
_OF_REGIONS = 2 * log(3) / 36 / _AUTO_WEIGHT
#: Segments, at most, between which regions move: more take longer and have few regions each.
_MOST_MOVED = 64
#: How regions move with the best effort, which lowers the energy by another 0.5 %.
_THOROUGH = {"n_cells": 2000, "n_rounds": 2}
#: Part of the spread of the image that noise is in the averages from which the descent starts, and pixels of their
#: blur at most: more blur keeps noise from hiding segments, and hides small ones itself.
_NOISE_AT_START, _LARGEST_START = 0.25, 5.0
#: Pixels, at most: time grows as the square of the radius; wider averages than pictures show nothing.
LARGEST_RADIUS, _LARGEST_AVERAGING = 30, 1000
#: Segments as for which images are blurred where curves start: more blur them more.
_SEGMENTS_AT_START = 4


@dataclass(frozen=True, slots=True)
class Smoothness:
    """The options against noise, checked: averaging and the weight of edges."""

    averaging: float  # deviation of a Gaussian, in pixels
    edge_weight: float | None  # in squared values; none if it is to follow the smallest detail and the noise
    edge_radius: int  # pixels are near each other up to this distance
    smallest_detail: float  # radius of the discs that are just worth their edge
    described: bool  # whether edges may cost less, as segments are described in the fewest bits
    volume_power: float  # cells count by their share of the mass to this power
    planes: Planes | None  # of a volume
    effort: EffortName

    @classmethod
    def checked(
        cls,
        averaging: float,
        edge_weight: float | str,
        edge_radius: int,
        smallest_detail: float | str,
        volume_power: float = 0,
        planes: Planes | None = None,
        effort: EffortName = "balanced",
    ) -> Smoothness:
        """Check the arguments of `segment` by these names."""
        radius = check_count("edge_radius", edge_radius, LARGEST_RADIUS, "the largest disc")
        given = check_edge_weight(smallest_detail, "smallest_detail")
        # Where "auto" decides what counts, details larger than a pixel that are as different as any always do.
        detail, described = (1.0, not volume_power) if given is None else (given, False)
        check_non_negative("averaging", averaging)
        check_in_range("averaging", averaging, averaging <= _LARGEST_AVERAGING, f"<= {_LARGEST_AVERAGING} pixels")
        weight = check_edge_weight(edge_weight)
        return cls(averaging, weight, radius, detail, described, volume_power, planes, effort)

    def edge_weight_for(self, noise: Floats, gain: float = 1.0) -> tuple[float, float]:
        """Return the edge weight, or the least one and the detail that it is to follow; gain is that of the noise."""
        if self.edge_weight is not None:
            return self.edge_weight, 0.0
        return auto_weight(noise, self.edge_radius, self.planes) * gain, self.smallest_detail

    def moves(self, edge_weight: float, n_segments: int) -> dict[str, Any]:
        """Return which regions move as a whole, if any, by the edge weight of pixels: arguments of `Moves`."""
        if self.volume_power or n_segments > _MOST_MOVED:
            return {}
        of_regions = edge_weight if self.edge_weight is not None else edge_weight * _OF_REGIONS
        return {"of_regions": of_regions, "described": self.described, **(_THOROUGH if self.effort == "best" else {})}

    def prepare(self, values: PictureValues, shaded: int = 0) -> Prepared:
        """Average the image and measure its noise as far as asked for; with `shaded` segments in uneven light."""
        field, deviation = values.field(), self.averaging
        data = values.in_even_light(field, shaded) if shaded else field
        noise = np.zeros((1, 1)) if self.edge_weight == 0 else noise_covariance(data, values.inside)
        weight, detail = self.edge_weight_for(noise, noise_gain(deviation) if deviation else 1.0)
        if deviation:
            data = averaged(data, deviation, values.inside)
        return Prepared(self, values, field, data, noise, weight, detail)


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """An image that is ready to be segmented."""

    how: Smoothness
    values: PictureValues  # the colors inside the mask
    field: Floats32  # (H, W, D): values of the pixels about their mean; 0 outside the mask
    data: Floats32  # (H, W, D): the values to segment: the field, in even light or averaged first
    noise: Floats  # (D, D): covariance of the noise of the field; measured only where edges cost
    edge_weight: float  # cost of each pair of near pixels in different segments, in squared values; or the least
    smallest_detail: float  # radius of the discs that are just worth their edge; 0 if the weight is given

    def start(self, n_segments: int) -> Floats32 | None:
        """(H, W, D) values in which to find the first cells, or None if the distinct colors serve."""
        # An image that is averaged or in even light is taken as it is; another is blurred here if noise would hide its
        # segments.
        if self.data is not self.field:
            return self.data
        blur = blur_at_start(self.values.variance, self.noise, n_segments)
        return averaged(self.field, blur, self.values.inside) if blur else None

    def settle(self, labels: Ints, n_segments: int, by_detail: bool = True) -> tuple[Ints, EdgeWeighted | None]:
        """Lower the edge-weighted energy of segments, if edges cost."""
        how, detail = self.how, self.smallest_detail if by_detail else 0.0
        if not (self.edge_weight or detail):
            return labels, None
        moves: dict[str, Any] = {"radius": how.edge_radius, "volume_power": how.volume_power, "planes": how.planes}
        if by_detail:
            moves |= how.moves(self.edge_weight, n_segments)
        end = descend(self.data, labels, n_segments, edge_weight=self.edge_weight, detail=detail, **moves)
        return end.labels, end


def auto_weight(noise: Floats, radius: int, planes: Planes | None = None) -> float:
    """Follow the noise in the direction where it is greatest, at the same cost of length for every radius."""
    variance = max(float(np.linalg.eigvalsh(noise)[-1]), 0.0)
    return _AUTO_WEIGHT * variance * length_cost(RADIUS) / length_cost(radius, planes)


def blur_at_start(variance: float, noise: Floats, n_segments: int) -> float:
    """Return the standard deviation of a Gaussian that keeps noise from hiding the segments; 0 if none is needed."""
    noisy = float(np.trace(noise))
    signal = max(variance - noisy, 1e-3 * noisy, np.finfo(float).tiny)
    # A Gaussian of standard deviation s leaves 1 / (2 s sqrt(pi)) of white noise. Levels of K segments are K / 2
    # times closer to each other than those of two.
    blur = np.sqrt(noisy / signal) * n_segments / 2 / (2 * np.sqrt(np.pi) * _NOISE_AT_START)
    return 0.0 if blur < 0.5 else float(min(blur, _LARGEST_START))


def curve_of_segments(prepared: Prepared, n_max: int, rng: int | np.random.Generator) -> EnergyCurve:
    """Compute the energies of 1, 2, ... n_max segments from those of the cells that they start from."""
    # The curve never rises: where another segment would cost more, because of its edges, it stays empty, and the curve
    # keeps the energy and the generators of one segment less.
    inside, volume_power = prepared.values.inside, prepared.how.volume_power
    start = prepared.start(_SEGMENTS_AT_START)
    samples: Any = prepared.values.samples if start is None else start[inside]  # those that segments start from
    cells = replace(energy_curve(samples, n_max, volume_power=volume_power, rng=rng), is_continuum=False)
    if start is None:  # of levels, which become values
        scale = prepared.values.scale
        places_of = tuple(scale * places for places in cells.generators)
        peak = None if cells.scale.peak is None else 255.0
        cells = EnergyCurve(scale**2 * cells.energies, places_of, Scale(cells.scale.n_values, peak))
    # Edges count where a weight is given, or where noise is so strong that segments are found in a blurred image.
    if start is None and (prepared.smallest_detail or not prepared.edge_weight):
        return cells
    rows = (prepared.field if start is None else start)[inside]
    points, center = pack(rows, np.ones(len(rows))), prepared.values.center  # which the field is about
    energies: list[float] = []
    generators: list[Floats] = []
    for places in cells.generators:
        labels = np.zeros(inside.shape, np.int32)
        about = places - center if start is None else places
        labels[inside] = assign(points, points.frame.inward(about))[: len(rows)] + 1
        labels, end = prepared.settle(labels, len(places), by_detail=False)
        if end is None:  # measured as it is
            end = descend(prepared.data, labels, len(places), edge_weight=0, volume_power=volume_power, max_sweeps=0)
        energy, means = end.energies[-1], end.generators[end.masses[:, 0] > 0] + center
        if energies and energy > energies[-1]:
            energy, means = energies[-1], generators[-1]
        energies.append(energy)
        generators.append(means)
    return EnergyCurve(np.array(energies), tuple(generators), Scale(float(rows.size), None))

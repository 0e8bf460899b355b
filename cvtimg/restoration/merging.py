"""Versions merged into flat segments: cells of stacked values, and one color for each, at full contrast.

A segment that is painted over in one of three versions has a diluted generator: a third of the way to the color that
covers it. Each rule of renormalization undoes that in its own way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cvtimg._shared.choices import EffortName, SpaceName
from cvtimg._shared.pixels import peak
from cvtimg._shared.progress import each
from cvtimg._shared.types import Bools, Floats, Floats32, Ints
from cvtimg.colors.spaces import from_space
from cvtimg.elbow.curves import auto_count
from cvtimg.restoration.evidence import Evidence
from cvtimg.restoration.patches import cells_of
from cvtimg.restoration.result import Restoration
from cvtimg.restoration.versions import Versions, fuse
from cvtimg.segmentation.edge_weight import EdgeWeighted, descend

#: Blurs, in pixels, of the images in which the search for segments begins; the lowest end is kept.
_BLURS = {"fast": (1.0,), "balanced": (0.0, 1.5), "best": (0.0, 0.75, 1.5, 3.0)}


def merge_versions(
    evidence: Evidence,
    n_generators: int | None,
    *,
    edge_weight: float | None,
    renormalize: str,
    effort: EffortName,
    space: SpaceName,
) -> Restoration:
    """Find segments of pixels whose stacked values are alike, and one color for each; None picks their number."""
    versions, trust = evidence.versions, evidence.trust
    if evidence.suspicion:
        versions = evidence.suspicion.first_kept(versions, fuse(versions, trust)[0])
    unit, cost = versions.level(space) ** 2, edge_weight
    if cost is None:  # half or twice as much serves nearly as well
        cost = 0.5 * max(evidence.variances(versions)) / unit
    if n_generators is None:
        seen = versions.coverage.ravel() > 0  # what is filled in does not tell
        n_generators, _ = auto_count(_fused_rows(versions, evidence, 1.5)[seen], 32)
        sharp = _fused_rows(versions, evidence, 0.0)[seen]  # a drawing of two colors has more once it is blurred
        told = np.einsum("ij,j->i", sharp, np.pi ** np.arange(sharp.shape[1]))
        n_generators = min(n_generators, len(np.unique(told)))
    weights = np.where(versions.known, trust.astype(np.float32), np.float32(0))[:, :, versions.version_of]
    values = versions.values
    center = values[weights > 0].mean(dtype=np.float64)
    values = values - np.float32(center)  # so that float32 is precise enough

    def settled(labels: Ints, some: Bools) -> EdgeWeighted:
        """Lower the energy in some bands from initial labels until they rest."""
        cells = descend(values[:, :, some], labels, n_generators, edge_weight=cost * unit, weights=weights[:, :, some])
        return replace(cells, generators=cells.generators + np.float32(center))

    def started(blur: float) -> Ints:
        """(H, W) cells, from 1, of the colors of the versions fused and blurred, where nothing is missing."""
        rows = _fused_rows(versions, evidence, blur)
        cells = cells_of(rows, n_generators, effort=effort)
        return (cells.labels + 1).reshape(versions.known.shape[:2])

    ends = (settled(started(blur), versions.version_of >= 0) for blur in each(_BLURS[effort]))
    end = min(ends, key=lambda end: end.energies[-1])
    bands = [versions.version_of == version for version in range(1 if evidence.channels else versions.n_versions)]

    levels = Levels(
        versions,
        end.labels,
        generators=np.stack([end.generators[:, some] for some in bands]),
        masses=np.stack([end.masses[:, some] for some in bands]),
        alone=lambda version: settled(end.labels, bands[version]),
    )
    colors = RENORMALIZATIONS[renormalize](levels)
    white = peak(evidence.placed.dtypes[0]) if space != "rgb" else 1.0
    shown = from_space(colors, space, np.dtype(np.float64)) * white
    # Segments that are left, from dark to bright.
    order = np.lexsort((*shown.T[::-1], shown.sum(axis=1)))
    order = order[np.bincount(end.labels.ravel(), minlength=len(shown) + 1)[1:][order] > 0]
    rank = np.zeros(len(shown) + 1, np.int32)
    rank[order + 1] = np.arange(1, len(order) + 1)
    labels = rank[end.labels]
    by_version = np.full((len(order), versions.n_versions, int(np.bincount(versions.version_of).max())), np.nan)
    for version, dtype in enumerate(evidence.placed.dtypes):
        some = versions.version_of == version
        places = np.where(end.masses > 0, end.generators, np.nan)[order][:, some]
        white = peak(dtype) if space != "rgb" else 1.0
        by_version[:, version, : np.count_nonzero(some)] = from_space(places, space, np.dtype(np.float64)) * white
    return Restoration.of(
        colors[order][labels - 1],
        versions,
        evidence,
        space,
        labels=labels,
        generators=by_version,
        colors=shown[order],
        edge_weight=cost,
        energies=end.energies,
        converged=end.converged,
    )


def _fused_rows(versions: Versions, evidence: Evidence, blur: float) -> Floats32:
    """(N, C) colors of the versions fused and blurred; channels side by side."""
    trust, numbers = evidence.trust, [*range(versions.n_versions)]
    looks = [[number] for number in numbers] if evidence.channels else [numbers]
    parts = [fuse(versions, trust, blur, some)[0] * np.float32(np.sqrt(trust[some].mean())) for some in looks]
    return np.concatenate(parts, axis=2).reshape(versions.known[:, :, 0].size, -1)


# --- renormalization


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """Segments of versions, from which their colors are made."""

    versions: Versions
    labels: Ints  # (H, W): labels from 1
    generators: Floats  # (S, K, C): means and weights of the segments in each version; of channels, in the first
    masses: Floats
    #: Takes the number of a version and returns its segments once they have settled in it alone
    alone: Callable[[int], EdgeWeighted]


def mean_colors(levels: Levels) -> Floats:
    """(K, C) mean of the known values of each segment in all versions."""
    totals = levels.masses.sum(axis=0)
    sums = (levels.masses * levels.generators).sum(axis=0)
    return np.divide(sums, totals, out=levels.generators.mean(axis=0), where=totals > 0)


def median_colors(levels: Levels) -> Floats:
    """(K, C) median of the known values of each segment: right while less than half of it is painted over."""
    colors, known = mean_colors(levels), levels.versions.known
    some = range(len(levels.masses))
    values = np.concatenate([levels.versions.bands(version)[known[:, :, version]] for version in some])
    labels = np.concatenate([levels.labels[known[:, :, version]] for version in some])
    for label in np.unique(labels):
        colors[label - 1] = np.median(values[labels == label], axis=0)
    return colors


def range_colors(levels: Levels) -> Floats:
    """(K, C) median over the versions of the level that each segment has in that version alone."""
    # In a single version, painted-over parts belong to the background and no longer dilute the level of the rest, so
    # the levels span the range of the versions again. Levels are those of segments, not of the least and greatest
    # pixels, which are the noisiest. A segment that has less than a thousandth of every version keeps its mean.
    colors, told = mean_colors(levels), []
    for end in map(levels.alone, range(len(levels.masses))):
        enough = end.masses >= max(1e-3 * float(end.masses.sum(axis=0).max()), 1e-12)
        told.append(np.where(enough, end.generators, np.nan))
    some = ~np.isnan(told).all(axis=(0, 2))
    colors[some] = np.nanmedian(np.array(told)[:, some], axis=0)
    return colors


#: The registry: names for `renormalize` and ``--renormalize``; "none" keeps the means.
RENORMALIZATIONS: dict[str, Callable[[Levels], Floats]] = {
    "range": range_colors,
    "median": median_colors,
    "none": mean_colors,
}

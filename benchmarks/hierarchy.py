"""Trees of regions beside other programs: regions and edges that people drew.

Every program is scored at every threshold of its own. "One threshold" is the best that serves all pictures (ODS),
"its best" the best of each picture (OIS), "default" the default cut of cvtimg, found on the training pictures.
Edges are compared within 0.75 % of the diagonal, without the one-to-one matching of the official benchmark, so they
are comparable here and not with published figures.

    python benchmarks/hierarchy.py [--quick] [--parts regions edges chances] [--set bsds bsds_train]
"""

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import permutations
from types import ModuleType
from typing import Any, Self
from unittest.mock import patch

import numpy as np
from common import DATA, Rows, parser, progress, run
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, maximum_filter
from scipy.optimize import curve_fit
from scipy.spatial import cKDTree
from segmentation import Divided, berkeley, metrics_of
from skimage import __version__ as skimage_version

from cvtimg import find_edges, segment_hierarchy
from cvtimg.segmentation.hierarchy import building, evidence
from cvtimg.segmentation.hierarchy.settings import SETTINGS, Settings

OURS = "cvtimg segment_hierarchy"
LEVELS = np.linspace(0.1, 1.2, 56)  # of evidence
#: Numbers of evidence that are chosen, and the step of powers.
CURVE = ("half_drawn", "drawn_power")
CHOSEN, STEP = ("view_powers", "inhibition", "surround"), 0.1

Labels = NDArray[Any]


def divided(given: argparse.Namespace) -> tuple[list[Divided], ModuleType]:
    """Read the pictures, and load the measures."""
    data = given.data or DATA
    pictures, metrics = berkeley(data / given.set, given.quick), metrics_of(data)
    if not pictures or metrics is None:
        sys.exit(f"no pictures that people divided in {data / given.set}, or no measures beside them")
    return pictures, metrics


# Regions


def regions(given: argparse.Namespace) -> Rows:
    """Score regions: PRI (high) / VOI (low) / covering (high); seconds of one call."""
    pictures, metrics = divided(given)
    rows = []
    for name, (thresholds, divide) in region_rivals().items():
        scores, seconds = [], []
        for number, picture in enumerate(pictures):
            progress(f"{name}: {number + 1} of {len(pictures)}")
            start = time.process_time()
            cuts = divide(picture.pixels)
            seconds.append(time.process_time() - start)
            scores.append([agreement(labels, picture.segments, metrics) for labels in cuts])
        rows.append({"rival": name, **summary(np.array(scores), np.array(thresholds))})
        rows[-1]["seconds"] = statistics.median(seconds) / (1 if name == OURS else len(thresholds))
    return rows


def agreement(labels: Labels, segments: NDArray[Any], metrics: ModuleType) -> tuple[float, float, float]:
    """PRI, VOI and covering, means over the people."""
    tables = [metrics.cont(labels, segment) for segment in segments]
    kinds = (metrics.ri, metrics.vi, metrics.covering)
    pri, voi, covering = (float(np.mean([kind(table) for table in tables])) for kind in kinds)
    return pri, voi, covering


def summary(scores: NDArray[np.float64], thresholds: NDArray[np.float64]) -> dict[str, str | None]:
    """Sum up (pictures, thresholds, 3) scores; a threshold of NaN stands for the default cut."""

    def text(values: NDArray[np.float64]) -> str:
        return f"{values[0]:.3f} / {values[1]:.3f} / {values[2]:.3f}"

    signs = np.array([1, -1, 1])
    is_default = np.isnan(thresholds)
    signed = signs * scores[:, ~is_default]
    return {
        "ods": text(signs * signed.mean(axis=0).max(axis=0)),
        "ois": text(signs * signed.max(axis=1).mean(axis=0)),
        "default": text(scores[:, is_default].mean(axis=(0, 1))) if is_default.any() else None,
    }


def region_rivals() -> dict[str, tuple[list[float], Callable[[NDArray[np.uint8]], Iterator[Labels] | list[Labels]]]]:
    """Name the programs: their thresholds, and what gives the labels at each."""
    from skimage.segmentation import felzenszwalb

    levels = [float(level) for level in np.arange(2, 17) / 20]

    def ours(image: NDArray[np.uint8]) -> list[Labels]:
        tree = segment_hierarchy(image)
        return [tree.cut(), *(tree.cut(threshold=level) for level in levels)]

    scales = [100.0, 200, 400, 600, 900, 1300]

    def graph_based(image: NDArray[np.uint8]) -> list[Labels]:
        return [felzenszwalb(image, scale=scale, sigma=0.8, min_size=int(scale / 4)) + 1 for scale in scales]

    return {OURS: ([np.nan, *levels], ours), f"scikit-image {skimage_version} felzenszwalb": (scales, graph_based)}


# Edges


def edges(given: argparse.Namespace) -> Rows:
    """Score edges: the F of one threshold for all pictures, and of the best for each, over the pixels of all."""
    pictures, metrics = divided(given)
    rows = []
    for name, find in edge_rivals().items():
        counts = []
        for number, picture in enumerate(pictures):
            progress(f"{name}: {number + 1} of {len(pictures)}")
            maps = find(picture.pixels)
            counts.append([metrics.boundary_counts(lines.astype(float), picture.borders, [0.5])[0] for lines in maps])
        f_ods, f_ois = metrics.boundary_f(np.array(counts))
        rows.append({"rival": name, "f_ods": float(f_ods), "f_ois": float(f_ois)})
    return rows


def edge_rivals() -> dict[str, Callable[[NDArray[np.uint8]], list[NDArray[np.bool_]]]]:
    """Name the programs, and what gives the edges at each of their thresholds."""
    from skimage.color import rgb2gray
    from skimage.feature import canny
    from skimage.filters import apply_hysteresis_threshold, gaussian, sobel
    from skimage.segmentation import felzenszwalb

    def ours(image: NDArray[np.uint8]) -> list[NDArray[np.bool_]]:
        chances = segment_hierarchy(image).find_edges(strength=True)
        return [chances >= level for level in np.arange(1, 36) / 40]

    def canny_edges(image: NDArray[np.uint8]) -> list[NDArray[np.bool_]]:
        grey = rgb2gray(image)
        return [canny(grey, 2, 0.4 * high, high) for high in (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4)]

    def sobel_edges(image: NDArray[np.uint8]) -> list[NDArray[np.bool_]]:
        steps = sobel(gaussian(rgb2gray(image), 2))
        levels = (0.02, 0.03, 0.04, 0.05, 0.065, 0.08, 0.1, 0.13)
        return [apply_hysteresis_threshold(steps, level / 2, level) for level in levels]

    def region_edges(image: NDArray[np.uint8]) -> list[NDArray[np.bool_]]:
        scales = (100, 200, 400, 600, 900, 1300, 2000)
        return [find_edges(felzenszwalb(image, scale, 0.8, min_size=scale // 4) + 1) for scale in scales]

    return {
        f"{OURS}, find_edges": ours,
        f"scikit-image {skimage_version} canny, sigma 2": canny_edges,
        f"scikit-image {skimage_version} sobel, sigma 2, hysteresis": sobel_edges,
        f"scikit-image {skimage_version} borders of felzenszwalb": region_edges,
    }


# What the chances of edges are: powers of evidence, and the curve


@dataclass(frozen=True, slots=True, eq=False)
class Watched:
    """The borders of leaves of a picture, and what people drew near them."""

    asked: tuple[Any, ...]  # arguments of `evidence_of`
    right: NDArray[np.intp]  # (B,): cracks of each border within the tolerance of what anybody drew
    near: NDArray[np.intp]  # (N,): borders within the tolerance of pixels that people drew, for one after the other
    starts: NDArray[np.intp]  # (P,): where those of each pixel begin
    n_drawn: int  # pixels, of all people, also those without a border near them

    @classmethod
    def of(cls, picture: Divided, asked: tuple[Any, ...]) -> Self:
        """Compare the borders with what people drew."""
        borders, _, inside = asked
        off = SETTINGS.drawing_accuracy * np.hypot(*inside.shape)
        is_right = distance_transform_edt(~picture.borders.any(axis=0))[tuple(borders.places.T)] <= off
        drawn = np.argwhere(picture.borders)[:, 1:]
        lists = [cracks for cracks in cKDTree(borders.places).query_ball_point(drawn, off) if cracks]
        border_of = np.repeat(np.arange(len(borders.lengths)), borders.lengths)
        return cls(
            asked,
            np.add.reduceat(is_right.astype(np.intp), borders.starts[:-1]),
            border_of[np.concatenate(lists).astype(np.intp)],
            np.cumsum([0, *map(len, lists[:-1])]),
            len(drawn),
        )

    def counts(self) -> NDArray[np.float64]:
        """(T, 4) cracks that are right, all, drawn pixels near one, all, for each level of the present evidence."""
        levels, lengths = evidence.evidence_of(*self.asked), self.asked[0].lengths
        best = np.maximum.reduceat(levels[self.near], self.starts)
        rows = [(self.right[levels >= t].sum(), lengths[levels >= t].sum(), (best >= t).sum()) for t in LEVELS]
        return np.column_stack([np.array(rows, float), np.full(len(LEVELS), self.n_drawn)])


def steps_from(settings: Settings) -> Iterator[Settings]:
    """Yield settings of evidence beside some: powers have the sum 1, as evidence is told apart by its order."""
    for more, less in permutations(range(3), 2):
        powers = np.array(settings.view_powers)
        powers[[more, less]] += [STEP, -STEP]
        if powers.min() > -1e-9:
            yield replace(settings, view_powers=tuple(powers.round(2).tolist()))
    for inhibition in (settings.inhibition - STEP, settings.inhibition + STEP):
        if inhibition > -1e-9:
            yield replace(settings, inhibition=round(inhibition, 2))
    for factor in (0.5, 2.0):
        yield replace(settings, surround=settings.surround * factor)


def chances(given: argparse.Namespace) -> Rows:
    """Choose the numbers of evidence, by steps from like powers, and fit the curve of chances; on bsds_train."""
    pictures, metrics = divided(given)
    asked: list[tuple[Any, ...]] = []
    with patch.object(building, "evidence_of", lambda *about: asked.append(about) or evidence.evidence_of(*about)):
        for number, picture in enumerate(pictures):
            progress(f"chances: {number + 1} of {len(pictures)}")
            segment_hierarchy(picture.pixels)
    watched = [Watched.of(*each) for each in zip(pictures, asked, strict=True)]
    rows: Rows = []

    def score(settings: Settings) -> float:
        progress(f"chances: {len(rows)} settings")
        with patch.object(evidence, "SETTINGS", settings):
            f_ods, f_ois = metrics.boundary_f(np.array([each.counts() for each in watched]))
        numbers = {name: getattr(settings, name) for name in CHOSEN}
        rows.append({**numbers, "f_ods": float(f_ods), "f_ois": float(f_ois)})
        return float(f_ods + f_ois)

    best = replace(SETTINGS, view_powers=(0.4, 0.3, 0.3), inhibition=0.0, surround=1 / 16)
    most, before = score(best), None
    while best != before:
        before = best
        scores = [(score(settings), number, settings) for number, settings in enumerate(steps_from(best))]
        if max(scores)[0] > most:
            most, _, best = max(scores)
    score(SETTINGS)
    with patch.object(evidence, "SETTINGS", best):
        known, share = np.concatenate([drawn(*each) for each in zip(pictures, asked, strict=True)], axis=1)
    curve, _ = curve_fit(lambda e, h, p: 1 / (1 + (h / e) ** p), known, share, (0.5, 2.0))
    chosen = {name: getattr(best, name) for name in CHOSEN} | dict(zip(CURVE, map(float, curve), strict=True))
    print("\nchosen:", chosen, "\nin the record:", {name: getattr(SETTINGS, name) for name in chosen})
    return rows


def drawn(picture: Divided, asked: tuple[Any, ...]) -> NDArray[np.float64]:
    """(2, P) evidence of edges as `find_edges` draws them, and the share of people who drew them."""
    from skimage.morphology import thin

    seen = asked[0].on_pixels(evidence.evidence_of(*asked), asked[2].shape)
    off = SETTINGS.drawing_accuracy * np.hypot(*seen.shape)
    share = np.mean([distance_transform_edt(~drawn) <= off for drawn in picture.borders], axis=0)
    lines = thin(seen > 0)
    return np.stack([np.maximum(seen, maximum_filter(np.where(lines, 0, seen), 3))[lines], share[lines]])


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--set", default="bsds", choices=("bsds", "bsds_train"), help="pictures (default: bsds)")
    run(read, regions, edges, chances)

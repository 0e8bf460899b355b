"""Placement in the plane: passes over pictures, descents, and exact polygons.

Prints milliseconds of a pass over a picture and its ratio to `scipy.spatial.cKDTree.query` over the same pixels;
processor seconds and energy of each effort against the best of some long runs; seconds and memory of a million
generators; and how far centroids are from those of exact polygons.

    python benchmarks/plane.py [--quick] [--parts passes descents centroids million]
"""

import argparse
import resource
import time
from functools import partial

import numpy as np
from common import DATA, SAMPLES, Rows, cpu_seconds, parser, run, timed
from numpy.typing import NDArray
from PIL import Image

PASSES = {1: (1000, 1000), 12: (3000, 4000)}
COUNTS = (1000, 20_000, 100_000)


def photograph(megapixels: float) -> NDArray[np.float32]:
    """Return the squared darkness of a photograph, enlarged to about so many megapixels."""
    paths = [DATA / "kodak" / "kodim05.png", SAMPLES / "coffee.png"]
    with Image.open(next(path for path in paths if path.exists())) as image:
        factor = (megapixels * 1e6 / (image.width * image.height)) ** 0.5
        size = (round(image.width * factor), round(image.height * factor))
        grey = np.asarray(image.convert("L").resize(size, Image.Resampling.BICUBIC), np.float32)
    density: NDArray[np.float32] = (1 - grey / 255) ** 2
    return density


def passes(given: argparse.Namespace) -> Rows:
    """Time passes over uniform densities, and the tree that finds the nearest generator of each pixel."""
    from scipy.spatial import cKDTree

    from cvtimg.placement import PixelMoments

    rows = []
    for megapixels, (height, width) in PASSES.items():
        rng = np.random.default_rng(0)
        moments = PixelMoments(rng.random((height, width), np.float32))
        y, x = np.mgrid[:height, :width] + 0.5
        centers = np.stack([x.ravel(), y.ravel()], axis=1)
        for n in COUNTS:
            points = rng.random((n, 2)) * [width, height]
            for _ in range(3):
                points = moments(points).centroids
            ours = min(cpu_seconds(partial(moments, points), 3 if given.quick else 15))
            labels = min(cpu_seconds(partial(moments.labels, points), 3 if given.quick else 7))
            theirs = min(cpu_seconds(partial(cKDTree(points).query, centers), 1))
            row = {"megapixels": megapixels, "n": n, "ms": ours * 1e3, "labels_ms": labels * 1e3}
            rows.append({**row, "ckdtree_ms": theirs * 1e3, "ratio": theirs / ours})
    return rows


def descents(given: argparse.Namespace) -> Rows:
    """Efforts on a megapixel against the best of long runs from other seeds."""
    from cvtimg import place_generators

    density = photograph(1)
    rows = []
    for n in (20_000,) if given.quick else (20_000, 100_000):
        seeds = range(1, 3 if given.quick else 6)  # of long runs, whose best is the measure of all others
        best = min(place_generators(None, n, density=density, effort="best", rng=seed).energy for seed in seeds)
        for effort in ("fast", "balanced"):
            placement, seconds = timed(
                lambda n=n, e=effort: place_generators(None, n, density=density, effort=e), time.process_time
            )
            over = placement.energy / best - 1
            rows.append({"n": n, "effort": effort, "seconds": seconds, "passes": placement.n_iter, "over_best": over})
    return rows


def million(given: argparse.Namespace) -> Rows:
    """Place a million generators on 24 megapixels."""
    if given.quick:
        return []
    from cvtimg import place_generators

    density = photograph(24)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    placement, seconds = timed(lambda: place_generators(None, 1_000_000, density=density), time.process_time)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    row = {"n": 1_000_000, "megapixels": density.size / 1e6, "seconds": seconds, "peak_mib": peak / 1024}
    row |= {"over_start_mib": (peak - before) / 1024, "empty": int((placement.masses == 0).sum())}
    return [row]


def centroids(given: argparse.Namespace) -> Rows:
    """Centroids for a constant density: largest error of those of pixels, by the spacing."""
    from cvtimg.placement import Box, ConstantDensity, PixelMoments, PolygonMoments

    rows = []
    for n in (1000,) if given.quick else (1000, 10_000):
        points = np.random.default_rng(0).random((n, 2))
        exact, seconds = timed(lambda p=points: PolygonMoments(Box([0, 0], [1, 1]), ConstantDensity())(p))
        side = 2048
        pixels = PixelMoments(np.ones((side, side), np.float32), scale=side)(points)
        off = np.abs(pixels.centroids - exact.centroids).max() * n**0.5
        rows.append({"n": n, "pixels": off, "polygons_s": seconds})
    return rows


if __name__ == "__main__":
    run(parser(__doc__), passes, descents, centroids, million)

"""Segmentation beside other programs: noise, pictures that people divided, energies, superpixels.

Prints four parts: accuracy on three drawn shapes under noise; agreement with the human segmentations of the Berkeley
pictures, if they are there; energies beside those of expansion over pixels; superpixels beside SLIC.

    python benchmarks/segmentation.py [--quick] [--parts noise bsds energy cells]
"""

import argparse
import importlib.metadata
import importlib.util
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from common import DATA, SAMPLES, Rows, parser, progress, read_rgb, run, timed
from numpy.typing import NDArray

from cvtimg import segment, segment_hierarchy, superpixels
from cvtimg.labels import connected_pieces, region_means

SIGMAS = (0.25, 0.5, 1.0)
N_SUPERPIXELS, EDGE_WEIGHT = 400, 600.0

Labels = NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Divided:
    """A picture with the segments that people see in it, and the borders of these."""

    name: str
    pixels: NDArray[np.uint8]
    segments: NDArray[Any]
    borders: NDArray[np.bool_]


def three_shapes(size: int = 256) -> NDArray[np.bool_]:
    """Draw a disc, a rectangle and a triangle."""
    rows, columns = np.mgrid[:size, :size] * (256 / size)
    disc = (rows - 80) ** 2 + (columns - 80) ** 2 < 45**2
    rectangle = (rows >= 50) & (rows < 120) & (columns >= 150) & (columns < 225)
    triangle = (rows >= 150) & (rows < 230) & (abs(columns - 130) <= 0.875 * (rows - 150))
    return disc | rectangle | triangle


def bright(values: NDArray[Any], labels: Labels) -> NDArray[np.bool_]:
    """Tell the brighter of two labels."""
    first = labels == labels.flat[0]
    return first if first.all() or values[first].mean() > values[~first].mean() else ~first


def two_phase_rivals() -> dict[str, Callable[[NDArray[np.float64]], Labels]]:
    """Name the ways to find the shapes."""
    from scipy.ndimage import gaussian_filter
    from skimage.segmentation import chan_vese

    return {
        "cvtimg segment": lambda image: segment(image, 2).labels,
        "cvtimg segment, edge_weight=0 (k-means)": lambda image: segment(image, 2, edge_weight=0).labels,
        "Gaussian 1, then k-means": lambda image: segment(gaussian_filter(image, 1), 2, edge_weight=0).labels,
        "Gaussian 2, then k-means": lambda image: segment(gaussian_filter(image, 2), 2, edge_weight=0).labels,
        f"{skimage()} chan_vese": lambda image: chan_vese(image).astype(int),
        f"{skimage()} chan_vese, mu=0.03": lambda image: chan_vese(image, mu=0.03).astype(int),
    }


def noise(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """Measure percents of pixels right on three shapes of contrast 1 under noise, 256 x 256."""
    truth = three_shapes()
    rows: Rows = []
    for name, find in two_phase_rivals().items():
        for sigma in SIGMAS:
            progress(f"noise: {name} {sigma}")
            for seed in range(2 if given.quick else 5):
                image = truth + np.random.default_rng(seed).normal(0, sigma, truth.shape)
                found, seconds = timed(lambda find=find, image=image: find(image), time.process_time)
                accuracy = float((bright(image, found) == truth).mean())
                rows.append({"part": "noise", "rival": name, "sigma": sigma, "seed": seed, "accuracy": accuracy})
                rows[-1]["seconds"] = seconds
    table = []
    for name in dict.fromkeys(row["rival"] for row in rows):
        own = [row for row in rows if row["rival"] == name]
        means = [100 * statistics.mean(row["accuracy"] for row in own if row["sigma"] == sigma) for sigma in SIGMAS]
        seconds = statistics.median(row["seconds"] for row in own)
        table.append({"": name, **dict(zip(map("sigma {}".format, SIGMAS), means, strict=True)), "seconds": seconds})
    return rows, table


def berkeley(folder: Path, quick: bool) -> list[Divided]:
    """Read the pictures of a folder of the Berkeley set with their human segmentations."""
    found = []
    for path in sorted(folder.glob("*.jpg"))[:: 4 if quick else 1]:
        with np.load(path.with_name(f"{path.stem}_gt.npz")) as truth:
            if "boundaries" in truth:
                borders = truth["boundaries"]
            else:
                shape = truth["shape"]
                borders = np.unpackbits(truth["boundaries_packed"])[: np.prod(shape)].reshape(shape).astype(bool)
            found.append(Divided(path.stem, read_rgb(path), truth["segmentation"], borders))
    return found


def measured(rivals: dict[str, Callable[[NDArray[np.uint8]], Labels]], given: argparse.Namespace) -> Rows:
    """Score each rival on each picture."""
    data = given.data or DATA
    pictures, metrics = berkeley(data / "bsds", given.quick), metrics_of(data)
    if metrics is None or not pictures:
        print(f"Left out, for {data / 'bsds'} or the measures beside it are not there.", file=sys.stderr)
        return []
    rows = []
    for name, divide in rivals.items():
        for picture in pictures:
            progress(f"{name} {picture.name}")
            labels, seconds = timed(lambda divide=divide, picture=picture: divide(picture.pixels), time.process_time)
            scores = metrics.scores(labels, picture.segments, picture.borders)
            found = {"rival": name, "picture": picture.name, "specks": specks(labels)}
            rows.append({**found, **scores, "seconds": seconds})
    return rows


def specks(labels: Labels) -> float:
    """Count connected regions of less than 20 pixels, for each 10,000 pixels."""
    sizes = np.bincount(connected_pieces(labels + 1).ravel())[1:]
    return 1e4 * float((sizes < 20).sum()) / labels.size


def means_of(rows: Rows, columns: dict[str, str]) -> Rows:
    """Return the means over the pictures."""
    table = []
    for name in dict.fromkeys(row["rival"] for row in rows):
        own = [row for row in rows if row["rival"] == name]
        means = {column: statistics.mean(float(row[key]) for row in own) for key, column in columns.items()}
        table.append({"": name, **means, "seconds": statistics.median(row["seconds"] for row in own)})
    return table


def bsds(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """Compare with human segmentations of Berkeley pictures."""
    from skimage.color import rgb2gray
    from skimage.filters import gaussian, sobel
    from skimage.graph import cut_threshold, rag_mean_color
    from skimage.segmentation import chan_vese, felzenszwalb, slic, watershed

    def merged(image: NDArray[np.uint8]) -> Labels:
        cells = slic(image, N_SUPERPIXELS)
        return np.asarray(cut_threshold(cells, rag_mean_color(image, cells), 29))

    rivals: dict[str, Callable[[NDArray[np.uint8]], Labels]] = {
        "cvtimg segment_hierarchy": lambda image: segment_hierarchy(image).cut(),
        "cvtimg segment, K = 4": lambda image: segment(image, 4).labels,
        "cvtimg segment, K = 4, effort best": lambda image: segment(image, 4, effort="best").labels,
        "cvtimg segment, K = 4, edge_weight=0 (k-means)": lambda image: segment(image, 4, edge_weight=0).labels,
        f"{skimage()} chan_vese, gray": lambda image: chan_vese(rgb2gray(image)).astype(np.int32),
        f"{skimage()} felzenszwalb, scale 600": lambda image: felzenszwalb(image, scale=600),
        f"{skimage()} watershed of sobel, 40": lambda image: watershed(sobel(gaussian(rgb2gray(image), 2)), markers=40),
        f"{skimage()} slic, 400, merged at 29": merged,
    }
    rows = measured(rivals, given)
    columns = {"PRI": "PRI (high)", "VOI": "VOI (low)", "COV": "covering (high)", "BR2": "boundary recall"}
    columns |= {"bP": "precision", "specks": "specks", "n": "segments"}
    return rows, means_of(rows, columns)


def energy(given: argparse.Namespace) -> Rows:
    """Compare the energy of six segments at one edge weight: shares of that of k-means, and seconds."""
    rows: Rows = []
    for name in ("chelsea", "coffee"):
        image = read_rgb(SAMPLES / f"{name}.png")[::2, ::2].astype(np.float64)
        start = segment(image / 255, 6, edge_weight=0).labels
        ways: dict[str, Callable[[], Labels]] = {
            "k-means": lambda start=start: start,
            "cvtimg segment": lambda image=image: segment(image / 255, 6, edge_weight=EDGE_WEIGHT).labels,
            "cvtimg segment, effort best": lambda image=image: (
                segment(image / 255, 6, edge_weight=EDGE_WEIGHT, effort="best").labels
            ),
        }
        if importlib.util.find_spec("maxflow"):
            ways["PyMaxflow, expansion over pixels"] = lambda image=image, start=start: expanded(image, start)
        for rival, divide in ways.items():
            progress(f"energy: {name}, {rival}")
            labels, seconds = timed(divide, time.process_time)
            rows.append({"picture": name, "rival": rival, "energy": energy_of(image, labels), "seconds": seconds})
            rows[-1]["share"] = rows[-1]["energy"] / next(row["energy"] for row in rows if row["picture"] == name)
    return rows


def pairs(shape: tuple[int, ...]) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """List the pixels and their neighbors within 3 pixels, by flat numbers, each pair once."""
    numbers, (height, width) = np.arange(np.prod(shape)).reshape(shape), shape
    steps = [(y, x) for y in range(4) for x in range(-3, 4) if (y, x) > (0, 0) and y * y + x * x <= 9]
    return [
        (
            numbers[: height - y, max(-x, 0) : width - max(x, 0)].ravel(),
            numbers[y:, max(x, 0) : width + min(x, 0)].ravel(),
        )
        for y, x in steps
    ]


def energy_of(image: NDArray[np.float64], labels: Labels) -> float:
    """Return the energy at the edge weight."""
    flat, apart = labels.ravel(), image - region_means(labels, image)[labels]
    borders = sum(np.count_nonzero(flat[one] != flat[other]) for one, other in pairs(labels.shape))
    return float(np.square(apart).sum() + 2 * EDGE_WEIGHT * borders)


def expanded(image: NDArray[np.float64], labels: Labels) -> Labels:
    """Let each segment take the set of pixels that lowers the energy most, twice: Boykov, Veksler and Zabih 2001."""
    import maxflow

    near, rows, own = pairs(labels.shape), image.reshape(-1, image.shape[2]), labels.ravel() - 1
    cost = 2.0 * EDGE_WEIGHT
    for label in [*range(own.max() + 1)] * 2:
        means = region_means(own.reshape(labels.shape) + 1, image)[1:]
        costs = np.stack([np.square(rows - mean).sum(axis=1) for mean in means])
        supplies, free = costs[label] - costs[own, np.arange(len(own))], own != label
        graph = maxflow.Graph[float](len(own), len(own) * len(near))
        nodes = graph.add_nodes(len(own))
        for one, other in near:
            both, now = free[one] & free[other], cost * (own[one] != own[other])
            np.add.at(supplies, one, np.where(both, cost - now, np.where(free[one] & ~free[other], -cost, 0)))
            np.add.at(supplies, other, np.where(both | (free[other] & ~free[one]), -cost, 0))
            graph.add_edges(one[both], other[both], 2 * cost - now[both], np.zeros(both.sum()))
        supplies[~free] = 0
        graph.add_grid_tedges(nodes, np.maximum(supplies, 0), np.maximum(-supplies, 0))
        graph.maxflow()
        own = np.where(graph.get_grid_segments(nodes) & free, label, own)
    return own.reshape(labels.shape) + 1


def cells(given: argparse.Namespace) -> tuple[Rows, Rows]:
    """Compare superpixels; SLIC gives fewer than it is asked for, so it is asked for more too."""
    from skimage.segmentation import slic

    rivals: dict[str, Callable[[NDArray[np.uint8]], Labels]] = {
        "cvtimg superpixels, rgb": lambda image: superpixels(image, N_SUPERPIXELS).labels,
        "cvtimg superpixels, lab": lambda image: superpixels(image, N_SUPERPIXELS, space="lab").labels,
        f"{skimage()} slic, {N_SUPERPIXELS}": lambda image: slic(image, N_SUPERPIXELS),
        f"{skimage()} slic, {N_SUPERPIXELS * 27 // 20}": lambda image: slic(image, N_SUPERPIXELS * 27 // 20),
    }
    rows = measured(rivals, given)
    columns = {"BR2": "boundary recall (high)", "UE": "undersegmentation (low)", "ASA": "achievable", "n": "cells"}
    return rows, means_of(rows, columns)


def skimage() -> str:
    """Name the version of scikit-image."""
    return f"scikit-image {importlib.metadata.version('scikit-image')}"


def metrics_of(data: Path) -> ModuleType | None:
    """Load the measures, which lie beside the data."""
    path = data.parent / "measure" / "segmentation_metrics.py"
    spec = importlib.util.spec_from_file_location("segmentation_metrics", path)
    if not path.exists() or spec is None or spec.loader is None:
        return None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


if __name__ == "__main__":
    run(parser(__doc__), noise, bsds, energy, cells)

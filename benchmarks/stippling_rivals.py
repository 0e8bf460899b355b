"""Stippling beside d3-delaunay, the package stippler and LBG stippling, with one density and one number of dots.

    python benchmarks/stippling_rivals.py [--quick] [--node-modules DIR]

d3-delaunay runs in Node.js: `npm install --prefix DIR d3-delaunay`, and give DIR. Energies are those of one exact pass
over the same density; times are processor seconds from the density to the points.
"""

import argparse
import importlib.metadata
import json
import shutil
import subprocess
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import Rows, parser, run, timed
from numpy.typing import NDArray
from PIL import Image
from stippling import MAX_INK, errors, photographs

import cvtimg
from cvtimg import place_generators
from cvtimg.artwork import ink_coverage
from cvtimg.placement import PixelMoments

Row = dict[str, Any]
Points = NDArray[np.float64]
#: Iterations of the rivals: those of d3's notebook, and the default of stippler.
D3_ITERATIONS, STIPPLER_ITERATIONS = 80, 50
#: More dots than this take stippler minutes.
STIPPLER_MOST = 5000
#: LBG: iterations, and the share of a dot that a cell may be off, at first and more each time.
LBG_ITERATIONS, LBG_OFF, LBG_GROWTH = 50, 0.6, 0.01


def by_density(density: NDArray[np.float32], n_dots: int) -> Points:
    """Draw places with the probability of the density, as the rivals start."""
    rng = np.random.default_rng(1)
    sums = np.cumsum(density, dtype=np.float64)
    pixels = np.minimum(np.searchsorted(sums, rng.random(n_dots) * sums[-1]), density.size - 1)
    corners = np.stack([pixels % density.shape[1], pixels // density.shape[1]], axis=1)
    return corners + rng.random((n_dots, 2))


def d3(density: NDArray[np.float32], n_dots: int, modules: Path) -> tuple[Points, float]:
    """Run the iterations of d3's notebook; its own processor seconds without the start of Node.js."""
    with tempfile.TemporaryDirectory(dir=modules) as folder:
        where = Path(folder)
        script = shutil.copy(Path(__file__).with_name("d3_stippling.mjs"), where)
        density.tofile(where / "density")
        by_density(density, n_dots).tofile(where / "points")
        height, width = density.shape
        arguments = ["density", width, height, "points", n_dots, D3_ITERATIONS, "output"]
        command = ["node", script, *map(str, arguments)]
        done = subprocess.run(command, cwd=where, check=True, capture_output=True, text=True)
        return np.fromfile(where / "output").reshape(-1, 2), float(done.stdout)


def stippler(density: NDArray[np.float32], n_dots: int) -> tuple[Points, float]:
    """Run the relaxation of the package."""
    from stippler import pipeline

    rows = density.astype(np.float64).cumsum(axis=1)
    start = by_density(density, n_dots)
    relax = partial(pipeline.relax, start, density, rows, rows.cumsum(axis=1), n_iter=STIPPLER_ITERATIONS)
    return timed(relax, time.process_time)


def lbg(ink: NDArray[np.float32], n_dots: int) -> Points:
    """Linde-Buzo-Gray stippling on the passes of cvtimg: cells with too much ink split, those with too little go.

    O. Deussen, M. Spicker, Q. Zheng, Weighted Linde-Buzo-Gray stippling, ACM Trans. Graphics 36 (2017), doi
    10.1145/3130800.3130819.
    """
    rng = np.random.default_rng(0)
    moments = PixelMoments(ink)
    share = moments.mass / n_dots
    size = np.array(ink.shape[::-1], np.float64)
    points = by_density(ink, n_dots // 4)
    for iteration in range(LBG_ITERATIONS):
        found = moments(points)
        off = (LBG_OFF + LBG_GROWTH * iteration) / 2
        split, kept = found.masses > (1 + off) * share, found.masses >= (1 - off) * share
        if iteration == LBG_ITERATIONS - 1:
            break
        turn = 2 * np.pi * rng.random(split.sum())
        aside = np.stack([np.cos(turn), np.sin(turn)], axis=1) * np.sqrt(ink.size / n_dots / np.pi) / 2
        centers = found.centroids
        points = np.concatenate([centers[kept & ~split], centers[split] + aside, centers[split] - aside])
        points = np.clip(points, 0, size)
    return found.centroids[found.masses > 0]


def compare(gray: NDArray[np.uint8], n_dots: int, asked: argparse.Namespace) -> list[Row]:
    """Run all that is here, on the squared ink of one image."""
    wanted = np.float32(MAX_INK) * ink_coverage(gray)
    density = np.square(wanted)
    energies = PixelMoments(density)
    runs: dict[str, tuple[Points, float]] = {
        "cvtimg place_generators": timed(
            lambda: place_generators(None, n_dots, density=density).points, time.process_time
        ),
        'cvtimg place_generators, "fast"': timed(
            lambda: place_generators(None, n_dots, density=density, effort="fast").points, time.process_time
        ),
        "cvtimg stipple": timed(
            lambda: cvtimg.stipple(gray, n_dots, max_ink=MAX_INK, tones="true").points, time.process_time
        ),
        "LBG, our port of the paper": timed(partial(lbg, wanted, n_dots), time.process_time),
    }
    modules = asked.node_modules
    if modules is not None and shutil.which("node"):
        about = json.loads((modules / "node_modules" / "d3-delaunay" / "package.json").read_text())
        runs[f"d3-delaunay {about['version']}"] = d3(density, n_dots, modules)
    else:
        print("d3-delaunay: no --node-modules or no Node.js, skipped")
    try:
        version = importlib.metadata.version("stippler")
    except importlib.metadata.PackageNotFoundError:
        print("stippler is not installed, skipped")
    else:
        if n_dots <= STIPPLER_MOST:
            runs[f"stippler {version}"] = stippler(density, n_dots)
    points, seconds = runs["cvtimg place_generators"]
    least = energies(points).energy
    rows = []
    for name, (places, spent) in runs.items():
        radii = np.full(len(places), np.sqrt(wanted.sum() / len(places) / np.pi))
        row = {"who": name, "dots": len(places), "s": spent, "times": spent / seconds}
        over = energies(places).energy / least - 1
        rows.append({**row, "energy_over": over, **errors(places, radii, wanted)})
    return rows


def rivals(given: argparse.Namespace) -> Rows:
    """Seconds and energy over those of cvtimg, PSNR in dB and error of tones in %."""
    rows = []
    images = photographs(0.25 if given.quick else 1.0, quick=False)
    for name in [name for name in ("camera", "kodim05") if name in images][: 1 if given.quick else 2]:
        gray = np.asarray(Image.fromarray(images[name]).convert("L"))
        for n_dots in (2000,) if given.quick else (5000, 20_000):
            rows += [{"image": name, **row} for row in compare(gray, n_dots, given)]
    return rows


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--node-modules", type=Path, metavar="DIR", help="folder with node_modules/d3-delaunay")
    run(read, rivals)

"""Designs of experiments: ten methods by six measures, and errors of interpolation from 100 points.

Methods are those of M. Gunzburger's lecture, and our Latin CVT; Latin hypercubes of SciPy, diversipy and pydoe are its
rivals. Measures are those of `cvtimg.point_measures`: of each, less is more even. Interpolation is by cubic radial
basis functions at 4,096 places, of 48 functions: ridges, peaks, sums of one-dimensional ones, and two active inputs.

    python benchmarks/designs.py [--quick] [--parts measures interpolation] [--effort best]
"""

import argparse
import random
import time
from collections.abc import Callable
from dataclasses import asdict
from importlib.util import find_spec
from typing import Any

import numpy as np
from common import Rows, parser, run, timed
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator
from scipy.spatial.distance import pdist
from scipy.stats import qmc

Points = NDArray[np.float64]
Row = dict[str, Any]
DIMS, COUNTS = (2, 3, 7), (100, 1000)
MEASURES = ("discrepancy", "h", "chi", "tau", "d", "energy")
#: The greatest designs of methods in pure Python.
SLOW = 100
#: What is measured of designs in batches.
BATCHES = ("distance", "discrepancy", "distance_of_batches", "discrepancy_of_batches", "seconds")


def hammersley(n: int, n_dims: int) -> Points:
    """Take pydoe's Hammersley sequence."""
    from pydoe import hammersley_sequence

    return np.asarray(hammersley_sequence(n, n_dims))


def improved_latin(n: int, n_dims: int) -> Points:
    """Take diversipy's improved Latin hypercube (IHS)."""
    from diversipy.hycusampling import improved_lhd_matrix

    random.seed(0)
    return (np.asarray(improved_lhd_matrix(n, n_dims), float) + 0.5) / n


def maximin(n: int, n_dims: int) -> Points:
    """Take pydoe's Latin hypercube with the greatest least distance of a few."""
    from pydoe import lhs

    np.random.seed(0)
    return np.asarray(lhs(n_dims, samples=n, criterion="maximin", iterations=20))


def methods(effort: str, seed: int = 0) -> dict[str, Callable[[int, int], Points]]:
    """Name all ways to make n points of the unit cube."""
    from cvtimg import design, latinize

    def cvt(n: int, d: int, latin: bool = False, periodic: bool = False) -> Points:
        return design(n, d, latin=latin, periodic=periodic, effort=effort, rng=seed).unit_points

    return {
        "Monte Carlo": lambda n, d: np.random.default_rng(seed).random((n, d)),
        "Halton": lambda n, d: qmc.Halton(d, scramble=False).random(n + 1)[1:],
        "Hammersley": hammersley,
        "Sobol": lambda n, d: qmc.Sobol(d, rng=seed).random(n),
        "LHS": lambda n, d: qmc.LatinHypercube(d, rng=seed).random(n),
        "IHS (diversipy)": improved_latin,
        "CVT": cvt,
        "CVTP": lambda n, d: cvt(n, d, periodic=True),
        "LCVT, Latinized": lambda n, d: latinize(cvt(n, d)),
        "LCVTP, Latinized": lambda n, d: latinize(cvt(n, d, periodic=True)),
        "Latin CVT (default)": lambda n, d: cvt(n, d, latin=True),
        "LHS random-cd (SciPy)": lambda n, d: qmc.LatinHypercube(d, optimization="random-cd", rng=seed).random(n),
        "LHS maximin (pydoe)": maximin,
    }


def measures(given: argparse.Namespace) -> Rows:
    """Measure designs by all methods."""
    from cvtimg import point_measures

    rows: list[Row] = []
    for n_dims in DIMS:
        for n in COUNTS[:1] if given.quick else COUNTS:
            for name, make in methods(given.effort).items():
                if n > SLOW and name.startswith(("IHS", "LHS maximin", "LHS random-cd")):
                    continue
                try:
                    points, seconds = timed(lambda m=make, n=n, d=n_dims: m(n, d), time.process_time)
                except ImportError as error:
                    print(f"{name}: {error}")
                    continue
                found = {key: value for key, value in asdict(point_measures(points)).items() if key in MEASURES}
                rows.append({"dimensions": n_dims, "n": n, "method": name, **found, "seconds": seconds})
    return rows


def criteria(given: argparse.Namespace) -> Rows:
    """Compare designs for a criterion with those of others by three measures; means over a few seeds."""
    from cvtimg import design

    def enhanced(n: int, n_dims: int, seed: int) -> Points:
        from smt.sampling_methods import LHS

        return LHS(xlimits=np.tile([0.0, 1.0], (n_dims, 1)), criterion="ese", seed=seed)(n)

    ways: dict[str, Callable[[int, int, int], Points]] = {
        **{
            f"criterion={name!r}": lambda n, d, seed, name=name: (
                design(n, d, criterion=name, effort=given.effort, rng=seed).unit_points
            )
            for name in ("cvt", "maximin", "projection", "discrepancy")
        },
        **({"LHS ESE (smt)": enhanced} if find_spec("smt") else {}),
        "LHS random-cd (SciPy)": lambda n, d, seed: qmc.LatinHypercube(d, optimization="random-cd", rng=seed).random(n),
        "Sobol (SciPy)": lambda n, d, seed: qmc.Sobol(d, rng=seed).random(n),
    }
    rows: list[Row] = []
    for n, n_dims in ((20, 3), (50, 5), (100, 10)):
        for name, make in ways.items():
            figures = []
            for seed in range(1 if given.quick else 3):
                points, seconds = timed(lambda m=make, n=n, d=n_dims, s=seed: m(n, d, s), time.process_time)
                along = np.stack([pdist(axis[:, None], "sqeuclidean") for axis in points.T])
                projection = np.mean(1 / along.prod(axis=0)) ** (1 / n_dims)
                figures.append((pdist(points).min(), projection, qmc.discrepancy(points), seconds))
            means = dict(
                zip(("distance", "projection", "discrepancy", "seconds"), np.mean(figures, axis=0), strict=True)
            )
            rows.append({"n": n, "dimensions": n_dims, "method": name, **means})
    return rows


def batches(given: argparse.Namespace) -> Rows:
    """Compare designs in batches: ours, the same runs divided at random, and hypercubes for each batch."""
    from cvtimg import design
    from cvtimg.designs import Factor

    def sliced(n: int, n_dims: int, n_batches: int, seed: int) -> tuple[Points, Points]:
        levels = tuple("ABCDEFGH"[:n_batches])
        axes = [*(Factor(f"x{axis}") for axis in range(n_dims)), Factor("batch", levels=levels)]
        found = design(n, axes, effort=given.effort, rng=seed)
        return found.unit_points[:, :-1], axes[-1].levels_at(found.points[:, -1])

    def divided(n: int, n_dims: int, n_batches: int, seed: int) -> tuple[Points, Points]:
        points = design(n, n_dims, effort=given.effort, rng=seed).unit_points
        return points, np.random.default_rng(seed).permutation(np.arange(n) % n_batches)

    def joined(n: int, n_dims: int, n_batches: int, seed: int) -> tuple[Points, Points]:
        of_seed = np.random.default_rng(seed)
        parts = [
            qmc.LatinHypercube(n_dims, optimization="random-cd", rng=of_seed).random(n // n_batches)
            for _ in range(n_batches)
        ]
        return np.concatenate(parts), np.arange(n) // (n // n_batches)

    ways = {"levels": sliced, "divided at random": divided, "LHS random-cd a batch (SciPy)": joined}
    rows: list[Row] = []
    for n, n_dims, n_batches in ((30, 2, 3), (60, 5, 3), (100, 4, 5), (200, 8, 4)):
        for name, make in ways.items():
            figures = []
            for seed in range(1 if given.quick else 3):
                (points, labels), seconds = timed(
                    lambda m=make, n=n, d=n_dims, b=n_batches, s=seed: m(n, d, b, s), time.process_time
                )
                parts = [points[labels == label] for label in range(n_batches)]
                of_parts = np.mean([(pdist(part).min(), qmc.discrepancy(part)) for part in parts], axis=0)
                figures.append((pdist(points).min(), qmc.discrepancy(points), *of_parts, seconds))
            rows.append({"n": n, "dimensions": n_dims, "batches": n_batches, "method": name})
            rows[-1] |= dict(zip(BATCHES, np.mean(figures, axis=0).tolist(), strict=True))
    return rows


def functions(n_dims: int) -> list[Callable[[Points], NDArray[np.float64]]]:
    """Make 48 functions, of four kinds."""
    rng = np.random.default_rng(1)
    found: list[Callable[[Points], NDArray[np.float64]]] = []
    for _ in range(12):
        along = rng.normal(size=n_dims)
        along *= 4.5 / np.linalg.norm(along)
        phase, middle, sizes, waves = rng.random() * 6, rng.random(n_dims), rng.normal(size=n_dims), rng.random(n_dims)
        one, other = rng.permutation(n_dims)[:2]
        found += [
            lambda x, along=along, phase=phase: np.sin(x @ along + phase),
            lambda x, middle=middle: np.exp(-2 * ((x - middle) ** 2).sum(axis=1)),
            lambda x, sizes=sizes, waves=waves: (sizes * np.sin(6 * waves * x)).sum(axis=1),
            lambda x, one=one, other=other: np.sin(4 * x[:, one]) * np.cos(3 * x[:, other]),
        ]
    return found


def interpolation(given: argparse.Namespace) -> Rows:
    """Interpolate all functions from 100 points; of methods that draw, the mean over a few seeds."""
    rows = []
    chosen = ("Monte Carlo", "Halton", "LHS", "CVT", "Latin CVT (default)", "LHS random-cd (SciPy)")
    for n_dims in DIMS:
        places = qmc.Sobol(n_dims, rng=11).random(1 << 12)
        wanted = np.stack([function(places) for function in functions(n_dims)], axis=1)
        for name in chosen:
            squares = []
            for seed in range(2 if given.quick else 5):
                points = methods(given.effort, seed)[name](100, n_dims)
                values = np.stack([function(points) for function in functions(n_dims)], axis=1)
                error = RBFInterpolator(points, values, kernel="cubic", degree=1)(places) - wanted
                squares.append((error**2).mean(axis=0) / wanted.var(axis=0))
            # Functions differ in how hard they are: the geometric mean gives each its say.
            rows.append({"dimensions": n_dims, "method": name, "error": np.exp(np.log(squares).mean() / 2)})
    return rows


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--effort", default="balanced", choices=("fast", "balanced", "best"))
    run(read, measures, criteria, batches, interpolation)

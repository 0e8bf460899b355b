"""Radii of supports: overlap of covers by random, Halton and tessellation points, with seconds.

The overlap is the share of entries of the matrix of a meshless
method that are not zero. Uniform points, and points with the density exp(-3 |x|^2), which is centered on the region.

    python benchmarks/supports.py [--quick]
"""

import argparse
import time
from typing import Any

import numpy as np
from common import Rows, parser, run, timed
from numpy.typing import NDArray
from scipy.stats import qmc

Points = NDArray[np.float64]
COVERS = (1, 3)


def regions() -> dict[str, Any]:
    """Make the square and the disk, a polygon of 256 sides."""
    from cvtimg.placement import Box, PolygonRegion

    angles = np.arange(256) * np.pi / 128
    return {"square": Box([-1, -1], [1, 1]), "disk": PolygonRegion(np.stack([np.cos(angles), np.sin(angles)], axis=1))}


def gaussian(places: Points) -> NDArray[np.float64]:
    """Return the density that is not uniform."""
    return np.asarray(np.exp(-3 * (places**2).sum(axis=1)))


def points(kind: str, region: Any, n: int, density: Any) -> Points:
    """Make points of a kind; random and Halton points by rejection."""
    from cvtimg import place_generators

    if kind == "CVT":
        return place_generators(region, n, density=density).points
    draw = np.random.default_rng(0).random if kind == "random" else qmc.Halton(3, scramble=False).random
    cube = draw((64 * n, 3)) if kind == "random" else draw(64 * n + 1)[1:]
    places = 2 * cube[:, :2] - 1
    good = region.contains(places)
    if density is not None:
        good &= cube[:, 2] < density(places)
    return np.ascontiguousarray(places[good][:n])


def covers(given: argparse.Namespace) -> Rows:
    """Share of entries of the overlap that are not zero."""
    from cvtimg import support_radii

    rows = []
    for name, region in regions().items():
        for law, density in (("uniform", None), ("Gaussian", gaussian)):
            for n in (128,) if given.quick or density is not None else (128, 256, 512):
                for kind in ("random", "Halton", "CVT"):
                    where = points(kind, region, n, density)
                    row = {"region": name, "density": law, "n": n, "points": kind}
                    for cover in COVERS:
                        found, seconds = timed(
                            lambda w=where, c=cover, r=region: support_radii(w, r, c), time.process_time
                        )
                        row |= {f"p={cover}": found.overlap.nnz / n**2, f"p={cover} s": seconds}
                        row["proved"] = row.get("proved", True) and found.proved
                    rows.append(row)
    return rows


if __name__ == "__main__":
    run(parser(__doc__), covers)

"""Grids of the sphere by seconds, energy and angles.

Prints uniform grids, to given offsets and to those where
`sphere_grid` stops; refined ones, with the energy by the quadrature that published figures are given in as well; nested
ones; and grids along coasts, of the package global-land-mask or of a mask.

    python benchmarks/sphere.py [--quick] [--parts uniform refined nested coast] [--land MASK.npy]
"""

import argparse
import importlib.util
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import Rows, parser, run, timed
from numpy.typing import NDArray
from scipy.spatial import KDTree

from cvtimg.sphere import Refinement

Row = dict[str, Any]
Points = NDArray[np.float64]
#: Root mean squares of offsets to be reached, by numbers of points.
OFFSETS = {40_962: 1e-6, 163_842: 6e-6, 655_362: 4e-6, 2_621_442: 2e-6}
#: The density of one cap with cells four times as fine, and five more.
CAP = np.array([0.3, -0.5, 0.6]) / 0.7**0.5
#: The regional grids of J. Burkardt's lecture "Gridding the Earth": 65,026 points, 40 km apart in the United States
#: and 120 km elsewhere, which is what a radius of 26.8 degrees comes to.
PLACE = (-96.0, 38.0)
UNITED_STATES = Refinement(*PLACE, radius=26.8, ratio=3)
#: Radius in kilometers.
EARTH = 6371.0
DENSITIES: dict[str, Callable[[Points], Any]] = {
    "cap x4": lambda x: (
        (np.tanh((np.pi / 6 - np.arccos(np.clip(x @ CAP, -1, 1))) / (np.pi / 20)) + 1) / 2 * (1 - 4**-4) + 4**-4
    ),
    "exp(-6 z^2)": lambda x: np.exp(-6 * x[:, 2] ** 2),
    "exp(-3 (1 - z)^2)": lambda x: np.exp(-3 * (1 - x[:, 2]) ** 2),
    "1 + 20 x^2": lambda x: 1 + 20 * x[:, 0] ** 2,
    "waves": lambda x: np.exp(2 * np.sin(4 * x[:, 0]) * np.cos(3 * x[:, 1])),
    "two caps": lambda x: 0.01 + np.exp(-8 * (1 - x[:, 0])) + np.exp(-8 * (1 - x[:, 1])),
}


def figures(grid: Any, seconds: float) -> Row:
    """Say what a grid is like."""
    measures = grid.measures()
    return {
        "n": len(grid.points),
        "seconds": seconds,
        "offset": grid.offset,
        "energy": grid.energy,
        "least angle": measures.least_angle,
        "largest angle": measures.largest_angle,
        "obtuse": measures.n_obtuse,
        "5 / 7 sides": f"{measures.n_pentagons} / {measures.n_heptagons}",
    }


def uniform(given: argparse.Namespace) -> Rows:
    """Make grids of even cells, to the offsets above, and as they are made by default."""
    import cvtimg
    from cvtimg.sphere.grids import EFFORTS

    counts = (40_962, 40_000) if given.quick else (*OFFSETS, 40_000)
    rows = []
    for n in counts:
        if n in OFFSETS:
            EFFORTS["to the offset"] = replace(EFFORTS["balanced"], tolerance=OFFSETS[n])
            grid, seconds = timed(partial(cvtimg.sphere_grid, n, effort="to the offset"), time.process_time)
            rows.append({"to": OFFSETS[n], **figures(grid, seconds)})
        rows.append({"to": "default", **figures(*timed(partial(cvtimg.sphere_grid, n), time.process_time))})
    return rows


def refined(given: argparse.Namespace) -> Rows:
    """Make grids by densities; "E n" is the energy times n by moments alone, as published figures are."""
    import cvtimg
    from cvtimg.sphere.triangulation import SphereTriangulation

    rows = []
    cases = [(name, 10_242 if given.quick else 40_962) for name in DENSITIES]
    for name, n in cases if given.quick else [*cases, ("cap x4", 163_842)]:
        density = DENSITIES[name]
        grid, seconds = timed(partial(cvtimg.sphere_grid, n, density=density), time.process_time)
        mesh = SphereTriangulation(grid.points, grid.triangles)
        centers = mesh.circumcenters()
        masses, moments, _ = mesh.weighted_moments(grid.density, centers, density(centers))
        energy = 2 * (masses.sum() - np.einsum("ij,ij", moments, grid.points))
        rows.append({"density": name, **figures(grid, seconds), "E n": energy * n})
    return rows


def nested(given: argparse.Namespace) -> Rows:
    """Refine the United States three times, to cells of 40 and 120 km: as a new grid, and as a part of an even one.

    The even grid has 40,962 points. All triangles that have no corner in the nested region must stay.
    """
    import cvtimg
    from cvtimg.sphere import Cap, nested_grid

    parent = cvtimg.sphere_grid(10_242 if given.quick else 40_962)
    # Outside of the circle around all but 29,756 points, the density is next to even.
    n_inside = len(parent.points) - (7_440 if given.quick else 29_756)
    depths = np.sort(Cap(*PLACE, 90).depth(parent.points))
    within = Cap(*PLACE, 90 - float(np.degrees(depths[-n_inside - 1 : -n_inside + 1].mean())))
    n = 8_818 if given.quick else 35_270
    total = len(parent.points) - n_inside + n
    new, seconds = timed(partial(cvtimg.sphere_grid, total, density=UNITED_STATES), time.process_time)
    rows = [{"scenario": "new", **_regional(new, seconds, within), "same bits": None, "lost triangles": None}]
    make = partial(nested_grid, parent, n, within=within, density=UNITED_STATES)
    grid, seconds = timed(make, time.process_time)
    inside = within(parent.points)
    number = np.where(inside, -1, np.cumsum(~inside) - 1)
    before = _kept(number[parent.triangles])
    after = _kept(np.where(grid.fixed, np.arange(len(grid.points)), -1)[grid.triangles])
    same = bool((grid.points[grid.fixed] == parent.points[~inside]).all())
    lost = f"{len(before - after)} of {len(before)}"
    found = {**_regional(grid, seconds, within), "in the region": n, "same bits": same, "lost triangles": lost}
    return [*rows, {"scenario": "nested", **found}]


def _regional(grid: Any, seconds: float, within: Any) -> Row:
    """Say what a regional grid is like: mean distances of neighbors in kilometers by the areas of cells."""
    distances = EARTH * np.sqrt(grid.areas / 0.75**0.5)
    inside = within.depth(grid.points)
    middle = inside > np.radians(within.radius - UNITED_STATES.radius / 2)
    return {
        **figures(grid, seconds),
        "in the region": int((inside > 0).sum()),
        "km inside": float(distances[middle].mean()),
        "km outside": float(distances[inside < 0].mean()),
    }


def _kept(triangles: NDArray[Any]) -> set[tuple[int, ...]]:
    return {tuple(row) for row in np.sort(triangles[(triangles >= 0).all(axis=1)], axis=1).tolist()}


def coast(given: argparse.Namespace) -> Rows:
    """Make a grid along the coasts of the earth, and measure how far its points are from those of the map as it is."""
    from skimage.measure import find_contours

    from cvtimg.sphere import coastal_grid
    from cvtimg.sphere.densities import from_degrees

    mask = _land() if given.land is None else np.load(given.land)
    if mask is None:
        return []
    n = 10_242 if given.quick else 40_962
    grid, seconds = timed(partial(coastal_grid, n, mask), time.process_time)
    on_land, at_sea = grid.on_land[grid.triangles], ~(grid.on_land | grid.on_coast)[grid.triangles]
    height, width = mask.shape
    rows, columns = np.concatenate(find_contours(np.concatenate([mask, mask[:, :1]], axis=1), mask.max() / 2)).T
    shore = from_degrees((columns + 0.5) * 360 / width - 180, 90 - (rows + 0.5) * 180 / height)
    distances = EARTH * KDTree(shore).query(grid.points[grid.on_coast])[0]
    return [
        {
            **figures(grid, seconds),
            "on the coast": int(grid.on_coast.sum()),
            "straddling": int((on_land.any(axis=1) & at_sea.any(axis=1)).sum()),
            "median km to the map's coast": float(np.median(distances)),
            "largest": float(distances.max()),
        }
    ]


def _land() -> Points | None:
    """Return the share of land in 2,160 x 4,320 pixels by the data of global-land-mask, if that is installed."""
    found = importlib.util.find_spec("global_land_mask")
    if found is None or found.origin is None:
        return None
    with np.load(Path(found.origin).parent / "globe_combined_mask_compressed.npz") as content:
        at_sea = content["mask"]
    strips = [at_sea[top : top + 10].reshape(10, -1, 10).mean(axis=(0, 2)) for top in range(0, len(at_sea), 10)]
    return np.asarray(1 - np.array(strips))


if __name__ == "__main__":
    read = parser(__doc__)
    read.add_argument("--land", type=Path, help="(H, 2 H) array of the share of land, .npy (default: global-land-mask)")
    run(read, uniform, refined, nested, coast)

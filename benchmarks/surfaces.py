"""Points on surfaces beside pyacvd: processor seconds, energy and angles on a torus and on a closed blob.

Both get the same triangles. pyacvd clusters vertices, so its input is subdivided as its documentation advises, until
it has 20 vertices or more per point. Energy (E n, for area 1; less is better) is measured alike for both, with the same
million samples of the fine surface. The blob is where a sum of Gaussians is constant, as marching cubes find it.

    python benchmarks/surfaces.py [--quick] [--effort best]
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from common import machine, parser, pin_threads, print_table, timed, write_results
from numpy.typing import NDArray

Points = NDArray[np.float64]
Mesh = tuple[Points, NDArray[np.int32]]
Row = dict[str, Any]
COUNTS = (1_000, 10_000)
SAMPLES = 1_000_000
#: Vertices per point that pyacvd gets.
PER_POINT = 20


def torus(n_around: int = 240, n_across: int = 100) -> Mesh:
    """Triangulate a torus of radii 1 and 0.4."""
    u, v = (np.arange(n) * 2 * np.pi / n for n in (n_around, n_across))
    u, v = (angles.ravel() for angles in np.meshgrid(u, v, indexing="ij"))
    radius = 1 + 0.4 * np.cos(v)
    points = np.stack([radius * np.cos(u), radius * np.sin(u), 0.4 * np.sin(v)], axis=1)
    i, j = (numbers.ravel() for numbers in np.meshgrid(np.arange(n_around), np.arange(n_across), indexing="ij"))
    a, b = i * n_across + j, (i + 1) % n_around * n_across + j
    c, d = (i + 1) % n_around * n_across + (j + 1) % n_across, i * n_across + (j + 1) % n_across
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)


def blob(n_cubes: int = 90) -> Mesh:
    """Make a body with head, ears, tail and feet of marching cubes, as a scan might be."""
    from cvtimg.surfaces import ImplicitSurface

    centers = np.array([
        [0, 0, 0], [0.75, 0, 0.55], [0.78, 0.22, 1.15], [0.78, -0.22, 1.15], [-0.85, 0, -0.05], [0.45, 0.4, -0.5],
        [0.45, -0.4, -0.5], [-0.45, 0.42, -0.5], [-0.45, -0.42, -0.5], [0.76, 0.2, 0.9], [0.76, -0.2, 0.9],
    ])  # fmt: skip
    widths = np.array([0.55, 0.36, 0.17, 0.17, 0.25, 0.22, 0.22, 0.24, 0.24, 0.15, 0.15])

    def function(places: Points) -> Points:
        squares = ((places[:, None] - centers) ** 2).sum(axis=2)
        return np.asarray(0.5 - np.exp(-squares / widths**2).sum(axis=1))

    surface = ImplicitSurface(function, [-1.4, -1, -1.1], [1.4, 1, 1.5], spacing=2.8 / n_cubes)
    return surface.triangulation.points, surface.triangulation.triangles


def samples(mesh: Mesh, n: int) -> Points:
    """Spread samples evenly over triangles, in their order."""
    from cvtimg.placement.regions import low_discrepancy

    a, b, c = (mesh[0][mesh[1][:, k]] for k in range(3))
    ends = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    face = np.minimum(np.searchsorted(ends, (np.arange(n) + 0.5) * ends[-1] / n), len(mesh[1]) - 1)
    x, y = low_discrepancy(n, 2, 0).T
    x = np.sqrt(x)
    return np.asarray((1 - x)[:, None] * a[face] + (x * (1 - y))[:, None] * b[face] + (x * y)[:, None] * c[face])


def ours(mesh: Mesh, n: int, effort: Any) -> Mesh:
    """Place points by `cvtimg.surface_points`."""
    from cvtimg import surface_points

    found = surface_points(mesh, n, effort=effort)
    return found.points, found.triangles


def pyacvd(mesh: Mesh, n: int) -> Mesh:
    """Remesh by pyacvd."""
    import pyvista
    from pyacvd import Clustering

    clusters = Clustering(pyvista.PolyData.from_regular_faces(*mesh))
    n_vertices, rounds = len(mesh[0]), 0
    while n_vertices < PER_POINT * n:
        n_vertices, rounds = 4 * n_vertices, rounds + 1
    if rounds:
        clusters.subdivide(rounds)
    clusters.cluster(n)
    found = clusters.create_mesh()
    return np.asarray(found.points, float), np.asarray(found.faces).reshape(-1, 4)[:, 1:].astype(np.int32)


def measure(name: str, method: str, n: int, make: Callable[[], Mesh], places: Points) -> Row:
    """Run one method once and measure what it made."""
    from scipy.spatial import KDTree

    from cvtimg.surfaces import measure_surface

    (points, triangles), seconds = timed(make, time.process_time)
    distances, _ = KDTree(points).query(places)
    figures = measure_surface(points, triangles)
    return {
        "surface": name, "n": n, "method": method, "points": len(points), "seconds": seconds,
        "energy_n": float((distances**2).mean()) * len(points), "least_angle": figures.least_angle,
        "n_obtuse": figures.n_obtuse, "mean_quality": figures.mean_quality, "closed": figures.is_closed,
        "euler": figures.euler_characteristic,
    }  # fmt: skip


def main() -> None:
    """Run all methods, print a table and write the results."""
    read = parser(__doc__)
    read.add_argument("--effort", default="balanced", choices=("fast", "balanced", "best"))
    options = read.parse_args()
    pin_threads(1)
    rows = []
    for name, mesh in (("torus", torus()), ("blob", blob())):
        places = samples(mesh, SAMPLES // 10 if options.quick else SAMPLES)
        ours(mesh, 100, "fast"), pyacvd(mesh, 100)  # imports and compiles
        for n in COUNTS[:1] if options.quick else COUNTS:
            for method, make in (
                ("cvtimg", lambda mesh=mesh, n=n: ours(mesh, n, options.effort)),
                ("pyacvd", lambda mesh=mesh, n=n: pyacvd(mesh, n)),
            ):
                rows.append(measure(name, method, n, make, places))
    header = ("surface", "n", "method", "points", "seconds", "E n / area", "least angle", "obtuse", "closed", "Euler")
    table = [
        (row["surface"], str(row["n"]), row["method"], str(row["points"]), f"{row['seconds']:.2f}",
         f"{row['energy_n']:.5f}", f"{row['least_angle']:.1f}", str(row["n_obtuse"]), str(row["closed"]),
         str(row["euler"]))
        for row in rows
    ]  # fmt: skip
    print_table(f"Points on surfaces ({machine()})", header, table)
    write_results("surfaces", {"effort": options.effort, "samples": SAMPLES}, rows)


if __name__ == "__main__":
    main()

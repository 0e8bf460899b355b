"""Meshes beside triangle, Gmsh and DistMesh.

Prints, for an ocean with a coast and a size image, processor seconds and qualities beside Gmsh's Frontal on the same
borders and sizes; and, for eleven domains, how often each program is best and worst by eight measures. DistMesh has
four starts, and cvtimg those of effort best; then each has one. For images of labels, prints how far the area of the
worst piece is off. For outlines of maps as they are, prints angles beside both (--outlines FILE).

    python benchmarks/meshes.py [--quick] [--only ocean,domains,labels,outlines] [--starts N]
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import astuple
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from common import DATA, parser, pin_threads, print_table, timed, write_results
from mesh_domains import comparison, ocean
from mesh_labels import of_labels
from mesh_outlines import of_outlines
from numpy.typing import NDArray
from scipy.spatial import Delaunay

Row = dict[str, Any]
Points = NDArray[np.float64]
Triangles = NDArray[np.int32]
PARTS = ("ocean", "domains", "labels")
COUNTS = (47_305, 183_907)
#: The measures that count, as `cvtimg.meshes.MeshMeasures` has them.
MEASURES = ("h", "chi", "tau", "d", "alpha", "beta", "q", "p")


def options() -> argparse.Namespace:
    """Read the command line."""
    read = parser(__doc__)
    read.add_argument("--only", default=",".join(PARTS), help=f"parts to run, of {','.join(PARTS)}")
    read.add_argument("--starts", type=int, default=4, help="starts of DistMesh; cvtimg has 24 with effort best")
    read.add_argument(
        "--outlines", type=Path, help="land-10m.json of the npm package world-atlas, for the part outlines"
    )
    return read.parse_args()


def with_oceans(quick: bool) -> list[Row]:
    """Mesh the ocean by sizes, with cvtimg and with Gmsh."""
    import cvtimg

    sea, sizes = ocean()
    rows = []
    for n in COUNTS[:1] if quick else COUNTS:
        for effort in ("fast", "balanced"):
            mesh, seconds = timed(partial(cvtimg.mesh_region, sea, n=n, size=sizes, effort=effort), time.process_time)
            row = figures(mesh.points, mesh.triangles, seconds)
            rows.append({"program": f"cvtimg {effort}", **row, "as long as wanted %": as_wanted(mesh, sizes)})
        (points, triangles), seconds = timed(partial(by_gmsh, mesh, sizes_of(mesh)), time.process_time)
        # Gmsh has the sizes of the mesh of cvtimg, which are not those that were wanted.
        rows.append({"program": "Gmsh Frontal", **figures(points, triangles, seconds), "as long as wanted %": "-"})
    return rows


def figures(points: Points, triangles: Triangles, seconds: float) -> Row:
    """Return what a table shows of a mesh."""
    from cvtimg.meshes import measure_triangles

    each = measure_triangles(points, triangles)
    return {
        "vertices": len(np.unique(triangles)),
        "seconds": round(seconds, 2),
        "least angle": round(float(each.least_angles.min()), 1),
        "below 30 %": round(100 * float((each.least_angles < 30).mean()), 3),
        "mean q": round(float(each.qualities.mean()), 4),
    }


def as_wanted(mesh: Any, sizes: NDArray[np.float64]) -> float:
    """Return the share of edges that are .85 to 1.2 times as long as sizes ask for, but for a factor."""
    from cvtimg.meshes.fields import PictureField

    field = PictureField(sizes.astype(np.float32), np.ones(sizes.shape, bool))
    field = field.scaled((field.count / len(mesh.points)) ** 0.5)
    edges = np.unique(np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    places = mesh.points[edges]
    wanted = field.metric(places.mean(axis=1))[:, 0] ** -0.5
    ratios = np.linalg.norm(places[:, 1] - places[:, 0], axis=1) / wanted
    ratios /= np.median(ratios)
    return round(100 * float(((ratios > 0.85) & (ratios < 1.2)).mean()), 1)


def sizes_of(mesh: Any) -> NDArray[np.float64]:
    """Return the sizes that a mesh has at each pixel: means of the sides of the nearest triangle."""
    from scipy.interpolate import griddata

    corners = mesh.points[mesh.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    x, y = np.meshgrid(np.arange(1024) + 0.5, np.arange(1024) + 0.5)
    found: NDArray[np.float64] = griddata(corners.mean(axis=1), sides, (x, y), method="nearest")
    return found


@contextmanager
def gmsh_frontal() -> Iterator[Any]:
    """Give Gmsh, quiet, with one thread and its Frontal algorithm."""
    import gmsh

    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Verbosity", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("Mesh.Algorithm", 6)
        yield gmsh
    finally:
        gmsh.finalize()


def meshed(gmsh: Any) -> tuple[Points, Triangles]:
    """Mesh the geometry that Gmsh holds."""
    gmsh.model.geo.synchronize()
    gmsh.model.mesh.generate(2)
    numbers, places, _ = gmsh.model.mesh.getNodes()
    index = np.zeros(int(numbers.max()) + 1, np.int32)
    index[numbers.astype(int)] = np.arange(len(numbers))
    triangles = index[gmsh.model.mesh.getElementsByType(2)[1].astype(int)].reshape(-1, 3)
    return places.reshape(-1, 3)[:, :2], triangles


def by_gmsh(mesh: Any, grid: NDArray[np.float64]) -> tuple[Points, Triangles]:
    """Mesh the inside of the borders of a mesh, with sizes on a grid of pixels."""
    from cvtimg.halfedges import connected_parts

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "sizes.txt")
        head = f"0.5 0.5 -1\n1 1 2\n{grid.shape[1]} {grid.shape[0]} 2\n"
        path.write_text(head + "\n".join(f"{value:.6g} {value:.6g}" for value in grid.T.ravel()) + "\n")
        with gmsh_frontal() as gmsh:
            geometry = gmsh.model.geo
            tags = {int(v): geometry.addPoint(*mesh.points[v], 0, 1.0) for v in np.unique(mesh.edges)}
            lines = [geometry.addLine(tags[int(a)], tags[int(b)]) for a, b in mesh.edges]
            for line in lines:
                geometry.mesh.setTransfiniteCurve(line, 2)
            loops = geometry.addCurveLoops(lines)
            # Gmsh lists loops by their first line; the one around all others comes first.
            ring = connected_parts(tuple(mesh.edges.T), len(mesh.points))[1]
            first = np.sort(np.unique(ring[mesh.edges[:, 0]], return_index=True)[1])
            is_inner = ring[mesh.edges[first, 0]] != ring[mesh.points[:, 0].argmin()]
            geometry.addPlaneSurface([loops[i] for i in np.argsort(is_inner, kind="stable")])
            field = gmsh.model.mesh.field.add("Structured")
            gmsh.model.mesh.field.setString(field, "FileName", str(path))
            gmsh.model.mesh.field.setNumber(field, "TextFormat", 1)
            gmsh.model.mesh.field.setAsBackgroundMesh(field)
            for name in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
                gmsh.option.setNumber(f"Mesh.MeshSize{name}", 0)
            return meshed(gmsh)


def with_domains(starts: int) -> tuple[list[Row], list[Row]]:
    """Count how often each program is best and worst, by eight measures on eleven domains: of some starts, and of one.

    The starts of cvtimg are its own, with effort "best"; otherwise it has one.
    """
    found: dict[str, dict[str, tuple[float, ...]]] = {}
    several = ("triangle", "Gmsh", f"DistMesh of {starts}", "cvtimg best")
    single = ("triangle", "Gmsh", "DistMesh of 1", "cvtimg")
    for name, (rings, n) in comparison().items():
        by_springs = [measured(by_distmesh(rings, n, seed)) for seed in range(starts)]
        found[name] = {
            "triangle": measured(by_triangle(rings, n)),
            "Gmsh": measured(by_gmsh_uniformly(rings, n)),
            "DistMesh of 1": by_springs[0],
            f"DistMesh of {starts}": min(by_springs, key=score),
            "cvtimg": measured(by_cvtimg(rings, n, "balanced")),
            "cvtimg best": measured(by_cvtimg(rings, n, "best")),
        }
        for program, values in found[name].items():
            print(f"{name:20s}{program:16s}", *(f"{value:.3g}" for value in values))
    return counted(found, several), counted(found, single)


def score(measures: tuple[float, ...]) -> float:
    """Weigh measures by their logarithms; the less the better."""
    return float(np.log(np.maximum(measures, 1e-12)).sum())


def counted(found: dict[str, dict[str, tuple[float, ...]]], programs: tuple[str, ...]) -> list[Row]:
    """Count best and worst values of each program among some."""
    values = np.array([[of[program] for program in programs] for of in found.values()])
    best, worst = values.argmin(axis=1), values.argmax(axis=1)
    return [
        {"program": program, "best": int((best == k).sum()), "worst": int((worst == k).sum())}
        | {name: f"{(best[:, i] == k).sum()}-{(worst[:, i] == k).sum()}" for i, name in enumerate(MEASURES)}
        for k, program in enumerate(programs)
    ]


def measured(mesh: tuple[Points, Triangles]) -> tuple[float, ...]:
    """Return the eight measures of a mesh."""
    from cvtimg.meshes import measure_mesh

    return astuple(measure_mesh(*mesh))[: len(MEASURES)]


def by_cvtimg(rings: list[Points], n: int, effort: str) -> tuple[Points, Triangles]:
    """Mesh with cvtimg, as it is by default but for the effort."""
    import cvtimg

    mesh = cvtimg.mesh_region(rings, n=n, effort=effort)
    return mesh.points, mesh.triangles


def nearest_length(count: Callable[[float], int], area: float, n: int) -> float:
    """Find the edge length with which a program comes nearest to n vertices."""
    middle = (2 * area / (3**0.5 * n)) ** 0.5
    best, gap, low, high = middle, np.inf, 0.5 * middle, 2 * middle
    for _ in range(20):
        length = (low * high) ** 0.5
        number = count(length)
        if abs(number - n) < gap:
            best, gap = length, abs(number - n)
        if not gap:
            break
        low, high = (length, high) if number > n else (low, length)
    return best


def nearest_number(make: Callable[[float], tuple[Points, Triangles]], area: float, n: int) -> tuple[Points, Triangles]:
    """Make the mesh of an edge length with which a program comes nearest to n vertices."""
    return make(nearest_length(lambda length: len(np.unique(make(length)[1])), area, n))


def outlines(rings: list[Points], length: float) -> list[Points]:
    """Cut smooth rings into steps of a length; keep those of few corners."""
    cut = []
    for ring in rings:
        closed = np.vstack([ring, ring[:1]])
        sides = np.linalg.norm(np.diff(closed, axis=0), axis=1)
        corners = np.flatnonzero(turning(ring) > np.radians(20))
        along = np.append(0, np.cumsum(sides))
        stops = [*along[corners], along[-1] + (along[corners[0]] if len(corners) else 0)] if len(corners) else None
        places: list[float] = []
        for start, stop in pairwise(stops) if stops else [(0.0, along[-1])]:
            k = max(round((stop - start) / length), 1 if stops else 5)
            places += (start + np.arange(k) / k * (stop - start)).tolist()
        at = np.array(places) % along[-1]
        cut.append(np.stack([np.interp(at, along, closed[:, axis]) for axis in (0, 1)], axis=1))
    return cut


def turning(ring: Points) -> NDArray[np.float64]:
    """Return the angle by which a ring turns at each point."""
    come, go = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return np.abs(np.arctan2(come[:, 0] * go[:, 1] - come[:, 1] * go[:, 0], (come * go).sum(axis=1)))


def by_triangle(rings: list[Points], n: int) -> tuple[Points, Triangles]:
    """Mesh with triangle: angles of at least 30 degrees, and a largest area."""

    def make(length: float) -> tuple[Points, Triangles]:
        return triangulated(outlines(rings, length), f"pq30a{3**0.5 / 4 * length**2 * 1.3:.9f}")

    return nearest_number(make, shapely.Polygon(rings[0], rings[1:]).area, n)


def triangulated(rings: list[Points], flags: str = "pq30") -> tuple[Points, Triangles]:
    """Mesh rings with triangle."""
    import triangle

    starts, each = np.cumsum([0, *map(len, rings)]), [np.arange(len(ring)) for ring in rings]
    segments = [np.stack([at, np.roll(at, -1)], axis=1) + start for at, start in zip(each, starts, strict=False)]
    given = {"vertices": np.vstack(rings), "segments": np.vstack(segments)}
    if len(rings) > 1:
        given["holes"] = [shapely.Polygon(ring).representative_point().coords[0] for ring in rings[1:]]
    made = triangle.triangulate(given, flags)
    return made["vertices"], made["triangles"].astype(np.int32)


def gmsh_of_rings(rings: list[Points], length: float | None = None) -> tuple[Points, Triangles]:
    """Mesh with Gmsh's Frontal, with edges of one length, or as long as the distances of points on rings are."""
    with gmsh_frontal() as gmsh:
        loops = []
        for ring in rings:
            steps = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
            sizes = (steps + np.roll(steps, 1)) / 2 if length is None else np.full(len(ring), length)
            tags = [gmsh.model.geo.addPoint(*place, 0, size) for place, size in zip(ring, sizes, strict=True)]
            lines = [gmsh.model.geo.addLine(a, b) for a, b in zip(tags, [*tags[1:], tags[0]], strict=True)]
            for line in lines if length else []:
                gmsh.model.geo.mesh.setTransfiniteCurve(line, 2)
            loops.append(gmsh.model.geo.addCurveLoop(lines))
        gmsh.model.geo.addPlaneSurface(loops)
        return meshed(gmsh)


def by_gmsh_uniformly(rings: list[Points], n: int) -> tuple[Points, Triangles]:
    """Mesh with Gmsh's Frontal and edges of one length."""

    def make(length: float) -> tuple[Points, Triangles]:
        return gmsh_of_rings(outlines(rings, length), length)

    return nearest_number(make, shapely.Polygon(rings[0], rings[1:]).area, n)


def by_distmesh(rings: list[Points], n: int, seed: int) -> tuple[Points, Triangles]:
    """Mesh with DistMesh, written from the paper; its lattice is moved and shaken where `seed` > 0.

    P.-O. Persson, G. Strang, A simple mesh generator in MATLAB, SIAM Review 46 (2004), doi 10.1137/S0036144503429121.
    """
    domain = Domain(rings)

    def lattice(length: float) -> Points:
        random = np.random.default_rng(seed)
        low, high = np.array(domain.polygon.bounds).reshape(2, 2)
        low = low - length * random.random(2) * (seed > 0)
        x, y = np.meshgrid(np.arange(low[0], high[0] + length, length), np.arange(low[1], high[1], length * 0.75**0.5))
        x[1::2] += length / 2
        points = np.stack([x.ravel(), y.ravel()], axis=1) + random.normal(0, 0.05 * length * (seed > 0), (x.size, 2))
        points = points[domain.distances(points)[0] < 0.001 * length]
        if len(domain.corners):
            near = np.linalg.norm(points[:, None] - domain.corners, axis=2).min(axis=1) < 0.5 * length
            points = np.vstack([domain.corners, points[~near]])
        return points

    length = nearest_length(lambda length: len(lattice(length)), domain.polygon.area, n)
    return distmesh(domain, lattice(length), length)


class Domain:
    """A polygon with holes, as signed distances."""

    def __init__(self, rings: list[Points]) -> None:
        from cvtimg.meshes.outlines import StraightParts

        self.polygon = shapely.Polygon(rings[0], rings[1:])
        shapely.prepare(self.polygon)
        self.corners = np.vstack([ring[turning(ring) > np.radians(20)] for ring in rings])
        self.parts = StraightParts.of([np.vstack([ring, ring[:1]]) for ring in rings])

    def distances(self, points: Points) -> tuple[NDArray[np.float64], Points]:
        """Return signed distances (N,), < 0 inside, and the nearest places (N, 2) on the boundary."""
        nearest = self.parts.feet(points)
        away = np.linalg.norm(nearest - points, axis=1)
        return np.where(shapely.contains_xy(self.polygon, *points.T), -away, away), nearest


def distmesh(domain: Domain, points: Points, length: float, steps: int = 1000) -> tuple[Points, Triangles]:
    """Move points by the forces of springs until they rest; Delaunay's triangles of them where they have moved far."""

    def triangulated() -> Triangles:
        found = Delaunay(points).simplices
        found = found[domain.distances(points[found].mean(axis=1))[0] < -0.001 * length]
        a, b, c = (points[found[:, k]] for k in range(3))
        turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        return found[np.abs(turn) > 1e-6 * length**2]

    before = np.full_like(points, np.inf)
    for _ in range(steps):
        if np.linalg.norm(points - before, axis=1).max() > 0.1 * length:
            before = points.copy()
            bars = np.unique(np.sort(triangulated()[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
        ways = points[bars[:, 0]] - points[bars[:, 1]]
        sides = np.linalg.norm(ways, axis=1)
        wanted = 1.2 * np.sqrt((sides**2).mean())
        pushes = (np.maximum(wanted - sides, 0) / sides)[:, None] * ways
        force = np.zeros_like(points)
        np.add.at(force, bars, np.stack([pushes, -pushes], axis=1))
        force[: len(domain.corners)] = 0
        points = points + 0.2 * force
        away, nearest = domain.distances(points)
        outside = np.flatnonzero(away > 0)
        outside = outside[outside >= len(domain.corners)]
        points[outside] = nearest[outside]
        if np.linalg.norm(0.2 * force[away < -0.001 * length], axis=1).max(initial=0) < 0.001 * length:
            break
    return points, triangulated()


def main() -> None:
    """Run the parts that are asked for."""
    read = options()
    pin_threads(read.threads)
    tables = {}
    if "ocean" in read.only:
        tables["ocean"] = with_oceans(read.quick)
    if "domains" in read.only:
        tables["domains"], tables["domains, one start"] = with_domains(1 if read.quick else read.starts)
    if "labels" in read.only:
        tables["labels"] = of_labels(read.data or DATA, read.quick)
    if "outlines" in read.only:
        import cvtimg

        def ours(rings: list[Points]) -> tuple[Points, Triangles]:
            mesh = cvtimg.mesh_region(rings)
            return mesh.points, mesh.triangles

        programs = {"cvtimg": ours, "triangle pq30": triangulated, "Gmsh Frontal": gmsh_of_rings}
        tables["outlines"] = [{"program": name} | of_outlines(read.outlines, make) for name, make in programs.items()]
    for name, rows in tables.items():
        header = list(rows[0])
        print_table(name, header, [[str(row[column]) for column in header] for row in rows])
    write_results("meshes", {"starts": read.starts}, [row for rows in tables.values() for row in rows])


if __name__ == "__main__":
    main()

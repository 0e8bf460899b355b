"""Points on surfaces beside pyacvd, pymeshlab (isotropic remeshing) and mmgs: processor seconds, energy, angles, shape.

All get the same triangles. pyacvd clusters vertices, so its input is subdivided as its documentation advises, until
it has 20 vertices or more per point. Energy (E n, for area 1; less is better) is measured alike for all, with the same
million samples of the fine surface. The blob is where a sum of Gaussians is constant, as marching cubes find it.

Others have edges or borders: a cube, a part with a hole and a boss, a sheet, a bowl, and six models more, of which the
fading fold has a crease that ends within a face. How far from the surface results are is measured by pymeshlab, in both
directions and by the diagonal. Edge lengths of pymeshlab and mmgs are found by trial, and the seconds of the trial that
was taken are shown. Needs pyacvd, pymeshlab, mmgpy, trimesh and manifold3d.

With --scans FOLDER, its surfaces get what scanners leave: noise, or doubled faces and holes. Beside is pymeshlab alone.

    python benchmarks/surfaces.py [--quick] [--effort best] [--only cube gear] [--scans FOLDER]
"""

import time
from collections.abc import Callable
from pathlib import Path
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
    return points, squares(np.pad(np.arange(len(points)).reshape(n_around, n_across), (0, 1), mode="wrap"))


def squares(number: NDArray[Any]) -> NDArray[np.int32]:
    """Return two triangles in each square of a grid of numbered points."""
    a, b, c, d = (each.ravel() for each in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)


def sheet(fold: float = 0.0) -> Mesh:
    """Make a sheet of 2 by 1 with a fold, sharp at one end and flat from the middle on."""
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(0, 2, 81), np.linspace(0, 1, 41), indexing="ij"))
    height = fold * np.clip(1 - x, 0, None) * (1 - np.abs(2 * y - 1))
    return np.stack([x, y, height], axis=1), squares(np.arange(81 * 41).reshape(81, 41))


def arrays(meshes: dict[str, Any]) -> dict[str, Mesh]:
    """Return meshes of trimesh as arrays."""
    return {name: (np.array(mesh.vertices), np.array(mesh.faces, np.int32)) for name, mesh in meshes.items()}


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


def shapes() -> dict[str, Mesh]:
    """Make surfaces with edges or a border."""
    import trimesh

    plate, hole = trimesh.creation.box((2, 1.4, 0.3)), trimesh.creation.cylinder(0.25, 1, sections=64)
    boss = trimesh.creation.cylinder(0.3, 0.5, sections=64)
    part = plate.difference(hole.apply_translation([-0.5, 0, 0])).union(boss.apply_translation([0.45, 0.1, 0.3]))
    bowl = trimesh.creation.icosphere(5).slice_plane([0, 0, 0.13], [0, 0, -1])
    bowl.merge_vertices()
    bowl.update_faces(bowl.nondegenerate_faces(height=1e-9))
    return arrays({"cube": trimesh.creation.box(), "part": part, "bowl": bowl}) | {"sheet": sheet()}


def models() -> dict[str, Mesh]:
    """Make six models more: with edges of many angles, thin walls, borders, and creases that end in a face."""
    import shapely
    import trimesh

    def extruded(ring: Points, height: float, holes: tuple[Points, ...] = ()) -> Any:
        return trimesh.creation.extrude_polygon(shapely.Polygon(ring, holes), height)

    def circle(n: int, radius: float, x: float = 0.0, y: float = 0.0) -> Points:
        turns = 2 * np.pi * np.arange(n) / n
        return np.stack([x + radius * np.cos(turns), y + radius * np.sin(turns)], axis=1)

    turns = 2 * np.pi * np.arange(96) / 96
    gear = np.where(np.arange(96) // 4 % 2, 1.0, 0.8)[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    bracket = np.array([[0, 0], [2, 0], [2, 0.3], [0.3, 0.3], [0.3, 1.5], [0, 1.5]])
    dome = trimesh.creation.icosphere(4).slice_plane([0, 0, 0.1], [0, 0, 1], cap=True)
    solids = {
        "gear": extruded(gear, 0.4, (circle(64, 0.3),)),
        "bracket": extruded(bracket, 1),
        "nut": extruded(circle(6, 1), 0.7, (circle(96, 0.5),)),
        "pyramid": trimesh.convex.convex_hull(np.vstack([np.c_[circle(4, 1), np.zeros(4)], [[0, 0, 1]]])),
        "dome": dome,
    }
    return arrays(solids) | {"fading fold": sheet(1.0)}


def scans(folder: Path) -> dict[str, Mesh]:
    """Read surfaces twice: with noise of a tenth of the edges around, and with doubled faces and five holes."""
    import trimesh

    found, random = {}, np.random.default_rng(0)
    for path in sorted(folder.iterdir()):
        (mesh := trimesh.load_mesh(path)).merge_vertices(merge_tex=True, merge_norm=True)  # noise opens no seams
        points, faces = np.array(mesh.vertices), np.array(mesh.faces, np.int32)
        edges, lengths = mesh.edges_unique.ravel(), mesh.edges_unique_length.repeat(2)
        around = np.bincount(edges, lengths, len(points)) / np.maximum(np.bincount(edges, minlength=len(points)), 1)
        found[f"{path.stem}, noise"] = points + around[:, None] / 10 * random.normal(size=points.shape), faces
        spots = points[random.choice(faces.ravel(), 5)]
        kept = np.linalg.norm(points[faces].mean(axis=1)[:, None] - spots, axis=2).min(axis=1) > 4 * np.median(lengths)
        found[f"{path.stem}, holes"] = points, np.concatenate([faces[kept], faces[kept][::100]])
    return found


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


def pymeshlab(mesh: Mesh, n: int) -> Mesh:
    """Remesh by the isotropic remeshing of MeshLab, which keeps edges of more than 40 degrees and borders."""
    import pymeshlab as library

    def remesh(length: float) -> Mesh:
        meshes = library.MeshSet()
        meshes.add_mesh(library.Mesh(*mesh))
        meshes.meshing_isotropic_explicit_remeshing(
            iterations=10, targetlen=library.PureValue(length), featuredeg=40, checksurfdist=False
        )
        found = meshes.current_mesh()
        return found.vertex_matrix(), found.face_matrix().astype(np.int32)

    return by_trial(remesh, mesh, n)


def mmgs(mesh: Mesh, n: int) -> Mesh:
    """Remesh by mmgs, which keeps edges of more than 40 degrees and borders."""
    from mmgpy import MmgMeshS

    def remesh(length: float) -> Mesh:
        found = MmgMeshS(np.ascontiguousarray(mesh[0]), np.ascontiguousarray(mesh[1], np.int32))
        found.remesh(hsiz=length, hausd=0.1 * length, ar=40.0, verbose=-1)
        return np.array(found.get_vertices()), np.array(found.get_triangles(), np.int32)

    return by_trial(remesh, mesh, n)


#: Seconds of the trial that was taken.
_last = [0.0]


def by_trial(remesh: Callable[[float], Mesh], mesh: Mesh, n: int) -> Mesh:
    """Remesh with lengths of edges until there are about n points; return what was nearest to that."""
    from cvtimg.halfedges import measure_triangles

    length = (measure_triangles(*mesh).areas.sum() / (0.75**0.5 * n)) ** 0.5
    best: Mesh | None = None
    for _ in range(8):
        found, seconds = timed(lambda length=length: remesh(length), time.process_time)
        if best is None or abs(len(found[0]) - n) < abs(len(best[0]) - n):
            best, _last[0] = found, seconds
        if abs(len(found[0]) / n - 1) < 0.01:
            break
        length *= (len(found[0]) / n) ** 0.4
    assert best is not None
    return best


def shape(before: Mesh, after: Mesh) -> Row:
    """Measure what a result keeps: distances by the diagonal, area and length of borders by what they were, corners."""
    import pymeshlab as library
    from scipy.spatial import KDTree

    from cvtimg.halfedges import boundary_edges, measure_triangles

    meshes = library.MeshSet()
    meshes.add_mesh(library.Mesh(*before))
    meshes.add_mesh(library.Mesh(*after))
    found = [
        meshes.get_hausdorff_distance(
            sampledmesh=k, targetmesh=1 - k, samplenum=200_000, maxdist=library.PureValue(1e9)
        )
        for k in (0, 1)
    ]
    diagonal = float(np.linalg.norm(np.ptp(before[0], axis=0)))
    areas = [float(measure_triangles(*mesh).areas.sum()) for mesh in (before, after)]
    borders = [
        float(np.linalg.norm(np.diff(mesh[0][boundary_edges(mesh[1])], axis=1), axis=2).sum())
        for mesh in (before, after)
    ]
    # Corners of boxes: vertices where the surface reaches its bounds along all axes but flat ones.
    low, high = before[0].min(axis=0), before[0].max(axis=0)
    corners = before[0][((before[0] == low) | (before[0] == high)).all(axis=1)]
    off = KDTree(after[0]).query(corners)[0].max() / diagonal if len(corners) else 0.0
    return {
        "hausdorff": max(one["max"] for one in found) / diagonal, "area": areas[1] / areas[0],
        "border": borders[1] / borders[0] if borders[0] else 1.0, "corners": float(off),
    }  # fmt: skip


def measure(name: str, method: str, n: int, make: Callable[[], Mesh], mesh: Mesh, places: Points) -> Row:
    """Run one method once and measure what it made."""
    from scipy.spatial import KDTree

    from cvtimg.surfaces import measure_surface

    (points, triangles), seconds = timed(make, time.process_time)
    seconds = _last[0] if method in ("pymeshlab", "mmgs") else seconds
    distances, _ = KDTree(points).query(places)
    figures = measure_surface(points, triangles)
    return {
        "surface": name, "n": n, "method": method, "points": len(points), "seconds": seconds,
        "energy_n": float((distances**2).mean()) * len(points), "least_angle": figures.least_angle,
        "n_obtuse": figures.n_obtuse, "mean_quality": figures.mean_quality, "closed": figures.is_closed,
        "euler": figures.euler_characteristic, **shape(mesh, (points, triangles)),
    }  # fmt: skip


def main() -> None:
    """Run all methods, print a table and write the results."""
    read = parser(__doc__)
    read.add_argument("--effort", default="balanced", choices=("fast", "balanced", "best"))
    read.add_argument("--only", nargs="*", help="names of surfaces, all by default")
    read.add_argument("--scans", type=Path, help="folder of surfaces that get noise, doubled faces and holes")
    options = read.parse_args()
    pin_threads(1)
    rows = []
    surfaces = scans(options.scans) if options.scans else {"torus": torus(), "blob": blob()} | shapes() | models()
    surfaces = {name: mesh for name, mesh in surfaces.items() if name in (options.only or surfaces)}
    methods = {
        "cvtimg": lambda mesh, n: ours(mesh, n, options.effort), "pyacvd": pyacvd, "pymeshlab": pymeshlab, "mmgs": mmgs
    }  # fmt: skip
    methods = {name: methods[name] for name in ("cvtimg", "pymeshlab")} if options.scans else methods
    for make in methods.values():
        make(torus(), 100)  # imports and compiles
    for name, mesh in surfaces.items():
        places = samples(mesh, SAMPLES // 10 if options.quick else SAMPLES)
        counts = COUNTS if name in ("torus", "blob") else (5_000,) if options.scans else (2_000,)
        for n in counts[:1] if options.quick else counts:
            for method, make in methods.items():
                rows.append(measure(name, method, n, lambda make=make, mesh=mesh, n=n: make(mesh, n), mesh, places))
    header = ("surface", "n", "method", "points", "seconds", "E n / area", "least angle", "quality", "obtuse", "closed",
              "Euler", "Hausdorff e-3", "area", "border", "corners e-3")  # fmt: skip
    table = [
        (row["surface"], str(row["n"]), row["method"], str(row["points"]), f"{row['seconds']:.2f}",
         f"{row['energy_n']:.5f}", f"{row['least_angle']:.1f}", f"{row['mean_quality']:.4f}", str(row["n_obtuse"]),
         str(row["closed"]), str(row["euler"]), f"{1e3 * row['hausdorff']:.2f}", f"{row['area']:.4f}",
         f"{row['border']:.4f}", f"{1e3 * row['corners']:.2f}")
        for row in rows
    ]  # fmt: skip
    print_table(f"Points on surfaces ({machine()})", header, table)
    write_results("surfaces", {"effort": options.effort, "samples": SAMPLES}, rows)


if __name__ == "__main__":
    main()

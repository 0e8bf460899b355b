"""Tetrahedra beside TetGen, fTetWild and CGAL: processor seconds and angles for the same body of voxels.

All fill a gyroid within a ball, of 100 voxels along each axis, with about as many tetrahedra. The rivals get the
surface of the result of cvtimg, and the size of tetrahedra by trial; the seconds of the trial that was taken are shown.
The same body in eight labels, which the rivals are not given, is shown as well. Needs tetgen, pytetwild and cgal; those
that are not installed are left out.

    python benchmarks/volumes.py [--quick] [--only cvtimg tetgen ftetwild cgal]
"""

import contextlib
import importlib.util
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from common import machine, parser, print_table, timed, write_results
from numpy.typing import NDArray

Points = NDArray[np.float64]
Cells = NDArray[np.int32]
Tetrahedra = tuple[Points, Cells]
Row = dict[str, Any]
PACKAGES = {"cvtimg": "cvtimg", "tetgen": "tetgen", "ftetwild": "pytetwild", "cgal": "CGAL"}


def body(side: int) -> NDArray[np.bool_]:
    """Make a thick gyroid within a ball."""
    z, y, x = ((np.mgrid[:side, :side, :side] + 0.5) / side * 2 - 1)[:]
    turns = 2 * np.pi / 1.6
    sines, cosines = ([np.asarray(wave(turns * axis)) for axis in (x, y, z)] for wave in (np.sin, np.cos))
    waves = sum(sines[k] * cosines[(k + 1) % 3] for k in range(3))
    return np.asarray((np.abs(waves) < 0.8) & (x * x + y * y + z * z < 0.9))


def tetgen(points: Points, faces: Cells, size: float) -> Tetrahedra:
    """Refine by TetGen, which keeps the triangles of the surface."""
    from tetgen import TetGen

    found = TetGen(points, faces).tetrahedralize(minratio=1.3, mindihedral=14.0, maxvolume=size**3 / 5, nobisect=True)
    return np.asarray(found[0]), np.asarray(found[1])


def ftetwild(points: Points, faces: Cells, size: float) -> Tetrahedra:
    """Fill by fTetWild, within its usual distance from the surface."""
    from pytetwild import tetrahedralize

    # It leaves the surface that it tracks in the working folder.
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        return tetrahedralize(points, faces, edge_length_abs=size, num_threads=1)


def cgal(points: Points, faces: Cells, size: float) -> Tetrahedra:
    """Fill by CGAL with usual criteria; it perturbs and exudes, so that slivers go."""
    from CGAL.CGAL_Mesh_3 import Default_mesh_criteria, Mesh_3_parameters, Polyhedral_mesh_domain_3, make_mesh_3
    from CGAL.CGAL_Polyhedron_3 import Polyhedron_3

    with tempfile.TemporaryDirectory() as folder:
        corners = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
        sides = "".join(f"3 {a} {b} {c}\n" for a, b, c in faces.tolist())
        Path(folder, "a.off").write_text(f"OFF\n{len(points)} {len(faces)} 0\n{corners}{sides}")
        criteria = Default_mesh_criteria()
        criteria.facet_angle(25).facet_size(size).facet_distance(size / 10).cell_radius_edge_ratio(2).cell_size(size)
        domain = Polyhedral_mesh_domain_3(Polyhedron_3(str(Path(folder, "a.off"))))
        made = make_mesh_3(domain, criteria, Mesh_3_parameters())
        made.output_to_medit(str(Path(folder, "a.mesh")))
        words = Path(folder, "a.mesh").read_text().split()

    def rows(name: str, width: int) -> NDArray[np.float64]:
        start = words.index(name) + 2
        return np.array(words[start : start + width * int(words[start - 1])], float).reshape(-1, width)

    return rows("Vertices", 4)[:, :3], rows("Tetrahedra", 5)[:, :4].astype(np.int32) - 1


def by_trial(make: Callable[[float], Tetrahedra], n: int, size: float) -> tuple[Tetrahedra, float]:
    """Fill with sizes until there are about n tetrahedra."""
    for _ in range(3):
        found, seconds = timed(lambda size=size: make(size), time.process_time)
        if abs(len(found[1]) / n - 1) < 0.1:
            break
        size *= float(np.clip((len(found[1]) / n) ** (1 / 3), 0.6, 1.6))
    return found, seconds


def row(method: str, found: Tetrahedra, seconds: float) -> Row:
    """Measure the tetrahedra of one method."""
    from cvtimg.meshes import VolumeMesh

    used, cells = np.unique(found[1], return_inverse=True)
    cells = cells.reshape(-1, 4).astype(np.int32)
    mesh = VolumeMesh(np.asarray(found[0], float)[used], cells, np.ones(len(cells), np.int32), None)
    measures, peak = mesh.measures(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return {
        "method": method, "vertices": len(used), "tetrahedra": len(cells), "seconds": seconds,
        "least_angle": measures.least_angle, "largest_angle": measures.largest_angle, "below_20": measures.below_20,
        "mean_quality": measures.mean_quality, "volume": abs(measures.volume), "peak_gib": peak,
    }  # fmt: skip


def main() -> None:
    """Run all methods, print a table and write the results."""
    from cvtimg.meshes import mesh_volume

    read = parser(__doc__)
    read.add_argument("--only", nargs="*", default=[*PACKAGES], choices=[*PACKAGES], help="methods to run")
    options = read.parse_args()
    side, n = (50, 5_000) if options.quick else (100, 41_000)
    mask = body(side)
    ours, seconds = timed(lambda: mesh_volume(mask, n=n), time.process_time)
    rows = [row("cvtimg", (ours.points, ours.tetrahedra), seconds)]
    used, faces = np.unique(ours.surface, return_inverse=True)
    surface = ours.points[used], faces.reshape(-1, 3).astype(np.int32)
    for name, make in {"tetgen": tetgen, "ftetwild": ftetwild, "cgal": cgal}.items():
        if name in options.only and importlib.util.find_spec(PACKAGES[name]):
            size = (mask.sum() * 2 / n) ** (1 / 3)
            found, seconds = by_trial(lambda size, make=make: make(*surface, size), len(ours.tetrahedra), size)
            rows.append(row(name, found, seconds))
    octants = mask * (1 + np.arange(8).reshape(2, 2, 2).repeat(side // 2, 0).repeat(side // 2, 1).repeat(side // 2, 2))
    parts, seconds = timed(lambda: mesh_volume(octants, n=n), time.process_time)
    rows.append(row("cvtimg, eight labels", (parts.points, parts.tetrahedra), seconds))
    header = ("method", "vertices", "tetrahedra", "seconds", "least angle", "largest", "below 20", "quality", "volume")
    table = [
        (one["method"], str(one["vertices"]), str(one["tetrahedra"]), f"{one['seconds']:.1f}",
         f"{one['least_angle']:.1f}", f"{one['largest_angle']:.1f}", f"{one['below_20']:.2%}",
         f"{one['mean_quality']:.3f}", f"{one['volume'] / mask.sum():.4f}")
        for one in rows
    ]  # fmt: skip
    print_table(f"Tetrahedra in {mask.sum()} voxels ({machine()})", header, table)
    write_results("volumes", {"side": side, "n": n}, rows)


if __name__ == "__main__":
    main()

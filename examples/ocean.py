"""An ocean from two images: a coast, and the energy of currents, which asks for short edges where it is high.

Both images may be measured data: a mask of the sea, and any gray image of the same size for the energy. Without them,
they are made up and written to the folder. Edges are as long as energy^(-1/4), as the lecture on gridding the Earth
takes them, at most as much longer as the distance from the coast lets them grow, and no shorter than a tenth of the
longest. Prints vertices, triangles, seconds and qualities, and draws a part of the coarser mesh.

    python examples/ocean.py [--sea SEA.png --energy ENERGY.png] [-n 47305,183907] [--folder FOLDER]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from cvtimg import mesh_region, read_image
from cvtimg.meshes import Mesh, measure_triangles
from cvtimg.plotting.meshes import draw_mesh

COUNTS = (47_305, 183_907)
#: How sizes grow from the coast, for each pixel, and the least size by the largest.
GROWTH, AT_COAST, LEAST = 0.02, 0.25, 0.1


def made_up(folder: Path, side: int) -> tuple[Path, Path]:
    """Write a sea with islands and the energy of its currents as images."""
    random = np.random.default_rng(3)

    def noise(spread: float) -> NDArray[np.float64]:
        field: NDArray[np.float64] = ndimage.gaussian_filter(random.standard_normal((side, side)), spread) * spread
        return field

    scale = side / 1024
    land = sum(part * noise(spread * scale) for spread, part in ((80, 1.0), (30, 0.35), (12, 0.12), (5, 0.03)))
    parts, n_parts = ndimage.label(land > np.quantile(land, 0.3))
    sea = parts == 1 + np.argmax(ndimage.sum_labels(parts > 0, parts, np.arange(1, n_parts + 1)))
    islands, n_islands = ndimage.label(~sea)
    sizes = ndimage.sum_labels(~sea, islands, np.arange(1, n_islands + 1))
    sea |= np.isin(islands, 1 + np.flatnonzero(sizes < 30 * scale**2))
    energy = np.exp(2.4 * (noise(60 * scale) + 0.5 * noise(15 * scale)))
    paths = folder / "sea.png", folder / "energy.png"
    Image.fromarray(sea).save(paths[0])
    Image.fromarray((65535 * energy / energy.max()).astype(np.uint16)).save(paths[1])
    return paths


def sizes_of(sea: NDArray[np.bool_], energy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sizes that energy and coast ask for, but for a factor."""
    sizes = np.maximum(energy / energy.max(), 1e-6) ** -0.25
    sizes /= np.median(sizes[sea])
    sizes = np.minimum(sizes, AT_COAST + GROWTH * ndimage.distance_transform_edt(sea))
    return np.maximum(sizes, LEAST * sizes.max())


def main(
    sea_path: Path | None, energy_path: Path | None, counts: tuple[int, ...], folder: Path, side: int = 1024
) -> list[Mesh]:
    """Mesh an ocean with several numbers of vertices."""
    if sea_path is None or energy_path is None:
        sea_path, energy_path = made_up(folder, side)
    sea, energy = read_image(sea_path) > 0, read_image(energy_path).astype(np.float64)
    if energy.ndim == 3:
        energy = energy.mean(axis=2)
    sizes, meshes = sizes_of(sea, energy), []
    print("vertices  triangles  seconds  least angle  below 30  mean quality")
    for n in counts:
        start = time.process_time()
        mesh = mesh_region(sea, n=n, size=sizes)
        seconds, each = time.process_time() - start, measure_triangles(mesh.points, mesh.triangles)
        print(
            f"{n:8d} {len(mesh.triangles):10d} {seconds:8.2f} {each.least_angles.min():12.1f}"
            f" {(each.least_angles < 30).mean():9.3%} {each.qualities.mean():13.4f}"
        )
        meshes.append(mesh)
    (folder / "ocean.png").write_bytes(quarter(meshes[0], np.array(sea.shape[::-1]) / 2))
    return meshes


def quarter(mesh: Mesh, limit: NDArray[np.float64]) -> bytes:
    """Draw the triangles up to a limit in x and y, so that they can be seen."""
    shown = (mesh.points[mesh.triangles].mean(axis=1) < limit).all(axis=1)
    used, triangles = np.unique(mesh.triangles[shown], return_inverse=True)
    number = np.full(len(mesh.points), -1, np.int32)
    number[used] = np.arange(len(used))
    edges = number[mesh.edges]
    edges = edges[(edges >= 0).all(axis=1)]
    triangles = triangles.reshape(-1, 3).astype(np.int32)
    return draw_mesh(mesh.points[used], triangles, mesh.qualities[shown], edges, ".png", y_down=True)


if __name__ == "__main__":
    read = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    read.add_argument("--sea", type=Path, help="mask of the sea")
    read.add_argument("--energy", type=Path, help="gray image of the same size")
    read.add_argument("-n", default=",".join(map(str, COUNTS)), help="numbers of vertices")
    read.add_argument("--folder", type=Path, default=Path(), help="where images are written")
    given = read.parse_args()
    main(given.sea, given.energy, tuple(int(n) for n in given.n.split(",")), given.folder)

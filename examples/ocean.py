"""Seas from an image: refined along a complicated coast, and by a measured field.

By default the seas are those of Europe in a composite of satellite images by NASA, in which they are shaded by their
measured depth: edges are as long as the sea is dark, that is, deep, and short on the shelf. It is a measured field, but
not the energy of currents, for which the lecture on gridding the Earth takes edges as long as energy^(-1/4). With
such a field, or the thickness of ice, give a mask of the sea and a gray image of the same size. From the coast, sizes
grow with the distance, and none is below a tenth of the largest. Prints vertices, triangles, seconds and qualities, and
draws the coarser mesh, whole and a part of it.

    python examples/ocean.py [IMAGE | --sea SEA.png --energy ENERGY.png] [-n 47305,183907] [--folder FOLDER]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from cvtimg import mesh_region, read_image
from cvtimg.meshes import Mesh, measure_triangles
from cvtimg.plotting import draw_mesh

COUNTS = (47_305, 183_907)
EUROPE = Path(__file__).parent.parent / "sample_images" / "europe_day.png"
#: How sizes grow from the coast, by the distance; the size there, and the least, by the median and the largest.
GROWTH, AT_COAST, LEAST = 0.02, 0.25, 0.1
#: An image is enlarged and blurred by so many pixels, so that its coasts get smooth.
ENLARGED, BLUR = 4, 2.0
#: The corners of the part that is drawn alone, by the width and the height: the Adriatic and the Aegean Sea.
WINDOW = np.array([[0.44, 0.56], [0.72, 0.95]])
#: The sea is more blue than red and green by so many levels of 255, and has no part below this share of its area.
BLUE, PART = 6, 0.01
#: Edges are as long as this power of the brightness of the sea, or of the energy of currents.
BY_BRIGHTNESS, BY_ENERGY = -1.0, -0.25


def sea_of(picture: NDArray[np.uint8]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return where a colored image is blue, and how bright it is there, both enlarged."""
    large = ndimage.zoom(picture[..., :3].astype(np.float64), (ENLARGED, ENLARGED, 1), order=1)
    red, green, blue = np.moveaxis(ndimage.gaussian_filter(large, (BLUR, BLUR, 0)), 2, 0)
    parts, n_parts = ndimage.label(blue > np.maximum(red, green) + BLUE)
    areas = ndimage.sum_labels(parts > 0, parts, np.arange(1, n_parts + 1))
    sea = np.isin(parts, 1 + np.flatnonzero(areas > PART * areas.sum()))
    return sea, ndimage.gaussian_filter(red + green + blue, 2 * BLUR)


def sizes_of(sea: NDArray[np.bool_], field: NDArray[np.float64], power: float) -> NDArray[np.float64]:
    """Return the sizes that a field and the coast ask for, but for a factor."""
    sizes = np.maximum(field / field[sea].max(), 1e-6) ** power
    sizes /= np.median(sizes[sea])
    sizes = np.minimum(sizes, AT_COAST + GROWTH * ndimage.distance_transform_edt(sea))
    return np.maximum(sizes, LEAST * sizes[sea].max())


def main(sea: NDArray[np.bool_], sizes: NDArray[np.float64], counts: tuple[int, ...], folder: Path) -> list[Mesh]:
    """Mesh a sea with several numbers of vertices."""
    meshes = []
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
    whole = np.array(sea.shape[::-1], np.float64)
    for name, low, high in (("ocean", 0 * whole, whole), ("ocean_part", WINDOW[0] * whole, WINDOW[1] * whole)):
        (folder / f"{name}.png").write_bytes(drawn(meshes[0], low, high))
    return meshes


def drawn(mesh: Mesh, low: NDArray[np.float64], high: NDArray[np.float64]) -> bytes:
    """Draw the triangles between two corners."""
    middles = mesh.points[mesh.triangles].mean(axis=1)
    shown = ((middles >= low) & (middles < high)).all(axis=1)
    used, triangles = np.unique(mesh.triangles[shown], return_inverse=True)
    number = np.full(len(mesh.points), -1, np.int32)
    number[used] = np.arange(len(used))
    edges = number[mesh.edges]
    edges = edges[(edges >= 0).all(axis=1)]
    triangles = triangles.reshape(-1, 3).astype(np.int32)
    return draw_mesh(mesh.points[used], triangles, mesh.qualities[shown], edges, ".png", y_down=True)


if __name__ == "__main__":
    read = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    read.add_argument("picture", nargs="?", type=Path, default=EUROPE, help="colored image in which the sea is blue")
    read.add_argument("--sea", type=Path, help="mask of the sea")
    read.add_argument("--energy", type=Path, help="gray image of the same size")
    read.add_argument("-n", default=",".join(map(str, COUNTS)), help="numbers of vertices")
    read.add_argument("--folder", type=Path, default=Path(), help="where images are written")
    given = read.parse_args()
    if (given.sea is None) != (given.energy is None):
        read.error("give --sea and --energy, or none of them")
    if given.sea is None:
        water = sea_of(read_image(given.picture))
        wanted = sizes_of(*water, BY_BRIGHTNESS)
    else:
        water = read_image(given.sea) > 0, read_image(given.energy).astype(np.float64)
        wanted = sizes_of(*water, BY_ENERGY)
    main(water[0], wanted, tuple(int(n) for n in given.n.split(",")), given.folder)

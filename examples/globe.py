"""Grids of the globe: three densities of 256 points, two regional grids, coasts, and the lights of cities.

The regional grids are those of J. Burkardt's lecture "Gridding the Earth": cells in the United States are three times
as fine as elsewhere, once in a new grid and once in a part of an even grid, the rest of which stays. With -n 40962, as
in the lecture, points are 40 and 120 km apart.

Takes a map with white land, twice as wide as high, or draws two continents. Of the lights at night, the sample image
shows Europe.

    python examples/globe.py [-n N] [--land MAP] [--out FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import cvtimg
from cvtimg.plotting.globes import draw_globe
from cvtimg.sphere import Cap, CoastalGrid, Refinement, SphereGrid, by_spacing, coastal_grid, nested_grid

#: The densities of M. Gunzburger's lecture on centroidal Voronoi tessellations.
LECTURE = {
    "even": None,
    "equator": lambda x: np.exp(-6 * x[:, 2] ** 2),
    "pole": lambda x: np.exp(-3 * (1 - x[:, 2]) ** 2),
}
UNITED_STATES = Refinement(-96, 38, radius=26.8, ratio=3)
#: Points of the even grid that are replaced, and new ones, by the number of all; and the radius around them in degrees.
REPLACED, NEW, RADIUS = 11_206 / 40_962, 35_270 / 40_962, 63.078
#: Cities of Europe, NASA's, cut out of a map of 4096 x 2048 pixels at this row and column.
LIGHTS = Path(__file__).parent.parent / "sample_images" / "europe_night.png"
ROW, COLUMN, HEIGHT = 317, 1911, 2048


def lights() -> NDArray[np.float64]:
    """Put the red of the sample image, which shows cities and little else, into a map of the globe."""
    red = cvtimg.read_image(LIGHTS)[:, :, 0]
    globe = np.zeros((HEIGHT, 2 * HEIGHT))
    globe[ROW : ROW + red.shape[0], COLUMN : COLUMN + red.shape[1]] = red
    return globe


def continents() -> NDArray[np.float64]:
    """Draw a round continent with bays, and another that is square."""
    lat, lon = np.meshgrid(np.linspace(89.5, -89.5, 180), np.linspace(-179.5, 179.5, 360), indexing="ij")
    round_one = np.hypot((lon + 60) * np.cos(np.radians(lat)), lat - 10) < 35 + 6 * np.cos(np.radians(4 * lon))
    return (round_one | ((np.abs(lon - 60) < 40) & (np.abs(lat - 30) < 20))).astype(np.float64)


def grids(n: int, land: NDArray[Any]) -> dict[str, SphereGrid]:
    """Make all grids by name; n points in the even grid, along coasts and by lights."""
    found = {name: cvtimg.sphere_grid(256, density=density, rng=1) for name, density in LECTURE.items()}
    n_new, n_kept = round(NEW * n), n - round(REPLACED * n)
    found["regional"] = cvtimg.sphere_grid(n_kept + n_new, density=UNITED_STATES)
    within = Cap(UNITED_STATES.lon, UNITED_STATES.lat, RADIUS)
    found["nested"] = nested_grid(cvtimg.sphere_grid(n), n_new, within=within, density=UNITED_STATES)
    found["coast"] = coastal_grid(n, land)
    found["lights"] = cvtimg.sphere_grid(n, density=by_spacing(lights(), 10))
    return found


def main(out: Path, n: int = 10_242, land: Path | None = None) -> dict[str, SphereGrid]:
    """Make the grids, plot each and write it as a mesh of MPAS."""
    found = grids(n, continents() if land is None else np.atleast_3d(cvtimg.read_image(land)).mean(axis=2))
    out.mkdir(parents=True, exist_ok=True)
    for name, grid in found.items():
        center = (10.0, 40.0) if name in ("coast", "lights") else (-96.0, 38.0)
        if isinstance(grid, CoastalGrid):
            values, label = 1.0 + grid.on_land + 3 * grid.on_coast, "1 sea, 2 land, 4 coast"
        else:
            values, label = np.degrees(np.sqrt(grid.areas)), "cell size (degrees)"
        drawn = draw_globe(list(grid.cells()), values, ".png", center=center, label=label)
        (out / f"{name}.png").write_bytes(drawn)
        grid.save(out / f"{name}.nc", overwrite=True)
        measures = grid.measures()
        print(
            f"{name:8} {len(grid.points):6} points, angles {measures.least_angle:.1f} to {measures.largest_angle:.1f}, "
            f"{measures.n_obtuse} obtuse, energy {grid.energy:.5g}"
        )
    return found


if __name__ == "__main__":
    read = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    read.add_argument("-n", type=int, default=10_242)
    read.add_argument("--land", type=Path)
    read.add_argument("--out", type=Path, default=Path("globe"))
    given = read.parse_args()
    main(given.out, given.n, given.land)

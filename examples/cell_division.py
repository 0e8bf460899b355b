"""Cells that divide: each generator becomes two, which then move to the centers of mass of their cells.

The growing embryos of some animals keep to such patterns, for instance starfish (Q. Du, V. Faber, M. Gunzburger, SIAM
Review 41 (1999), doi 10.1137/S0036144599352836).

    python examples/cell_division.py [OUT.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from drawing import draw_cells, panels, save
from numpy.typing import NDArray

from cvtimg.engine.methods import Stopping
from cvtimg.placement import (
    DESCENTS,
    ConstantDensity,
    Descent,
    Placement,
    PolygonMoments,
    PolygonRegion,
    Terms,
    voronoi_cells,
)

N_DIVISIONS = 5


def embryo() -> PolygonRegion:
    """Return an ellipse."""
    angles = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    return PolygonRegion(np.stack([1.3 * np.cos(angles), np.sin(angles)], axis=1))


def divide(region: PolygonRegion, generators: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divide each cell across its longest axis."""
    children = []
    for cell, generator in zip(voronoi_cells(generators, region), generators, strict=True):
        corners = np.asarray(cell.exterior.coords)[:-1] - generator
        _, sizes, axes = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)
        step = 0.4 * sizes[0] / len(corners) ** 0.5 * axes[0]
        children += [generator - step, generator + step]
    return np.array(children)


def main(path: Path) -> list[int]:
    """Divide some times, draw every stage, and return how many cells each has."""
    region = embryo()
    moments = PolygonMoments(region, ConstantDensity())
    generators = np.array([[0.1, 0.05]])
    stages: list[Descent] = []
    for _ in range(N_DIVISIONS + 1):
        stages.append(DESCENTS["l-bfgs"](moments, generators, Terms(Stopping(1e-8, 200))))
        generators = divide(region, stages[-1].generators)
    figure, axes = panels(
        [f"{len(stage.generators)} cell{'s' * (len(stage.generators) > 1)}" for stage in stages], side=2.6
    )
    for each, stage in zip(axes, stages, strict=True):
        placement = Placement.of(stage, region)
        draw_cells(each, placement.cells(), placement.points, placement.masses)
    save(figure, path)
    return [len(stage.generators) for stage in stages]


if __name__ == "__main__":
    print(main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/cell_division.png")))

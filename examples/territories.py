"""Territories of fish: each digs its pit, and spits sand away from it, towards its neighbors.

Mouthbreeders that settle at the same time end with polygons that are nearly Voronoi cells, with the pit in the middle
(G. Barlow, Hexagonal territories, Animal Behaviour 22 (1974), doi 10.1016/0003-3472(74)90010-4). Where fish settle one
after the other, those who are there do not move, and newcomers take the middle of what is left: the least regular
cells.

    python examples/territories.py [OUT.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

from drawing import draw_cells, panels, save

from cvtimg import place_generators
from cvtimg.placement import Box, CellMeasures, Placement

POND = Box([0, 0], [1.3, 1])
N_FISH = 60


def together(n_moves: int) -> Placement:
    """Let all settle at once; each moves its pit to the middle of its territory some times."""
    return place_generators(
        POND, N_FISH, method="lloyd", effort="best" if n_moves > 15 else "fast", callback=lambda i, _: i >= n_moves
    )


def one_by_one() -> Placement:
    """Let one settle after the other; only the last one moves."""
    there = place_generators(POND, 1)
    for n in range(2, N_FISH + 1):
        there = place_generators(POND, n, fixed=there.points, rng=n)
    return there


def main(path: Path) -> dict[str, CellMeasures]:
    """Settle the fish in both ways, draw their territories, and return how regular these are."""
    settled = {
        "One after the other": one_by_one(),
        "Together, at first": together(0),
        "Together, after 200 moves": together(200),
    }
    measures = {name: placement.measures() for name, placement in settled.items()}
    titles = [f"{name}\nareas differ by {measure.area_ratio:.1f}" for name, measure in measures.items()]
    figure, axes = panels(titles)
    for each, placement in zip(axes, settled.values(), strict=True):
        draw_cells(each, placement.cells(), placement.points, placement.masses)
    save(figure, path)
    return measures


if __name__ == "__main__":
    for name, measure in main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/territories.png")).items():
        print(f"{name}: largest area {measure.area_ratio:.1f} times the smallest, chi {measure.chi:.2f}")

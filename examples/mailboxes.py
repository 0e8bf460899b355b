"""Where to put mailboxes, so that the people of a town walk least.

The density is that of people; the energy, by their number, is the mean square of the way to the nearest mailbox. Two
mailboxes stand already and stay. Compare with mailboxes placed where it is only evenly far between them.

    python examples/mailboxes.py [OUT.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from drawing import draw_cells, panels, save
from numpy.typing import NDArray

from cvtimg import place_generators
from cvtimg.placement import PolygonRegion, SampleMoments

#: A town by a lake, in kilometers.
TOWN = PolygonRegion(
    [
        [[0, 0], [6, -0.4], [9, 1], [9.4, 4], [7, 6.2], [3, 6.4], [0.4, 5]],
        [[3.0, 2.6], [4.2, 2.2], [5.0, 2.9], [4.4, 3.8], [3.3, 3.7]],
    ]
)
#: Centers of quarters, with how many live there in thousands per square kilometer, and how far the quarter reaches.
QUARTERS = [((2.0, 1.4), 9.0, 0.9), ((7.2, 3.6), 14.0, 1.1), ((2.4, 5.2), 5.0, 0.8)]
STANDING = np.array([[2.0, 1.4], [6.0, 1.0]])


def people(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how many live at places, in thousands per square kilometer."""
    density = np.full(len(places), 0.3)
    for center, most, reach in QUARTERS:
        density += most * np.exp(-((places - center) ** 2).sum(axis=1) / (2 * reach**2))
    return density


def main(path: Path) -> dict[str, float]:
    """Place the mailboxes, draw them, and return the root mean square way in kilometers of both placements."""
    placements = {
        "Evenly spread": place_generators(TOWN, 24, fixed=STANDING),
        "By where people live": place_generators(TOWN, 24, fixed=STANDING, density=people),
    }
    walked = SampleMoments(TOWN.sample(100_000, density=people))
    ways = {}
    for name, placement in placements.items():
        moments = walked(placement.points)
        ways[name] = float((moments.energy / moments.masses.sum()) ** 0.5)
    figure, axes = panels([f"{name}: {1000 * way:.0f} m" for name, way in ways.items()])
    for each, placement in zip(axes, placements.values(), strict=True):
        draw_cells(each, placement.cells(), placement.points, walked(placement.points).masses)
        each.plot(*STANDING.T, "s", color="#c1121f", markersize=6)
    figure.suptitle("Mailboxes (red: standing already); cells are darker where more people use one", fontsize=10)
    save(figure, path)
    return ways


if __name__ == "__main__":
    for name, way in main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/mailboxes.png")).items():
        print(f"{name}: {1000 * way:.0f} m")

"""A field around the tip of a crack, interpolated by moving least squares from its values at scattered points.

The region is a square with a slit from its middle to its right side. Across the slit the field jumps, so points must
not reach through it: supports end where their points do not see. Each place lies in enough supports for polynomials of
the degree, which `support_radii` proves. Points of a centroidal Voronoi tessellation that is denser at the tip are
compared with as many points of a Halton sequence.

    python examples/slit.py [OUT.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from drawing import INK, panels, save
from matplotlib.collections import EllipseCollection
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import qmc

from cvtimg import place_generators, support_radii
from cvtimg.placement import Box
from cvtimg.supports import Supports

Points = NDArray[np.float64]

SQUARE = Box([-1, -1], [1, 1])
SLIT = [[[0, 0], [1, 0]]]
#: Supports that hold each place, by the degree of the polynomials: about twice as many as these have terms.
COVERS = {1: 6, 2: 12}


def field(places: Points) -> NDArray[np.float64]:
    """Return the displacement at a crack, which jumps across it and is not smooth at its tip, and a smooth part."""
    x, y = places.T
    angle = np.arctan2(y, x) % (2 * np.pi)
    return np.asarray(np.sqrt(np.hypot(x, y)) * np.sin(angle / 2) + 0.3 * np.sin(3 * x) * np.cos(2 * y))


def density(places: Points) -> NDArray[np.float64]:
    """Return how much places count: more at the tip."""
    return np.asarray((np.hypot(*places.T) + 0.03) ** -1.75)


def graded(n_points: int, n_moves: int = 40) -> Points:
    """Place generators that are denser at the tip, then move them to the centers of mass of what they see."""
    points = place_generators(SQUARE, n_points, density=density).points.copy()
    samples = SQUARE.draw(60 * n_points)
    weights = density(samples)
    for _ in range(n_moves):
        apart, near = cKDTree(points).query(samples, 8)
        apart[hidden(samples[:, None], points[near])] = np.inf
        own = np.take_along_axis(near, apart.argmin(axis=1)[:, None], axis=1)[:, 0]
        masses = np.bincount(own, weights, n_points)
        points = np.stack([np.bincount(own, weights * axis, n_points) / masses for axis in samples.T], axis=1)
    return points


def hidden(places: Points, points: Points) -> NDArray[np.bool_]:
    """Tell which lines between places and points cross the slit."""
    above, over = places[..., 1], points[..., 1]
    across = (above > 0) != (over > 0)
    share = above / np.where(across, above - over, 1)
    return np.asarray(across & (places[..., 0] + share * (points[..., 0] - places[..., 0]) > 0))


def halton(n_points: int) -> Points:
    """Take the first points of a Halton sequence, without its origin."""
    return np.asarray(2 * qmc.Halton(2, scramble=False).random(n_points + 1)[1:] - 1)


def terms(steps: Points, degree: int) -> Points:
    """Evaluate the monomials up to a degree at (m, 2) steps."""
    x, y = steps.T
    return np.stack([x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)], axis=1)


def interpolate(supports: Supports, values: NDArray[np.float64], places: Points, degree: int) -> NDArray[np.float64]:
    """Fit a polynomial around each place to the values in whose supports it lies, by weighted least squares."""
    near = supports.distances(places)
    found = np.empty(len(places))
    for row, place in enumerate(places):
        part = slice(near.indptr[row], near.indptr[row + 1])
        own, share = near.indices[part], near.data[part]
        weights = (1 - share) ** 2 * np.sqrt(4 * share + 1)  # the square root of Wendland's C2 function
        steps = (supports.points[own] - place) / supports.radii[own].max()
        # The value at the place is the constant term, the first.
        found[row] = np.linalg.lstsq(terms(steps, degree) * weights[:, None], values[own] * weights, rcond=1e-10)[0][0]
    return found


def errors(points: Points, places: Points) -> dict[int, float]:
    """Root mean squared errors at places, for polynomials of each degree."""
    found = {}
    for degree, cover in COVERS.items():
        supports = support_radii(points, SQUARE, cover, visible=SLIT, tighten=False)
        error = interpolate(supports, field(points), places, degree) - field(places)
        found[degree] = float(np.sqrt((error**2).mean()))
    return found


def main(path: Path, n_points: int = 1024, n_places: int = 3000) -> dict[str, dict[int, float]]:
    """Interpolate from both kinds of points, draw their supports, and return the errors."""
    places = np.random.default_rng(9).uniform(-1, 1, (n_places, 2))
    kinds = {"Halton points": halton(n_points), "Centroidal Voronoi, graded": graded(n_points)}
    found = {name: errors(points, places) for name, points in kinds.items()}
    figure, axes = panels([f"{name}\nrms error {error[1]:.1e}, {error[2]:.1e}" for name, error in found.items()])
    for each, points in zip(axes, kinds.values(), strict=True):
        radii = support_radii(points, SQUARE, visible=SLIT).radii
        disks = EllipseCollection(
            2 * radii, 2 * radii, 0, units="x", offsets=points, offset_transform=each.transData, facecolor="none"
        )
        disks.set(edgecolor=INK, linewidth=0.2, clip_on=True)
        each.add_collection(disks)
        each.plot(*points.T, ".", color=INK, markersize=2)
        each.plot([0, 1], [0, 0], color="#c1121f", linewidth=2)
        each.set(xlim=(-1, 1), ylim=(-1, 1))
    save(figure, path)
    return found


if __name__ == "__main__":
    for name, error in main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/slit.png")).items():
        print(f"{name}: root mean squared error {error[1]:.2e} linear, {error[2]:.2e} quadratic")

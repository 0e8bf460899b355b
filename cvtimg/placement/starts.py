"""Where generators start: as many in each part of a picture as a centroidal Voronoi tessellation ends with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg.placement import _moments

#: Children of a generator: offsets from it, as parts of the distance to its nearest neighbor.
_CHILDREN = np.array([[-2, -1], [1, -2], [2, 1], [-1, 2]]) / 6


def along_hilbert_curve(
    density: NDArray[np.float32], n_generators: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Draw (K, 2) places, in pixels, in the order of a Hilbert curve; each in one of K parts of equal rho^(1/2).

    In the plane a centroidal Voronoi tessellation of many generators has about rho^(1/2) of them in an area (Gersho's
    conjecture). A start by rho itself would leave light parts to few, and a uniform one cells without mass.
    """
    weights = np.sqrt(density)
    places = np.empty((n_generators, 2))
    total = weights.sum(dtype=np.float64)
    found = _moments.place_along_curve(weights, total / n_generators, places)
    places[found:] = places[found - 1]  # but for rounding, all are found
    return places + rng.random(places.shape)


def split_generators(generators: NDArray[np.float64], n_generators: int) -> NDArray[np.float64]:
    """Split each of (K, 2) generators into four that stand around it; leave out the last ones over `n_generators`."""
    from scipy.spatial import cKDTree

    gaps = cKDTree(generators).query(generators, 2)[0][:, 1]
    children: NDArray[np.float64] = generators[:, None] + gaps[:, None, None] * _CHILDREN
    return children.reshape(-1, 2)[:n_generators]

"""Voronoi cells of points in the unit cube or on the torus by samples, in any number of dimensions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts
from cvtimg.designs import _torus
from cvtimg.designs.exact_cells import Cells
from cvtimg.engine.points import assign, pack

_Floats = NDArray[np.float64]


def sobol_samples(n_samples: int, n_dims: int, rng: int | np.random.Generator) -> NDArray[np.float32]:
    """(m, d) scrambled Sobol points in the unit cube, m the power of two from `n_samples` on."""
    from scipy.stats.qmc import Sobol

    generator = np.random.default_rng(rng)
    samples: NDArray[np.float64] = Sobol(n_dims, rng=generator).random_base2((n_samples - 1).bit_length())
    return samples.astype(np.float32)


def nearest_points(samples: NDArray[np.float32], points: _Floats, periodic: bool) -> NDArray[np.int32]:
    """(m,) index of the nearest of (n, d) points to each sample in the unit cube, or on the torus."""
    if not periodic:
        packed = pack(samples, np.ones(len(samples)))
        return assign(packed, packed.frame.inward(points))[: len(samples)]
    labels = np.empty(len(samples), np.int32)
    columns = np.ascontiguousarray(points.T, np.float32)

    def assign_part(start: int, stop: int) -> None:
        _torus.assign_on_torus(samples[start:stop], columns, np.empty(len(points), np.float32), labels[start:stop])

    in_parts(assign_part, len(samples), work=samples.size * len(points) / 8)
    return labels


def offsets(
    samples: NDArray[np.float32], points: _Floats, labels: NDArray[np.int32], periodic: bool
) -> NDArray[np.float64]:
    """(m, d) vectors from the nearest point to each sample, the short way round on the torus."""
    apart = samples - points[labels]
    return apart - np.rint(apart) if periodic else apart


def sampled_cells(points: _Floats, n_samples: int, periodic: bool, rng: int | np.random.Generator) -> Cells:
    """Estimate the cells of (n, d) points by about so many samples."""
    n_points, n_dims = points.shape
    samples = sobol_samples(n_samples, n_dims, rng)
    labels = nearest_points(samples, points, periodic)
    apart = offsets(samples, points, labels, periodic)
    reaches, firsts = np.zeros(n_points), np.empty((n_points, n_dims))
    np.maximum.at(reaches, labels, np.sqrt((apart**2).sum(axis=1)))
    seconds = np.empty((n_points, n_dims, n_dims))
    for i in range(n_dims):
        firsts[:, i] = np.bincount(labels, apart[:, i], n_points)
        for j in range(n_dims):
            seconds[:, i, j] = np.bincount(labels, apart[:, i] * apart[:, j], n_points)
    volumes = np.bincount(labels, minlength=n_points)
    return Cells(volumes / len(samples), firsts / len(samples), seconds / len(samples), reaches)

"""The global structure of an image: slow patterns on the graph of its regions.

Neighboring regions are springs, weak across strong borders; the slowest vibrations of that graph move the large parts
of a picture against each other, and steps of them from region to region tell of borders that no disc can see.

P. Arbelaez, M. Maire, C. Fowlkes, J. Malik, IEEE Trans. Pattern Analysis and Machine Intelligence 33 (2011) 898-916,
doi 10.1109/TPAMI.2010.161: the same on pixels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_N_VECTORS = 16
#: Springs weaken by e for so much strength.
_SOFTNESS = 0.3
#: A spring is never weaker than this.
_LEAST = 1e-6
#: Below this number of regions all vibrations are computed.
_FEW = 100


def global_strengths(
    pairs: NDArray[np.int32],
    strengths: NDArray[np.float64],
    lengths: NDArray[np.int32],
    sizes: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(B,) steps of the eigenvectors across borders (B, 2), summed.

    Parameters
    ----------
    pairs, lengths, strengths
        Of the borders.
    sizes : (N,) array
        Pixels of each region.

    Returns
    -------
    (B,) float64 array
        Of the order of the strengths.
    """
    if not len(pairs):
        return np.zeros(0)
    weights = lengths.astype(np.float64) * np.exp(-strengths / _SOFTNESS) + _LEAST
    eigenvalues, vectors = _slow_vectors(pairs, weights, sizes)
    if not len(eigenvalues):
        return np.zeros(len(pairs))
    spans = vectors.max(axis=0) - vectors.min(axis=0)
    steps = np.abs(vectors[pairs[:, 0]] - vectors[pairs[:, 1]]) / spans
    summed: NDArray[np.float64] = np.einsum("bk,k->b", steps, np.sqrt(eigenvalues[0] / eigenvalues))
    return summed


def _slow_vectors(
    pairs: NDArray[np.int32], weights: NDArray[np.float64], masses: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Eigenvalues, rising, and eigenvectors in columns; without those of 0, which only tell connected parts apart."""
    from scipy.sparse import coo_array, csc_array, diags_array
    from scipy.sparse.csgraph import connected_components
    from scipy.sparse.linalg import eigsh
    from threadpoolctl import threadpool_limits

    n_regions = len(masses)
    ends = np.concatenate([pairs, pairs[:, ::-1]]).T
    springs = coo_array((np.tile(weights, 2), (ends[0], ends[1])), shape=(n_regions, n_regions))
    n_still = connected_components(springs, directed=False)[0]
    n_vectors = min(_N_VECTORS + n_still, n_regions)
    stiffness = np.bincount(ends[0], np.tile(weights, 2), n_regions)
    roots = np.sqrt(masses / masses.mean())
    scale = diags_array(1 / roots)
    matrix = csc_array(scale @ (diags_array(stiffness) - springs) @ scale)
    # One thread, for the bits must not depend on how many there are.
    with threadpool_limits(1, user_api="blas"):
        if n_regions <= _FEW:
            values, vectors = np.linalg.eigh(matrix.toarray())
        else:
            start = roots + 0.1 * np.cos(1.7 * np.arange(n_regions))
            shift = -1e-4 * stiffness.mean()
            values, vectors = eigsh(matrix, k=n_vectors, sigma=shift, which="LM", v0=start, tol=1e-4)
    order = np.argsort(values)[n_still:n_vectors]
    return np.maximum(values[order], 1e-9), vectors[:, order] / roots[:, None]

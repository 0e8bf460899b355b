"""Make the blue-noise mask of cvtimg by void and cluster: ``python docs/make_blue_noise.py``.

R. Ulichney, "The void-and-cluster method for dither array generation", Proc. SPIE 1913 (1993) 332-343,
doi 10.1117/12.152707. The mask is a torus; the same seed gives the same mask.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

MASK = Path(__file__).parent.parent / "cvtimg" / "quantization" / "blue_noise.npy"
SIDE = 64
#: Standard deviation of the filter that tells clusters from voids; the paper recommends 1.5.
SIGMA = 1.5
#: Part of the pixels in the first pattern.
FIRST = 0.1
SEED = 0


class Pattern:
    """A binary pattern on a torus, and how crowded each place is."""

    def __init__(self, ones: NDArray[np.bool_]) -> None:
        point = np.zeros(ones.shape)
        point[0, 0] = 1
        self._around_origin = gaussian_filter(point, SIGMA, mode="wrap")
        self.ones = ones.copy()
        self._crowd = gaussian_filter(ones.astype(np.float64), SIGMA, mode="wrap")

    def flip(self, place: tuple[int, int]) -> None:
        """Set or clear one pixel."""
        sign = -1 if self.ones[place] else 1
        self.ones[place] ^= True
        self._crowd += sign * np.roll(self._around_origin, place, axis=(0, 1))

    def tightest_cluster(self) -> tuple[int, int]:
        """Find the most crowded pixel that is set."""
        return self._place(np.where(self.ones, self._crowd, -np.inf).argmax())

    def largest_void(self) -> tuple[int, int]:
        """Find the least crowded pixel that is not set."""
        return self._place(np.where(self.ones, np.inf, self._crowd).argmin())

    def _place(self, index: np.intp) -> tuple[int, int]:
        row, column = np.unravel_index(index, self.ones.shape)
        return int(row), int(column)


def first_pattern() -> NDArray[np.bool_]:
    """Move set pixels from clusters to voids, until the one that is moved goes back to where it was."""
    pattern = Pattern(np.random.default_rng(SEED).random((SIDE, SIDE)) < FIRST)
    while True:
        cluster = pattern.tightest_cluster()
        pattern.flip(cluster)
        void = pattern.largest_void()
        pattern.flip(void)
        if void == cluster:
            return pattern.ones


def mask() -> NDArray[np.uint16]:
    """(SIDE, SIDE) rank of each pixel: those of the first pattern by cluster, those that fill it up by void."""
    ones = first_pattern()
    ranks = np.empty(ones.shape, np.uint16)
    down, up = Pattern(ones), Pattern(ones)
    for rank in range(int(ones.sum()) - 1, -1, -1):
        cluster = down.tightest_cluster()
        down.flip(cluster)
        ranks[cluster] = rank
    for rank in range(int(ones.sum()), ones.size):
        void = up.largest_void()
        up.flip(void)
        ranks[void] = rank
    return ranks


def main() -> None:
    """Write cvtimg/quantization/blue_noise.npy."""
    np.save(MASK, mask())


if __name__ == "__main__":
    main()

"""Edge-weighted tessellations: every pair of near pixels in different segments costs, so that edges are few and short.

The energy of labels l with generators z on the values u of the pixels is

    E = sum over x of |u(x) - z_l(x)|^2 + edge_weight * sum over x of |{y near x: l(y) != l(x)}|,

with y near x if it lies within a disc about x. Pixels on a boundary are transferred to the segment where E is least,
one after the other, and both means move with each: as the change of E is known exactly, E never rises. Along a
straight edge in the direction of the axes each pixel's length costs 36 `edge_weight` at radius 3; a disc that differs
by c from its surroundings is worth its edge from a radius of about 72 `edge_weight` / c^2 on.

J. Wang, L. Ju, X. Wang, IEEE Transactions on Image Processing 18 (2009) 1844-1858.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cvtimg._shared.threads import in_parts
from cvtimg.segmentation import _edge_weight

#: A sweep that transfers no more than this share of the boundary pixels has transferred almost none.
_ALMOST_NONE = 1e-3
_MAX_SWEEPS = 1000


@dataclass(frozen=True, slots=True, eq=False)
class EdgeWeighted:
    """Segments of low edge-weighted energy.

    Attributes
    ----------
    labels : (H, W) int32 array
        From 1; 0 outside of the mask.
    generators : (K, D) float64 array
        The mean of each segment, by its label less 1. Where no pixel has weight, it is where the last one left it.
    masses : (K, D) float64 array
        The weight of each segment in each channel; 0 for segments that have vanished.
    energies : tuple of float
        Before each sweep and at the end; they never rise.
    n_sweeps : int
        Sweeps over the boundary pixels.
    converged : bool
        Whether the last sweep transferred almost none.
    """

    labels: NDArray[np.int32]
    generators: NDArray[np.float64]
    masses: NDArray[np.float64]
    energies: tuple[float, ...]
    n_sweeps: int
    converged: bool

    def __post_init__(self) -> None:
        for array in (self.labels, self.generators, self.masses):
            array.flags.writeable = False


def descend(
    values: NDArray[np.float32],
    labels: NDArray[np.int32],
    n_segments: int,
    *,
    edge_weight: float,
    radius: int = 3,
    weights: NDArray[np.float32] | None = None,
    volume_power: float = 0,
    connected: bool = False,
    max_sweeps: int = _MAX_SWEEPS,
) -> EdgeWeighted:
    """Transfer boundary pixels between segments until that lowers the energy no more.

    Parameters
    ----------
    values : (H, W, D) float32 array
        Finite, and best with a mean near 0: float32 then holds what matters.
    labels : (H, W) int32 array
        Where to start: 1..n_segments, and 0 outside of the mask. A pixel outside has no energy and is nobody's
        neighbor, as if the picture ended there.
    n_segments : int
        K. Segments can vanish.
    edge_weight : float
        What a pair of near pixels in different segments costs, in squared units of the values; each pair counts
        twice, once from each side.
    radius : int
        Pixels are near each other up to this distance.
    weights : (H, W, D) float32 array, optional
        Finite weights >= 0 of each pixel in each channel. A pixel that has none in any channel starts with the label
        of the nearest pixel that has, and follows its neighbors.
    volume_power : float
        Each segment's first term counts by its share of the mass to this power.
    connected : bool
        Keep in one piece, and from vanishing, each segment that starts so: pixels that share a side are neighbors.
    max_sweeps : int
        Stop after so many sweeps in any case.

    Returns
    -------
    EdgeWeighted
    """
    padded = np.pad(_start(labels, weights).astype(np.int32, copy=False), radius)
    whole = _Whole(
        values=np.ascontiguousarray(values, dtype=np.float32),
        weights=None if weights is None else np.ascontiguousarray(weights, dtype=np.float32),
        labels=padded,
        others=np.zeros(padded.shape, np.uint16),
        stale=np.zeros(padded.shape, np.uint8),
    )
    state = State(lambda backward: [whole], values.shape[1:], n_segments, radius)
    state.begin()
    energies, converged = settle(state, edge_weight, volume_power, connected, max_sweeps)
    return EdgeWeighted(
        labels=padded[radius:-radius, radius:-radius].copy(),
        generators=state.means[1:].copy(),
        masses=state.masses[1:].copy(),
        energies=energies,
        n_sweeps=len(energies) - 1,
        converged=converged,
    )


def settle(
    state: State,
    edge_weight: float,
    volume_power: float = 0,
    connected: bool = False,
    max_sweeps: int = _MAX_SWEEPS,
) -> tuple[tuple[float, ...], bool]:
    """Sweep until almost nothing moves; return the energies, before each sweep and at the end, and whether it rests."""
    energies = [state.energy(edge_weight, volume_power)]
    all_visited, converged = True, False
    while not converged and len(energies) <= max_sweeps:
        moved = state.sweep(edge_weight, volume_power, connected, backward=len(energies) % 2 == 0)
        energies.append(state.energy(edge_weight, volume_power))
        at_rest = moved <= _ALMOST_NONE * state.n_boundary
        # Generators have moved a little since some pixels were looked at: all are, before it is over.
        converged = at_rest and all_visited
        all_visited = at_rest
        if at_rest:
            state.wake()
    state.measure()  # free of the rounding of the sweeps
    return tuple(energies), converged


def _start(labels: NDArray[np.int32], weights: NDArray[np.float32] | None) -> NDArray[np.int32]:
    """Give unknown pixels the label of the nearest known one."""
    if weights is None:
        return labels
    unknown = ~weights.any(axis=2)
    known = ~unknown & (labels > 0)
    if not (unknown & (labels > 0)).any() or not known.any():
        return labels
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.where(unknown & (labels > 0), labels[tuple(nearest)], labels)


class Strip(Protocol):
    """All rows of a picture, or some that follow each other; a frame of `radius` pixels surrounds all but the values.

    The frame holds what lies around these rows, or zeros beyond the picture.
    """

    @property
    def values(self) -> NDArray[np.float32]:
        """(H, W, D) values."""

    @property
    def weights(self) -> NDArray[np.float32] | None:
        """(H, W, D) weights of the values, or None."""

    @property
    def labels(self) -> NDArray[np.int32]:
        """Labels from 1; 0 outside of the mask."""

    @property
    def others(self) -> NDArray[np.uint16]:
        """How many pixels that are near have another label."""

    @property
    def stale(self) -> NDArray[np.uint8]:
        """1 where a pixel that is near has changed its label since this one was visited."""

    def save(self) -> None:
        """Put back where they are from the labels, and what is kept up to date with them."""


@dataclass(frozen=True, slots=True, eq=False)
class _Whole:
    """A picture in memory."""

    values: NDArray[np.float32]
    weights: NDArray[np.float32] | None
    labels: NDArray[np.int32]
    others: NDArray[np.uint16]
    stale: NDArray[np.uint8]

    def save(self) -> None:
        """Nothing is elsewhere."""


class State:
    """The cells of a picture that comes in strips, which make no difference to what becomes of it.

    Parameters
    ----------
    strips : callable
        From whether backward to the strips in order, from above to below or, backward, from below to above.
    shape : (W, D)
        Pixels of a row, and values of a pixel.
    n_segments, radius
        As in `descend`.
    """

    def __init__(
        self, strips: Callable[[bool], Iterable[Strip]], shape: tuple[int, ...], n_segments: int, radius: int
    ) -> None:
        width, n_dims = shape
        self.radius = radius
        self.steps = (disc(radius) @ (width + 2 * radius, 1)).astype(np.int32)
        self.means = np.zeros((n_segments + 1, n_dims))
        self.masses = np.zeros_like(self.means)
        self.parts = np.zeros(n_segments + 1)
        self._strips = strips
        self._n_pairs = self.n_boundary = 0
        self._counts = np.zeros(n_segments + 1, np.int32)
        self._found = np.zeros(len(self.steps), np.int32)

    def begin(self) -> None:
        """Count neighbors, and measure the cells."""
        for strip in self._strips(False):

            def count(first: int, last: int, strip: Strip = strip) -> None:
                _edge_weight.count_others(strip.labels, self.steps, self.radius, first, last, strip.others)

            in_parts(count, len(strip.values), work=strip.labels.size * len(self.steps) / 8)
            strip.stale[:] = 1
            strip.save()
        self._count()
        self.measure()  # about the origin, to find the means
        self.measure()

    def _count(self) -> None:
        """Add up what the strips know of edges."""
        self._n_pairs = self.n_boundary = 0
        for strip in self._strips(False):
            own = strip.others[self.radius : -self.radius]
            self._n_pairs += int(own.sum(dtype=np.int64))
            self.n_boundary += int(np.count_nonzero(own))

    def wake(self) -> None:
        """Let the next sweep visit all pixels."""
        for strip in self._strips(False):
            strip.stale[:] = 1
            strip.save()

    def energy(self, edge_weight: float, volume_power: float) -> float:
        """Return the energy of the labels as they are."""
        sizes = self.masses.mean(axis=1)
        shares = sizes / max(sizes.sum(), 1e-300)
        return float(shares**volume_power @ self.parts) + edge_weight * self._n_pairs

    def sweep(self, edge_weight: float, volume_power: float, connected: bool, backward: bool) -> int:
        """Return how many pixels were transferred."""
        moved = 0
        for strip in self._strips(backward):
            if strip.stale.any():
                moved += self._sweep(strip, edge_weight, volume_power, connected, backward)
                strip.save()
        self._count()
        return moved

    def _sweep(self, strip: Strip, edge_weight: float, volume_power: float, connected: bool, backward: bool) -> int:
        return _edge_weight.sweep(
            strip.values,
            strip.weights,
            strip.labels,
            strip.others,
            strip.stale,
            self.steps,
            self.radius,
            self.masses,
            self.means,
            self.parts,
            self._counts,
            self._found,
            edge_weight,
            volume_power,
            float(self.masses.mean(axis=1).sum()),
            connected,
            backward,
        )

    def measure(self) -> None:
        """Sum up each segment, about the mean that it had, and move that to the mean that it has."""
        moments = np.zeros((3, *self.means.shape))
        for strip in self._strips(False):
            _edge_weight.measure_cells(strip.values, strip.weights, strip.labels, self.radius, self.means, moments)
        self.masses, sums, squares = np.ascontiguousarray(moments)
        step = np.divide(sums, self.masses, out=np.zeros_like(sums), where=self.masses > 0)
        self.means += step
        self.parts = np.maximum(squares - step * sums, 0).sum(axis=1)


def disc(radius: int) -> NDArray[np.intp]:
    """(S, 2) steps down and right to the neighbors within a disc, its center not among them."""
    down, right = np.mgrid[-radius : radius + 1, -radius : radius + 1].reshape(2, -1)
    near = (down**2 + right**2 <= radius**2) & ((down != 0) | (right != 0))
    steps: NDArray[np.intp] = np.stack([down, right], axis=1)[near]
    return steps


def length_cost(radius: int) -> int:
    """Return what a pixel's length of a straight edge along an axis costs, for an edge weight of 1: 36 at radius 3."""
    return int(np.abs(disc(radius)[:, 0]).sum())

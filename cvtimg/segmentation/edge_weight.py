"""Edge-weighted tessellations: each pair of near pixels in different segments costs, which keeps edges few and short.

The energy of labels l with generators z on the values u of the pixels is

    E = sum over x of |u(x) - z_l(x)|^2 + edge_weight * sum over x of |{y near x: l(y) != l(x)}|,

where y is near x if it lies within a disc about x. Boundary pixels are transferred, one after the other, to the segment
where E is least, and each transfer updates both means at once: the change of E is known exactly, so E falls. A
straight edge along an axis costs 36 `edge_weight` per pixel of its length at radius 3; a disc that differs by c from
its surroundings is worth its edge from a radius of about 72 `edge_weight` / c^2 on. A disc shrinks pixel by pixel only
below half of that radius: to take away what is not worth its edge, descend at twice the weight first. In a volume the
disc of near pixels is a ball; one that differs by c is worth its border from a radius of about 428 `edge_weight` / c^2
on, and shrinks below two thirds of that: there, 3/2 of the weight comes first. Where regions move as a whole
(`region_moves.py`), larger ones that are not worth their edges go as well.

A segment k may have rates of its own: its part of E is then f_k times its energy, and o_k for each of its pixels.

J. Wang, L. Ju, X. Wang, IEEE Transactions on Image Processing 18 (2009) 1844-1858.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial, reduce
from itertools import pairwise
from math import log
from typing import Any, NamedTuple

import numpy as np

import cvtimg.segmentation._segments as _segments
from cvtimg._shared.progress import tell
from cvtimg._shared.records import ReadOnly
from cvtimg._shared.sums import copy_rows
from cvtimg._shared.threads import in_stripes, of_each, side_by_side
from cvtimg._shared.types import Bools, Floats, Floats32, Indices, Ints
from cvtimg.labels.components import grid_of_cells
from cvtimg.segmentation.region_moves import parts_of, rearranged
from cvtimg.segmentation.values import from_nearest

#: A sweep has transferred almost no pixels if it has transferred at most this share of those on boundaries.
_ALMOST_NONE = 9e-4
_MAX_SWEEPS = 1000
#: Rows of a stripe at least: with fewer, 16 threads have more parts of 14 megapixels, and borders meet more stripes.
_STRIPE = 32
#: Pixels are near each other up to this distance by default, and correlated where a segment does not explain them.
RADIUS = 3
#: Pixels of which variances are taken; up to four times as many where rows are long.
_ENOUGH_SAMPLES = 1 << 14
#: Regions of an image of more pixels move in a smaller one in memory, whose sides are halved until it has no more.
_ENOUGH_PIXELS = 1 << 19
#: Pixels above which superpixels are found at half the size, and sweeps that they get.
_ENOUGH_FOR_CELLS, _CELL_SWEEPS = 1 << 16, 4
#: Sweeps before regions move, and between rounds of moves.
_FIRST_SWEEPS, _SWEEPS_BETWEEN = 3, 2


@dataclass(frozen=True, slots=True, eq=False)
class EdgeWeighted(ReadOnly):
    """Segments of low edge-weighted energy."""

    labels: Ints  # (H, W): labels from 1; 0 outside the mask
    #: (K, D): mean of each segment; row ``label - 1`` belongs to a label. A segment without weight keeps its last
    #: mean.
    generators: Floats
    masses: Floats  # (K, D): weight of each segment in each channel; 0 for segments that have vanished
    energies: tuple[float, ...]  # energy before each sweep and at the end; it never rises
    edge_weight: float  # the cost of each pair of near pixels, from either side
    converged: bool  # whether the last sweep transferred almost no pixels


def descend(
    values: Floats32,
    labels: Ints,
    n_segments: int,
    *,
    edge_weight: float,
    weights: Floats32 | None = None,
    max_sweeps: int = _MAX_SWEEPS,
    detail: float = 0,
    **moves: Any,
) -> EdgeWeighted:
    """Move pixels and regions of (H, W) labels between segments until that lowers the energy no more; see `Moves`."""
    # Values, (H, W, D), have a mean near 0, so that float32 is precise enough. Label 0 is outside: it has no energy and
    # is nobody's neighbor. Each pair of near pixels in different segments costs `edge_weight` twice, once from each
    # side. A pixel without weight, (H, W, D), in any channel starts with the label of the nearest one that has some,
    # and follows its neighbors. With `connected`, segments stay in one piece and do not vanish. With `detail`, the
    # edge weight is at least that of `State.descend`.
    allowed = Moves(**moves)
    frame = slice(allowed.radius, -allowed.radius)
    padded = np.zeros([side + 2 * allowed.radius for side in labels.shape], np.int32)
    known = None if weights is None else np.ascontiguousarray(weights, dtype=np.float32)
    if known is not None:
        inside, has_weight = labels > 0, known.any(axis=2)
        if (inside & has_weight).any():
            labels = np.where(inside & ~has_weight, from_nearest(labels, inside & has_weight), labels)
    copy_rows(labels, padded[frame, frame])
    others, stale = np.zeros(padded.shape, np.uint16), np.zeros(padded.shape, np.uint8)
    whole = Layers(np.ascontiguousarray(values, dtype=np.float32), known, padded, others, stale)
    state = State(whole, values.shape, n_segments, allowed)
    energies, edge_weight, converged = state.descend(edge_weight, detail, max_sweeps)
    inner, cells = copy_rows(padded[frame, frame], np.empty(labels.shape, np.int32)), state.cells
    return EdgeWeighted(inner, cells.means[1:].copy(), cells.masses[1:].copy(), energies, edge_weight, converged)


class Layers(NamedTuple):
    """An image and its labels, in arrays or in files of arrays: in anything that has slices of rows."""

    values: Any  # (H, W, D) float32
    weights: Any  # (H, W, D) float32: weights of the values, or None
    labels: Any  # (H + 2 R, W + 2 R) int32, in a frame of zeros: labels from 1; 0 outside the mask
    others: Any  # the same in uint16: number of near pixels with another label
    stale: Any  # the same in uint8: 1 where a near pixel has changed its label since this one was visited

    def rows(self, first: int, last: int, radius: int) -> Layers:
        """Return some rows, in a frame that holds what surrounds them."""
        inner, framed = slice(first, last), slice(first, last + 2 * radius)
        weights = None if self.weights is None else self.weights[inner]
        return Layers(self.values[inner], weights, *(layer[framed] for layer in self[2:]))


class Moves(NamedTuple):
    """Which transfers lower the energy, and which are allowed."""

    radius: int = RADIUS  # pixels are near each other up to this distance
    volume_power: float = 0  # cells count by their share of the mass to this power
    connected: bool = False  # whether cells must stay in one piece
    planes: Planes | None = None  # those of a volume, or none: an image
    #: Edge weight of regions, which move as a whole; with a detail, the least. None: pixels move one by one.
    of_regions: float | None = None
    described: bool = False  # whether that of a detail is the most, and the least description decides
    n_cells: int = 500  # superpixels, whose parts in segments move
    n_rounds: int = 1  # of moves


class Planes(NamedTuple):
    """The planes of a volume as one image, each below the one before."""

    # Rows that do not count keep the planes apart, and enough planes of these come first and last that none of the
    # steps to neighbors leads out of the image.
    rows: int  # from one plane to the next
    spacing: float  # from one plane to the next, in pixels


class SegmentMoments:
    """Moments of each label; row 0, for pixels outside the mask, stays empty."""

    def __init__(self, n_segments: int, n_dims: int) -> None:
        self.rows = np.zeros((n_segments + 1, 2 * n_dims + 1))
        self.masses, self.means = self.rows[:, :n_dims], self.rows[:, n_dims:-1]  # in each channel
        self.energies = self.rows[:, -1]  # of each cell about its mean

    def add(self, changes: Floats, cells: Indices | slice = slice(None)) -> None:
        """Add masses, sums and squares about the means of some cells, and move these to where they are then."""
        n_dims = self.masses.shape[1]
        before, sums = self.masses[cells], changes[:, n_dims:-1]
        masses = before + changes[:, :n_dims]
        is_there = masses > 1e-12 * before  # less may be rounding: the cell is gone and keeps its mean
        step = np.divide(sums, masses, out=np.zeros_like(sums), where=is_there)
        self.masses[cells] = masses
        self.means[cells] += step
        self.energies[cells] = np.maximum(self.energies[cells] + changes[:, -1] - (step * sums).sum(axis=1), 0)

    def measure(self, image: Layers, stripes: Sequence[tuple[int, int]], margin: int) -> None:
        """Sum up each segment about the mean that it had, and move that to the mean that it has now."""

        def moments(stripe: tuple[int, int]) -> Floats:
            part, sums = image.rows(*stripe, margin), np.zeros_like(self.rows)
            _segments.measure_cells(part.values, part.weights, part.labels, margin, self.rows, sums)
            return sums

        total = reduce(np.add, side_by_side(moments, stripes))
        self.masses[:], self.energies[:] = 0, 0
        self.add(total)


def moments_of(values: Floats32, labels: Ints) -> SegmentMoments:
    """Measure the segments of (H, W, D) values with a mean near 0."""
    moments = SegmentMoments(int(labels.max(initial=0)), values.shape[2])
    for _ in range(2):  # about the origin, to find the means; and about these
        moments.measure(Layers(values, None, *(labels,) * 3), _stripes(len(labels)), 0)
    return moments


def _stripes(height: int, least: int = 0) -> list[tuple[int, int]]:
    return [*pairwise([*range(0, height, max(_STRIPE, least)), height])]


class State:
    """The cells of an image of the shape (H, W, D), of which some rows are read at a time.

    Sweeps go over stripes of rows, every other one side by side and then those between: no pixel of one is near one of
    another. Each sees the cells as they were and what it changes itself. Stripes depend on the image alone, not on the
    threads; transfers in two of them could raise E a little together, which none of 120 descents on photographs did.
    The first sweep, which moves most, takes six in turn, or borders would gather where stripes meet.
    """

    def __init__(self, image: Layers, shape: tuple[int, ...], n_segments: int, moves: Moves) -> None:
        (height, width, n_dims), radius = shape, moves.radius
        stride, rows = width + 2 * radius, moves.planes.rows if moves.planes else 0
        steps = (neighbors(radius, moves.planes) @ (rows * stride, stride, 1)).astype(np.int32)
        self._steps, self._margin, self._reach = steps, radius, -(-int(steps.max()) // stride)
        self.cells = SegmentMoments(n_segments, n_dims)
        self.rates = np.zeros((n_segments + 1, 2))
        self.rates[:, 0] = 1
        self._image, self._moves, self._shape = image, moves, shape
        self._stripes = _stripes(height, 2 * self._reach)
        self._measure = partial(self.cells.measure, image, self._stripes, radius)
        self._measure()  # about the origin, to find the means
        self._measure()

    def descend(self, edge_weight: float, detail: float, max_sweeps: int = _MAX_SWEEPS) -> tuple[Any, float, bool]:
        """Sweep until nothing moves; return the energies, the edge weight, and whether that was the end.

        The weight is the least at which discs of the radius `detail` are just worth their edge where the contrast
        between segments that meet is greatest.
        """
        radius, planes = self._moves.radius, self._moves.planes
        worth = self._greatest_step() * weight_of_detail(detail, radius, planes) if detail else 0.0
        weight, shrinking = max(edge_weight, worth), (1.5 if is_deep(radius, planes) else 2) * worth
        of_regions, described = self._moves.of_regions, self._moves.described and worth > 0
        self._begin()
        if shrinking > weight and not described:
            self._settle(shrinking, max_sweeps)
        if of_regions is not None:
            least, most = (of_regions, worth) if described else (max(of_regions, worth), 0.0)
            self._settle(weight, min(_FIRST_SWEEPS, max_sweeps))
            weight = self._move_regions(edge_weight, least, most)
        energies, converged = self._settle(weight, max_sweeps)
        return energies, weight, converged

    def _move_regions(self, of_pixels: float, least: float, most: float) -> float:
        """Move regions, of a large image in a smaller one, and return the edge weight to go on with."""
        (height, width, _), margin = self._shape, self._margin
        if self._moves.planes or height * width <= _ENOUGH_PIXELS:
            cells = self._cells()
            for _ in range(self._moves.n_rounds):
                weight = self._describe(least, most)
                if not self._rearrange(cells, weight):
                    break
                self._settle(max(weight, of_pixels), _SWEEPS_BETWEEN)
            return max(weight, of_pixels)
        side = 2 ** int(np.log2(height * width / _ENOUGH_PIXELS) / 2 + 1)  # of the squares that become one pixel
        values, before = self._reduced(side)
        frames = (np.zeros([length + 2 * margin for length in before.shape], kind) for kind in (np.uint16, np.uint8))
        image = Layers(values, None, np.pad(before, margin), *frames)
        small = State(image, values.shape, len(self.rates) - 1, self._moves)
        small._begin()
        small._settle(small._move_regions(of_pixels / side, least / side, most / side), _MAX_SWEEPS)
        after = image.labels[margin:-margin, margin:-margin]
        columns = np.minimum(np.arange(width) // side, before.shape[1] - 1)
        has_changed = after != before

        def enlarge(stripe: tuple[int, int]) -> None:
            labels = self._image.rows(*stripe, margin).labels[margin:-margin, margin:-margin]
            rows = np.minimum(np.arange(*stripe) // side, len(before) - 1)
            y, x = np.nonzero(has_changed[rows].take(columns, axis=1))
            blocks = rows[y], columns[x]
            labels[y, x] = np.where(labels[y, x] == before[blocks], after[blocks], labels[y, x])

        deque(side_by_side(enlarge, self._stripes), maxlen=0)
        self._changed()
        return max(self._describe(least, most), of_pixels)

    def _changed(self) -> None:
        """Measure labels that have been written."""
        margin = self._margin
        for first, last in self._stripes:
            self._image.others[first + margin : last + margin][:] = 0
        self._measure()
        self._begin()

    def _describe(self, least: float, most: float) -> float:
        """Set what pixels cost in each segment by its variance, and return the edge weight of regions.

        A segment of the variance C describes n pixels in n / 2 A ln C nats beyond what all have, and an edge takes ln 3
        for each pixel of its length, as a chain code. A is the area over which pixels are correlated. If the most is 0,
        it is the least weight that holds.
        """
        if not most:
            return least
        radius, planes, margin = self._moves.radius, self._moves.planes, self._margin
        lags = [(down, right) for _, down, right in neighbors(min(radius, RADIUS)) if (down, right) > (0, 0)]
        n_labels, means = len(self.rates), self.cells.means
        products, counts = np.zeros((2, len(lags) + 1, n_labels))
        n_rows = -(-_ENOUGH_SAMPLES // (self._shape[1] * len(self._stripes)))
        some = self._stripes[:: max(8 * self._shape[1] * len(self._stripes) // (4 * _ENOUGH_SAMPLES), 1)]
        for first, last in some:
            band = self._image.rows(first, min(last, first + max(n_rows, 8)), margin)
            labels = band.labels[margin:-margin, margin:-margin]
            rest = band.values - means[labels]
            for number, (down, right) in enumerate([(0, 0), *lags]):
                here = np.s_[: len(labels) - down, max(-right, 0) : labels.shape[1] - max(right, 0)]
                there = np.s_[down:, max(right, 0) : labels.shape[1] + min(right, 0)]
                same = np.where(labels[here] == labels[there], labels[here], 0).ravel()
                product = np.einsum("yxd,yxd->yx", rest[here], rest[there]).ravel()
                products[number] += np.bincount(same, product, n_labels)
                counts[number] += np.bincount(same, minlength=n_labels)
        covariances = products / np.maximum(counts, 1)
        share = counts[0] * (np.arange(n_labels) > 0)
        share /= share.sum()
        least_variance = max(1e-9 * float((share * covariances[0]).sum()), 1e-100)  # of segments of one color
        c = np.maximum(covariances[0], least_variance)
        s = np.maximum(c + 2 * covariances[1:].sum(axis=0), least_variance)
        g0 = float(np.exp((share * np.log(c)).sum()))
        g = max(float(np.exp((share * np.log(s)).sum())), g0)
        c[share == 0] = g0
        self.rates[:] = np.stack([g0 / c, g0 * np.log(c / g0)], axis=1)
        return max(least, min(2 * log(3) * g / length_cost(radius, planes), most))

    def _cells(self) -> Ints:
        """(H, W) superpixels; of a volume, cubes."""
        planes, (height, width, _), n_cells = self._moves.planes, self._shape, self._moves.n_cells
        image = self._image.rows(0, height, self._margin)
        inside = image.labels[self._margin : -self._margin, self._margin : -self._margin] > 0
        if planes is None:
            return cells_at_edges(image.values, inside, n_cells)
        side = max((np.count_nonzero(inside) * planes.spacing / n_cells) ** (1 / 3), 1)
        plane, down = np.divmod(np.arange(height, dtype=np.int32), planes.rows)
        deep = plane // max(round(side / planes.spacing), 1)
        high, wide = (places // round(side) for places in (down, np.arange(width, dtype=np.int32)))
        return ((deep * (high.max() + 1) + high) * (wide.max() + 1))[:, None] + wide

    def _rearrange(self, cells: Ints, edge_weight: float) -> bool:
        """Move regions, in parts of superpixels; return whether any moved."""
        margin, image, n_labels = self._margin, self._image.rows(0, self._shape[0], self._margin), len(self.rates)
        inner = image.labels[margin:-margin, margin:-margin]
        keys = np.where(inner > 0, cells * np.int64(n_labels) + inner, 0)
        present = np.bincount(keys.ravel()) > 0
        present[0] = False
        before = np.flatnonzero(present) % n_labels - 1
        numbers = np.where(present, np.cumsum(present), 0).astype(np.int32)[keys]
        parts = parts_of(image.values, np.pad(numbers, margin), margin, self._steps, 2 * edge_weight, self.rates[1:])
        after = rearranged(parts, before)
        if (after == before).all():
            return False
        inner[:] = np.append(0, after + 1)[numbers]
        self._changed()
        return True

    def _reduced(self, side: int) -> tuple[Floats32, Ints]:
        """Return means of squares of pixels, and the labels in their middles."""
        margin, height, values, labels = self._margin, self._shape[0] // side, [], []
        for first in range(0, height, _STRIPE):
            rows = self._image.rows(first * side, min(first + _STRIPE, height) * side, margin)
            inner = rows.labels[margin:-margin, margin:-margin]
            labels.append(inner[side // 2 :: side, side // 2 :: side])
            values.append(rows.values)
            for _ in range(side.bit_length() - 1):
                values[-1] = halved(values[-1])
        width = values[0].shape[1]
        return np.concatenate(values), np.concatenate([rows[:, :width] for rows in labels])

    def _settle(self, edge_weight: float, max_sweeps: int) -> tuple[tuple[float, ...], bool]:
        """Sweep until almost nothing moves; return the energies before each sweep and at the end."""
        energies = [self._energy(edge_weight)]
        all_visited, converged = True, False
        shares: list[float] = []  # of pixels on boundaries that moved
        while not converged and len(energies) <= max_sweeps:
            moved = self._sweep(edge_weight, len(energies), all_visited)
            energies.append(self._energy(edge_weight))
            shares.append(moved / max(self._n_boundary, 1))
            at_rest = shares[-1] <= _ALMOST_NONE
            if not at_rest:
                tell(log(max(shares) / shares[-1]) / log(max(shares) / _ALMOST_NONE))
            # Generators have moved a little since some pixels were last visited: visit all once more before stopping.
            converged = at_rest and all_visited
            all_visited = at_rest
        self._measure()  # without the rounding of the sweeps
        return tuple(energies), converged

    def _begin(self) -> None:
        steps, margin = self._steps, self._margin
        beyond = self._reach - margin  # rows from which steps lead out
        height = self._stripes[-1][1]

        def count(stripe: tuple[int, int]) -> tuple[int, int]:
            labels, others, _ = self._image.rows(*stripe, margin)[2:]
            ends = max(beyond - stripe[0], 0), min(height - beyond, stripe[1]) - stripe[0]
            _segments.count_others(labels, steps, margin, *ends, others)
            counts = others[margin:-margin]
            return int(counts.sum(dtype=np.int64)), int(np.count_nonzero(counts))

        self._n_pairs, self._n_boundary = map(sum, zip(*side_by_side(count, self._stripes), strict=True))

    def _shares(self) -> Floats:
        """(K + 1,) factors of the energies of cells: their shares of the mass to the power."""
        sizes = self.cells.masses.mean(axis=1)
        return np.asarray((sizes / max(sizes.sum(), 1e-300)) ** self._moves.volume_power)

    def _energy(self, edge_weight: float) -> float:
        """Return the energy of the labels as they are."""
        cells, (f, o) = self.cells, self.rates.T
        energies = self._shares() * cells.energies * f + cells.masses.mean(axis=1) * o
        return float(np.einsum("k->", energies)) + edge_weight * self._n_pairs

    def _greatest_step(self) -> float:
        """Return the greatest squared distance between the means of segments that meet, times the share of either."""
        means, shares, margin = self.cells.means, self._shares(), self._margin

        def greatest_in(stripe: tuple[int, int]) -> float:
            labels, greatest = self._image.labels[stripe[0] + margin : stripe[1] + margin + 1], 0.0
            for here, there in ((labels[:, 1:], labels[:, :-1]), (labels[1:], labels[:-1])):
                meet = (here != there) & (here > 0) & (there > 0)
                pairs = np.unique(here[meet].astype(np.int64) * len(means) + there[meet])
                low, high = pairs // len(means), pairs % len(means)
                steps = np.square(means[low] - means[high]).sum(axis=1) * np.maximum(shares[low], shares[high])
                greatest = max(greatest, float(steps.max(initial=0)))
            return greatest

        return max(side_by_side(greatest_in, self._stripes))

    def _sweep(self, edge_weight: float, number: int, everywhere: bool) -> int:
        """Visit the pixels on boundaries, or those of them near transfers; return how many were transferred."""
        moved, margin, rows, image, backward = 0, self._margin, self.cells.rows, self._image, number % 2 == 0
        total = float(self.cells.masses.mean(axis=1).sum())
        allowed = self._moves.volume_power, self._moves.connected, backward
        how = self.rates, total, self._steps, margin, edge_weight, *allowed

        def sweep(stripes: Sequence[tuple[int, int]], number: int) -> Any:
            at = slice(*(end + margin for end in stripes[number]))
            if everywhere:
                image.stale[at][:] = image.others[at] > 0
            return _segments.sweep(image.rows(*stripes[number], margin), rows, *how) if image.stale[at].any() else None

        apart = min(6 if number == 1 else 2, len(self._stripes))
        groups = [self._stripes[first::apart] for first in range(apart)]
        for stripes in reversed(groups) if backward else groups:
            changes, is_touched = np.zeros_like(rows), np.zeros(len(rows), np.bool_)
            changed = filter(None, of_each(partial(sweep, stripes), len(stripes), work=250.0 * self._n_boundary))
            for n_moved, n_pairs, n_boundary, touched, change in changed:
                moved += n_moved
                self._n_pairs += n_pairs
                self._n_boundary += n_boundary
                changes[touched] += change
                is_touched[touched] = True
            cells = np.flatnonzero(is_touched)
            self.cells.add(changes[cells], cells)
        return moved


def cells_at_edges(values: Floats32, inside: Bools, n_cells: int) -> Ints:
    """(H, W) superpixels of (H, W, D) values, not quite settled, so that dots and lines are parts that can move."""
    if inside.all() and inside.size > _ENOUGH_FOR_CELLS:
        half = halved(values)
        return doubled(cells_at_edges(half, np.ones(half.shape[:2], bool), n_cells), inside.shape)
    cells = grid_of_cells(inside, min(n_cells, int(inside.sum())))
    weight = compactness_of(values, cells)
    return descend(values, cells, int(cells.max()), edge_weight=weight, connected=True, max_sweeps=_CELL_SWEEPS).labels


def compactness_of(values: Floats32, cells: Ints) -> float:
    """Return the edge weight of details of one pixel that differ as two pixels of a cell do."""
    within = float(moments_of(values, cells).energies.sum() / np.count_nonzero(cells))
    return 2 * within * weight_of_detail(1, RADIUS)


def halved(values: Floats32) -> Floats32:
    """(H // 2, W // 2, D) means of squares of four pixels."""
    height, width = (side // 2 for side in values.shape[:2])
    half = np.empty((height, width, values.shape[2]), np.float32)

    def halve(own: slice) -> None:
        rows = values[2 * own.start : 2 * own.stop, : 2 * width]
        pairs = rows[::2] + rows[1::2]
        half[own] = (pairs[:, ::2] + pairs[:, 1::2]) / 4

    in_stripes(halve, height, work=8.0 * values.size)
    return half


def doubled(labels: Ints, shape: tuple[int, ...]) -> Ints:
    """Return the labels of an image of half the size as those of the whole one, of a shape (H, W)."""
    rows, columns = (np.minimum(np.arange(side) // 2, side // 2 - 1) for side in shape)
    whole = np.empty(shape, np.int32)

    def double(own: slice) -> None:
        whole[own] = labels[rows[own]].take(columns, axis=1)

    in_stripes(double, shape[0], work=8.0 * whole.size)
    return whole


def is_deep(radius: int, planes: Planes | None) -> bool:
    """Return whether pixels of different planes are near each other."""
    return planes is not None and planes.spacing <= radius


def neighbors(radius: int, planes: Planes | None = None) -> Indices:
    """(S, 3) steps in planes, down and right to the neighbors within a disc or a ball, without its center."""
    depth = planes.spacing if planes else 1.0
    deep = int(radius / depth) if planes else 0
    plane, down, right = np.mgrid[-deep : deep + 1, -radius : radius + 1, -radius : radius + 1].reshape(3, -1)
    squares = (depth * plane) ** 2 + down**2 + right**2
    return np.stack([plane, down, right], axis=1)[(squares > 0) & (squares <= radius**2)]


def length_cost(radius: int, planes: Planes | None = None) -> int:
    """Return the cost per pixel of a straight edge along an axis at an edge weight of 1: 36 at radius 3."""
    return int(np.abs(neighbors(radius, planes)[:, 1]).sum())


def weight_of_detail(detail: float, radius: int, planes: Planes | None = None) -> float:
    """Return the edge weight at which a disc of this radius that differs by 1 from all around is worth its edge.

    The pairs that its edge parts are, for each step to a neighbor, the part of the disc that does not lie in the disc
    moved by this step. For large discs this tends to 1/75 of the radius of the disc, at radius 3. A disc smaller than a
    pixel lends it that part of its contrast. In volumes the same is true of balls, and of 1/428 of their radius.
    """
    if not detail:
        return 0.0
    depth = planes.spacing if planes else 1.0
    half = np.minimum(np.linalg.norm(neighbors(radius, planes) * (depth, 1, 1), axis=1) / (2 * detail), 1)
    if is_deep(radius, planes):
        size, shared = 4 / 3 * np.pi * detail**3 / depth, (1 - half) ** 2 * (2 + half) / 2
    else:
        size, shared = np.pi * detail**2, 2 / np.pi * (np.arccos(half) - half * np.sqrt(1 - half**2))
    return float(min(size, 1) ** 2 / (2 * (1 - shared).sum()))

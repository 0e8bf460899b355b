"""Moves of regions: parts of an image that change their segment together, as many at once as lower the energy most.

A region that is not worth its edges stays where single pixels move, if it is larger than what shrinks by itself. Here,
parts are superpixels cut where segments meet, so that the labels as they are can be told in them, and the energy of any
labels of parts is known exactly. For each segment in turn, the set of parts that would best join it is a minimum cut
(alpha-expansion: Y. Boykov, O. Veksler, R. Zabih, IEEE Trans. Pattern Analysis and Machine Intelligence 23 (2001)
1222-1239, doi 10.1109/34.969114), and generators follow each move. A segment that has lost all its parts is given to
the piece of another that gains most by a generator of its own; and two segments are joined where that frees a generator
that gains more elsewhere.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np

import cvtimg.segmentation._segments as _segments
from cvtimg._shared.types import Floats, Floats32, Ints, Ints64
from cvtimg.segmentation.touching import ROUNDS

#: Share of the energy by which a cycle over all segments lowers it, below which cycles end: less takes more of them.
_WORTHWHILE = 1e-5
#: How often lost segments are given back, and two are joined to free one.
_MAX_CHANGES = 4

_Labels = Ints64


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """Parts of an image, numbered from 0, and what their pixels cost in each of K segments.

    In a segment of the rates (f, o), a pixel costs f times its squared distance from the generator, and o.
    """

    masses: Floats  # (N,): pixels
    sums: Floats  # (N, D): sums of their values
    squares: Floats  # (N,): sums of their squared values
    tails: Ints  # (A,): part that each arc comes from
    heads: Ints  # (A,): part that it leads to; there is an arc back
    borders: Floats  # (A,): what it costs if the two are in different segments
    rates: Floats  # (K, 2): f and o

    def moments(self, labels: _Labels, n_labels: int) -> tuple[Floats, Floats, Floats]:
        """Return the masses, the sums and the energies about the means of all labels, from 0."""
        masses = np.bincount(labels, self.masses, n_labels).astype(np.float64)
        sums: Floats = np.stack([np.bincount(labels, column, n_labels) for column in self.sums.T], axis=1)
        squares = np.bincount(labels, self.squares, n_labels).astype(np.float64)
        return masses, sums, squares - _squared(sums) / np.maximum(masses, 1e-9)

    def costs(self, labels: _Labels) -> tuple[Floats, Floats]:
        """Return the energy of each segment, and (K, D) its sums over its mass."""
        masses, sums, energies = self.moments(labels, len(self.rates))
        means = sums / np.maximum(masses, 1e-9)[:, None]
        return self.rates[:, 0] * energies + self.rates[:, 1] * masses, means

    def costs_at(self, means: Floats) -> Floats:
        """(K, N) costs of each part in each segment with these generators."""
        away = self.squares - 2 * np.einsum("kd,nd->kn", means, self.sums) + self.masses * _squared(means)[:, None]
        return np.asarray(self.rates[:, :1] * away + self.rates[:, 1:] * self.masses)

    def energy(self, labels: _Labels) -> float:
        """Return the energy of labels, of segments and of borders."""
        apart = labels[self.tails] != labels[self.heads]
        return float(self.costs(labels)[0].sum() + self.borders[apart].sum() / 2)


def _squared(rows: Floats) -> Floats:
    return np.asarray(np.einsum("kd,kd->k", rows, rows))


def parts_of(values: Floats32, numbers: Ints, margin: int, steps: Ints, border: float, rates: Floats) -> Parts:
    """Measure parts on (H, W, D) values; numbers, from 1 and 0 outside, are padded by the margin.

    A pair of near pixels in different segments costs `border`; `steps` lead to near pixels in the flat padded image.
    """
    from scipy.sparse import coo_array, csr_array

    n_parts, n_dims = int(numbers.max()), values.shape[2]
    moments = np.zeros((n_parts + 1, 2 * n_dims + 1))
    _segments.measure_cells(values, None, numbers, margin, np.zeros_like(moments), moments)
    columns = moments[1:, 0], moments[1:, n_dims:-1], moments[1:, -1]
    masses, sums, squares = map(np.ascontiguousarray, columns)
    flat, near = numbers.ravel(), csr_array((n_parts, n_parts))
    for step in steps[steps > 0]:
        before, after = flat[:-step], flat[step:]
        meet = np.flatnonzero((before != after) & (before > 0) & (after > 0))
        ends = before[meet] - 1, after[meet] - 1
        near += coo_array((np.ones(len(meet)), ends), shape=near.shape).tocsr()
    pairs = (border * (near + near.T)).tocoo()
    return Parts(masses, sums, squares, pairs.row, pairs.col, pairs.data, rates)


def rearranged(parts: Parts, labels: _Labels) -> _Labels:
    """Return labels of parts, from 0, of lower energy; the same where no move lowers it."""
    best = _expanded(parts, labels)
    for way in (_given_back, _traded):
        for _ in range(_MAX_CHANGES):
            start = way(parts, best)
            if start is None or parts.energy(start) >= parts.energy(best):
                break
            other = _expanded(parts, start)
            if parts.energy(other) >= parts.energy(best) * (1 - 1e-6):
                break
            best = other
    return best


def _expanded(parts: Parts, labels: _Labels) -> _Labels:
    """Let each segment in turn take the parts that lower the energy most, until a cycle gains little."""
    energy, means = parts.energy(labels), parts.costs(labels)[1]
    costs, n_labels, in_vain = parts.costs_at(means), len(parts.rates), 0
    for _ in range(ROUNDS):
        before = energy
        for label in range(n_labels):
            if in_vain >= n_labels:  # nothing has changed since each was tried
                return labels
            in_vain += 1
            moved = _joined(parts, labels, label, costs)
            if moved is None:
                continue
            after = parts.energy(moved)
            if after < energy - 1e-9 * abs(energy):
                present = np.bincount(moved, minlength=n_labels) > 0
                means = np.where(present[:, None], parts.costs(moved)[1], means)
                labels, energy, costs, in_vain = moved, after, parts.costs_at(means), 0
        if energy > before - _WORTHWHILE * abs(before):
            break
    return labels


def _joined(parts: Parts, labels: _Labels, label: int, costs: Floats) -> _Labels | None:
    """Return labels where the best set of parts has joined a segment, by (K, N) costs; None if that is none."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import breadth_first_order, maximum_flow

    free, border, tails, heads, n_parts = labels != label, parts.borders, parts.tails, parts.heads, len(labels)
    now = np.where(labels[tails] != labels[heads], border, 0)
    # The energy of a pair of which one, the other or both join is that of a cut; each pair has two arcs.
    both = free[tails] & free[heads] & (tails < heads)
    joining = np.where(both, border - now, np.where(free[tails] & ~free[heads], -border, 0))
    supplies = costs[label] - costs[labels, np.arange(n_parts)]
    supplies += np.bincount(tails, joining, n_parts) - np.bincount(heads, both * border, n_parts)
    arcs = np.where(both, 2 * border - now, 0)
    # What is more than all arcs of a part take changes no cut, and would hide small costs among whole numbers.
    most = [2 * np.bincount(ends, arcs, n_parts) + border.max(initial=1) for ends in (heads, tails)]
    supplies = np.where(free, np.clip(supplies, -most[0], most[1]), 0)
    if supplies.min() >= 0:
        return None
    source, sink, each = n_parts, n_parts + 1, np.arange(n_parts)
    starts = np.concatenate([tails[both], np.where(supplies > 0, source, each)])
    ends = np.concatenate([heads[both], np.where(supplies > 0, each, sink)])
    capacities = np.concatenate([arcs[both], np.abs(supplies)])
    whole = np.rint(np.minimum(capacities / np.abs(supplies).sum(), 1) * (np.iinfo(np.int32).max // 2)).astype(np.int32)
    graph = csr_array((whole, (starts, ends)), shape=(n_parts + 2,) * 2)
    left = graph - maximum_flow(graph, source, sink).flow
    left.eliminate_zeros()
    joins = np.zeros(n_parts + 2, np.bool_)
    joins[breadth_first_order(left.T.tocsr(), sink, return_predecessors=False)] = True
    joins = joins[:n_parts] & free
    return np.where(joins, label, labels) if joins.any() else None


def _given_back(parts: Parts, labels: _Labels) -> _Labels | None:
    """Give each segment without parts to the connected piece that lowers the energy most by its own generator."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    given, tails, heads, (f, o) = labels, parts.tails, parts.heads, parts.rates.T
    for lost in np.flatnonzero(np.bincount(labels, minlength=len(parts.rates)) == 0):
        same = given[tails] == given[heads]
        graph = coo_array((np.ones(same.sum()), (tails[same], heads[same])), shape=(len(labels),) * 2)
        n_pieces, pieces = connected_components(graph, directed=False)
        of_piece = np.empty(n_pieces, np.int64)
        of_piece[pieces] = given
        masses, sums, energies = parts.moments(pieces, n_pieces)
        whole = [moment[of_piece] for moment in parts.moments(given, len(parts.rates))]
        rest = np.maximum(whole[0] - masses, 1e-9)
        # What the piece and the rest are apart is what both together lose.
        apart = _squared(sums / masses[:, None] - (whole[1] - sums) / rest[:, None]) * masses * rest / whole[0]
        gains = f[of_piece] * (energies + apart) + o[of_piece] * masses - f[lost] * energies - o[lost] * masses
        gains[masses >= whole[0]] = -np.inf
        best = int(gains.argmax())
        if gains[best] <= 0:
            break
        given = np.where(pieces == best, lost, given)
    return None if given is labels else given


def _traded(parts: Parts, labels: _Labels) -> _Labels | None:
    """Join the two segments that cost least together, and give the free one to the piece that gains most."""
    masses, sums, energies = parts.moments(labels, len(parts.rates))
    used = np.flatnonzero(masses > 0)
    if len(used) < 3:
        return None
    shared = np.zeros((len(masses),) * 2)
    np.add.at(shared, (labels[parts.tails], labels[parts.heads]), parts.borders)
    least, pair = np.inf, (0, 0)
    for kept, gone in permutations(used.tolist(), 2):
        (f, o), total = parts.rates[kept], masses[kept] + masses[gone]
        step = sums[kept] / masses[kept] - sums[gone] / masses[gone]
        together = energies[gone] + masses[kept] * masses[gone] / total * float(np.square(step).sum())
        before = parts.rates[gone, 0] * energies[gone] + parts.rates[gone, 1] * masses[gone]
        cost = f * together + o * masses[gone] - before - shared[kept, gone]
        if cost < least:
            least, pair = cost, (kept, gone)
    return _given_back(parts, np.where(labels == pair[1], pair[0], labels))

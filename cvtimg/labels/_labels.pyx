# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops over labels: walks along cracks, and graphs of regions whose neighbors merge.

A crack is the border between two adjacent pixels of different regions; cracks meet at pixel corners. Walked from a
corner in a direction it is the step 4 * corner + direction, where the directions are east, south, west and north.

A graph of N regions has B borders; border b has the halves 2 b and 2 b + 1, one for the region at each end, and each
region has a list of its halves. Arguments are marked IN, OUT or INOUT.
"""
from libc.math cimport pow
from libc.stdint cimport int32_t, int64_t, uint8_t

import numpy as np

#: Bit of a corner, in addition to one for each crack that leaves it: lines end there.
JUNCTION = 16


def follow_lines(
    uint8_t[::1] corners,  # INOUT (n_corners,) bits 0..3: a crack leaves in this direction, used up; 4: lines end there
    Py_ssize_t width,      # IN corners in a row
    int64_t[::1] path,     # OUT (n_cracks,) steps, line after line
    int64_t[::1] starts,   # OUT (n_cracks,) where in the path each line begins
):
    """Walk along all cracks, from junction to junction, then around what is left, and return the number of lines."""
    cdef Py_ssize_t n_lines = 0, n_done = 0, first, corner
    cdef int sweep, direction
    cdef Py_ssize_t[4] reach = [1, width, -1, -width]
    with nogil:
        for sweep in range(2):
            for first in range(corners.shape[0]):
                while corners[first] & 15 and (sweep or corners[first] & 16):
                    starts[n_lines] = n_done
                    n_lines += 1
                    corner = first
                    while corners[corner] & 15:
                        direction = 0
                        while not corners[corner] >> direction & 1:
                            direction += 1
                        path[n_done] = 4 * corner + direction
                        n_done += 1
                        corners[corner] ^= 1 << direction
                        corner += reach[direction]
                        corners[corner] ^= 1 << (direction ^ 2)
                        if corners[corner] & 16:
                            break
    return n_lines


cdef void link_halves(
    const int32_t[:, ::1] ends, int32_t[::1] heads, int32_t[::1] tails, int32_t[::1] following, int32_t[::1] degrees,
) noexcept nogil:
    """List the halves of each region, the last first; heads and tails are -1 where a region has none."""
    cdef Py_ssize_t half
    cdef int32_t region
    for half in range(2 * ends.shape[0]):
        region = ends[half // 2, half % 2]
        following[half] = heads[region]
        if heads[region] < 0:
            tails[region] = <int32_t>half
        heads[region] = <int32_t>half
        degrees[region] += 1


cdef inline int32_t root_of(int32_t *parents, int32_t region) noexcept nogil:
    while parents[region] != region:
        parents[region] = parents[parents[region]]
        region = parents[region]
    return region


def absorb(
    const int32_t[:, ::1] ends,  # IN (B, 2): regions at either side of each border
    const double[::1] lengths,   # IN (B,)
    int64_t[::1] sizes,          # INOUT (N,): pixels of each region
    double[:, ::1] means,        # INOUT (N, D)
    int64_t min_size,            # IN
    double length_price,         # IN: price per pixel of border
):
    """Merge regions smaller than min_size, the smallest first, into the neighbor that raises the energy least.

    Lists of borders are put together as they are, and the regions beyond looked up, because most small regions border
    on the same large one. Return the region that each is now part of.
    """
    cdef Py_ssize_t n_regions = sizes.shape[0], dims = means.shape[1], size, f, n_neighbors, d, n_entries = 0
    cdef int32_t region, other, best, half, entry
    cdef int32_t[::1] heads = np.full(n_regions, -1, np.int32), tails = np.full(n_regions, -1, np.int32)
    cdef int32_t[::1] following = np.empty(2 * ends.shape[0], np.int32), degrees = np.zeros(n_regions, np.int32)
    # A queue for each size, of entries that hold a region and the next entry; first come those in reading order.
    cdef int32_t[::1] queues = np.full(min_size, -1, np.int32)
    cdef int32_t[::1] entries = np.empty(2 * n_regions, np.int32), queued = np.empty(2 * n_regions, np.int32)
    cdef double[::1] touching = np.zeros(n_regions)
    cdef int32_t[::1] neighbors = np.empty(n_regions, np.int32)
    parents_ = np.arange(n_regions, dtype=np.int32)
    cdef int32_t[::1] parents = parents_
    cdef int32_t *parent = &parents[0]
    cdef double cost, least, step, share
    with nogil:
        link_halves(ends, heads, tails, following, degrees)
        for region in range(<int32_t>n_regions - 1, -1, -1):
            if sizes[region] < min_size:
                queued[n_entries] = region
                entries[n_entries] = queues[sizes[region]]
                queues[sizes[region]] = <int32_t>n_entries
                n_entries += 1
        for size in range(1, min_size):
            entry = queues[size]
            while entry >= 0:
                region = queued[entry]
                entry = entries[entry]
                if parent[region] != region or sizes[region] != size:
                    continue
                n_neighbors = 0
                half = heads[region]
                while half >= 0:
                    other = root_of(parent, ends[half // 2, 1 - half % 2])
                    if other != region:
                        if touching[other] == 0:
                            neighbors[n_neighbors] = other
                            n_neighbors += 1
                        touching[other] += lengths[half // 2]
                    half = following[half]
                best = -1
                least = 0
                for f in range(n_neighbors):
                    other = neighbors[f]
                    cost = 0
                    for d in range(dims):
                        step = means[region, d] - means[other, d]
                        cost = cost + step * step
                    cost = cost * size * sizes[other] / (size + sizes[other]) - length_price * touching[other]
                    if best < 0 or cost < least or (cost == least and other < best):
                        best = other
                        least = cost
                    touching[other] = 0
                if best < 0:
                    continue
                share = size / <double>(size + sizes[best])
                for d in range(dims):
                    means[best, d] += share * (means[region, d] - means[best, d])
                sizes[best] += size
                parent[region] = best
                following[tails[best]] = heads[region]
                tails[best] = tails[region]
                if sizes[best] < min_size:
                    queued[n_entries] = best
                    entries[n_entries] = queues[sizes[best]]
                    queues[sizes[best]] = <int32_t>n_entries
                    n_entries += 1
        for region in range(n_regions):
            parent[region] = root_of(parent, region)
    return parents_


ctypedef struct Graph:
    int32_t *ends        # (B, 2): regions at either side of each border
    double *lengths      # (B,)
    double *steps        # (B,): strength of each border, summed over its length
    double *sizes        # (N,): pixels
    double *perimeters   # (N,)
    double *sums         # (N, H): histograms
    Py_ssize_t n_sums
    const int32_t *blocks  # (C + 1,): where the histogram of each channel begins in the sums; textons are the last
    Py_ssize_t n_blocks
    double color
    double texture
    double shared
    double size_power
    double total         # pixels of all regions


cdef double difference(const Graph *graph, Py_ssize_t border) noexcept nogil:
    """Return how much the regions at either side of a border differ: its strength, and that of their histograms."""
    cdef int32_t a = graph.ends[2 * border], b = graph.ends[2 * border + 1]
    cdef double na = graph.sizes[a], nb = graph.sizes[b], u, v, chi, result
    cdef double per_a = 1 / na, per_b = 1 / nb
    cdef const double *left = graph.sums + a * graph.n_sums
    cdef const double *right = graph.sums + b * graph.n_sums
    cdef Py_ssize_t block, i
    result = graph.steps[border] / graph.lengths[border]
    for block in range(graph.n_blocks):
        chi = 0
        for i in range(graph.blocks[block], graph.blocks[block + 1]):
            u = left[i] * per_a
            v = right[i] * per_b
            chi = chi + (u - v) * (u - v) / (u + v + 1e-300)
        result = result + chi / 2 * (graph.texture if block == graph.n_blocks - 1 else graph.color)
    result = result * (1 - graph.shared * graph.lengths[border] / min(graph.perimeters[a], graph.perimeters[b]))
    return result * pow(na * nb / ((na + nb) * graph.total), graph.size_power)


cdef inline bint comes_first(const double *costs, int32_t a, int32_t b) noexcept nogil:
    return costs[a] < costs[b] or (costs[a] == costs[b] and a < b)


cdef void settle(int32_t *heap, int32_t *places, const double *costs, Py_ssize_t n, Py_ssize_t place) noexcept nogil:
    """Move the border at a place of a heap of n up or down to where its cost belongs."""
    cdef int32_t border = heap[place]
    cdef Py_ssize_t child
    while place > 0 and comes_first(costs, border, heap[(place - 1) // 2]):
        heap[place] = heap[(place - 1) // 2]
        places[heap[place]] = <int32_t>place
        place = (place - 1) // 2
    child = 2 * place + 1
    while child < n:
        if child + 1 < n and comes_first(costs, heap[child + 1], heap[child]):
            child += 1
        if not comes_first(costs, heap[child], border):
            break
        heap[place] = heap[child]
        places[heap[place]] = <int32_t>place
        place = child
        child = 2 * place + 1
    heap[place] = border
    places[border] = <int32_t>place


cdef void take_out(int32_t *heap, int32_t *places, const double *costs, Py_ssize_t n, Py_ssize_t place) noexcept nogil:
    """Take what is at a place out of a heap of n, which then has n - 1."""
    cdef int32_t moved = heap[n - 1]
    if place == n - 1:
        return
    heap[place] = moved
    places[moved] = <int32_t>place
    settle(heap, places, costs, n - 1, place)


def merge(
    int32_t[:, ::1] ends,           # INOUT (B, 2): regions at either side of each border
    double[::1] lengths,            # INOUT (B,)
    double[::1] steps,              # INOUT (B,): strength of each border, summed over its length
    double[::1] sizes,              # INOUT (N,): pixels of each region
    double[:, ::1] sums,            # INOUT (N, H): histograms
    const int32_t[::1] blocks,      # IN (C + 1,): where the histogram of each channel begins; textons are the last
    double color,                   # IN: weight of a channel of color
    double texture,                 # IN: weight of textons
    double shared,                  # IN: how a shared border counts
    double size_power,              # IN
):
    """Merge the pair of neighbors that costs least, again and again; the arguments are used up.

    Borders are in a heap by what merging across them costs; each knows its place there, so that a cost that has changed
    moves it. Return (M, 2) numbers of the regions that merge, where merge m makes region N + m, and (M,) costs.
    """
    cdef Graph graph
    cdef Py_ssize_t n_borders = lengths.shape[0], n_regions = sizes.shape[0], n = n_borders, n_merges = 0, b, h
    cdef int32_t border, kept, gone, half, after, other, twin, last, degree
    cdef int32_t[::1] heads = np.full(n_regions, -1, np.int32), tails = np.full(n_regions, -1, np.int32)
    cdef int32_t[::1] following = np.empty(2 * n_borders, np.int32), degrees = np.zeros(n_regions, np.int32)
    cdef int32_t[::1] heap = np.arange(n_borders, dtype=np.int32), places = np.arange(n_borders, dtype=np.int32)
    cdef int32_t[::1] joined = np.arange(n_borders, dtype=np.int32)  # the border that took up each, or its own number
    cdef int32_t[::1] numbers = np.arange(n_regions, dtype=np.int32), marks = np.full(n_regions, -1, np.int32)
    cdef double[::1] costs = np.empty(n_borders), perimeters = np.zeros(n_regions)
    merges_, altitudes_ = np.empty((max(n_regions - 1, 0), 2), np.int32), np.empty(max(n_regions - 1, 0))
    cdef int32_t[:, ::1] merges = merges_
    cdef double[::1] altitudes = altitudes_
    if n_borders == 0:
        return merges_[:0], altitudes_[:0]
    cdef int32_t *queue = &heap[0]
    cdef int32_t *place = &places[0]
    cdef double *cost = &costs[0]
    graph.ends, graph.lengths, graph.steps = &ends[0, 0], &lengths[0], &steps[0]
    graph.sizes, graph.perimeters, graph.sums, graph.n_sums = &sizes[0], &perimeters[0], &sums[0, 0], sums.shape[1]
    graph.blocks, graph.n_blocks = &blocks[0], blocks.shape[0] - 1
    graph.color, graph.texture, graph.shared, graph.size_power = color, texture, shared, size_power
    graph.total = 0
    with nogil:
        link_halves(ends, heads, tails, following, degrees)
        for b in range(n_regions):
            graph.total += sizes[b]
        for b in range(n_borders):
            perimeters[ends[b, 0]] += lengths[b]
            perimeters[ends[b, 1]] += lengths[b]
        for b in range(n_borders):
            costs[b] = difference(&graph, b)
            settle(queue, place, cost, b + 1, b)
        while n > 0:
            border = queue[0]
            kept = ends[border, 0]
            gone = ends[border, 1]
            if degrees[kept] < degrees[gone]:
                other = kept
                kept = gone
                gone = other
            merges[n_merges, 0] = min(numbers[kept], numbers[gone])
            merges[n_merges, 1] = max(numbers[kept], numbers[gone])
            altitudes[n_merges] = costs[border]
            numbers[kept] = <int32_t>(n_regions + n_merges)
            n_merges += 1
            take_out(queue, place, cost, n, 0)
            n -= 1
            sizes[kept] += sizes[gone]
            perimeters[kept] += perimeters[gone] - 2 * lengths[border]
            for h in range(graph.n_sums):
                sums[kept, h] += sums[gone, h]
            # A list of the borders that remain: first those of the region that is kept, marked by what is beyond.
            last = -1
            degree = 0
            half = heads[kept]
            while half >= 0:
                after = following[half]
                if half // 2 != border and joined[half // 2] == half // 2:
                    marks[ends[half // 2, 1 - half % 2]] = half // 2
                    following[half] = last
                    last = half
                    degree += 1
                half = after
            half = heads[gone]
            while half >= 0:
                after = following[half]
                b = half // 2
                if b != border and joined[b] == b:
                    other = ends[b, 1 - half % 2]
                    twin = marks[other]
                    if twin >= 0:
                        lengths[twin] += lengths[b]
                        steps[twin] += steps[b]
                        joined[b] = twin
                        degrees[other] -= 1
                        take_out(queue, place, cost, n, place[b])
                        n -= 1
                    else:
                        ends[b, half % 2] = kept
                        following[half] = last
                        last = half
                        degree += 1
                half = after
            heads[kept] = last
            degrees[kept] = degree
            half = last
            while half >= 0:
                b = half // 2
                marks[ends[b, 1 - half % 2]] = -1
                cost[b] = difference(&graph, b)
                settle(queue, place, cost, n, place[b])
                half = following[half]
    return merges_[:n_merges], altitudes_[:n_merges]

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops over trees of regions: merging, the cheapest pair first, and the labels of a cut.

Borders are in a heap by what merging across them costs; each knows its place there, so that a cost that has changed
moves it. Nothing here allocates or checks its arguments. Each argument is marked IN, OUT or INOUT.
"""
from libc.math cimport pow
from libc.stdint cimport int32_t

ctypedef struct Graph:
    int32_t *ends      # (B, 2): regions at either side of each border
    double *lengths    # (B,)
    double *strengths  # (B,): sums over the length
    double *sizes      # (N,)
    double *perimeters
    double *histograms  # (N, H)
    const int32_t *blocks  # (C + 1,): where the histogram of each channel begins
    Py_ssize_t n_bins
    Py_ssize_t n_blocks
    double color
    double texture
    double shared
    double size_power
    double total


cdef double cost(const Graph *graph, Py_ssize_t border) noexcept nogil:
    """What it costs to merge the regions at either side of a border."""
    cdef int32_t a = graph.ends[2 * border], b = graph.ends[2 * border + 1]
    cdef double na = graph.sizes[a], nb = graph.sizes[b], u, v, chi, result
    cdef double per_a = 1 / na, per_b = 1 / nb
    cdef const double *left = graph.histograms + a * graph.n_bins
    cdef const double *right = graph.histograms + b * graph.n_bins
    cdef Py_ssize_t block, i
    result = graph.strengths[border] / graph.lengths[border]
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


cdef void rise(int32_t *heap, int32_t *places, const double *costs, Py_ssize_t place) noexcept nogil:
    cdef int32_t border = heap[place]
    while place > 0 and comes_first(costs, border, heap[(place - 1) // 2]):
        heap[place] = heap[(place - 1) // 2]
        places[heap[place]] = <int32_t>place
        place = (place - 1) // 2
    heap[place] = border
    places[border] = <int32_t>place


cdef void sink(int32_t *heap, int32_t *places, const double *costs, Py_ssize_t n, Py_ssize_t place) noexcept nogil:
    cdef int32_t border = heap[place]
    cdef Py_ssize_t child = 2 * place + 1
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
    rise(heap, places, costs, place)
    sink(heap, places, costs, n - 1, places[moved])


def merge(
    int32_t[:, ::1] ends,            # INOUT (B, 2): regions at either side of each border
    double[::1] lengths,             # INOUT (B,)
    double[::1] strengths,           # INOUT (B,): summed over the length
    double[::1] sizes,               # INOUT (N,): pixels of each region
    double[::1] perimeters,          # INOUT (N,)
    double[:, ::1] histograms,       # INOUT (N, H)
    const int32_t[::1] blocks,       # IN (C + 1,): where the histogram of each channel begins; textons are the last
    double color,                    # IN: weight of a channel of color
    double texture,                  # IN: weight of textons
    double shared,                   # IN: how a shared border counts
    double size_power,               # IN
    int32_t[::1] heads,              # INOUT (N,): first half border of each region, or -1; border b has 2 b, 2 b + 1
    int32_t[::1] following,          # INOUT (2 B,): the next half border of the same region, or -1
    int32_t[::1] heap,               # scratch (B,)
    int32_t[::1] places,             # scratch (B,)
    double[::1] costs,               # scratch (B,)
    int32_t[::1] joined,             # scratch (B,): the border that took up each, or its own number
    int32_t[::1] numbers,            # INOUT (N,): 0 .. N - 1, then the number of each region that remains
    int32_t[::1] degrees,            # INOUT (N,): borders of each region
    int32_t[::1] marks,              # scratch (N,), -1
    int32_t[:, ::1] merges,          # OUT (N - 1, 2): numbers of the regions that merge; the result has N + row
    double[::1] altitudes,           # OUT (N - 1,): what each merge costs
):
    """Merge the pair of neighbors that costs least until no neighbors are left; return how many merges there were."""
    cdef Graph graph
    cdef Py_ssize_t n_borders = lengths.shape[0], n_regions = sizes.shape[0], n = n_borders, n_merges = 0, b, h
    cdef int32_t border, kept, gone, half, after, other, twin, last, degree
    cdef int32_t *heap_ = &heap[0]
    cdef int32_t *places_ = &places[0]
    cdef double *costs_ = &costs[0]
    graph.ends, graph.lengths, graph.strengths = &ends[0, 0], &lengths[0], &strengths[0]
    graph.sizes, graph.perimeters, graph.histograms = &sizes[0], &perimeters[0], &histograms[0, 0]
    graph.blocks, graph.n_bins, graph.n_blocks = &blocks[0], histograms.shape[1], blocks.shape[0] - 1
    graph.color, graph.texture, graph.shared, graph.size_power = color, texture, shared, size_power
    graph.total = 0
    with nogil:
        for b in range(n_regions):
            graph.total += sizes[b]
        for b in range(n_borders):
            costs_[b] = cost(&graph, b)
            heap_[b] = places_[b] = joined[b] = <int32_t>b
        for b in range(n_borders // 2 - 1, -1, -1):
            sink(heap_, places_, costs_, n, b)
        while n > 0:
            border = heap_[0]
            kept = ends[border, 0]
            gone = ends[border, 1]
            if degrees[kept] < degrees[gone]:
                other = kept
                kept = gone
                gone = other
            merges[n_merges, 0] = min(numbers[kept], numbers[gone])
            merges[n_merges, 1] = max(numbers[kept], numbers[gone])
            altitudes[n_merges] = costs_[border]
            numbers[kept] = <int32_t>(n_regions + n_merges)
            n_merges += 1
            take_out(heap_, places_, costs_, n, 0)
            n -= 1
            sizes[kept] += sizes[gone]
            perimeters[kept] += perimeters[gone] - 2 * lengths[border]
            for h in range(histograms.shape[1]):
                histograms[kept, h] += histograms[gone, h]
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
                        strengths[twin] += strengths[b]
                        joined[b] = twin
                        degrees[other] -= 1
                        take_out(heap_, places_, costs_, n, places_[b])
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
                costs_[b] = cost(&graph, b)
                rise(heap_, places_, costs_, places_[b])
                sink(heap_, places_, costs_, n, places_[b])
                half = following[half]
    return n_merges


def label_pixels(
    const int32_t[:, ::1] leaves,  # IN (H, W): leaf of each pixel, plus 1; 0 outside the mask
    const int32_t[::1] labels,     # IN (N + 1,): label of each leaf, that of 0 first
    int32_t[:, ::1] pixels,        # OUT (H, W): label of each pixel
):
    """Look up the label of each pixel: two to three times as fast as numpy.take, which widens the leaves to 64 bits."""
    cdef Py_ssize_t i, n = leaves.shape[0] * leaves.shape[1]
    cdef const int32_t *leaf = &leaves[0, 0]
    cdef int32_t *pixel = &pixels[0, 0]
    with nogil:
        for i in range(n):
            pixel[i] = labels[leaf[i]]

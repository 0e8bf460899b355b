# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of segmentation: the edge-weighted descent, and half discs along borders.

Nothing here checks its arguments or decides when to stop. Each argument is marked IN, OUT or INOUT. In the descent,
labels are padded: a frame of label 0, as wide as the disc of neighbors, surrounds the image, so that no labeled pixel
has a neighbor outside the array. Pixels of label 0 are nobody's neighbors. A disc is given by the steps, in the flat
padded image, from a pixel to each of its neighbors.
"""
from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint64_t
from libc.string cimport memcpy, memset

import numpy as np

cdef extern from "cell_weight.h" nogil:
    double cell_weight(double share, double power)

cdef extern from "half_discs.h" nogil:
    int _N_LEVELS "N_LEVELS"
    int _N_TEXTONS "N_TEXTONS"
    int _REACH "REACH"
    int _SLOT "SLOT"
    int _HIDDEN "HIDDEN"
    int _MAX_CHANNELS "MAX_CHANNELS"
    float channel_distance(const float *slots, const float *taps, int is_texton)

#: Bins of a color channel, and of textons; what smoothing reaches; the bin of pixels that do not count.
N_LEVELS, N_TEXTONS, REACH, HIDDEN = _N_LEVELS, _N_TEXTONS, _REACH, _HIDDEN


def count_others(
    const int32_t[:, ::1] labels,  # IN (H + 2 R, W + 2 R), padded
    const int32_t[::1] steps,      # IN (S,): the disc
    Py_ssize_t margin,             # IN: R
    Py_ssize_t first,              # IN: rows of the picture, without its frame, of which to count
    Py_ssize_t last,
    uint16_t[:, ::1] others,       # INOUT (H + 2 R, W + 2 R), zeros: neighbors with another label, of each pixel
):
    cdef Py_ssize_t height = labels.shape[0] - 2 * margin, width = labels.shape[1] - 2 * margin, y, x, s
    cdef const int32_t *own
    cdef const int32_t *other
    cdef uint16_t *count
    with nogil:
        for y in range(first, last):
            own = &labels[y + margin, margin]
            count = &others[y + margin, margin]
            for s in range(steps.shape[0]):
                other = own + steps[s]
                for x in range(width):
                    count[x] += (own[x] != other[x]) & (own[x] != 0) & (other[x] != 0)


def measure_cells(
    const float[:, :, ::1] values,   # IN (H, W, D)
    const float[:, :, ::1] weights,  # IN (H, W, D), or None for 1 everywhere
    const int32_t[:, ::1] labels,    # IN (H + 2 R, W + 2 R), padded
    Py_ssize_t margin,               # IN: R
    const double[:, ::1] cells,      # IN (K + 1, 2 D + 1): masses, means about which to measure, energies
    double[:, ::1] moments,          # INOUT (K + 1, 2 D + 1): += weight times (1, v), (1, v^2), v the value less the mean
):
    cdef Py_ssize_t height = values.shape[0], width = values.shape[1], dims = values.shape[2], y, x, d, first, last
    cdef const int32_t *own
    cdef double *moment
    cdef bint weighted = weights is not None
    cdef double weight = 1, mass, total, square, mean, step
    with nogil:
        for y in range(height):
            own = &labels[y + margin, margin]
            last = 0
            while last < width:  # runs of a label, whose sums stay in registers
                first = last
                while last < width and own[last] == own[first]:
                    last += 1
                if own[first] == 0:
                    continue
                moment = &moments[own[first], 0]
                for d in range(dims):
                    mass, total, square, mean = moment[d], moment[dims + d], moment[2 * dims], cells[own[first], dims + d]
                    for x in range(first, last):
                        if weighted:
                            weight = weights[y, x, d]
                        step = values[y, x, d] - mean
                        mass += weight
                        total += weight * step
                        square += weight * step * step
                    moment[d], moment[dims + d], moment[2 * dims] = mass, total, square


cdef inline double cost_of_pixel(
    const float *value, const float *weight, const double *mean, const double *mass, Py_ssize_t dims, double side,
) noexcept nogil:
    """Energy that a cell gains with a pixel that comes (side 1), or loses with one that goes (side -1)."""
    cdef double total = 0, step, rest
    cdef Py_ssize_t d
    if weight == NULL:
        for d in range(dims):
            step = value[d] - mean[d]
            total = total + step * step
        rest = mass[0] + side
        return total * mass[0] / rest if rest > 0.5 else 0.0
    for d in range(dims):
        rest = mass[d] + side * weight[d]
        if weight[d] > 0 and rest > 1e-9 * weight[d]:  # the last pixel to go takes no energy with it
            step = value[d] - mean[d]
            total = total + mass[d] * weight[d] / rest * step * step
    return total


cdef inline void move_pixel(
    const float *value, const float *weight, double *mean, double *mass, Py_ssize_t dims, double side,
) noexcept nogil:
    cdef double part, rest
    cdef Py_ssize_t d
    for d in range(dims):
        part = side if weight == NULL else side * weight[d]
        rest = mass[d] + part
        if rest > 1e-9 * part * side:
            mean[d] += (value[d] - mean[d]) * part / rest
        mass[d] = rest


cdef inline double weighed(
    double cost, const float *weight, const double *cell, Py_ssize_t dims, double side, double total, double power,
) noexcept nogil:
    """The cost of a pixel that comes or goes where cells count by their share of the mass of all."""
    cdef double size = 0, mass = 0, after
    cdef Py_ssize_t d
    if power == 0:
        return cost
    for d in range(dims):
        size = size + cell[d] / dims
        mass = mass + (1 if weight == NULL else weight[d]) / <double>dims
    after = cell_weight(max(size + side * mass, 0) / total, power)
    return after * cost + side * (after - cell_weight(size / total, power)) * cell[2 * dims]


cdef inline bint is_simple(const int32_t *label, Py_ssize_t width) noexcept nogil:
    """Whether the cell of a pixel stays in one piece when the pixel leaves it, judged by its eight neighbors."""
    cdef int32_t own = label[0]
    cdef bint n = label[-width] == own, e = label[1] == own, s = label[width] == own, w = label[-1] == own
    cdef bint ne = label[1 - width] == own, se = label[width + 1] == own
    cdef bint sw = label[width - 1] == own, nw = label[-width - 1] == own
    # Yokoi's connectivity number.
    return n + e + s + w - (n & ne & e) - (e & se & s) - (s & sw & w) - (w & nw & n) == 1


cdef inline int32_t count_near(const int32_t *at, const int32_t *steps, Py_ssize_t n_steps, int32_t label) noexcept nogil:
    cdef int32_t n = 0, s
    for s in range(n_steps):
        n += at[steps[s]] == label
    return n


cdef inline double *copy_of(
    int32_t label, const double[:, ::1] cells, double[:, ::1] copies, int32_t *places, int32_t *touched, Py_ssize_t *n,
) noexcept nogil:
    """Moments of a cell in the copies, of which `places` has the number of each, from 1."""
    if places[label] == 0:
        touched[n[0]] = label
        memcpy(&copies[n[0], 0], &cells[label, 0], cells.shape[1] * sizeof(double))
        n[0] += 1
        places[label] = <int32_t>n[0]
    return &copies[places[label] - 1, 0]


def sweep(
    stripe,                   # INOUT: labels, others and stale, (H + 2 R, W + 2 R); IN: values and weights, (H, W, D)
    const double[:, ::1] cells,  # IN (K + 1, 2 D + 1): masses, means and energy of each
    const double[:, ::1] rates,  # IN (K + 1, 2): what a unit of energy, and of mass, costs in each
    double total,             # IN: the mass of all
    const int32_t[::1] steps, # IN (S,): the disc
    Py_ssize_t margin,        # IN: R
    double edge_weight,       # IN
    double power,             # IN: cells count by their share of the mass to this power
    bint connected,           # IN: whether cells must stay in one piece
    bint backward,            # IN: from the last pixel to the first
):
    """Transfer boundary pixels, one after the other, to the cell where the energy is least.

    A stripe is some `Layers` of `edge_weight.py`, framed by the labels of the rows above and below, which stay. Cells
    change in a copy. Returned are how many pixels moved and how many pairs and boundary pixels came, the cells that were
    looked at, (N,), and what came to their moments about the means, (N, 2 D + 1): masses, sums and squares.
    """
    cdef const float[:, :, ::1] values = stripe.values
    cdef const float[:, :, ::1] weights = stripe.weights
    cdef int32_t[:, ::1] labels = stripe.labels
    cdef uint16_t[:, ::1] others = stripe.others
    cdef uint8_t[:, ::1] stale = stripe.stale
    cdef int32_t[::1] counts = np.zeros(cells.shape[0], np.int32), found = np.empty(steps.shape[0], np.int32)
    # Only the cells that are looked at are copied, so that many cells cost no more than few.
    cdef int32_t[::1] places = np.zeros(cells.shape[0], np.int32), touched = np.empty(cells.shape[0], np.int32)
    cdef double[:, ::1] copies = np.empty_like(cells)
    cdef Py_ssize_t width = values.shape[1], dims = values.shape[2], n_steps = steps.shape[0], stride = labels.shape[1]
    cdef Py_ssize_t[4] sides = [-stride, -1, 1, stride]
    cdef Py_ssize_t first = margin * stride, last = (labels.shape[0] - margin) * stride
    cdef Py_ssize_t t, p, q, s, f, n_found, n_touched = 0, n_moved = 0, n_pairs = 0, n_boundary = 0
    cdef int32_t own, label, best
    cdef double cost, least, own_cost, best_cost, after, step
    cdef double *here
    cdef double *there
    cdef const double *old
    cdef const float *value
    cdef const float *weight = NULL
    cdef int32_t *at
    cdef int32_t *label_of = &labels[0, 0]
    cdef uint16_t *other = &others[0, 0]
    cdef uint8_t *is_stale = &stale[0, 0]
    cdef uint64_t eight
    cdef bint weighted = weights is not None
    with nogil:
        t = first
        while t < last:
            q = first + last - 1 - t if backward else t
            # Most pixels have nothing to do: pass over eight at a time.
            if t + 8 <= last:
                memcpy(&eight, is_stale + (q - 7 if backward else q), 8)
                if eight == 0:
                    t += 8
                    continue
            t += 1
            if is_stale[q] == 0:
                continue
            is_stale[q] = 0
            if other[q] == 0:
                continue
            at = label_of + q
            p = (q // stride - margin) * width + q % stride - margin
            own = at[0]
            if connected and not is_simple(at, stride):
                continue
            value = &values[0, 0, 0] + p * dims
            if weighted:
                weight = &weights[0, 0, 0] + p * dims
            n_found = 0
            for s in range(4 if connected else n_steps):
                label = at[sides[s] if connected else steps[s]]
                if counts[label] == 0:
                    found[n_found] = label
                    n_found += 1
                counts[label] += 1
            for f in range(n_found if connected else 0):  # only these can be joined
                counts[found[f]] = count_near(at, &steps[0], n_steps, found[f])
            # The cost of the pixel in its own cell, and in each that it could join.
            here = copy_of(own, cells, copies, &places[0], &touched[0], &n_touched)
            own_cost = cost_of_pixel(value, weight, here + dims, here, dims, -1)
            least = weighed(own_cost, weight, here, dims, -1, total, power)
            least = rates[own, 0] * least + rates[own, 1] - 2 * edge_weight * counts[own]
            # A smaller gain is rounding, and could go round in circles.
            least = least - 1e-12 * (fabs(least) + 4 * edge_weight * n_steps)
            best = own
            best_cost = 0
            for f in range(n_found):
                label = found[f]
                if label == own or label == 0:
                    continue
                there = copy_of(label, cells, copies, &places[0], &touched[0], &n_touched)
                cost = cost_of_pixel(value, weight, there + dims, there, dims, 1)
                after = weighed(cost, weight, there, dims, 1, total, power)
                after = rates[label, 0] * after + rates[label, 1] - 2 * edge_weight * counts[label]
                if after < least:
                    least = after
                    best = label
                    best_cost = cost
            for f in range(n_found):
                if found[f] != own and found[f] != best:
                    counts[found[f]] = 0
            if best != own:
                n_moved += 1
                there = copy_of(best, cells, copies, &places[0], &touched[0], &n_touched)
                here[2 * dims] -= own_cost
                there[2 * dims] += best_cost
                move_pixel(value, weight, here + dims, here, dims, -1)
                move_pixel(value, weight, there + dims, there, dims, 1)
                at[0] = best
                n_pairs += 2 * (counts[own] - counts[best])
                other[q] = <uint16_t>(other[q] + counts[own] - counts[best])
                n_boundary += (other[q] != 0) - 1
                for s in range(n_steps):
                    label = at[steps[s]]
                    n_boundary -= other[q + steps[s]] != 0
                    other[q + steps[s]] += (label == own) - (label == best)
                    n_boundary += other[q + steps[s]] != 0
                    is_stale[q + steps[s]] = 1
                counts[best] = 0
            counts[own] = 0
        for f in range(n_touched):
            here = &copies[f, 0]
            old = &cells[touched[f], 0]
            here[2 * dims] -= old[2 * dims]
            for s in range(dims):
                step = here[dims + s] - old[dims + s]
                here[2 * dims] += here[s] * step * step
                here[dims + s] = here[s] * step
                here[s] -= old[s]
    return n_moved, n_pairs, n_boundary, np.asarray(touched)[:n_touched], np.asarray(copies)[:n_touched]


def half_disc_distances(
    const uint8_t[:, ::1] bins,       # IN (padded pixels, C): colors, then textons; HIDDEN for what does not count
    const int32_t[::1] places,        # IN (P,): padded pixel before each crack
    const int32_t[::1] turns,         # IN (P,): which of the discs lies along each crack
    const int32_t[:, :, ::1] steps,   # IN (T, 2, S): from that pixel to those of either half, inner ones first
    const int32_t[:, ::1] counts,     # IN (T, R): pixels of a half up to each radius
    const float[::1] taps,            # IN (2 REACH + 1,): how levels are smoothed
    Py_ssize_t first,                 # IN: cracks to look at
    Py_ssize_t last,
    float[:, :, ::1] distances,       # OUT (P, C, R)
):
    """Measure how the halves of discs around cracks differ: chi-square distances of their histograms."""
    cdef float slots[512]  # MAX_CHANNELS * 2 * SLOT
    cdef Py_ssize_t n_channels = bins.shape[1], c, p, r, s, side
    cdef int begin, end
    cdef const int32_t *step
    cdef const uint8_t *pixel
    cdef float *slot
    with nogil:
        for p in range(first, last):
            memset(slots, 0, sizeof(slots))
            begin = 0
            for r in range(counts.shape[1]):
                end = counts[turns[p], r]
                for side in range(2):
                    step = &steps[turns[p], side, 0]
                    slot = slots + side * _SLOT + _REACH
                    for s in range(begin, end):
                        pixel = &bins[places[p] + step[s], 0]
                        for c in range(n_channels):
                            slot[2 * c * _SLOT + pixel[c]] += 1
                begin = end
                for c in range(n_channels):
                    distances[p, c, r] = channel_distance(slots + 2 * c * _SLOT, &taps[0], c == n_channels - 1)

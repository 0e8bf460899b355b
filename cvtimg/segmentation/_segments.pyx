# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of segmentation: the edge-weighted descent, and half discs along borders.

Nothing here checks its arguments or decides when to stop. Each argument is marked IN, OUT or INOUT. In the descent,
labels are padded: a frame of label 0, as wide as the disc of neighbors, surrounds the image, so that no labeled pixel
has a neighbor outside the array. Pixels of label 0 are nobody's neighbors. A disc is given by the steps, in the flat
padded image, from a pixel to each of its neighbors.
"""
from libc.stdint cimport int32_t, uint8_t, uint16_t, uint64_t
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
    const double[:, ::1] means,      # IN (K + 1, D): about which to measure
    double[:, :, ::1] moments,       # INOUT (3, K + 1, D): += weight times (1, v, v^2), v the value less the mean
):
    cdef Py_ssize_t height = values.shape[0], width = values.shape[1], dims = values.shape[2], y, x, d
    cdef Py_ssize_t label
    cdef bint weighted = weights is not None
    cdef double weight = 1, step
    with nogil:
        for y in range(height):
            for x in range(width):
                label = labels[y + margin, x + margin]
                if label == 0:
                    continue
                for d in range(dims):
                    if weighted:
                        weight = weights[y, x, d]
                    step = values[y, x, d] - means[label, d]
                    moments[0, label, d] += weight
                    moments[1, label, d] += weight * step
                    moments[2, label, d] += weight * step * step


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


cdef inline double size_of(const double *mass, Py_ssize_t dims) noexcept nogil:
    cdef double total = 0
    cdef Py_ssize_t d
    for d in range(dims):
        total = total + mass[d]
    return total / dims


cdef inline bint is_simple(const int32_t *label, Py_ssize_t width) noexcept nogil:
    """Whether the cell of a pixel stays in one piece when the pixel leaves it, judged by its eight neighbors."""
    cdef int32_t own = label[0]
    cdef bint n = label[-width] == own, e = label[1] == own, s = label[width] == own, w = label[-1] == own
    cdef bint ne = label[1 - width] == own, se = label[width + 1] == own
    cdef bint sw = label[width - 1] == own, nw = label[-width - 1] == own
    # Yokoi's connectivity number.
    return n + e + s + w - (n & ne & e) - (e & se & s) - (s & sw & w) - (w & nw & n) == 1


cdef inline bint touches(const int32_t *label, Py_ssize_t width, int32_t other) noexcept nogil:
    return label[-width] == other or label[1] == other or label[width] == other or label[-1] == other


def sweep(
    strip,               # INOUT: labels, others and stale, (H + 2 R, W + 2 R); IN: values and weights, (H, W, D)
    cells,               # INOUT: masses and means, (K + 1, D), energies, (K + 1,); IN: total, the mass of all
    disc,                # IN: steps, (S,), and margin, R
    double edge_weight,  # IN
    double power,        # IN: cells count by their share of the mass to this power
    bint connected,      # IN: whether cells must stay in one piece
    bint backward,       # IN: from the last pixel to the first
):
    """Transfer boundary pixels, one after the other, to the cell where the energy is least; return how many moved.

    The records are those of `edge_weight.py`, which say what each array holds. A strip may be some rows of an image,
    framed by the labels of the rows above and below: those stay as they are.
    """
    cdef const float[:, :, ::1] values = strip.values
    cdef const float[:, :, ::1] weights = strip.weights
    cdef int32_t[:, ::1] labels = strip.labels
    cdef uint16_t[:, ::1] others = strip.others
    cdef uint8_t[:, ::1] stale = strip.stale
    cdef double[:, ::1] masses = cells.masses
    cdef double[:, ::1] means = cells.means
    cdef double[::1] energies = cells.energies
    cdef double total = cells.total
    cdef const int32_t[::1] steps = disc.steps
    cdef int32_t[::1] counts = np.zeros(masses.shape[0], np.int32), found = np.empty(steps.shape[0], np.int32)
    cdef Py_ssize_t margin = disc.margin
    cdef Py_ssize_t width = values.shape[1], dims = values.shape[2]
    cdef Py_ssize_t n_steps = steps.shape[0], stride = labels.shape[1]
    cdef Py_ssize_t first = margin * stride, last = (labels.shape[0] - margin) * stride
    cdef Py_ssize_t t, p, q, s, f, n_found, n_moved = 0
    cdef int32_t own, label, best
    cdef double cost, least, own_cost, best_cost, mass, size, before, after
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
            mass = 1
            if weighted:
                weight = &weights[0, 0, 0] + p * dims
                mass = 0
                for s in range(dims):
                    mass = mass + weight[s] / dims
            n_found = 0
            for s in range(n_steps):
                label = at[steps[s]]
                if counts[label] == 0:
                    found[n_found] = label
                    n_found += 1
                counts[label] += 1
            # The cost of the pixel in its own cell, and in each that it could join.
            own_cost = cost_of_pixel(value, weight, &means[own, 0], &masses[own, 0], dims, -1)
            least = own_cost
            if power != 0:
                size = size_of(&masses[own, 0], dims)
                before = cell_weight(size / total, power)
                after = cell_weight(max(size - mass, 0) / total, power)
                least = after * own_cost + (before - after) * energies[own]
            least = least - 2 * edge_weight * counts[own]
            # A smaller gain is rounding, and could go round in circles.
            least = least - 1e-12 * (least + 4 * edge_weight * n_steps)
            best = own
            best_cost = 0
            for f in range(n_found):
                label = found[f]
                if label == own or label == 0 or (connected and not touches(at, stride, label)):
                    continue
                cost = cost_of_pixel(value, weight, &means[label, 0], &masses[label, 0], dims, 1)
                after = cost
                if power != 0:
                    size = size_of(&masses[label, 0], dims)
                    before = cell_weight(size / total, power)
                    after = cell_weight((size + mass) / total, power)
                    after = after * cost + (after - before) * energies[label]
                after = after - 2 * edge_weight * counts[label]
                if after < least:
                    least = after
                    best = label
                    best_cost = cost
            for f in range(n_found):
                if found[f] != own and found[f] != best:
                    counts[found[f]] = 0
            if best != own:
                n_moved += 1
                energies[own] -= own_cost
                energies[best] += best_cost
                move_pixel(value, weight, &means[own, 0], &masses[own, 0], dims, -1)
                move_pixel(value, weight, &means[best, 0], &masses[best, 0], dims, 1)
                at[0] = best
                other[q] = <uint16_t>(other[q] + counts[own] - counts[best])
                for s in range(n_steps):
                    label = at[steps[s]]
                    other[q + steps[s]] += (label == own) - (label == best)
                    is_stale[q + steps[s]] = 1
                counts[best] = 0
            counts[own] = 0
    return n_moved


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

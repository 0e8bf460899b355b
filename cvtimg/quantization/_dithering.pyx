# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of dithering: one pass each, over buffers that the caller owns.

Places have four coordinates here, the last of which may be 0 everywhere: one loop serves grey, color and alpha, and
processors add four floats at once. Each argument is marked IN, OUT or INOUT.
"""
from libc.float cimport FLT_MAX
from libc.math cimport sqrtf
from libc.stdint cimport int32_t, uint8_t, uint16_t
from libc.string cimport memset

import numpy as np

DIMS = WIDTH

cdef enum:
    WIDTH = 4


cdef inline float squared_distance(const float *a, const float *b) noexcept nogil:
    cdef float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2], w = a[3] - b[3]
    return (x * x + y * y) + (z * z + w * w)


cdef struct Line:
    const float *palette    # (K, 4)
    const float *axis       # (4,): its direction, of length 1
    const float *along      # (N,): where entries lie on it, ascending for each kind
    const uint16_t *names   # (N,): which entries they are
    const int32_t *ends     # (n_kinds + 1,): where those that a kind of color may take begin, and end
    float doubt             # that rounding leaves about places on the line


cdef class Finder:
    """Entries of a palette in their order along a line, for each kind of color."""

    cdef Line line
    cdef object arrays  # kept alive

    def __init__(
        self,
        const float[:, ::1] palette,
        const float[::1] axis,
        const float[::1] along,
        const uint16_t[::1] names,
        const int32_t[::1] ends,
        float doubt,
    ):
        self.line = Line(&palette[0, 0], &axis[0], &along[0], &names[0], &ends[0], doubt)
        self.arrays = palette, axis, along, names, ends


cdef inline Py_ssize_t look_up(const Line *line, const float *place, Py_ssize_t kind) noexcept nogil:
    """The nearest entry that a kind of color may take, the first on a tie.

    Entries are as far away as their places on the line, or farther, so the search goes along it both ways, as far as
    the nearest one (S.-W. Ra, J.-K. Kim, IEEE Trans. Circuits and Systems II 40 (1993) 576-579).
    """
    cdef Py_ssize_t first = line.ends[kind], end = line.ends[kind + 1], low = first, high = end, middle, i, best = 0
    cdef float at = 0, least = FLT_MAX, reach = FLT_MAX, below, above, square
    for i in range(WIDTH):
        at += place[i] * line.axis[i]
    while low < high:
        middle = (low + high) // 2
        if line.along[middle] < at:
            low = middle + 1
        else:
            high = middle
    low -= 1
    while True:
        below = at - line.along[low] if low >= first else FLT_MAX
        above = line.along[high] - at if high < end else FLT_MAX
        if min(below, above) >= reach:
            return best
        if below < above:
            i, low = line.names[low], low - 1
        else:
            i, high = line.names[high], high + 1
        square = squared_distance(place, line.palette + WIDTH * i)
        if square < least or (square == least and i < best):
            best, least, reach = i, square, sqrtf(square) + line.doubt


cdef inline void miss(
    const float *place, const float *entry, float strength, float most, float *missed
) noexcept nogil:
    """The error handed on: the fraction `strength` of the step from an entry to a place, shortened to `most`."""
    cdef float squared = squared_distance(place, entry)
    if squared > most * most:
        strength *= most / sqrtf(squared)
    for d in range(WIDTH):
        missed[d] = (place[d] - entry[d]) * strength


def diffuse(
    const float[:, ::1] places,       # IN (M, 4): of the colors
    const uint8_t[::1] kinds,         # IN (M,): which entries a color may take
    const int32_t[:, ::1] inverse,    # IN (H, W): color of each pixel
    Finder finder,                    # IN
    const float[::1] strengths,       # IN (n_kinds,): fraction of its error that a kind of color hands on
    float most,                       # IN: longest error handed on
    const uint8_t[:, ::1] clean,      # IN (H, W): pixels that get their own nearest entry, and hand on nothing
    int32_t[:, ::1] labels,           # OUT (H, W)
):
    """Give each pixel the nearest entry, and hand the error to its neighbors, in alternating directions row by row."""
    cdef Line line = finder.line
    cdef Py_ssize_t n_rows = inverse.shape[0], width = inverse.shape[1], x, y, step, i, d, label
    # Errors handed to this row and the next, from column 1.
    cdef float[:, :, ::1] rows = np.zeros((2, width + 2, WIDTH), np.float32)
    cdef uint8_t[::1] row_kinds = np.empty(width, np.uint8)
    cdef float place[WIDTH]
    cdef float ahead[WIDTH]
    cdef float missed[WIDTH]
    cdef float strength
    cdef float *here
    cdef float *below
    with nogil:
        for y in range(n_rows):
            here, below = &rows[y & 1, 1, 0], &rows[1 - (y & 1), 1, 0]
            # Fetched ahead of use, so that no fetch waits for the choice of the previous pixel.
            for x in range(width):
                row_kinds[x] = kinds[inverse[y, x]]
                for d in range(WIDTH):
                    here[WIDTH * x + d] += places[inverse[y, x], d]
            memset(below - WIDTH, 0, (width + 2) * WIDTH * sizeof(float))
            memset(ahead, 0, sizeof(ahead))
            step = 1 - 2 * (y & 1)
            x = 0 if step > 0 else width - 1
            for i in range(width):
                for d in range(WIDTH):
                    place[d] = places[inverse[y, x], d] if clean[y, x] else here[WIDTH * x + d] + ahead[d]
                label = look_up(&line, place, row_kinds[x])
                labels[y, x] = <int32_t>label
                strength = 0 if clean[y, x] else strengths[row_kinds[x]]
                miss(place, line.palette + WIDTH * label, strength, most, missed)
                for d in range(WIDTH):
                    ahead[d] = missed[d] * <float>(7. / 16)
                    below[WIDTH * (x - step) + d] += missed[d] * <float>(3. / 16)
                    below[WIDTH * x + d] += missed[d] * <float>(5. / 16)
                    below[WIDTH * (x + step) + d] += missed[d] * <float>(1. / 16)
                x += step


def mix(
    const float[:, ::1] places,       # IN (M, 4): of the colors
    const uint8_t[::1] kinds,         # IN (M,): which entries a color may take
    Finder finder,                    # IN
    const float[::1] strengths,       # IN (n_kinds,): fraction of its error that a kind of color hands on
    float most,                       # IN: longest error handed on
    const uint16_t[::1] ranks,        # IN (K,): rank of each entry by brightness
    uint16_t[:, ::1] mixtures,        # OUT (M, N): entries whose mean is the color, by rank
):
    """List the entries to mix for each color: each is the nearest to the color plus the error of those before it."""
    cdef Line line = finder.line
    cdef Py_ssize_t n_colors = places.shape[0], n_mixed = mixtures.shape[1], color, i, at, d, entry
    cdef float place[WIDTH]
    cdef float missed[WIDTH]
    cdef uint16_t *mixture
    with nogil:
        for color in range(n_colors):
            mixture = &mixtures[color, 0]
            memset(missed, 0, sizeof(missed))
            for i in range(n_mixed):
                for d in range(WIDTH):
                    place[d] = places[color, d] + missed[d]
                entry = look_up(&line, place, kinds[color])
                miss(place, line.palette + WIDTH * entry, strengths[kinds[color]], most, missed)
                at = i
                while at > 0 and ranks[mixture[at - 1]] > ranks[entry]:
                    mixture[at] = mixture[at - 1]
                    at -= 1
                mixture[at] = <uint16_t>entry

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops over the borders between regions: one pass each, over buffers that the caller owns.

Nothing here allocates, checks its arguments or decides when to stop; that is for the Python modules that call.
Each argument is marked IN, OUT or INOUT.
"""
from libc.math cimport atan2, rint
from libc.stdint cimport int32_t, uint8_t
from libc.string cimport memset

#: M_PI is not standard C, and not in the headers for Windows.
cdef double PI = 3.141592653589793

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


def orient(
    const int32_t[:, ::1] places,  # IN (P, 2): twice the row and the column of the middle of each crack
    const int32_t[::1] starts,     # IN (B + 1,): where the cracks of each border begin
    Py_ssize_t first,              # IN: borders to look at
    Py_ssize_t last,
    double radius,                 # IN: pixels
    int n_angles,                  # IN
    int32_t[::1] angles,           # OUT (P,): main axis of the border near each crack, -1 where a crack is alone
):
    cdef Py_ssize_t b, i, j, n
    cdef double reach = 4 * radius * radius, down, right, mean_down, mean_right, rr, rd, dd
    with nogil:
        for b in range(first, last):
            for i in range(starts[b], starts[b + 1]):
                n = 0
                mean_down = mean_right = rr = rd = dd = 0
                for j in range(starts[b], starts[b + 1]):
                    down = places[j, 0] - places[i, 0]
                    right = places[j, 1] - places[i, 1]
                    if down * down + right * right <= reach:
                        n += 1
                        mean_down += down
                        mean_right += right
                        rr += right * right
                        rd += right * down
                        dd += down * down
                # Sums of whole numbers: exact, so that no axis hangs on rounding.
                rr = n * rr - mean_right * mean_right
                rd = n * rd - mean_right * mean_down
                dd = n * dd - mean_down * mean_down
                angles[i] = -1
                if rr + dd > 0:
                    angles[i] = (<int32_t>rint(atan2(2 * rd, rr - dd) / (2 * PI) * n_angles) + n_angles) % n_angles


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
                    if n_channels == 4:
                        for s in range(begin, end):
                            pixel = &bins[places[p] + step[s], 0]
                            slot[pixel[0]] += 1
                            slot[2 * _SLOT + pixel[1]] += 1
                            slot[4 * _SLOT + pixel[2]] += 1
                            slot[6 * _SLOT + pixel[3]] += 1
                    else:
                        for s in range(begin, end):
                            pixel = &bins[places[p] + step[s], 0]
                            for c in range(n_channels):
                                slot[2 * c * _SLOT + pixel[c]] += 1
                begin = end
                for c in range(n_channels):
                    distances[p, c, r] = channel_distance(slots + 2 * c * _SLOT, &taps[0], c == n_channels - 1)

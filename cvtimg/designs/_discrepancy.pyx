# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of the star discrepancy: one pass each, over buffers that the caller owns.

Nothing here allocates, checks its arguments or decides when to stop; that is for the Python modules that call.
Each argument is marked IN, OUT or INOUT.
"""
from libc.stdint cimport int32_t


def greatest_gap(
    const int32_t[:, ::1] counts,  # IN (A, B): points in the box up to each corner
    const double[::1] down,        # IN (A,): sides of the boxes along the first axis
    const double[::1] right,       # IN (B,): along the second
    double depth,                  # IN: product of the other sides
    double share,                  # IN: what a point counts
    double sign,                   # IN: 1 where boxes have too many points, -1 where they have too few
):
    """Return the greatest of sign (share counts - volume) over all boxes."""
    cdef Py_ssize_t a, b
    cdef double greatest = -1, gap, side
    with nogil:
        for a in range(down.shape[0]):
            side = down[a] * depth
            for b in range(right.shape[0]):
                gap = sign * (share * counts[a, b] - side * right[b])
                if gap > greatest:
                    greatest = gap
    return greatest


def walk_boxes(
    const double[:, ::1] points,      # IN (n, d)
    const double[:, ::1] sides,       # IN (d, S): the sides that boxes can have, rising, along each axis
    int32_t[::1] corner,              # INOUT (d,): index of the box's side along each axis
    int32_t[::1] trial,               # scratch (d,)
    double[::1] inner,                # scratch (d,)
    const int32_t[:, ::1] moves,      # IN (T, d): steps to try, one after the other
    const double[::1] thresholds,     # IN (T,): a step that loses at most so much is taken
):
    """Walk from box to box, and return the greatest gap between the share of points and the volume that was met."""
    cdef Py_ssize_t n = points.shape[0], dims = points.shape[1], last = sides.shape[1] - 1, t, i, j, n_closed, n_open
    cdef double current = -1, greatest = 0, volume, tight, gap, side
    cdef bint is_inside, is_within
    with nogil:
        for t in range(moves.shape[0]):
            volume = 1
            for j in range(dims):
                trial[j] = min(max(corner[j] + moves[t, j], 0), <int32_t>last)
                volume = volume * sides[j, trial[j]]
                inner[j] = 0
            n_closed = n_open = 0
            for i in range(n):
                is_inside = is_within = True
                for j in range(dims):
                    side = sides[j, trial[j]]
                    is_inside = is_inside and points[i, j] <= side
                    is_within = is_within and points[i, j] < side
                    if not is_inside:
                        break
                if is_inside:
                    n_closed += 1
                    for j in range(dims):
                        inner[j] = max(inner[j], points[i, j])
                n_open += is_within and is_inside
            tight = 1 if n_closed else 0  # the least closed box with the same points
            for j in range(dims):
                tight = tight * inner[j]
            gap = max(n_closed / <double>n - tight, volume - n_open / <double>n)
            if gap >= current - thresholds[t]:
                current = gap
                for j in range(dims):
                    corner[j] = trial[j]
            greatest = max(greatest, gap)
    return greatest

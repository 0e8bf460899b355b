# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loop of swaps that lower a discrepancy: one pass, over buffers that the caller owns.

Nothing here allocates, checks its arguments or decides when to stop; that is for the Python modules that call.
Each argument is marked IN, OUT or INOUT.
"""
from libc.math cimport fabs
from libc.stdint cimport int32_t


cdef inline double factor(double a, double b, bint periodic) noexcept nogil:
    """Return the factor of one axis in the term of two points, whose coordinates count from the center of the cube."""
    cdef double apart = fabs(a - b)
    return 1.5 - apart * (1 - apart) if periodic else 1 + 0.5 * (fabs(a) + fabs(b) - apart)


cdef inline double square(double a, double b, bint periodic) noexcept nogil:
    """Return the squared distance along one axis."""
    cdef double apart = fabs(a - b)
    if periodic and apart > 0.5:
        apart = 1 - apart
    return apart * apart


cdef inline double own_term(
    const double[:, ::1] places, Py_ssize_t point, Py_ssize_t axis, double there
) noexcept nogil:
    """Return the terms of one point alone, with another coordinate along an axis; only walls make any."""
    cdef double with_itself = 1, with_cube = 1, size
    cdef Py_ssize_t k
    for k in range(places.shape[1]):
        size = fabs(there if k == axis else places[point, k])
        with_itself = with_itself * (1 + size)
        with_cube = with_cube * (1 + 0.5 * size * (1 - size))
    return with_itself - 2 * places.shape[0] * with_cube


def swap_coordinates(
    double[:, ::1] places,        # INOUT (n, d): coordinates from the center of the cube
    int32_t[:, ::1] order,        # INOUT (d, f): points that may swap, by their coordinate along each axis
    const int32_t[:, ::1] tries,  # IN (T, 2): an axis, and the rank along it of the first of two neighbors
    double least,                 # IN: squared distance below which no swap brings two points
    bint periodic,                # IN: wrap-around discrepancy, not centered
):
    """Swap coordinates of neighbors along an axis wherever that lowers the L2 discrepancy; return how often it did."""
    cdef Py_ssize_t n = places.shape[0], dims = places.shape[1], t, axis, i, j, m, k, n_swaps = 0
    cdef double here, there, change, rest_i, rest_j, at, square_i, square_j
    with nogil:
        for t in range(tries.shape[0]):
            axis = tries[t, 0]
            i = order[axis, tries[t, 1]]
            j = order[axis, tries[t, 1] + 1]
            here = places[i, axis]
            there = places[j, axis]
            change = 0
            for m in range(n):
                if m == i or m == j:
                    continue
                rest_i = rest_j = 1
                square_i = square_j = 0
                for k in range(dims):
                    if k != axis:
                        at = places[m, k]
                        rest_i = rest_i * factor(places[i, k], at, periodic)
                        rest_j = rest_j * factor(places[j, k], at, periodic)
                        square_i = square_i + square(places[i, k], at, periodic)
                        square_j = square_j + square(places[j, k], at, periodic)
                at = places[m, axis]
                if square_i + square(there, at, periodic) < least or square_j + square(here, at, periodic) < least:
                    break
                change = change + (factor(there, at, periodic) - factor(here, at, periodic)) * (rest_i - rest_j)
            else:
                m = n
            if m < n:
                continue
            change = 2 * change
            if not periodic:
                change = change + own_term(places, i, axis, there) - own_term(places, i, axis, here)
                change = change + own_term(places, j, axis, here) - own_term(places, j, axis, there)
            if change < -1e-12:
                places[i, axis] = there
                places[j, axis] = here
                order[axis, tries[t, 1]] = <int32_t>j
                order[axis, tries[t, 1] + 1] = <int32_t>i
                n_swaps += 1
    return n_swaps

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of designs: the star discrepancy, swaps that serve a criterion, and distances on the torus.

Nothing here checks its arguments or decides when to stop. Each argument is marked IN, OUT or INOUT.
"""
import numpy as np
from libc.math cimport fabs, fabsf
from libc.stdint cimport int32_t


def walk_boxes(
    const double[:, ::1] points,      # IN (n, d)
    const double[:, ::1] sides,       # IN (d, S): the sides that boxes can have, rising, along each axis
    int32_t[::1] corner,              # INOUT (d,): index of the box's side along each axis
    const int32_t[:, ::1] moves,      # IN (T, d): steps to try, one after the other
    const double[::1] thresholds,     # IN (T,): the largest loss of a step that is taken
):
    """Walk from box to box, and return the greatest gap between the share of points and the volume that was met."""
    cdef Py_ssize_t n = points.shape[0], dims = points.shape[1], last = sides.shape[1] - 1, t, i, j, n_closed, n_open
    cdef int32_t[::1] trial = np.empty(dims, np.int32)
    cdef double[::1] inner = np.empty(dims)
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


cdef inline double wall_term(
    const double[:, ::1] places, Py_ssize_t n, Py_ssize_t point, Py_ssize_t axis, double there
) noexcept nogil:
    """Return the terms of one point alone, with another coordinate along an axis; only walls make any."""
    cdef double with_itself = 1, with_cube = 1, size
    cdef Py_ssize_t k
    for k in range(places.shape[1]):
        size = fabs(there if k == axis else places[point, k])
        with_itself = with_itself * (1 + size)
        with_cube = with_cube * (1 + 0.5 * size * (1 - size))
    return with_itself - 2 * n * with_cube


cdef enum:
    EVEN_BOXES = 0       # the L2 discrepancy
    FAR_APART = 1        # the sum of inverse 16th powers of distances
    APART_IN_AXES = 2    # the sum of inverse products of squared distances along the axes

DISCREPANCY, MAXIMIN, PROJECTION = EVEN_BOXES, FAR_APART, APART_IN_AXES


cdef inline double along(double a, double b, int criterion, double scale, bint periodic) noexcept nogil:
    """Return what one axis adds to two points, as a factor or as a term."""
    if criterion == EVEN_BOXES:
        return factor(a, b, periodic)
    return scale * square(a, b, periodic)


cdef inline double joined(double rest, double part, int criterion) noexcept nogil:
    """Return what two points cost, of what one axis and the rest add."""
    cdef double inverse
    if criterion == EVEN_BOXES:
        return 2 * rest * part
    if criterion == APART_IN_AXES:
        return 1 / (rest * part)
    inverse = 1 / (rest + part)
    inverse = inverse * inverse
    inverse = inverse * inverse
    return inverse * inverse


def swap_coordinates(
    double[:, ::1] places,          # INOUT (n + s, d): coordinates from the center of the cube
    Py_ssize_t n,                   # IN: how many are points; those after them are places that are free
    int32_t[:, ::1] order,          # INOUT (d, f): which may swap, by their coordinate along each axis
    const int32_t[:, ::1] tries,    # IN (T, 3): an axis, and the ranks along it of two points
    double threshold,               # IN: a swap is taken if the criterion changes by less
    double[::1] changes,            # OUT (T,): of the criterion, by each swap; 0 where two points would be too near
    int criterion,                  # IN: DISCREPANCY, MAXIMIN or PROJECTION
    double scale,                   # IN: of squared distances, so that powers are in range
    double least,                   # IN: squared distance below which no swap brings two points
    bint periodic,                  # IN: distances are the short way round, the discrepancy is that with wrap-around
):
    """Swap coordinates of two points along an axis, or of one and a free place, wherever that serves a criterion."""
    cdef Py_ssize_t dims = places.shape[1], t, axis, i, j, m, k
    cdef double here, there, change, rest_i, rest_j, at, square_i, square_j, to_here, to_there
    cdef bint is_sum = criterion == FAR_APART, is_pair
    with nogil:
        for t in range(tries.shape[0]):
            axis = tries[t, 0]
            i = min(order[axis, tries[t, 1]], order[axis, tries[t, 2]])
            j = max(order[axis, tries[t, 1]], order[axis, tries[t, 2]])
            is_pair = j < n
            changes[t] = 0
            if i >= n:
                continue
            here = places[i, axis]
            there = places[j, axis]
            change = 0
            for m in range(n):
                if m == i or m == j:
                    continue
                rest_i = rest_j = 0 if is_sum else 1
                square_i = square_j = 0
                for k in range(dims):
                    if k != axis:
                        at = places[m, k]
                        if is_sum:
                            rest_i = rest_i + along(places[i, k], at, criterion, scale, periodic)
                            rest_j = rest_j + along(places[j, k], at, criterion, scale, periodic)
                        else:
                            rest_i = rest_i * along(places[i, k], at, criterion, scale, periodic)
                            rest_j = rest_j * along(places[j, k], at, criterion, scale, periodic)
                        if least > 0:
                            square_i = square_i + square(places[i, k], at, periodic)
                            square_j = square_j + square(places[j, k], at, periodic)
                at = places[m, axis]
                if least > 0 and (
                    square_i + square(there, at, periodic) < least or square_j + square(here, at, periodic) < least
                ):
                    break
                to_here = along(here, at, criterion, scale, periodic)
                to_there = along(there, at, criterion, scale, periodic)
                change = change + joined(rest_i, to_there, criterion) - joined(rest_i, to_here, criterion)
                if is_pair:
                    change = change + joined(rest_j, to_here, criterion) - joined(rest_j, to_there, criterion)
            else:
                m = n
            if m < n:
                continue
            if criterion == EVEN_BOXES and not periodic:
                change = change + wall_term(places, n, i, axis, there) - wall_term(places, n, i, axis, here)
                if is_pair:
                    change = change + wall_term(places, n, j, axis, here) - wall_term(places, n, j, axis, there)
            changes[t] = change
            if change < threshold:
                places[i, axis] = there
                places[j, axis] = here
                order[axis, tries[t, 1]], order[axis, tries[t, 2]] = order[axis, tries[t, 2]], order[axis, tries[t, 1]]


def assign_on_torus(
    const float[:, ::1] samples,     # IN (m, d), in 0..1
    const float[:, ::1] generators,  # IN (d, n), in 0..1
    int32_t[::1] labels,             # OUT (m,): the nearest generator, the first on a tie
):
    """Find the nearest generator of each sample, the short way round."""
    cdef Py_ssize_t dims = samples.shape[1], n = generators.shape[1], i, j, k, nearest
    cdef float[::1] squares = np.empty(n, np.float32)
    cdef float place, apart, least
    with nogil:
        for i in range(samples.shape[0]):
            for k in range(n):
                squares[k] = 0
            for j in range(dims):
                place = samples[i, j]
                for k in range(n):
                    apart = fabsf(place - generators[j, k])
                    apart = min(apart, 1 - apart)
                    squares[k] += apart * apart
            nearest = 0
            least = squares[0]
            for k in range(1, n):
                if squares[k] < least:
                    least = squares[k]
                    nearest = k
            labels[i] = <int32_t>nearest

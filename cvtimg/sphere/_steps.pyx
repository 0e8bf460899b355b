# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over the steps that a descent on the sphere remembers.

Rows are vectors of N points: the last steps, the changes of the gradient along them, and the gradient, all in coordinates
in which points are about equally stiff. Each argument is marked IN, OUT or INOUT.
"""
from libc.math cimport sqrt


def split_moments(
    const double[:, ::1] points,   # IN (N, 3)
    Py_ssize_t start,              # IN
    Py_ssize_t stop,               # IN
    double[:, ::1] moments,        # INOUT (N, 3): of cells; becomes their parts across the points, in rows start..stop
    double[::1] lengths,           # OUT (N,)
    double[::1] along,             # OUT (N,): their parts along the points
):
    """Split moments of uniform cells into their lengths, which are nearly areas, and their parts."""
    cdef Py_ssize_t i, k
    with nogil:
        for i in range(start, stop):
            lengths[i] = sqrt(
                moments[i, 0] * moments[i, 0] + moments[i, 1] * moments[i, 1] + moments[i, 2] * moments[i, 2])
            along[i] = moments[i, 0] * points[i, 0] + moments[i, 1] * points[i, 1] + moments[i, 2] * points[i, 2]
            for k in range(3):
                moments[i, k] -= along[i] * points[i, k]


def learn(
    const double[:, ::1] points,   # IN (N, 3)
    const double[:, ::1] before,   # IN (N, 3): where they came from
    const double[:, ::1] pulls,    # IN (N, 3): minus half the gradient
    const double[::1] stretches,   # IN (N,): the way of a point for one of its coordinate
    Py_ssize_t slot,               # IN: row of the step, or -1 where there was none
    Py_ssize_t n_steps,            # IN: rows of steps, and so of changes; the gradient is the row after these
    Py_ssize_t start,              # IN
    Py_ssize_t stop,               # IN
    double[:, :, ::1] rows,        # INOUT (2 n_steps + 1, N, 3): points start..stop
):
    """Write the last step, the change of the gradient, and the gradient."""
    cdef Py_ssize_t i, k
    cdef double slope
    with nogil:
        for i in range(start, stop):
            for k in range(3):
                slope = -2 * stretches[i] * pulls[i, k]
                if slot >= 0:
                    rows[slot, i, k] = (points[i, k] - before[i, k]) / stretches[i]
                    rows[slot + n_steps, i, k] = slope - rows[2 * n_steps, i, k]
                rows[2 * n_steps, i, k] = slope


cdef double product(const double *a, const double *b, Py_ssize_t n) noexcept nogil:
    cdef double sums[8]
    cdef Py_ssize_t i, j
    for j in range(8):
        sums[j] = 0
    for i in range(0, n - 7, 8):
        for j in range(8):
            sums[j] += a[i + j] * b[i + j]
    for i in range(n - n % 8, n):
        sums[0] += a[i] * b[i]
    return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]))


def sum_products(
    const double[:, :, ::1] rows,  # IN (R, N, 3)
    const Py_ssize_t[::1] new,     # IN (W,): which rows have changed
    Py_ssize_t block,              # IN: points of a block
    Py_ssize_t start,              # IN
    Py_ssize_t stop,               # IN
    double[:, :, ::1] sums,        # OUT (blocks, W, R): blocks start..stop
):
    """Sum the products of changed rows with all rows, over each block of points."""
    cdef Py_ssize_t b, i, j, first, n
    with nogil:
        for b in range(start, stop):
            first = b * block
            n = 3 * min(block, rows.shape[1] - first)
            for i in range(new.shape[0]):
                for j in range(rows.shape[0]):
                    sums[b, i, j] = product(&rows[new[i], first, 0], &rows[j, first, 0], n)


def move_points(
    const double[:, ::1] points,      # IN (N, 3)
    const double[:, :, ::1] rows,     # IN (R, N, 3)
    const double[::1] coefficients,   # IN (R,)
    const double[::1] stretches,      # IN (N,)
    const double[::1] areas,          # IN (N,): of cells
    double longest,                   # IN: step in sizes of the cell
    double part,                      # IN: of the step, to take
    Py_ssize_t start,                 # IN
    Py_ssize_t stop,                  # IN
    double[:, ::1] there,             # OUT (N, 3): unit vectors, in rows start..stop
):
    """Move points by a sum of rows."""
    cdef Py_ssize_t i, j, k
    cdef double step[3]
    cdef double scale, square
    with nogil:
        for i in range(start, stop):
            step[0] = step[1] = step[2] = 0
            for j in range(rows.shape[0]):
                for k in range(3):
                    step[k] += coefficients[j] * rows[j, i, k]
            scale = stretches[i]
            square = scale * scale * (step[0] * step[0] + step[1] * step[1] + step[2] * step[2])
            if square > longest * longest * areas[i]:
                scale *= longest * sqrt(areas[i] / square)
            square = 0
            for k in range(3):
                there[i, k] = points[i, k] + part * scale * step[k]
                square += there[i, k] * there[i, k]
            scale = 1 / sqrt(square)
            for k in range(3):
                there[i, k] *= scale

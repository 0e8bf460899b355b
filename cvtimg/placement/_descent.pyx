# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes of limited-memory BFGS over N vectors of D numbers, one after the other: (N D,).

Vectors are in B blocks, which stay in the cache for all that a pass does with them. Threads share blocks start..stop, each
of which has its own row of sums. Steps and changes (S, N D) are at places, of which `kept` (M,) are in use.
"""
from libc.stdint cimport int32_t

cdef enum:
    LANES = 8  # sums side by side, for the vectors of a processor


cdef double dot(const double *first, const double *second, Py_ssize_t n) noexcept nogil:
    cdef double sums[LANES]
    cdef Py_ssize_t i, k
    for k in range(LANES):
        sums[k] = 0
    for i in range(n // LANES):
        for k in range(LANES):
            sums[k] += first[LANES * i + k] * second[LANES * i + k]
    for i in range(n - n % LANES, n):
        sums[i % LANES] += first[i] * second[i]
    return ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))


cdef inline double times(const double[:, ::1] factors, Py_ssize_t i, const double *vector, Py_ssize_t k) noexcept nogil:
    """Return a coordinate of a vector times a factor, or times a symmetric matrix of two columns: xx, xy and yy."""
    if factors.shape[1] == 3:
        return factors[i, k] * vector[0] + factors[i, k + 1] * vector[1]
    return factors[i, 0] * vector[k]


def learn(
    const double[::1] after, const double[::1] before, const double[::1] old, const double[::1] new,
    double[:, ::1] steps, double[:, ::1] changes, const int32_t[::1] kept, Py_ssize_t n_vectors, double[:, ::1] sums,
    Py_ssize_t start, Py_ssize_t stop,
):
    """Fill in the last kept step, from before to after, and change, from new to old.

    Sums (B, 2 M + 2) are the products of that change, and then of new, with kept steps; and the squares of both.
    """
    cdef Py_ssize_t n_columns = after.shape[0] // n_vectors, last = kept.shape[0] - 1, block, first, size, i, m
    cdef double *step
    cdef double *change
    with nogil:
        for block in range(start, stop):
            first = n_vectors * block // sums.shape[0] * n_columns
            size = n_vectors * (block + 1) // sums.shape[0] * n_columns - first
            step, change = &steps[kept[last], first], &changes[kept[last], first]
            for i in range(size):
                step[i] = after[first + i] - before[first + i]
                change[i] = old[first + i] - new[first + i]
            for m in range(last + 1):
                sums[block, m] = dot(&steps[kept[m], first], change, size)
                sums[block, last + 1 + m] = dot(&steps[kept[m], first], &new[first], size)
            sums[block, 2 * last + 2] = dot(step, step, size)
            sums[block, 2 * last + 3] = dot(change, change, size)


def combine(
    double[::1] out, double scale, const double[::1] vectors, const double[::1] factors, const double[:, ::1] others,
    const int32_t[::1] kept, inverse, Py_ssize_t n_vectors, double[:, ::1] sums, Py_ssize_t start, Py_ssize_t stop,
):
    """Fill `out` with vectors times a scale, plus kept others times factors; multiply each by its row of `inverse`, if any.

    Then sums (B, M + 1) are the products with kept others, and that of the last of these with itself, multiplied so.
    """
    cdef const double[:, ::1] rows = inverse
    cdef bint is_multiplied = rows is not None
    cdef Py_ssize_t n_columns = out.shape[0] // n_vectors, n_kept = kept.shape[0], block, first, size, i, k, m
    cdef double x, y
    cdef double *vector
    cdef const double *last
    with nogil:
        for block in range(start, stop):
            first = n_vectors * block // sums.shape[0] * n_columns
            size = n_vectors * (block + 1) // sums.shape[0] * n_columns - first
            for i in range(first, first + size):
                out[i] = scale * vectors[i]
            for m in range(n_kept):
                for i in range(first, first + size):
                    out[i] += factors[m] * others[kept[m], i]
            if not is_multiplied:
                continue
            sums[block, n_kept] = 0
            for i in range(first // n_columns, (first + size) // n_columns):
                vector = &out[i * n_columns]
                if n_kept:
                    last = &others[kept[n_kept - 1], i * n_columns]
                    for k in range(n_columns):
                        sums[block, n_kept] += last[k] * times(rows, i, last, k)
                if n_columns == 2:
                    x, y = times(rows, i, vector, 0), times(rows, i, vector, 1)
                    vector[0], vector[1] = x, y
                else:
                    for k in range(n_columns):
                        vector[k] = times(rows, i, vector, k)
            for m in range(n_kept):
                sums[block, m] = dot(&others[kept[m], first], &out[first], size)

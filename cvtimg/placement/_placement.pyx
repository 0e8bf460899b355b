# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over pictures as densities: moments of cells, and labels.

Nothing here checks its arguments or decides. Each argument is marked IN, OUT or INOUT. B is the number of buckets, K
that of generators; generators are sorted by buckets, and sums are in that order.
"""
import numpy as np
from libc.stdint cimport int32_t

#: Owners of boxes inside of boxes, of all levels together, for each generator, and at least.
cdef Py_ssize_t ROOM_PER_GENERATOR = 3, ROOM = 1 << 13

cdef extern from "moments.h" nogil:
    struct c_buckets "buckets":
        int side, columns, rows
        const int32_t *first
        const double *places
        double heaviest

    struct c_owners "owners":
        double *x
        double *y
        double *c
        int32_t *index
        Py_ssize_t n

    struct c_running "running":
        pass

    struct c_sums "sums":
        pass

    void sum_bands(
        const float *density, int width, int height, c_buckets buckets, int first, int last, c_owners scratch,
        c_running *running, c_sums *sums, int32_t *low, int32_t *high,
    )
    void label_bands(
        int32_t *labels, int width, int height, c_buckets buckets, const int32_t *order, int first, int last,
        c_owners scratch,
    )


cdef inline Py_ssize_t bucket_of(double place, double per_pixel, Py_ssize_t n) noexcept nogil:
    # Far outside, a place may be larger than any integer.
    cdef double at = place * per_pixel
    return 0 if at <= 0 else n - 1 if at >= n else <Py_ssize_t>at


def sort_into_buckets(
    const double[:, ::1] points,  # IN (K, 2)
    const double[::1] weights,    # IN (K,), or None for 0
    int side,                     # IN: of a bucket, in pixels
    int columns,                  # IN
    int32_t[::1] first,           # OUT (B + 2,): the first of each bucket, and the end of the last
    int32_t[::1] order,           # OUT (K,): indices as given
    double[:, ::1] places,        # OUT (K, 3): x, y and weight
):
    """Sort generators by the bucket in which they lie."""
    cdef Py_ssize_t k, n = points.shape[0], n_buckets = first.shape[0] - 2, rows = n_buckets // columns, bucket, at
    cdef double per_pixel = 1.0 / side
    with nogil:
        first[:] = 0
        for k in range(n):
            bucket = bucket_of(points[k, 1], per_pixel, rows) * columns + bucket_of(points[k, 0], per_pixel, columns)
            first[bucket + 2] += 1
        for bucket in range(n_buckets):
            first[bucket + 2] += first[bucket + 1]
        # first[bucket + 1] is where the next of the bucket goes, and in the end where the next bucket begins.
        for k in range(n):
            bucket = bucket_of(points[k, 1], per_pixel, rows) * columns + bucket_of(points[k, 0], per_pixel, columns)
            at = first[bucket + 1]
            first[bucket + 1] += 1
            order[at] = <int32_t>k
            places[at, 0] = points[k, 0]
            places[at, 1] = points[k, 1]
            places[at, 2] = 0 if weights is None else weights[k]


cdef c_buckets as_buckets(
    const int32_t[::1] first, const double[:, ::1] places, int side, int columns, double heaviest,
) noexcept:
    cdef c_buckets buckets
    buckets.side = side
    buckets.columns = columns
    buckets.rows = <int>((first.shape[0] - 2) // columns)
    buckets.first = &first[0]
    buckets.places = &places[0, 0]
    buckets.heaviest = heaviest
    return buckets


cdef class Scratch:
    """Room for the owners of boxes; what is not needed is never touched."""
    cdef double[:, ::1] places
    cdef int32_t[::1] indices
    cdef c_owners owners

    def __cinit__(self, Py_ssize_t n_generators):
        cdef Py_ssize_t room = ROOM_PER_GENERATOR * n_generators + ROOM
        self.places = np.empty((3, room))
        self.indices = np.empty(room, np.int32)
        self.owners.x = &self.places[0, 0]
        self.owners.y = &self.places[1, 0]
        self.owners.c = &self.places[2, 0]
        self.owners.index = &self.indices[0]
        self.owners.n = room


def sum_cells(
    const float[:, ::1] density,   # IN (H, W)
    const int32_t[::1] first,      # IN (B + 2,)
    const double[:, ::1] places,   # IN (K, 3)
    int side,                      # IN
    int columns,                   # IN
    double heaviest,               # IN: the largest weight
    const int32_t[::1] bands,      # IN (P + 1,): rows of buckets that begin each part
    Py_ssize_t start,              # IN: parts start..stop - 1 are summed
    Py_ssize_t stop,               # IN
    double[:, :, ::1] sums,        # OUT (P, K, 3): mass, and it times x and y, of each cell, sorted as places
    int32_t[:, ::1] touched,       # OUT (P, 2): sums are written from the first to before the last of these
):
    """Sum the density, and x and y times it, over each cell, in parts that do not share a sum."""
    cdef c_buckets buckets = as_buckets(first, places, side, columns, heaviest)
    cdef Scratch scratch = Scratch(places.shape[0])
    cdef double[:, :, ::1] running = np.empty((side, density.shape[1] + 1, 2))
    cdef Py_ssize_t part
    with nogil:
        for part in range(start, stop):
            sum_bands(
                &density[0, 0], <int>density.shape[1], <int>density.shape[0], buckets, bands[part], bands[part + 1],
                scratch.owners, <c_running *>&running[0, 0, 0], <c_sums *>&sums[part, 0, 0], &touched[part, 0],
                &touched[part, 1],
            )


def add_parts(
    const double[:, :, ::1] sums,     # IN (P, K, 3)
    const int32_t[:, ::1] touched,    # IN (P, 2)
    const int32_t[::1] order,         # IN (K,)
    double[:, ::1] total,             # OUT (K, 3): in the order of the points
):
    """Add the sums of all parts, the first to the last, so that no bit depends on threads."""
    cdef Py_ssize_t part, k, d
    with nogil:
        total[:] = 0
        for part in range(sums.shape[0]):
            for k in range(touched[part, 0], touched[part, 1]):
                for d in range(3):
                    total[order[k], d] += sums[part, k, d]


def label_pixels(
    int32_t[:, ::1] labels,        # OUT (H, W): the generator nearest to the center of each pixel
    const int32_t[::1] order,      # IN (K,)
    const int32_t[::1] first,      # IN (B + 2,)
    const double[:, ::1] places,   # IN (K, 3)
    int side,                      # IN
    int columns,                   # IN
    double heaviest,               # IN
    Py_ssize_t start,              # IN: rows of buckets start..stop - 1
    Py_ssize_t stop,               # IN
):
    """Label pixels by the cell in which their center lies."""
    cdef c_buckets buckets = as_buckets(first, places, side, columns, heaviest)
    cdef Scratch scratch = Scratch(places.shape[0])
    with nogil:
        label_bands(
            &labels[0, 0], <int>labels.shape[1], <int>labels.shape[0], buckets, &order[0], <int>start, <int>stop,
            scratch.owners,
        )


cdef extern from "curve.h" nogil:
    struct c_walk "walk":
        const float *weights
        int width, height
        double each, sum
        double *places
        Py_ssize_t n, room

    void follow_curve(c_walk *walk, int x, int y, int ux, int uy, int vx, int vy)


def place_along_curve(
    const float[:, ::1] weights,  # IN (H, W)
    double each,                  # IN: weight between places
    double[:, ::1] places,        # OUT (K, 2): corners (x, y) of their pixels
):
    """Find the pixels that hold the middles of K equal parts of the weight along a Hilbert curve; return how many."""
    cdef c_walk walk
    cdef int side = 1
    walk.weights = &weights[0, 0]
    walk.height = <int>weights.shape[0]
    walk.width = <int>weights.shape[1]
    walk.each = each
    walk.sum = 0
    walk.places = &places[0, 0]
    walk.n = 0
    walk.room = places.shape[0]
    while side < max(walk.width, walk.height):
        side *= 2
    with nogil:
        follow_curve(&walk, 0, 0, side, 0, 0, side)
    return walk.n

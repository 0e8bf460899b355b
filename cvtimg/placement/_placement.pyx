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

    struct c_owners "owners":
        double *x
        double *y
        double *c
        int32_t *index
        Py_ssize_t n
        int32_t *own
        double *starts
        double *heights

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


cdef inline Py_ssize_t cell_of(double place, double per_pixel, Py_ssize_t n) noexcept nogil:
    # Far outside, a place may be larger than any integer.
    cdef double at = place * per_pixel
    return 0 if at <= 0 else n - 1 if at >= n else <Py_ssize_t>at


cdef inline Py_ssize_t bucket_of(
    const double[:, ::1] points, Py_ssize_t k, double per_pixel, Py_ssize_t rows, Py_ssize_t columns,
) noexcept nogil:
    return cell_of(points[k, 1], per_pixel, rows) * columns + cell_of(points[k, 0], per_pixel, columns)


cdef class Scratch:
    """Room for the owners of boxes; what is not needed is never touched."""
    cdef double[:, ::1] places
    cdef int32_t[:, ::1] indices
    cdef c_owners owners

    def __cinit__(self, Py_ssize_t n_generators):
        cdef Py_ssize_t room = ROOM_PER_GENERATOR * n_generators + ROOM
        self.places = np.empty((5, room))
        self.indices = np.empty((2, room), np.int32)
        self.owners.x, self.owners.y, self.owners.c = &self.places[0, 0], &self.places[1, 0], &self.places[2, 0]
        self.owners.starts, self.owners.heights = &self.places[3, 0], &self.places[4, 0]
        self.owners.index, self.owners.own = &self.indices[0, 0], &self.indices[1, 0]
        self.owners.n = room


cdef class Buckets:
    """Generators (x, y), sorted by square buckets of a picture."""
    cdef c_buckets buckets
    cdef int32_t[::1] first      # (B + 2,) of each bucket, and the end of the last
    cdef int32_t[::1] order      # (K,) indices as given
    cdef double[:, ::1] places   # (K, 2)
    cdef readonly Py_ssize_t n_generators
    cdef readonly int side, rows

    def __init__(self, const double[:, ::1] points, int height, int width, int side):
        cdef Py_ssize_t k, n = points.shape[0], rows = (height - 1) // side + 1, columns = (width - 1) // side + 1
        cdef Py_ssize_t n_buckets = rows * columns, bucket, at
        cdef double per_pixel = 1.0 / side
        cdef int32_t[::1] first = np.zeros(n_buckets + 2, np.int32)
        self.first = first
        self.order = np.empty(n, np.int32)
        self.places = np.empty((n, 2))
        self.n_generators, self.side, self.rows = n, side, <int>rows
        with nogil:
            for k in range(n):
                bucket = bucket_of(points, k, per_pixel, rows, columns)
                first[bucket + 2] += 1
            for bucket in range(n_buckets):
                first[bucket + 2] += first[bucket + 1]
            # first[bucket + 1] is where the next of the bucket goes, and in the end where the next bucket begins.
            for k in range(n):
                bucket = bucket_of(points, k, per_pixel, rows, columns)
                at = first[bucket + 1]
                first[bucket + 1] += 1
                self.order[at] = <int32_t>k
                self.places[at, 0] = points[k, 0]
                self.places[at, 1] = points[k, 1]
        self.buckets.side = side
        self.buckets.columns = <int>columns
        self.buckets.rows = <int>rows
        self.buckets.first = &first[0]
        self.buckets.places = &self.places[0, 0]

    def sum_cells(
        self,
        const float[:, ::1] density,   # IN (H, W)
        const int32_t[::1] bands,      # IN (P + 1,): rows of buckets that begin each part
        Py_ssize_t start,              # IN: parts start..stop - 1 are summed
        Py_ssize_t stop,               # IN
        double[:, :, ::1] sums,        # INOUT (P, K, 3): mass, and it times x and y, of each cell, sorted as places
        int32_t[:, ::1] touched,       # OUT (P, 2): sums change from the first to before the last of these
    ):
        """Sum the density, and x and y times it, over each cell, in parts that do not share a sum."""
        cdef Scratch scratch = Scratch(self.n_generators)
        cdef double[:, :, ::1] running = np.empty((self.side, density.shape[1] + 1, 2))
        cdef Py_ssize_t part
        with nogil:
            for part in range(start, stop):
                sum_bands(
                    &density[0, 0], <int>density.shape[1], <int>density.shape[0], self.buckets, bands[part],
                    bands[part + 1], scratch.owners, <c_running *>&running[0, 0, 0], <c_sums *>&sums[part, 0, 0],
                    &touched[part, 0], &touched[part, 1],
                )

    def add_parts(
        self,
        const double[:, :, ::1] sums,        # IN (P, K, 3)
        const int32_t[:, ::1] touched,       # IN (P, 2)
        const double[:, ::1] generators,     # IN (K, 2): in the units of the results
        const double[::1] origin,            # IN (2,): from which squared distances are counted
        double scale,                        # IN: pixels in one of these units
        Py_ssize_t start,                    # IN: parts start..stop - 1 of P of the generators are finished
        Py_ssize_t stop,                     # IN
        double[:, ::1] totals,                # INOUT (K, 3): 0 before; mass, and its center, or the generator if it is 0
        double[::1] energies,                # INOUT (P,): 0 before; of each part, less the second moment of the density
    ):
        """Add the sums of all parts, the first to the last, so that no bit depends on threads."""
        cdef Py_ssize_t n_parts = sums.shape[0], share, first, last, part, place, k, d
        cdef double here, *total
        with nogil:
            for share in range(start, stop):
                first, last = self.n_generators * share // n_parts, self.n_generators * (share + 1) // n_parts
                for part in range(n_parts):
                    for place in range(max(first, touched[part, 0]), min(last, touched[part, 1])):
                        for d in range(3):
                            totals[self.order[place], d] += sums[part, place, d]
                for place in range(first, last):
                    k = self.order[place]
                    total = &totals[k, 0]
                    for d in range(2):
                        total[1 + d] = total[1 + d] / (total[0] * scale) if total[0] > 0 else generators[k, d]
                        here = generators[k, d] - origin[d]
                        energies[share] += total[0] * here * (here - 2 * (total[1 + d] - origin[d]))

    def label_pixels(
        self,
        int32_t[:, ::1] labels,        # OUT (H, W): the generator nearest to the center of each pixel
        Py_ssize_t start,              # IN: rows of buckets start..stop - 1
        Py_ssize_t stop,               # IN
    ):
        """Label pixels by the cell in which their center lies."""
        cdef Scratch scratch = Scratch(self.n_generators)
        with nogil:
            label_bands(
                &labels[0, 0], <int>labels.shape[1], <int>labels.shape[0], self.buckets, &self.order[0], <int>start,
                <int>stop, scratch.owners,
            )

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over patches in groups: covariances, filters, the image made of patches, groups cut in two.

Nothing here checks its arguments or decides. Each argument is marked IN, OUT or INOUT. H x W is the size of an image in
pixels, N their number, C that of bands, P = 25 C that of the values of a patch and G the number of groups. Each pass
works on the groups, or rows, from `first` until `last`. To the BLAS, rows are columns.

Of float32 only `sgemm` is called: `ssyrk`, and `spotrf` and `spotri` which call it, are wrong in some versions of OpenBLAS
for ARM processors (its issue 5873).
"""
from libc.float cimport FLT_EPSILON
from libc.math cimport sqrt
from libc.stdint cimport int32_t, int64_t
from libc.string cimport memcpy
from scipy.linalg.cython_blas cimport sgemm
from scipy.linalg.cython_lapack cimport dpotrf, dpotri

import numpy as np

cdef enum:
    SIDE = 5
    SAMPLE = 512  # members of a group, about, that tell its main axis
    POWERS = 12  # multiplications of a vector by the covariance that find it


cdef void take_patches(
    const float[:, :, ::1] image, const int32_t *pixels, Py_ssize_t n, float *patches
) noexcept nogil:
    """Copy the patches around some pixels: their rows one after the other, the bands of each pixel side by side."""
    cdef Py_ssize_t width = image.shape[1] - SIDE + 1, row = SIDE * image.shape[2], i, y
    for i in range(n):
        for y in range(SIDE):
            memcpy(patches, &image[pixels[i] // width + y, pixels[i] % width, 0], row * sizeof(float))
            patches += row


cdef void measure(float[:, ::1] rows, int n, double[::1] means, float[:, ::1] covariance) noexcept nogil:
    """Measure the means and the covariance of the first n rows, which lose their means."""
    cdef int size = <int>rows.shape[1]
    cdef float share = 1 / <float>n, nothing = 0
    cdef Py_ssize_t i, j
    means[:] = 0
    for i in range(n):
        for j in range(size):
            means[j] += rows[i, j]
    for j in range(size):
        means[j] /= n
    for i in range(n):
        for j in range(size):
            rows[i, j] -= <float>means[j]
    sgemm(
        "N", "T", &size, &size, &n, &share, &rows[0, 0], &size, &rows[0, 0], &size, &nothing, &covariance[0, 0], &size
    )


def halve_groups(
    const float[:, ::1] features,  # IN (N, D)
    int32_t[::1] order,            # INOUT (N,): members of the groups, one group after the other
    const int64_t[::1] starts,     # IN (G,): of the groups to cut
    const int64_t[::1] stops,      # IN (G,)
    int64_t[::1] cuts,             # OUT (G,): where the second half of each begins
    Py_ssize_t first,              # IN
    Py_ssize_t last,               # IN
):
    """Cut groups at their mean, across their main axis; where that leaves less than an eighth, in equal parts."""
    cdef int n
    cdef Py_ssize_t g, i, j, power, step, fewer, size = features.shape[1]
    cdef double square, level, along
    cdef double[:, ::1] axes = np.empty((2, size))
    cdef double[::1] axis = axes[0], product = axes[1], means = np.empty(size)
    cdef float[:, ::1] rows = np.empty((SAMPLE, size), np.float32), covariance = np.empty((size, size), np.float32)
    cdef int32_t[::1] second = np.empty(np.max(np.subtract(stops, starts)[first:last], initial=1), np.int32)
    with nogil:
        for g in range(first, last):
            step = 1 + (stops[g] - starts[g] - 1) // SAMPLE
            n = <int>((stops[g] - starts[g] - 1) // step + 1)
            for i in range(n):
                memcpy(&rows[i, 0], &features[order[starts[g] + i * step], 0], size * sizeof(float))
            measure(rows, n, means, covariance)
            i = 0
            for j in range(1, size):
                if covariance[j, j] > covariance[i, i]:
                    i = j
            for j in range(size):
                axis[j] = covariance[i, j]
            for power in range(POWERS):
                square = level = 0
                for i in range(size):
                    square += axis[i] * axis[i]
                for i in range(size):
                    product[i] = 0
                    for j in range(size):
                        product[i] += covariance[i, j] * axis[j]
                    product[i] /= sqrt(square) if square > 0 else 1
                for i in range(size):
                    axis[i] = product[i]
                    level += axis[i] * means[i]
            cuts[g], fewer = starts[g], 0
            for i in range(starts[g], stops[g]):
                along = 0
                for j in range(size):
                    along += axis[j] * features[order[i], j]
                if along > level:
                    second[fewer] = order[i]
                    fewer += 1
                else:
                    order[cuts[g]] = order[i]
                    cuts[g] += 1
            if fewer:
                memcpy(&order[cuts[g]], &second[0], fewer * sizeof(int32_t))
            fewer = min(fewer, cuts[g] - starts[g])
            if fewer < 8 or fewer < (stops[g] - starts[g]) // 8:
                cuts[g] = (starts[g] + stops[g]) // 2


def measure_groups(
    const float[:, :, ::1] image,    # IN (H + 4, W + 4, C)
    const int32_t[::1] order,        # IN (N,): pixels of the groups, one group after the other
    const int64_t[::1] bounds,       # IN (G + 1,): where each group begins in `order`
    float[:, ::1] means,             # OUT (G, P)
    float[:, :, ::1] covariances,    # OUT (G, P, P)
    Py_ssize_t first,                # IN
    Py_ssize_t last,                 # IN
):
    """Measure the mean and the covariance of the patches of each group."""
    cdef int n
    cdef Py_ssize_t g, j
    cdef double[::1] sums = np.empty(means.shape[1])
    cdef float[:, ::1] patches = np.empty((np.max(np.diff(bounds)), means.shape[1]), np.float32)
    with nogil:
        for g in range(first, last):
            n = <int>(bounds[g + 1] - bounds[g])
            take_patches(image, &order[bounds[g]], n, &patches[0, 0])
            measure(patches, n, sums, covariances[g])
            for j in range(sums.shape[0]):
                means[g, j] = <float>sums[j]


def make_filters(
    float[:, :, ::1] matrices,    # INOUT (G, P, P): a covariance C, which becomes the filter I - v (C + v I)^-1
    const double[::1] variances,  # IN (G,): v, of the noise
):
    """Make the Wiener filter of each group: I, where the noise is less than the rounding of C in float32."""
    cdef int bad, size = <int>matrices.shape[1]
    cdef double trace
    cdef double[:, ::1] inverse = np.empty((size, size))
    cdef Py_ssize_t g, i, j
    with nogil:
        for g in range(matrices.shape[0]):
            trace = 0
            for i in range(size):
                for j in range(size):
                    inverse[i, j] = matrices[g, i, j]
                trace = trace + inverse[i, i]
                inverse[i, i] += variances[g]
            bad = variances[g] <= FLT_EPSILON * trace
            if not bad:
                dpotrf("L", &size, &inverse[0, 0], &size, &bad)
            if not bad:
                dpotri("L", &size, &inverse[0, 0], &size, &bad)
            for i in range(size):
                for j in range(i, size):  # LAPACK has left the other half as it was
                    matrices[g, i, j] = (i == j) - (0 if bad else <float>(variances[g] * inverse[i, j]))
                    matrices[g, j, i] = matrices[g, i, j]


def filter_groups(
    const float[:, :, ::1] image,    # IN (H + 4, W + 4, C)
    const float[:, :, ::1] change,   # IN (H + 4, W + 4, C)
    const double[::1] steps,         # IN (G,): what is filtered is the image plus this times the change
    const int32_t[::1] order,        # IN (N,)
    const int64_t[::1] bounds,       # IN (G + 1,)
    const float[:, ::1] means,       # IN (G, P)
    const float[:, :, ::1] filters,  # IN (G, P, P)
    float[:, ::1] patches,           # OUT (N, P)
    Py_ssize_t first,                # IN
    Py_ssize_t last,                 # IN
):
    """Filter the patches of each group about their mean."""
    cdef int n, size = <int>means.shape[1]
    cdef Py_ssize_t g, i, j
    cdef float one = 1, nothing = 0
    cdef float[:, :, ::1] seen = np.empty((2, np.max(np.diff(bounds)), size), np.float32)
    with nogil:
        for g in range(first, last):
            n = <int>(bounds[g + 1] - bounds[g])
            take_patches(image, &order[bounds[g]], n, &seen[0, 0, 0])
            take_patches(change, &order[bounds[g]], n, &seen[1, 0, 0])
            for i in range(n):
                for j in range(size):
                    seen[0, i, j] += <float>steps[g] * seen[1, i, j] - means[g, j]
            sgemm(
                "N", "N", &size, &n, &size, &one, <float *>&filters[g, 0, 0], &size, &seen[0, 0, 0], &size, &nothing,
                &seen[1, 0, 0], &size,
            )
            for i in range(n):
                for j in range(size):
                    patches[order[bounds[g] + i], j] = seen[1, i, j] + means[g, j]


def join_patches(
    const float[:, ::1] patches,     # IN (N, P)
    const int32_t[:, ::1] group_of,  # IN (H, W): group of the patch around each pixel
    const float[:, ::1] trust,       # IN (G, 25): weight of each pixel of the patches of a group
    float[:, :, ::1] sums,           # OUT (H + 4, W + 4, C)
    float[:, ::1] weights,           # OUT (H + 4, W + 4)
    Py_ssize_t first,                # IN: rows of the sums
    Py_ssize_t last,                 # IN
):
    """Sum what the patches that contain a pixel say, weighted, and their weights."""
    cdef Py_ssize_t height = group_of.shape[0], width = group_of.shape[1], n_bands = sums.shape[2]
    cdef Py_ssize_t y, x, i, j, place, c
    cdef float weight, total
    cdef const float *patch
    with nogil:
        for y in range(first, last):
            for x in range(width + SIDE - 1):
                total = 0
                for c in range(n_bands):
                    sums[y, x, c] = 0
                for i in range(max(y - SIDE + 1, 0), min(y + 1, height)):
                    for j in range(max(x - SIDE + 1, 0), min(x + 1, width)):
                        place = (y - i) * SIDE + x - j
                        weight = trust[group_of[i, j], place]
                        patch = &patches[i * width + j, place * n_bands]
                        total += weight
                        for c in range(n_bands):
                            sums[y, x, c] += weight * patch[c]
                weights[y, x] = total

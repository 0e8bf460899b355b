# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over patches in groups: covariances, filters, the image made of patches, groups cut in two.

Nothing here checks its arguments or decides. Each argument is marked IN, OUT or INOUT. H x W is the size of
an image in pixels, N their number, C that of bands, P = 25 C that of the values of a patch, R = P rounded up to a
multiple of 16, G the number of groups, and M the number of patches of the largest, rounded up to a multiple of 4. Each
pass works on the groups, or rows, from `first` until `last`.
"""
from libc.stdint cimport int32_t, int64_t, uint8_t

import numpy as np

cdef extern from "patches.h" nogil:
    int REACH, SIDE, LANES, ROWS_AT_ONCE

    struct picture:
        const float *values
        Py_ssize_t width, padded_width
        int n_bands

    struct patch_functions_s "patch_functions":
        void (*measure)(picture, const int32_t *, Py_ssize_t, Py_ssize_t, float *, float *, float *) noexcept nogil
        void (*make)(float *, Py_ssize_t, float, float *) noexcept nogil
        void (*filter)(
            picture, picture, float, const int32_t *, Py_ssize_t, Py_ssize_t, const float *, const float *, float *,
            float *, float *,
        ) noexcept nogil
        Py_ssize_t (*halve)(const float *, int, int32_t *, Py_ssize_t, uint8_t *, int32_t *) noexcept nogil

    const patch_functions_s *patch_functions()

cdef const patch_functions_s *functions = patch_functions()


cdef inline picture as_picture(const float[:, :, ::1] image) noexcept nogil:
    cdef picture result
    result.values = &image[0, 0, 0]
    result.padded_width = image.shape[1]
    result.width = image.shape[1] - SIDE + 1
    result.n_bands = <int>image.shape[2]
    return result


def halve_groups(
    const float[:, ::1] features,  # IN (N, D): D <= 32, a multiple of 8
    int32_t[::1] order,            # INOUT (N,): members of the groups, one group after the other
    const int64_t[::1] starts,     # IN (G,): of the groups to cut
    const int64_t[::1] stops,      # IN (G,)
    int64_t[::1] cuts,             # OUT (G,): where the second half of each begins
    Py_ssize_t first,              # IN
    Py_ssize_t last,               # IN
):
    """Cut groups in two, each by two generators of its own."""
    cdef Py_ssize_t g, start, largest = np.max(np.subtract(stops, starts)[first:last], initial=1)
    cdef uint8_t[::1] sides = np.empty(largest, np.uint8)
    cdef int32_t[::1] second = np.empty(largest, np.int32)
    with nogil:
        for g in range(first, last):
            start = starts[g]
            cuts[g] = start + functions.halve(
                &features[0, 0], <int>features.shape[1], &order[start], stops[g] - start, &sides[0], &second[0],
            )


def measure_groups(
    const float[:, :, ::1] image,    # IN (H + 4, W + 4, C)
    const int32_t[::1] order,        # IN (N,): pixels of the groups, one group after the other
    const int64_t[::1] bounds,       # IN (G + 1,): where each group begins in `order`
    float[:, ::1] means,             # OUT (G, P)
    float[:, :, ::1] covariances,    # OUT (last - first, R, R): 0 from P on
    Py_ssize_t first,                # IN
    Py_ssize_t last,                 # IN
):
    """Measure the mean and the covariance of the patches of each group."""
    cdef picture from_image = as_picture(image)
    cdef Py_ssize_t g
    cdef float[:, ::1] patches = np.empty((np.max(np.diff(bounds)), covariances.shape[2]), np.float32)
    with nogil:
        for g in range(first, last):
            functions.measure(
                from_image, &order[bounds[g]], bounds[g + 1] - bounds[g], means.shape[1], &patches[0, 0],
                &means[g, 0], &covariances[g - first, 0, 0],
            )


def make_filters(
    float[:, :, ::1] covariances,  # INOUT (G, R, R): 0 from P on; used up
    const double[::1] variances,   # IN (G,): of the noise
    float[:, :, ::1] filters,      # OUT (G, P, R)
):
    """Make the Wiener filter of each group."""
    cdef Py_ssize_t g
    with nogil:
        for g in range(filters.shape[0]):
            functions.make(&covariances[g, 0, 0], filters.shape[1], <float>variances[g], &filters[g, 0, 0])


def filter_groups(
    const float[:, :, ::1] image,    # IN (H + 4, W + 4, C)
    const float[:, :, ::1] change,   # IN (H + 4, W + 4, C)
    const double[::1] steps,         # IN (G,): what is filtered is the image plus this times the change
    const int32_t[::1] order,        # IN (N,)
    const int64_t[::1] bounds,       # IN (G + 1,)
    const float[:, ::1] means,       # IN (G, P)
    const float[:, :, ::1] filters,  # IN (G, P, R)
    float[:, ::1] patches,           # OUT (N, P)
    Py_ssize_t first,                # IN
    Py_ssize_t last,                 # IN
):
    """Filter the patches of each group about their mean."""
    cdef picture from_image = as_picture(image), from_change = as_picture(change)
    cdef Py_ssize_t g, most = (np.max(np.diff(bounds)) + ROWS_AT_ONCE - 1) // ROWS_AT_ONCE * ROWS_AT_ONCE
    cdef float[:, :, ::1] scratch = np.empty((2, most, filters.shape[2]), np.float32)
    with nogil:
        for g in range(first, last):
            functions.filter(
                from_image, from_change, <float>steps[g], &order[bounds[g]], bounds[g + 1] - bounds[g],
                means.shape[1], &means[g, 0], &filters[g, 0, 0], &scratch[0, 0, 0], &scratch[1, 0, 0], &patches[0, 0],
            )


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

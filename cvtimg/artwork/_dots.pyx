# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loop that draws disks, over buffers that the caller owns.

Nothing here allocates or checks its arguments. Each argument is marked IN, OUT or INOUT.
"""
from libc.math cimport ceil, sqrt
from libc.stdint cimport int32_t, int64_t, uint8_t
from libc.string cimport memset


def cover_rows(
    const double[:, ::1] centers,  # IN (N, 2): in pixels
    const double[::1] radii,       # IN (N,)
    const int64_t[::1] starts,     # IN (H + 1,): where the disks of each row begin in `disks`
    const int32_t[::1] disks,      # IN (S,): the disks that meet each row
    Py_ssize_t first_row,          # IN
    Py_ssize_t stop_row,           # IN
    uint8_t[:, ::1] raster,        # scratch (F, F W): one row of pixels, each of F by F parts
    float[:, ::1] coverage,        # OUT (H, W): share of each pixel that disks cover, in rows first_row..stop_row
):
    """Draw the union of disks by F by F parts of each pixel."""
    cdef Py_ssize_t fine = raster.shape[0], width = coverage.shape[1], row, line, column, left, right, x, i
    cdef int64_t q
    cdef int32_t k, count
    cdef double y, dy, half, share = 1.0 / (fine * fine)
    with nogil:
        for row in range(first_row, stop_row):
            memset(&raster[0, 0], 0, fine * fine * width)
            for q in range(starts[row], starts[row + 1]):
                k = disks[q]
                for line in range(fine):
                    y = row + (line + 0.5) / fine
                    dy = y - centers[k, 1]
                    half = radii[k] * radii[k] - dy * dy
                    if half <= 0:
                        continue
                    half = sqrt(half)
                    # Parts whose middles are in the disk.
                    left = max(<Py_ssize_t>ceil((centers[k, 0] - half) * fine - 0.5), 0)
                    right = min(<Py_ssize_t>ceil((centers[k, 0] + half) * fine - 0.5), fine * width)
                    if right > left:
                        memset(&raster[line, left], 1, right - left)
            for column in range(width):
                count = 0
                x = column * fine
                for line in range(fine):
                    for i in range(fine):
                        count += raster[line, x + i]
                coverage[row, column] = <float>(count * share)

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes of mosaics: sums of colors, gradients of the error, and labels of triangles.

Nothing here allocates or decides. Each argument is marked IN, OUT or INOUT. K is the number of cells, C that of bands.
"""
from libc.math cimport ceil, fabs, sqrt
from libc.stdint cimport int32_t


def add_colors(
    const float[:, :, ::1] image,     # IN (H, W, C)
    const int32_t[:, ::1] labels,     # IN (H, W): cell of each pixel
    Py_ssize_t first_row,             # IN
    Py_ssize_t stop_row,              # IN
    double[:, ::1] sums,              # INOUT (K, C + 2): sums of bands, of their squares, and pixels
):
    """Add up the pixels of each cell."""
    cdef Py_ssize_t bands = image.shape[2], x, y, band
    cdef double *cell
    cdef double value, squared
    with nogil:
        for y in range(first_row, stop_row):
            for x in range(labels.shape[1]):
                cell = &sums[labels[y, x], 0]
                squared = 0
                for band in range(bands):
                    value = image[y, x, band]
                    cell[band] += value
                    squared = squared + value * value
                cell[bands] += squared
                cell[bands + 1] += 1


cdef inline double gain(
    const float *left, const float *right, const double *color, const double *other, Py_ssize_t bands
) noexcept nogil:
    """How much farther the middle of two pixels is from one color than from another, squared."""
    cdef double total = 0, value
    cdef Py_ssize_t band
    for band in range(bands):
        value = 0.5 * (left[band] + right[band])
        total = total + (2 * value - color[band] - other[band]) * (other[band] - color[band])
    return total


def add_border_gradient(
    const float[:, :, ::1] image,     # IN (H, W, C)
    const int32_t[:, ::1] labels,     # IN (H, W): nearest generator of each pixel
    const double[:, ::1] points,      # IN (K, 2): generators
    const double[:, ::1] colors,      # IN (K, C): mean of each cell
    Py_ssize_t first_row,             # IN
    Py_ssize_t stop_row,              # IN
    double[:, ::1] gradient,          # INOUT (K, 2)
):
    """Add what moving each generator changes in the squared error of Voronoi cells, along their borders.

    A border that runs steeply is met in every row, and a flat one in every column.
    """
    cdef Py_ssize_t bands = image.shape[2], height = labels.shape[0], width = labels.shape[1], x, y
    cdef int32_t i, j
    cdef double step_x, step_y, at, slope
    with nogil:
        for y in range(first_row, stop_row):
            for x in range(width):
                i = labels[y, x]
                if x + 1 < width and labels[y, x + 1] != i:
                    j = labels[y, x + 1]
                    step_x = points[j, 0] - points[i, 0]
                    step_y = points[j, 1] - points[i, 1]
                    if fabs(step_x) >= fabs(step_y) and step_x != 0:
                        at = crossing(step_x, step_y, points[i, 0], points[i, 1], y + 0.5, x + 0.5)
                        slope = gain(&image[y, x, 0], &image[y, x + 1, 0], &colors[i, 0], &colors[j, 0], bands)
                        slope /= step_x
                        gradient[i, 0] += slope * (at - points[i, 0])
                        gradient[i, 1] += slope * (y + 0.5 - points[i, 1])
                        gradient[j, 0] -= slope * (at - points[j, 0])
                        gradient[j, 1] -= slope * (y + 0.5 - points[j, 1])
                if y + 1 < height and labels[y + 1, x] != i:
                    j = labels[y + 1, x]
                    step_x = points[j, 0] - points[i, 0]
                    step_y = points[j, 1] - points[i, 1]
                    if fabs(step_y) > fabs(step_x):
                        at = crossing(step_y, step_x, points[i, 1], points[i, 0], x + 0.5, y + 0.5)
                        slope = gain(&image[y, x, 0], &image[y + 1, x, 0], &colors[i, 0], &colors[j, 0], bands)
                        slope /= step_y
                        gradient[i, 0] += slope * (x + 0.5 - points[i, 0])
                        gradient[i, 1] += slope * (at - points[i, 1])
                        gradient[j, 0] -= slope * (x + 0.5 - points[j, 0])
                        gradient[j, 1] -= slope * (at - points[j, 1])


cdef inline double crossing(
    double along, double across, double own_along, double own_across, double line, double low
) noexcept nogil:
    """Where a line meets the border of two cells, between the middles of two pixels."""
    cdef double at = own_along + 0.5 * along + across * (own_across + 0.5 * across - line) / along
    return min(max(at, low), low + 1)


cdef inline double edge_at(const double[:, ::1] points, int32_t a, int32_t b, double y) noexcept nogil:
    """Where an edge crosses a row; the same bits from either side."""
    cdef int32_t low = min(a, b), high = max(a, b)
    cdef double part = (y - points[low, 1]) / (points[high, 1] - points[low, 1])
    return points[low, 0] + part * (points[high, 0] - points[low, 0])


def label_triangles(
    const double[:, ::1] points,      # IN (N, 2): corners
    const int32_t[:, ::1] triangles,  # IN (K, 3)
    int32_t[:, ::1] labels,           # OUT (H, W): the triangle that the middle of each pixel is in
):
    """Label the pixels of triangles that fill a picture; no pixel is left out between two."""
    cdef Py_ssize_t height = labels.shape[0], width = labels.shape[1], k, x, y, first, stop, left, right
    cdef int32_t corner, a, b, side
    cdef double top, bottom, middle, at, low, high
    with nogil:
        for k in range(triangles.shape[0]):
            top = bottom = points[triangles[k, 0], 1]
            for side in range(1, 3):
                top = min(top, points[triangles[k, side], 1])
                bottom = max(bottom, points[triangles[k, side], 1])
            first = max(<Py_ssize_t>ceil(top - 0.5), 0)
            stop = min(<Py_ssize_t>ceil(bottom - 0.5), height)
            for y in range(first, stop):
                middle = y + 0.5
                low = 1e300
                high = -1e300
                for side in range(3):
                    a = triangles[k, side]
                    b = triangles[k, (side + 1) % 3]
                    if (points[a, 1] <= middle) != (points[b, 1] <= middle):
                        at = edge_at(points, a, b, middle)
                        low = min(low, at)
                        high = max(high, at)
                left = max(<Py_ssize_t>ceil(low - 0.5), 0)
                right = min(<Py_ssize_t>ceil(high - 0.5), width)
                for x in range(left, right):
                    labels[y, x] = <int32_t>k


def add_edge_gradient(
    const float[:, :, ::1] image,     # IN (H, W, C)
    const double[:, ::1] points,      # IN (N, 2): corners
    const int32_t[:, ::1] edges,      # IN (M, 4): corners a and b, and the cells on both sides of the edge
    const double[:, ::1] colors,      # IN (K, C): mean of each cell
    double[:, ::1] gradient,          # INOUT (N, 2)
):
    """Add what moving each corner changes in the squared error of triangles, along their edges.

    Seen along the edge from a to b, with y down, the first cell is to the right and the second to the left.
    """
    cdef Py_ssize_t bands = image.shape[2], height = image.shape[0], width = image.shape[1], e, n, step, x, y
    cdef int32_t a, b
    cdef double run_x, run_y, part, slope, to_a, to_b
    cdef const float *pixel
    with nogil:
        for e in range(edges.shape[0]):
            a = edges[e, 0]
            b = edges[e, 1]
            run_x = points[b, 0] - points[a, 0]
            run_y = points[b, 1] - points[a, 1]
            n = <Py_ssize_t>ceil(max(fabs(run_x), fabs(run_y)))
            to_a = to_b = 0
            for step in range(n):
                part = (step + 0.5) / n
                x = min(max(<Py_ssize_t>(points[a, 0] + part * run_x), 0), width - 1)
                y = min(max(<Py_ssize_t>(points[a, 1] + part * run_y), 0), height - 1)
                pixel = &image[y, x, 0]
                slope = gain(pixel, pixel, &colors[edges[e, 2], 0], &colors[edges[e, 3], 0], bands) / n
                to_a += (1 - part) * slope
                to_b += part * slope
            # (run_y, -run_x) points to the left, and is as long as the edge.
            gradient[a, 0] += to_a * run_y
            gradient[a, 1] -= to_a * run_x
            gradient[b, 0] += to_b * run_y
            gradient[b, 1] -= to_b * run_x

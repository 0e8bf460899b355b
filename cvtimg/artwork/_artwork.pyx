# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of artwork: sums, gradients and labels of mosaics; tours of points.

Nothing here checks its arguments or decides how long to go on. Each argument is marked IN, OUT or INOUT. In mosaics, K
is the number of cells, C that of bands.
"""
from libc.math cimport ceil, fabs, sqrt
from libc.stdint cimport int32_t, uint8_t

#: Points of the longest chain that is moved as a whole.
cdef enum:
    CHAIN = 3


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


def add_moments(
    const float[:, :, ::1] image,     # IN (H, W, C)
    const int32_t[:, ::1] labels,     # IN (H, W): cell of each pixel
    Py_ssize_t first_row,             # IN
    Py_ssize_t stop_row,              # IN
    double[:, ::1] sums,              # INOUT (K, 2 C + 6): of 1, x, y and each band, times x and times y
):
    """Add up the moments of each cell."""
    cdef Py_ssize_t bands = image.shape[2], row, column, d, band
    cdef double *cell
    cdef double place[2]
    with nogil:
        for row in range(first_row, stop_row):
            place[1] = row + 0.5
            for column in range(labels.shape[1]):
                place[0] = column + 0.5
                cell = &sums[labels[row, column], 0]
                for d in range(2):
                    cell[d] += place[d]
                    cell[2 + d] += place[0] * place[d]
                    cell[4 + d] += place[1] * place[d]
                    for band in range(bands):
                        cell[6 + 2 * band + d] += image[row, column, band] * place[d]


cdef inline int32_t beside(const int32_t[:, ::1] labels, Py_ssize_t y, Py_ssize_t x, Py_ssize_t axis) noexcept nogil:
    """The cell of the pixel to the right, or below; at the end of the image that of the pixel itself."""
    if y + axis >= labels.shape[0] or x + 1 - axis >= labels.shape[1]:
        return labels[y, x]
    return labels[y + axis, x + 1 - axis]


def add_borders(
    const int32_t[:, ::1] labels,     # IN (H, W): cell of each pixel
    const double[:, ::1] colors,      # IN (K, C): mean of each cell
    Py_ssize_t first_row,             # IN
    Py_ssize_t stop_row,              # IN
    double[:, ::1] sums,              # INOUT (K, 2): squared differences from neighbors, and how many these are
):
    """Compare cells along their borders."""
    cdef Py_ssize_t bands = colors.shape[1], width = labels.shape[1], x, y, axis, band
    cdef int32_t i, j
    cdef double square
    with nogil:
        for y in range(first_row, stop_row):
            for x in range(width):
                i = labels[y, x]
                for axis in range(2):  # the pixel to the right, and the one below
                    j = beside(labels, y, x, axis)
                    if i == j:
                        continue
                    square = 0
                    for band in range(bands):
                        square = square + (colors[i, band] - colors[j, band]) * (colors[i, band] - colors[j, band])
                    sums[i, 0] += square
                    sums[j, 0] += square
                    sums[i, 1] += 1
                    sums[j, 1] += 1


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
    cdef Py_ssize_t bands = image.shape[2], width = labels.shape[1], x, y, axis, d
    cdef int32_t i, j
    cdef double along, across, line, slope, low, at
    cdef double place[2]
    with nogil:
        for y in range(first_row, stop_row):
            for x in range(width):
                i = labels[y, x]
                for axis in range(2):  # the pixel to the right, and the one below
                    j = beside(labels, y, x, axis)
                    if i == j:
                        continue
                    along = points[j, axis] - points[i, axis]
                    across = points[j, 1 - axis] - points[i, 1 - axis]
                    if fabs(along) < fabs(across) or fabs(along) == (fabs(across) if axis else 0):
                        continue
                    line = 0.5 + (x if axis else y)
                    low = 0.5 + (y if axis else x)
                    at = points[i, axis] + 0.5 * along + across * (points[i, 1 - axis] + 0.5 * across - line) / along
                    place[axis] = min(max(at, low), low + 1)  # between the middles of the two pixels
                    place[1 - axis] = line
                    slope = gain(
                        &image[y, x, 0], &image[y + axis, x + 1 - axis, 0], &colors[i, 0], &colors[j, 0], bands) / along
                    for d in range(2):
                        gradient[i, d] += slope * (place[d] - points[i, d])
                        gradient[j, d] -= slope * (place[d] - points[j, d])


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


cdef inline double distance(const double[:, ::1] points, int32_t a, int32_t b) noexcept nogil:
    cdef double x = points[a, 0] - points[b, 0], y = points[a, 1] - points[b, 1]
    return sqrt(x * x + y * y)


cdef inline int32_t root_of(int32_t[::1] parents, int32_t point) noexcept nogil:
    while parents[point] != point:
        parents[point] = parents[parents[point]]
        point = parents[point]
    return point


def join(
    const int32_t[:, ::1] pairs,  # IN (P, 2): ends that may be joined, the shortest first
    int32_t[:, ::1] links,        # INOUT (N, 2): the points beside each in its path, or -1
    int32_t[::1] parents,         # INOUT (N,): forest in which points of one path have one root
):
    """Join ends of different paths; return how many pairs were joined."""
    cdef Py_ssize_t i, n_joined = 0
    cdef int32_t a, b, root_a, root_b
    with nogil:
        for i in range(pairs.shape[0]):
            a = pairs[i, 0]
            b = pairs[i, 1]
            if links[a, 1] >= 0 or links[b, 1] >= 0:
                continue
            root_a = root_of(parents, a)
            root_b = root_of(parents, b)
            if root_a == root_b:
                continue
            parents[root_a] = root_b
            links[a, 0 if links[a, 0] < 0 else 1] = b
            links[b, 0 if links[b, 0] < 0 else 1] = a
            n_joined += 1
    return n_joined


cdef inline void reverse(int32_t[::1] tour, int32_t[::1] places, int32_t low, int32_t high) noexcept nogil:
    cdef int32_t a, b
    while low < high:
        a = tour[low]
        b = tour[high]
        tour[low] = b
        places[b] = low
        tour[high] = a
        places[a] = high
        low += 1
        high -= 1


cdef bint turn_part(
    const double[:, ::1] points, const int32_t[::1] near, const Py_ssize_t[:, ::1] spans, int32_t[::1] tour,
    int32_t[::1] places, uint8_t[::1] settled, int32_t reach, int32_t a, int32_t step
) noexcept nogil:
    """Try 2-opt at a point and the next of its path, after it (step 1) or before it (-1)."""
    cdef int32_t n = <int32_t>tour.shape[0], i = places[a], b, c, d, j, low, high
    cdef Py_ssize_t k
    cdef double gap, gain
    if not 0 <= i + step < n:
        return False
    b = tour[i + step]
    gap = distance(points, a, b)
    for k in range(spans[a, 0], spans[a, 1]):
        c = near[k]
        gain = gap - distance(points, a, c)
        if gain <= 1e-12:
            return False
        j = places[c]
        low = min(i, j) + (1 if step > 0 else 0)
        high = max(i, j) - (0 if step > 0 else 1)
        if high - low > reach:
            continue
        # Beyond an end of the path there is no gap to close.
        if 0 <= j + step < n:
            d = tour[j + step]
            gain += distance(points, c, d) - distance(points, b, d)
        else:
            d = c
        if gain > 1e-9:
            reverse(tour, places, low, high)
            settled[a] = settled[b] = settled[c] = settled[d] = 0
            return True
    return False


cdef bint move_chain(
    const double[:, ::1] points, const int32_t[::1] near, const Py_ssize_t[:, ::1] spans, int32_t[::1] tour,
    int32_t[::1] places, uint8_t[::1] settled, int32_t reach, int32_t s
) noexcept nogil:
    """Try Or-opt: move the chain that starts at a point to between two others, turned or not."""
    cdef int32_t n = <int32_t>tour.shape[0], i = places[s], e, p, q, c, f, j, length, side, at
    cdef Py_ssize_t k
    cdef double saved, to_c, cost
    for length in range(1, CHAIN + 1):
        if i == 0 or i + length >= n:
            return False
        p = tour[i - 1]
        e = tour[i + length - 1]
        q = tour[i + length]
        saved = distance(points, p, s) + distance(points, e, q) - distance(points, p, q)
        if saved <= 1e-12:
            continue
        for k in range(spans[s, 0], spans[s, 1]):
            c = near[k]
            to_c = distance(points, s, c)
            if to_c >= saved:
                break
            j = places[c]
            if i <= j < i + length or j - i > reach or i - j > reach:
                continue
            # s comes beside c, and e beside the point after c (side 1) or before it (-1).
            for side in range(-1, 2, 2):
                if not 0 <= j + side < n:
                    continue
                f = tour[j + side]
                if i <= places[f] < i + length:
                    continue
                cost = to_c + distance(points, e, f) - distance(points, c, f)
                if saved - cost <= 1e-9:
                    continue
                # The chain goes to between j and j + 1, or j - 1 and j; what was passed over fills its place.
                at = j + (side > 0) - (0 if j < i else length)
                reverse(tour, places, min(i, at), max(i, at) + length - 1)
                reverse(tour, places, at + length if at < i else i, i + length - 1 if at < i else at - 1)
                if side > 0:
                    reverse(tour, places, at, at + length - 1)
                settled[p] = settled[q] = settled[s] = settled[e] = settled[c] = settled[f] = 0
                return True
    return False


def improve(
    const double[:, ::1] points,  # IN (N, 2)
    const int32_t[::1] near,      # IN (M,): other points near each, the nearest first
    const Py_ssize_t[:, ::1] spans, # IN (N, 2): where those of each begin and end
    int32_t[::1] tour,            # INOUT (N,): points in order
    int32_t[::1] places,          # INOUT (N,): where in the tour each point is
    uint8_t[::1] settled,         # INOUT (N,): whether there was nothing to gain at a point
    int32_t reach,                # IN: points of the longest part that is turned or passed over
):
    """Shorten a path by 2-opt and Or-opt where it is not settled, in one pass; return how many moves were made."""
    cdef int32_t point
    cdef Py_ssize_t n_moves = 0
    with nogil:
        for point in range(<int32_t>tour.shape[0]):
            while not settled[point]:
                settled[point] = 1
                if (
                    turn_part(points, near, spans, tour, places, settled, reach, point, 1)
                    or turn_part(points, near, spans, tour, places, settled, reach, point, -1)
                    or move_chain(points, near, spans, tour, places, settled, reach, point)
                ):
                    settled[point] = 0
                    n_moves += 1
    return n_moves

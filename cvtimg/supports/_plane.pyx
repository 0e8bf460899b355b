# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of supports in the plane: sight past barriers, reaches of points, depths of covers.

Nothing here allocates or checks its arguments. Each argument is marked IN, OUT or INOUT. Rows of different lengths,
such as the barriers near each point, are one array with the start of each row, as in a CSR matrix.
"""
from libc.math cimport fabs, sqrt
from libc.stdint cimport int32_t, uint8_t


#: Farther than anything: the kernels are compiled for finite numbers.
cdef double FAR = 1e300

cdef extern from "sight.h":
    bint is_blocked(
        double from_x, double from_y, double to_x, double to_y, const double *barriers,
        const int32_t *at, const int32_t *end, double tolerance, double slack,
    ) noexcept nogil
    bint is_inside(double x, double y, const double *boundary, Py_ssize_t n) noexcept nogil


def see(
    const double[:, ::1] points,    # IN (n, 2)
    const int32_t[::1] own,         # IN (m,): the point that looks
    const double[:, ::1] places,    # IN (m, 2): where it looks
    const double[:, ::1] barriers,  # IN (S, 4): x, y of both ends
    const int32_t[::1] starts,      # IN (n + 1,)
    const int32_t[::1] near,        # IN: barriers near each point
    double tolerance,               # IN: places nearer to a barrier than this are on it, and seen from both sides
    double slack,                   # IN: barriers are longer by this at both ends
    uint8_t[::1] seen,              # OUT (m,)
):
    cdef Py_ssize_t m, i
    with nogil:
        for m in range(own.shape[0]):
            i = own[m]
            seen[m] = not is_blocked(
                points[i, 0], points[i, 1], places[m, 0], places[m, 1],
                &barriers[0, 0], &near[0] + starts[i], &near[0] + starts[i + 1], tolerance, slack,
            )


def count_depths(
    const double[:, ::1] places,    # IN (m, 2)
    const int32_t[::1] owners,      # IN (m,): a disk that holds the place
    const int32_t[:, ::1] without,  # IN (m, 2): disks that do not count there, or -1
    const double[:, ::1] points,    # IN (n, 2)
    const double[::1] radii,        # IN (n,)
    const int32_t[::1] row_starts,  # IN (n + 1,)
    const int32_t[::1] meets,       # IN: the disks that each disk meets, itself among them
    const double[:, ::1] barriers,  # IN (S, 4)
    const int32_t[::1] starts,      # IN (n + 1,)
    const int32_t[::1] near,        # IN: barriers near each point
    double tolerance,               # IN: as for `see`
    double slack,                   # IN: as for `see`
    int32_t enough,                 # IN: depths beyond this are not counted
    int32_t[::1] depths,            # OUT (m,): disks that hold a neighborhood of the place
):
    cdef Py_ssize_t m, at, owner
    cdef int32_t j, depth
    cdef double x, y, apart_x, apart_y, radius
    with nogil:
        for m in range(places.shape[0]):
            owner = owners[m]
            depth = 0
            x = places[m, 0]
            y = places[m, 1]
            for at in range(row_starts[owner], row_starts[owner + 1]):
                j = meets[at]
                if j == without[m, 0] or j == without[m, 1]:
                    continue
                apart_x = x - points[j, 0]
                apart_y = y - points[j, 1]
                radius = radii[j] * (1 - 1e-11)
                if apart_x * apart_x + apart_y * apart_y >= radius * radius:
                    continue
                if starts[j + 1] > starts[j] and is_blocked(
                    points[j, 0], points[j, 1], x, y,
                    &barriers[0, 0], &near[0] + starts[j], &near[0] + starts[j + 1], tolerance, slack,
                ):
                    continue
                depth += 1
                if depth >= enough:
                    break
            depths[m] = depth


cdef bint is_nearer_to_few(
    double x, double y, double radius, Py_ssize_t i, int32_t order,
    const double[:, ::1] points, const int32_t[::1] others, Py_ssize_t first, Py_ssize_t last,
    const double *barriers, const int32_t *near, const int32_t *near_end,
    bint blocking, double tolerance, double slack,
) noexcept nogil:
    """Whether fewer than `order` of the others that see a place are strictly nearer to it than point i is."""
    cdef Py_ssize_t at, j
    cdef int32_t n_nearer = 0
    cdef double apart_x, apart_y, limit = radius * radius * (1 - 1e-8)
    if blocking:  # a place on a barrier is looked at from the side of point i
        x = x + 1e-10 * (points[i, 0] - x)
        y = y + 1e-10 * (points[i, 1] - y)
    for at in range(first, last):
        j = others[at]
        apart_x = x - points[j, 0]
        apart_y = y - points[j, 1]
        if apart_x * apart_x + apart_y * apart_y < limit:
            if blocking and is_blocked(
                points[j, 0], points[j, 1], x, y, barriers, near, near_end, 1e-3 * tolerance, slack
            ):
                continue
            n_nearer += 1
            if n_nearer >= order:
                return False
    return True


cdef inline void set_line(
    double *line, double x, double y, double along_x, double along_y, double first, double last
) noexcept nogil:
    line[0] = x
    line[1] = y
    line[2] = along_x
    line[3] = along_y
    line[4] = first
    line[5] = last


def find_reaches(
    const double[:, ::1] points,     # IN (n, 2)
    const int32_t[::1] who,          # IN (k,): points whose reach is sought
    int32_t order,                   # IN: p
    const double[:, ::1] windows,    # IN (k, 4): least x and y, greatest x and y
    const double[::1] bounds,        # IN (4,): the same of the region, whose sides are no sides of windows
    const int32_t[::1] other_starts, # IN (k + 1,)
    const int32_t[::1] others,       # IN: points near each, the nearest first
    const double[:, ::1] barriers,   # IN (S, 4)
    Py_ssize_t n_boundary,           # IN: the first of the barriers are the boundary of the region
    const int32_t[::1] near_starts,  # IN (k + 1,)
    const int32_t[::1] near,         # IN: barriers in each window
    const double[:, ::1] tips,       # IN (T, 2): ends of barriers that cast shadows
    const int32_t[::1] tip_starts,   # IN (k + 1,)
    const int32_t[::1] near_tips,    # IN: tips in each window
    bint blocking,                   # IN: whether barriers block sight
    double tolerance,                # IN
    double slack,                    # IN
    double[:, ::1] lines,            # scratch (M, 6): origin, direction, first and last place along it
    double[::1] reaches,             # OUT (k,): the greatest distance at which the point is among the p nearest
):
    """Try all places where two lines cross: bisectors, barriers, sides of the window, and edges of shadows.

    Where a point is among the p nearest, its distance is greatest at such a place.
    """
    cdef Py_ssize_t k, i, at, j, a, b, n_lines, n_ends, side
    cdef double x, y, apart_x, apart_y, size, cross, s, t, radius, best, squared
    cdef double low_x, low_y, high_x, high_y
    cdef bint good
    with nogil:
        for k in range(who.shape[0]):
            i = who[k]
            low_x = windows[k, 0]
            low_y = windows[k, 1]
            high_x = windows[k, 2]
            high_y = windows[k, 3]
            n_lines = 0
            # Sides of the window and barriers come first: their ends are places to try, too.
            for side in range(4):
                b = 2 * side if side < 2 else 2 * side - 3  # left, right, top, bottom
                if windows[k, b] == bounds[b]:
                    continue
                set_line(
                    &lines[n_lines, 0], low_x if side != 1 else high_x, low_y if side != 3 else high_y,
                    0 if side < 2 else 1, 1 if side < 2 else 0, 0, high_y - low_y if side < 2 else high_x - low_x,
                )
                n_lines += 1
            for at in range(near_starts[k], near_starts[k + 1]):
                b = near[at]
                apart_x = barriers[b, 2] - barriers[b, 0]
                apart_y = barriers[b, 3] - barriers[b, 1]
                size = sqrt(apart_x * apart_x + apart_y * apart_y)
                set_line(&lines[n_lines, 0], barriers[b, 0], barriers[b, 1], apart_x / size, apart_y / size, 0, size)
                n_lines += 1
            n_ends = n_lines
            for at in range(other_starts[k], other_starts[k + 1]):
                j = others[at]
                apart_x = points[j, 0] - points[i, 0]
                apart_y = points[j, 1] - points[i, 1]
                size = sqrt(apart_x * apart_x + apart_y * apart_y)
                set_line(
                    &lines[n_lines, 0], points[i, 0] + apart_x / 2, points[i, 1] + apart_y / 2,
                    -apart_y / size, apart_x / size, -FAR, FAR,
                )
                n_lines += 1
            if blocking:
                for at in range(other_starts[k] - 1, other_starts[k + 1]):
                    j = i if at < other_starts[k] else others[at]
                    for a in range(tip_starts[k], tip_starts[k + 1]):
                        b = near_tips[a]
                        apart_x = tips[b, 0] - points[j, 0]
                        apart_y = tips[b, 1] - points[j, 1]
                        size = sqrt(apart_x * apart_x + apart_y * apart_y)
                        if size <= tolerance:
                            continue
                        # A ray of its own that leaves the region at the tip sees nothing beyond.
                        if j == i and not is_inside(
                            tips[b, 0] + slack * apart_x / size, tips[b, 1] + slack * apart_y / size,
                            &barriers[0, 0], n_boundary,
                        ):
                            continue
                        set_line(&lines[n_lines, 0], tips[b, 0], tips[b, 1], apart_x / size, apart_y / size, 0, FAR)
                        n_lines += 1
            best = 0
            for a in range(n_lines):
                # Both ends of a line that has ends, then where it crosses each line after it.
                for b in range(a - 1 if a < n_ends else a + 1, n_lines):
                    if b <= a:
                        s = lines[a, 4] if b == a else lines[a, 5]
                    else:
                        cross = lines[a, 2] * lines[b, 3] - lines[a, 3] * lines[b, 2]
                        if fabs(cross) < 1e-13:
                            continue
                        apart_x = lines[b, 0] - lines[a, 0]
                        apart_y = lines[b, 1] - lines[a, 1]
                        s = (apart_x * lines[b, 3] - apart_y * lines[b, 2]) / cross
                        t = (apart_x * lines[a, 3] - apart_y * lines[a, 2]) / cross
                        if s < lines[a, 4] - tolerance or s > lines[a, 5] + tolerance:
                            continue
                        if t < lines[b, 4] - tolerance or t > lines[b, 5] + tolerance:
                            continue
                    x = lines[a, 0] + s * lines[a, 2]
                    y = lines[a, 1] + s * lines[a, 3]
                    apart_x = x - points[i, 0]
                    apart_y = y - points[i, 1]
                    squared = apart_x * apart_x + apart_y * apart_y
                    if squared <= best * best:
                        continue
                    if x < low_x - tolerance or x > high_x + tolerance or y < low_y - tolerance or y > high_y + tolerance:
                        continue
                    radius = sqrt(squared)
                    if not is_nearer_to_few(
                        x, y, radius, i, order, points, others, other_starts[k], other_starts[k + 1],
                        &barriers[0, 0], &near[0] + near_starts[k], &near[0] + near_starts[k + 1],
                        blocking, tolerance, slack,
                    ):
                        continue
                    if blocking:
                        good = not is_blocked(
                            points[i, 0], points[i, 1], x, y,
                            &barriers[0, 0], &near[0] + near_starts[k], &near[0] + near_starts[k + 1],
                            tolerance, -slack,
                        )
                    else:
                        # Places on lines of the boundary or of the window need no test.
                        good = a < n_ends or b < n_ends or is_inside(x, y, &barriers[0, 0], n_boundary)
                    if good:
                        best = radius
            reaches[k] = best

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of supports: sight past barriers, reaches of points, depths of covers, and their tightening.

Nothing here checks its arguments. Each argument is marked IN, OUT or INOUT. Rows of different lengths, such as the
barriers near each point, are one array with the start of each row, as in a CSR matrix.
"""
import numpy as np
from libc.math cimport fabs, sqrt
from libc.stdint cimport int32_t, uint8_t

cdef extern from "sight.h":
    bint is_blocked(
        double from_x, double from_y, double to_x, double to_y, const double *barriers,
        const int32_t *at, const int32_t *end, double tolerance, double slack,
    ) noexcept nogil
    bint is_inside(double x, double y, const double *boundary, Py_ssize_t n) noexcept nogil

#: Farther than anything: the kernels are compiled for finite numbers.
cdef double FAR = 1e300
#: Most disks that change in one exchange.
cdef Py_ssize_t MOST_CHANGED = 512


def see(
    const double[:, ::1] points,    # IN (n, 2)
    const int32_t[::1] own,         # IN (m,): the point that looks
    const double[:, ::1] places,    # IN (m, 2): where it looks
    const double[:, ::1] barriers,  # IN (S, 4): x, y of both ends
    const int32_t[::1] starts,      # IN (n + 1,)
    const int32_t[::1] near,        # IN: barriers near each point
    double tolerance,               # IN: places nearer to a barrier than this are on it, and seen from both sides
    double slack,                   # IN: barriers are longer by this at both ends
):
    """Tell which places (m,) are seen, as booleans."""
    cdef Py_ssize_t m, i
    cdef uint8_t[::1] seen = np.empty(own.shape[0], np.uint8)
    with nogil:
        for m in range(own.shape[0]):
            i = own[m]
            seen[m] = not is_blocked(
                points[i, 0], points[i, 1], places[m, 0], places[m, 1],
                &barriers[0, 0], &near[0] + starts[i], &near[0] + starts[i + 1], tolerance, slack,
            )
    return np.asarray(seen).view(np.bool_)


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
):
    """Count the disks (m,) that hold a neighborhood of each place."""
    cdef int32_t[::1] depths = np.empty(places.shape[0], np.int32)
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
    return np.asarray(depths)


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
    Py_ssize_t most_lines,           # IN: that one window has
):
    """Find the greatest distance (k,) at which each point is among the p nearest.

    Try all places where two lines cross: bisectors, barriers, sides of the window, and edges of shadows.

    Where a point is among the p nearest, its distance is greatest at such a place.
    """
    cdef double[:, ::1] lines = np.empty((most_lines, 6))  # origin, direction, first and last place along it
    cdef double[::1] reaches = np.empty(who.shape[0])
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
    return np.asarray(reaches)


def shrink_over_samples(
    const int32_t[::1] turns,      # IN: balls in the order of their turns
    double part,                   # IN: how much of what it can spare each ball gives up, 0 to 1
    const double[::1] floors,      # IN (n,): least radii
    const int32_t[::1] starts,     # IN (n + 1,)
    const int32_t[::1] samples,    # IN: samples near to each ball, the nearest first
    const double[::1] distances,   # IN: how far the ball must reach to hold them
    int32_t order,                 # IN: how many balls must hold each sample
    int32_t[::1] taken,            # INOUT (n,): how many of its samples each ball holds
    double[::1] radii,             # INOUT (n,)
    int32_t[::1] depths,           # INOUT (m,): how many balls hold each sample
):
    """Let each ball in turn shrink by a part of what it can."""
    cdef Py_ssize_t turn, at
    cdef int32_t i
    cdef double radius
    with nogil:
        for turn in range(turns.shape[0]):
            i = turns[turn]
            at = starts[i] + taken[i] - 1
            while at >= starts[i] and depths[samples[at]] > order:
                at -= 1
            radius = max(floors[i], distances[at]) if at >= starts[i] else floors[i]
            if radius >= radii[i]:
                continue
            radius = radii[i] - part * (radii[i] - radius)
            at = starts[i] + taken[i]
            while at > starts[i] and distances[at - 1] > radius:
                at -= 1
                depths[samples[at]] -= 1
            taken[i] = <int32_t>(at - starts[i])
            radii[i] = radius


cdef struct Cover:
    const double *points        # (n, 2)
    const int32_t *pair_starts  # row of disks near to each disk
    const int32_t *pairs        # those disks, without itself
    const double *gaps          # distances of their centers
    const double *barriers      # (S, 4), the boundary first
    Py_ssize_t n_boundary
    const int32_t *near_starts  # row of barriers near to each disk
    const int32_t *near_barriers
    const double *limits        # radii that disks must not exceed; frozen disks have their own
    double *radii
    int32_t *meeting            # scratch: disks that meet the disk in turn
    int32_t order
    bint blocking
    double tolerance
    double aside                # how far from a barrier places beside it are


cdef struct Gap:
    double x
    double y
    double distance  # from the disk in turn; 0 if there is none
    int32_t one      # the disks whose circles cross there, or -1
    int32_t other


cdef int32_t n_met(const Cover *cover, int32_t i, double radius) noexcept nogil:
    """How many disks the disk i meets with a radius."""
    cdef int32_t at, n = 0
    for at in range(cover.pair_starts[i], cover.pair_starts[i + 1]):
        n += cover.gaps[at] < radius + cover.radii[cover.pairs[at]]
    return n


cdef int32_t set_radius(Cover *cover, int32_t i, double radius) noexcept nogil:
    """Give disk i another radius; return how many more disks it meets."""
    cdef int32_t more = n_met(cover, i, radius) - n_met(cover, i, cover.radii[i])
    cover.radii[i] = radius
    return more


cdef bint is_hidden(const Cover *cover, int32_t i, double x, double y) noexcept nogil:
    return cover.blocking and cover.near_starts[i + 1] > cover.near_starts[i] and is_blocked(
        cover.points[2 * i], cover.points[2 * i + 1], x, y, cover.barriers,
        cover.near_barriers + cover.near_starts[i], cover.near_barriers + cover.near_starts[i + 1], cover.tolerance, 0,
    )


cdef double apart(const Cover *cover, int32_t i, double x, double y) noexcept nogil:
    x = x - cover.points[2 * i]
    y = y - cover.points[2 * i + 1]
    return sqrt(x * x + y * y)


cdef void look(
    Cover *cover, int32_t i, double x, double y, double inner, double outer,
    int32_t one, int32_t other, int32_t n_meeting, bint on_barrier, Gap *gap,
) noexcept nogil:
    """Note a place in the ring between two radii around disk i if too few other disks hold it, and it is the farthest."""
    cdef double distance = apart(cover, i, x, y), radius
    cdef int32_t at, j, depth = 0
    if distance < inner or distance > outer or distance <= gap.distance:
        return
    if on_barrier and cover.blocking:  # on the side of disk i
        x = x + cover.aside * (cover.points[2 * i] - x) / distance
        y = y + cover.aside * (cover.points[2 * i + 1] - y) / distance
    for at in range(n_meeting):
        j = cover.meeting[at]
        if j == one or j == other:
            continue
        radius = cover.radii[j] * (1 - 1e-10)
        if apart(cover, j, x, y) < radius and not is_hidden(cover, j, x, y):
            depth += 1
            if depth >= cover.order:
                return
    if cover.blocking:
        if is_hidden(cover, i, x, y):
            return
    elif not on_barrier and not is_inside(x, y, cover.barriers, cover.n_boundary):
        return
    gap.x = x
    gap.y = y
    gap.distance = distance
    gap.one = one
    gap.other = other


cdef void look_on_barriers(
    Cover *cover, int32_t i, int32_t j, double inner, double outer, int32_t n_meeting, Gap *gap,
) noexcept nogil:
    """Look where the circle of disk j crosses barriers near to disk i; where these end if j is -1."""
    cdef int32_t at, sign
    cdef const double *barrier
    cdef double along_x, along_y, length, middle, under, step_x, step_y, place
    for at in range(cover.near_starts[i], cover.near_starts[i + 1]):
        barrier = cover.barriers + 4 * <Py_ssize_t>cover.near_barriers[at]
        if j < 0:
            look(cover, i, barrier[0], barrier[1], inner, outer, -1, -1, n_meeting, True, gap)
            look(cover, i, barrier[2], barrier[3], inner, outer, -1, -1, n_meeting, True, gap)
            continue
        along_x = barrier[2] - barrier[0]
        along_y = barrier[3] - barrier[1]
        length = sqrt(along_x * along_x + along_y * along_y)
        along_x = along_x / length
        along_y = along_y / length
        step_x = barrier[0] - cover.points[2 * j]
        step_y = barrier[1] - cover.points[2 * j + 1]
        middle = step_x * along_x + step_y * along_y
        under = middle * middle - step_x * step_x - step_y * step_y + cover.radii[j] * cover.radii[j]
        if under <= 0:
            continue
        for sign in range(-1, 2, 2):
            place = -middle + sign * sqrt(under)
            if -cover.tolerance <= place <= length + cover.tolerance:
                look(
                    cover, i, barrier[0] + place * along_x, barrier[1] + place * along_y,
                    inner, outer, j, -1, n_meeting, True, gap,
                )


cdef void look_on_circles(
    Cover *cover, int32_t i, int32_t a, int32_t b, double inner, double outer, int32_t n_meeting, Gap *gap,
) noexcept nogil:
    """Look where the circles of disks a and b cross."""
    cdef double x = cover.points[2 * a], y = cover.points[2 * a + 1]
    cdef double step_x = cover.points[2 * b] - x, step_y = cover.points[2 * b + 1] - y
    cdef double distance = sqrt(step_x * step_x + step_y * step_y), r = cover.radii[a], s = cover.radii[b]
    cdef double along, across
    if distance >= r + s or distance <= fabs(r - s):
        return
    along = (distance * distance + r * r - s * s) / (2 * distance)
    across = sqrt(max(r * r - along * along, 0)) / distance
    along = along / distance
    x = x + along * step_x
    y = y + along * step_y
    look(cover, i, x - across * step_y, y + across * step_x, inner, outer, a, b, n_meeting, False, gap)
    look(cover, i, x + across * step_y, y - across * step_x, inner, outer, a, b, n_meeting, False, gap)


cdef Gap farthest_gap(Cover *cover, int32_t i, double inner, double outer, bint with_own) noexcept nogil:
    """Find the farthest place in a ring around disk i that too few other disks hold, among corners of such parts.

    Without its own circle: what it must hold. With it: what is not covered.
    """
    cdef Gap gap
    cdef int32_t n_meeting = 0, at, a, b, j
    gap.distance = 0
    for at in range(cover.pair_starts[i], cover.pair_starts[i + 1]):
        j = cover.pairs[at]
        if cover.gaps[at] < outer + cover.radii[j]:
            cover.meeting[n_meeting] = j
            n_meeting += 1
    look_on_barriers(cover, i, -1, inner, outer, n_meeting, &gap)
    if with_own:
        look_on_barriers(cover, i, i, inner, outer, n_meeting, &gap)
    for a in range(n_meeting):
        look_on_barriers(cover, i, cover.meeting[a], inner, outer, n_meeting, &gap)
        if with_own:
            look_on_circles(cover, i, i, cover.meeting[a], inner, outer, n_meeting, &gap)
        for b in range(a):
            look_on_circles(cover, i, cover.meeting[a], cover.meeting[b], inner, outer, n_meeting, &gap)
    return gap


cdef double needed(Cover *cover, int32_t i, double floor, double beyond) noexcept nogil:
    """The radius that disk i needs for the places that no other disks can spare it."""
    cdef Gap gap = farthest_gap(cover, i, floor * (1 - beyond), cover.radii[i], False)
    return max(floor, gap.distance * (1 + beyond))


cdef int32_t helper(const Cover *cover, const Gap *gap, int32_t leaver, double scale) noexcept nogil:
    """The disk that reaches a gap at the least price: pairs, and a little for its growth; -1 if none can."""
    cdef int32_t at, j, best = -1
    cdef double price, least = 1e300, distance
    for at in range(cover.pair_starts[leaver], cover.pair_starts[leaver + 1]):
        j = cover.pairs[at]
        if j == gap.one or j == gap.other:
            continue
        distance = apart(cover, j, gap.x, gap.y)
        if distance < cover.radii[j] * (1 - 1e-10) or distance > cover.limits[j] or is_hidden(cover, j, gap.x, gap.y):
            continue
        price = n_met(cover, j, distance) - n_met(cover, j, cover.radii[j])
        price = price + 1e-3 * (distance - cover.radii[j]) / scale
        if price < least:
            least = price
            best = j
    return best


cdef class DiskCover:
    """Disks that cover a region, whose radii shrink and are exchanged in place."""
    cdef Cover cover
    cdef object arrays  # that the pointers of the cover point to

    def __init__(
        self,
        const double[:, ::1] points,      # IN (n, 2)
        const int32_t[::1] pair_starts,   # IN (n + 1,)
        const int32_t[::1] pairs,         # IN: disks near to each
        const double[::1] gaps,           # IN: distances of their centers
        const double[:, ::1] barriers,    # IN (S, 4)
        Py_ssize_t n_boundary,            # IN: the first of the barriers are the boundary of the region
        const int32_t[::1] near_starts,   # IN (n + 1,)
        const int32_t[::1] near,          # IN: barriers near to each disk
        const double[::1] limits,         # IN (n,): greatest radii
        int32_t order,                    # IN: how many disks must hold each place
        bint blocking,                    # IN: whether barriers block sight
        double tolerance,                 # IN: places nearer to a barrier are on it
        double aside,                     # IN: how far from a barrier places beside it are
        double[::1] radii,                # INOUT (n,)
    ):
        cdef int32_t[::1] meeting = np.empty(points.shape[0], np.int32)
        self.arrays = points, pair_starts, pairs, gaps, barriers, near_starts, near, limits, radii, meeting
        self.cover = Cover(
            &points[0, 0], &pair_starts[0], &pairs[0], &gaps[0], &barriers[0, 0], n_boundary, &near_starts[0], &near[0],
            &limits[0], &radii[0], &meeting[0], order, blocking, tolerance, aside,
        )

    def shrink(
        self,
        const int32_t[::1] turns,         # IN: disks in the order of their turns
        double part,                      # IN: how much of what it can spare each disk gives up, 0 to 1
        double beyond,                    # IN: share of its radius by which a disk holds more than it must
        const double[::1] floors,         # IN (n,): least radii
    ):
        """Let each disk in turn shrink by a part of what it can without a gap."""
        cdef Cover *cover = &self.cover
        cdef Py_ssize_t turn
        cdef int32_t i
        cdef double radius
        with nogil:
            for turn in range(turns.shape[0]):
                i = turns[turn]
                radius = needed(cover, i, floors[i], beyond)
                if radius < cover.radii[i]:
                    cover.radii[i] = cover.radii[i] - part * (cover.radii[i] - radius)

    def exchange(
        self,
        const int32_t[::1] turns,         # IN: disks in the order of their turns
        int32_t n_trials,                 # IN: how many of the next smaller radii each disk tries
        int32_t most_helpers,             # IN: how often disks grow in a trial
        double scale,                     # IN: the mean radius
        double beyond,                    # IN: as for `shrink`
        const double[::1] floors,         # IN (n,)
    ):
        """Let each disk in turn leave another one, if disks that take over what it held meet fewer; count these."""
        cdef Cover *cover = &self.cover
        cdef int32_t[::1] changed = np.empty(MOST_CHANGED, np.int32)  # disks whose radii a trial has changed
        cdef double[::1] before = np.empty(MOST_CHANGED)  # and what these were
        cdef Py_ssize_t turn
        cdef int32_t i, j, at, trial, more, n_changed, n_grown, grown, n_done = 0
        cdef double target, place, radius, ceiling
        cdef Gap gap
        cdef bint possible
        with nogil:
            for turn in range(turns.shape[0]):
                i = turns[turn]
                ceiling = cover.radii[i]
                for trial in range(n_trials):
                    # The greatest radius with which one disk more is left.
                    target = -1
                    for at in range(cover.pair_starts[i], cover.pair_starts[i + 1]):
                        place = (cover.gaps[at] - cover.radii[cover.pairs[at]]) * (1 - beyond)
                        if target < place < ceiling * (1 - beyond):
                            target = place
                    if target < floors[i] or target <= 0:
                        break
                    ceiling = target
                    changed[0] = i
                    before[0] = cover.radii[i]
                    n_changed = 1
                    more = set_radius(cover, i, target)
                    possible = False
                    while n_changed <= most_helpers:
                        gap = farthest_gap(cover, i, target * (1 - beyond), before[0], True)
                        if gap.distance == 0:
                            possible = True
                            break
                        j = helper(cover, &gap, i, scale)
                        if j < 0:
                            break
                        changed[n_changed] = j
                        before[n_changed] = cover.radii[j]
                        n_changed += 1
                        more += set_radius(cover, j, apart(cover, j, gap.x, gap.y) * (1 + beyond))
                        if more > n_changed:
                            break
                    if possible and more >= 0:
                        # What has grown lets its neighbors shrink.
                        n_grown = n_changed
                        for grown in range(1, n_grown):
                            for at in range(cover.pair_starts[changed[grown]], cover.pair_starts[changed[grown] + 1]):
                                j = cover.pairs[at]
                                if j == i or n_changed >= changed.shape[0]:
                                    continue
                                if cover.gaps[at] >= cover.radii[j] + cover.radii[changed[grown]]:
                                    continue
                                radius = needed(cover, j, floors[j], beyond)
                                if radius < cover.radii[j]:
                                    changed[n_changed] = j
                                    before[n_changed] = cover.radii[j]
                                    n_changed += 1
                                    more += set_radius(cover, j, radius)
                    if possible and more < 0:
                        n_done += 1
                        break
                    while n_changed:
                        n_changed -= 1
                        set_radius(cover, changed[n_changed], before[n_changed])
        return n_done

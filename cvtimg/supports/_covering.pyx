# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops that tighten covers, over buffers that the caller owns.

Nothing here allocates or checks its arguments. Each argument is marked IN, OUT or INOUT. Rows of different lengths are
one array with the start of each row, as in a CSR matrix.
"""
from libc.math cimport fabs, sqrt
from libc.stdint cimport int32_t

cdef extern from "sight.h":
    bint is_blocked(
        double from_x, double from_y, double to_x, double to_y, const double *barriers,
        const int32_t *at, const int32_t *end, double tolerance, double slack,
    ) noexcept nogil
    bint is_inside(double x, double y, const double *boundary, Py_ssize_t n) noexcept nogil


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


def shrink(
    const int32_t[::1] turns,         # IN: disks in the order of their turns
    double part,                      # IN: how much of what it can spare each disk gives up, 0 to 1
    double beyond,                    # IN: share of its radius by which a disk holds more than it must
    const double[::1] floors,         # IN (n,): least radii
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
    int32_t[::1] meeting,             # scratch (n,)
    double[::1] radii,                # INOUT (n,)
):
    """Let each disk in turn shrink by a part of what it can without a gap."""
    cdef Cover cover = Cover(
        &points[0, 0], &pair_starts[0], &pairs[0], &gaps[0], &barriers[0, 0], n_boundary, &near_starts[0], &near[0],
        &limits[0], &radii[0], &meeting[0], order, blocking, tolerance, aside,
    )
    cdef Py_ssize_t turn
    cdef int32_t i
    cdef double radius
    with nogil:
        for turn in range(turns.shape[0]):
            i = turns[turn]
            radius = needed(&cover, i, floors[i], beyond)
            if radius < radii[i]:
                radii[i] = radii[i] - part * (radii[i] - radius)


def exchange(
    const int32_t[::1] turns,         # IN: disks in the order of their turns
    int32_t n_trials,                 # IN: how many of the next smaller radii each disk tries
    int32_t most_helpers,             # IN: how often disks grow in a trial
    double scale,                     # IN: the mean radius
    double beyond,                    # IN: as for `shrink`, like all that follow
    const double[::1] floors,         # IN (n,)
    const double[:, ::1] points,      # IN (n, 2)
    const int32_t[::1] pair_starts,   # IN (n + 1,)
    const int32_t[::1] pairs,         # IN
    const double[::1] gaps,           # IN
    const double[:, ::1] barriers,    # IN (S, 4)
    Py_ssize_t n_boundary,            # IN
    const int32_t[::1] near_starts,   # IN (n + 1,)
    const int32_t[::1] near,          # IN
    const double[::1] limits,         # IN (n,)
    int32_t order,                    # IN
    bint blocking,                    # IN
    double tolerance,                 # IN
    double aside,                     # IN
    int32_t[::1] meeting,             # scratch (n,)
    double[::1] radii,                # INOUT (n,)
    int32_t[::1] changed,             # scratch (C,): disks whose radii a trial has changed
    double[::1] before,               # scratch (C,): and what these were
):
    """Let each disk in turn leave another one, if disks that take over what it held meet fewer; return how many did."""
    cdef Cover cover = Cover(
        &points[0, 0], &pair_starts[0], &pairs[0], &gaps[0], &barriers[0, 0], n_boundary, &near_starts[0], &near[0],
        &limits[0], &radii[0], &meeting[0], order, blocking, tolerance, aside,
    )
    cdef Py_ssize_t turn
    cdef int32_t i, j, at, trial, more, n_changed, n_grown, grown, n_done = 0
    cdef double target, place, radius, ceiling
    cdef Gap gap
    cdef bint possible
    with nogil:
        for turn in range(turns.shape[0]):
            i = turns[turn]
            ceiling = radii[i]
            for trial in range(n_trials):
                # The greatest radius with which one disk more is left.
                target = -1
                for at in range(pair_starts[i], pair_starts[i + 1]):
                    place = (gaps[at] - radii[pairs[at]]) * (1 - beyond)
                    if target < place < ceiling * (1 - beyond):
                        target = place
                if target < floors[i] or target <= 0:
                    break
                ceiling = target
                changed[0] = i
                before[0] = radii[i]
                n_changed = 1
                more = set_radius(&cover, i, target)
                possible = False
                while n_changed <= most_helpers:
                    gap = farthest_gap(&cover, i, target * (1 - beyond), before[0], True)
                    if gap.distance == 0:
                        possible = True
                        break
                    j = helper(&cover, &gap, i, scale)
                    if j < 0:
                        break
                    changed[n_changed] = j
                    before[n_changed] = radii[j]
                    n_changed += 1
                    more += set_radius(&cover, j, apart(&cover, j, gap.x, gap.y) * (1 + beyond))
                    if more > n_changed:
                        break
                if possible and more >= 0:
                    # What has grown lets its neighbors shrink.
                    n_grown = n_changed
                    for grown in range(1, n_grown):
                        for at in range(pair_starts[changed[grown]], pair_starts[changed[grown] + 1]):
                            j = pairs[at]
                            if j == i or n_changed >= changed.shape[0] or gaps[at] >= radii[j] + radii[changed[grown]]:
                                continue
                            radius = needed(&cover, j, floors[j], beyond)
                            if radius < radii[j]:
                                changed[n_changed] = j
                                before[n_changed] = radii[j]
                                n_changed += 1
                                more += set_radius(&cover, j, radius)
                if possible and more < 0:
                    n_done += 1
                    break
                while n_changed:
                    n_changed -= 1
                    set_radius(&cover, changed[n_changed], before[n_changed])
    return n_done

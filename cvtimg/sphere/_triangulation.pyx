# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over triangulations of the sphere: insertion, flips, and moments of their dual cells.

Nothing here allocates, checks its arguments or decides. Each argument is marked IN, OUT or INOUT. N is the number of
vertices, T = 2 N - 4 that of triangles.
"""
from libc.stdint cimport int32_t, uint8_t

cdef extern from "half_edges.h" nogil:
    struct c_globe "globe":
        const double *points
        int32_t *vertices
        int32_t *twins

    int32_t next_edge(int32_t e)
    int32_t last_edge(int32_t e)
    int32_t least_edge(const int32_t *vertices, int32_t t)
    double determinant(const double *a, const double *b, const double *c)
    double squared_distance(const double *a, const double *b)

cdef extern from "flips.h" nogil:
    int should_flip(const c_globe *globe, int32_t e)
    int may_flip(const double *arcs, int32_t e, int32_t f)
    Py_ssize_t flip_waiting(
        c_globe *globe, double *arcs, int32_t *stack, uint8_t *waiting, int32_t depth, Py_ssize_t most,
    )

cdef extern from "insertion.h" nogil:
    void start_from_four(c_globe *globe, const int32_t *four)
    int32_t find_triangle(
        const c_globe *globe, int32_t n_triangles, int32_t t, const double *inside, const double *place,
    )
    Py_ssize_t insert_vertex(
        c_globe *globe, int32_t n_triangles, int32_t t, int32_t vertex, int32_t *stack, Py_ssize_t most,
    )

cdef extern from "dual_cells.h" nogil:
    void circumcenter(const c_globe *globe, int32_t t, double *center)
    bint half_arcs(const c_globe *globe, int32_t t, double *arcs)
    void uniform_moment(const c_globe *globe, const double *arcs, int32_t first, double *moment)
    void weighted_moment(
        const c_globe *globe, const double *centers, const double *at_points, const double *at_centers,
        int32_t first, double *mass, double *moment, double *energy,
    )

cdef extern from "corners.h" nogil:
    int add_corner_slopes(
        const c_globe *globe, int32_t t, double least_cosine, double largest_cosine, double *slopes,
    )


cdef c_globe as_globe(const double[:, ::1] points, int32_t[:, ::1] triangles, int32_t[:, ::1] twins) noexcept:
    cdef c_globe globe
    globe.points = &points[0, 0]
    globe.vertices = &triangles[0, 0]
    globe.twins = &twins[0, 0]
    return globe


def insert(
    const double[:, ::1] points,   # IN (N, 3)
    const int32_t[::1] order,      # IN (N,): the first three of the first four are counterclockwise from outside
    const double[::1] inside,      # IN (3,): inside of the tetrahedron of the first four
    double least,                  # IN: the least squared distance of points
    Py_ssize_t most,               # IN: flips at most for one point
    int32_t[:, ::1] triangles,     # OUT (T, 3)
    int32_t[:, ::1] twins,         # OUT (T, 3)
    int32_t[::1] stack,            # scratch (3 T,)
):
    """Insert points in their order; return how many, fewer than N where one is too near to others."""
    cdef c_globe globe = as_globe(points, triangles, twins)
    cdef int32_t n = 4, t = 0, n_triangles = 4
    cdef int k
    cdef bint too_near = False
    with nogil:
        start_from_four(&globe, &order[0])
        while n < order.shape[0]:
            t = find_triangle(&globe, n_triangles, t, &inside[0], &points[order[n], 0])
            if t < 0:
                break
            for k in range(3):
                too_near |= squared_distance(&points[order[n], 0], &points[triangles[t, k], 0]) < least
            if too_near or insert_vertex(&globe, n_triangles, t, order[n], &stack[0], most) < 0:
                break
            n_triangles += 2
            n += 1
    return n


def find_twins(
    const int32_t[:, ::1] triangles,  # IN (T, 3)
    int32_t[:, ::1] twins,            # OUT (T, 3): -1 where there is none
    int32_t[::1] heads,               # scratch (N,)
    int32_t[::1] following,           # scratch (3 T,)
):
    """Find the same edge of the triangle beyond; return how many edges have none."""
    cdef int32_t e, f, start, end, n_open = 0
    cdef const int32_t *vertices = &triangles[0, 0]
    cdef int32_t *found = &twins[0, 0]
    with nogil:
        heads[:] = -1
        for e in range(<int32_t>(3 * triangles.shape[0])):
            following[e] = heads[vertices[e]]
            heads[vertices[e]] = e
            found[e] = -1
        for e in range(<int32_t>(3 * triangles.shape[0])):
            start, end = vertices[e], vertices[next_edge(e)]
            f = heads[end]
            while f >= 0 and vertices[next_edge(f)] != start:
                f = following[f]
            found[e] = f
            n_open += f < 0
    return n_open


def sort_triangles(
    const int32_t[:, ::1] triangles,     # IN (T, 3)
    const int32_t[:, ::1] twins,         # IN (T, 3)
    int32_t[::1] counts,                 # scratch (N + 1,)
    int32_t[::1] places,                 # scratch (3 T,)
    int32_t[:, ::1] sorted_triangles,    # OUT (T, 3)
    int32_t[:, ::1] sorted_twins,        # OUT (T, 3)
):
    """Sort triangles by their least vertex, which becomes their first: neighbors are near in memory, as vertices are."""
    cdef int32_t e, t, n = <int32_t>triangles.shape[0], first
    cdef const int32_t *vertices = &triangles[0, 0]
    cdef const int32_t *twin = &twins[0, 0]
    cdef int32_t *to_vertices = &sorted_triangles[0, 0]
    cdef int32_t *to_twins = &sorted_twins[0, 0]
    with nogil:
        counts[:] = 0
        for t in range(n):
            counts[vertices[least_edge(vertices, t)] + 1] += 1
        for e in range(1, <int32_t>counts.shape[0]):
            counts[e] += counts[e - 1]
        for t in range(n):
            e = least_edge(vertices, t)
            first = 3 * counts[vertices[e]]
            counts[vertices[e]] += 1
            places[e] = first
            places[next_edge(e)] = first + 1
            places[last_edge(e)] = first + 2
        for e in range(3 * n):
            to_vertices[places[e]] = vertices[e]
            to_twins[places[e]] = places[twin[e]]


def half_arcs_of_edges(
    const double[:, ::1] points,   # IN (N, 3)
    int32_t[:, ::1] triangles,     # IN (T, 3)
    Py_ssize_t start,              # IN
    Py_ssize_t stop,               # IN
    double[:, ::1] arcs,           # OUT (T, 3), in rows start..stop
):
    """For each edge, compute the arc from its middle to the circumcenter of its triangle, divided by its length.

    Returns how many triangles do not turn counterclockwise.
    """
    cdef c_globe globe = as_globe(points, triangles, triangles)
    cdef int32_t t
    cdef Py_ssize_t n_turned = 0
    with nogil:
        for t in range(<int32_t>start, <int32_t>stop):
            n_turned += not half_arcs(&globe, t, &arcs[0, 0])
    return n_turned


def find_wrong(
    const double[:, ::1] points,   # IN (N, 3)
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # IN (T, 3)
    const double[:, ::1] arcs,     # IN (T, 3): of half_arcs_of_edges
    Py_ssize_t start,              # IN
    Py_ssize_t stop,               # IN
    uint8_t[::1] wrong,            # OUT (3 T,): edges to flip, each once, of triangles start..stop
):
    """Mark edges that are not Delaunay."""
    cdef c_globe globe = as_globe(points, triangles, twins)
    cdef int32_t e, f
    with nogil:
        for e in range(<int32_t>(3 * start), <int32_t>(3 * stop)):
            f = globe.twins[e]
            wrong[e] = may_flip(&arcs[0, 0], e, f) and f > e and should_flip(&globe, e)


def flip(
    const double[:, ::1] points,   # IN (N, 3)
    int32_t[:, ::1] triangles,     # INOUT (T, 3)
    int32_t[:, ::1] twins,         # INOUT (T, 3)
    double[:, ::1] arcs,           # INOUT (T, 3): of half_arcs_of_edges
    int32_t[::1] stack,            # INOUT (3 T,): begins with the edges to flip
    Py_ssize_t depth,              # IN: how many
    uint8_t[::1] waiting,          # INOUT (3 T,): 1 for those
    Py_ssize_t most,               # IN: flips at most
):
    """Flip edges until the triangulation is Delaunay; return how many, or -1 if they were too many."""
    cdef c_globe globe = as_globe(points, triangles, twins)
    cdef Py_ssize_t n_flips
    with nogil:
        n_flips = flip_waiting(&globe, &arcs[0, 0], &stack[0], &waiting[0], <int32_t>depth, most)
    return n_flips


def circumcenters(
    const double[:, ::1] points,   # IN (N, 3)
    int32_t[:, ::1] triangles,     # IN (T, 3)
    Py_ssize_t start,              # IN
    Py_ssize_t stop,               # IN
    double[:, ::1] centers,        # OUT (T, 3): unit vectors, in rows start..stop
):
    """Compute the centers of circumscribed caps."""
    cdef c_globe globe = as_globe(points, triangles, triangles)
    cdef int32_t t
    with nogil:
        for t in range(<int32_t>start, <int32_t>stop):
            circumcenter(&globe, t, &centers[t, 0])


def first_edges(
    const int32_t[:, ::1] triangles,  # IN (T, 3)
    int32_t[::1] firsts,              # OUT (N,)
):
    """Find the edge from each vertex to its least neighbor: where sums over its cell begin, whatever the mesh."""
    cdef int32_t e, vertex
    cdef const int32_t *vertices = &triangles[0, 0]
    with nogil:
        firsts[:] = -1
        for e in range(<int32_t>(3 * triangles.shape[0])):
            vertex = vertices[e]
            if firsts[vertex] < 0 or vertices[next_edge(e)] < vertices[next_edge(firsts[vertex])]:
                firsts[vertex] = e


def sum_uniform(
    const double[:, ::1] points,   # IN (N, 3)
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # IN (T, 3)
    const double[:, ::1] arcs,     # IN (T, 3): of half_arcs_of_edges
    const int32_t[::1] firsts,     # IN (N,)
    Py_ssize_t start,              # IN
    Py_ssize_t stop,               # IN
    double[:, ::1] moments,        # OUT (N, 3): integral of x over each cell, in rows start..stop
):
    """Integrate x over cells, exactly."""
    cdef c_globe globe = as_globe(points, triangles, twins)
    cdef Py_ssize_t i
    with nogil:
        for i in range(start, stop):
            uniform_moment(&globe, &arcs[0, 0], firsts[i], &moments[i, 0])


def sum_weighted(
    const double[:, ::1] points,   # IN (N, 3)
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # IN (T, 3)
    const double[:, ::1] centers,  # IN (T, 3)
    const int32_t[::1] firsts,     # IN (N,)
    const double[::1] at_points,   # IN (N,): density
    const double[::1] at_centers,  # IN (T,): density
    Py_ssize_t start,              # IN
    Py_ssize_t stop,               # IN
    double[::1] masses,            # OUT (N,): integral of the density over each cell, in rows start..stop
    double[:, ::1] moments,        # OUT (N, 3): of the density times x
    double[::1] energies,          # OUT (N,): of the density times the squared distance to the vertex
):
    """Integrate a density over cells."""
    cdef c_globe globe = as_globe(points, triangles, twins)
    cdef Py_ssize_t i
    with nogil:
        for i in range(start, stop):
            weighted_moment(
                &globe, &centers[0, 0], &at_points[0], &at_centers[0], firsts[i], &masses[i], &moments[i, 0],
                &energies[i],
            )


def list_corners(
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # IN (T, 3)
    const int32_t[::1] firsts,     # IN (N,)
    int32_t[::1] offsets,          # OUT (N + 1,): where the corners of each cell begin
    int32_t[::1] corners,          # OUT (3 T,): triangles around each vertex, counterclockwise
):
    """List the triangles around each vertex: the corners of its cell are their circumcenters."""
    cdef Py_ssize_t i
    cdef int32_t e, n = 0
    cdef const int32_t *twin = &twins[0, 0]
    with nogil:
        for i in range(firsts.shape[0]):
            offsets[i] = n
            e = firsts[i]
            while True:
                corners[n] = e // 3
                n += 1
                # The next one counterclockwise is beyond the last edge of this triangle.
                e = twin[e + 2 if e % 3 == 0 else e - 1]
                if e == firsts[i]:
                    break
        offsets[firsts.shape[0]] = n


def sum_neighbors(
    const int32_t[:, ::1] triangles,  # IN (T, 3)
    const double[:, ::1] vectors,     # IN (N, 3)
    double[:, ::1] sums,              # OUT (N, 3): of those of the neighbors of each vertex
):
    """Sum vectors over the neighbors of vertices."""
    cdef Py_ssize_t t
    cdef int k, j
    cdef int32_t vertex, following
    with nogil:
        sums[:] = 0
        for t in range(triangles.shape[0]):
            for k in range(3):
                vertex, following = triangles[t, k], triangles[t, (k + 1) % 3]
                for j in range(3):
                    sums[vertex, j] += vectors[following, j]


def shortest_edge(
    const double[:, ::1] points,      # IN (N, 3)
    const int32_t[:, ::1] triangles,  # IN (T, 3)
):
    """Return the least squared length, and the edge 3 t + k that has it."""
    cdef double least = 1e300, length
    cdef int32_t t, k, found = 0
    with nogil:
        for t in range(<int32_t>triangles.shape[0]):
            for k in range(3):
                length = squared_distance(&points[triangles[t, k], 0], &points[triangles[t, (k + 1) % 3], 0])
                if length < least:
                    least, found = length, 3 * t + k
    return least, found


def sum_corner_slopes(
    const double[:, ::1] points,   # IN (N, 3)
    int32_t[:, ::1] triangles,     # IN (T, 3)
    double least_cosine,           # IN
    double largest_cosine,         # IN
    double[:, ::1] slopes,         # OUT (N, 3)
):
    """Sum the slopes of what angles out of bounds cost; return how many triangles have one."""
    cdef c_globe globe = as_globe(points, triangles, triangles)
    cdef int32_t t
    cdef Py_ssize_t n_out = 0
    with nogil:
        slopes[:] = 0
        for t in range(<int32_t>triangles.shape[0]):
            n_out += add_corner_slopes(&globe, t, least_cosine, largest_cosine, &slopes[0, 0])
    return n_out

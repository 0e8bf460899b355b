# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over triangulations: flips, moments of cells, moves and smoothing, and location of points.

Nothing here allocates, checks its arguments or decides. Each argument is marked IN, OUT or INOUT. N is the number of
vertices, T that of triangles. A metric has xx, xy and yy in a row.
"""
from libc.stdint cimport int32_t, uint8_t

cdef extern from "topology.h" nogil:
    struct c_mesh "triangulation":
        const double *points
        int32_t *vertices
        int32_t *twins
        uint8_t *borders
        int32_t *corners

    double twice_area(const double *a, const double *b, const double *c)
    int32_t next_corner(int32_t corner)
    int32_t last_corner(int32_t corner)
    void find_twins(c_mesh *mesh, int32_t n_vertices, int32_t n_edges, int32_t *first, int32_t *after)

cdef extern from "flips.h" nogil:
    Py_ssize_t flip_to_delaunay(
        c_mesh *mesh, const double *metric, int32_t n_edges, Py_ssize_t most, int32_t *stack, uint8_t *waiting,
    )

cdef extern from "cell_moments.h" nogil:
    struct c_sums "sums":
        double *inertia
        double *pull
        double energy

    void add_triangle(const c_mesh *mesh, const double *metric, int32_t t, c_sums *sums)

cdef extern from "quality.h" nogil:
    void move_vertices(
        c_mesh *mesh, double *points, const uint8_t *fixed, double *steps, int32_t n_vertices, int32_t n_triangles,
        double *least, uint8_t *is_late,
    )
    void smooth_vertex(c_mesh *mesh, double *place, int32_t vertex, const double *metric, int power)
    bint step_to_even(
        const c_mesh *mesh, const double *metric, int32_t vertex, const double *tangent, double mean, double share,
        double *step,
    )


cdef c_mesh as_mesh(
    const double[:, ::1] points, int32_t[:, ::1] triangles, int32_t[:, ::1] twins, uint8_t[:, ::1] borders,
    int32_t[::1] corners,
) noexcept:
    cdef c_mesh mesh
    mesh.points = &points[0, 0]
    mesh.vertices = &triangles[0, 0]
    mesh.twins = &twins[0, 0]
    mesh.borders = &borders[0, 0]
    mesh.corners = &corners[0]
    return mesh


def join(
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # OUT (T, 3)
    int32_t[::1] first,            # scratch (N,)
    int32_t[::1] after,            # scratch (3 T,)
):
    """Find the twin of each edge: the same edge of the next triangle, or -1."""
    cdef c_mesh mesh
    mesh.vertices = &triangles[0, 0]
    mesh.twins = &twins[0, 0]
    with nogil:
        find_twins(&mesh, <int32_t>first.shape[0], <int32_t>(3 * triangles.shape[0]), &first[0], &after[0])


def flip(
    const double[:, ::1] points,   # IN (N, 2)
    const double[:, ::1] metric,   # IN (N, 3), or None for the Euclidean one
    int32_t[:, ::1] triangles,     # INOUT (T, 3)
    int32_t[:, ::1] twins,         # INOUT (T, 3)
    uint8_t[:, ::1] borders,       # INOUT (T, 3)
    int32_t[::1] corners,          # INOUT (N,)
    Py_ssize_t most,               # IN: flips at most
    int32_t[::1] stack,            # scratch (3 T,)
    uint8_t[::1] waiting,          # scratch (3 T,)
):
    """Flip edges until the triangulation is constrained Delaunay; return how many."""
    cdef c_mesh mesh = as_mesh(points, triangles, twins, borders, corners)
    cdef const double *given = NULL
    cdef Py_ssize_t n_flips
    if metric is not None:
        given = &metric[0, 0]
    with nogil:
        n_flips = flip_to_delaunay(&mesh, given, <int32_t>(3 * triangles.shape[0]), most, &stack[0], &waiting[0])
    return n_flips


def sum_cells(
    const double[:, ::1] points,   # IN (N, 2)
    const double[:, ::1] metric,   # IN (N, 3)
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # IN (T, 3)
    uint8_t[:, ::1] borders,       # IN (T, 3)
    int32_t[::1] corners,          # IN (N,)
    double[:, ::1] inertia,        # OUT (N, 3): mass times metric of each cell
    double[:, ::1] pull,           # OUT (N, 2): that times the step from the vertex to the centroid
):
    """Sum the moments of the cells in their metric; return the energy."""
    cdef c_mesh mesh = as_mesh(points, triangles, twins, borders, corners)
    cdef c_sums sums
    cdef int32_t t
    inertia[:] = 0
    pull[:] = 0
    sums.inertia = &inertia[0, 0]
    sums.pull = &pull[0, 0]
    sums.energy = 0
    with nogil:
        for t in range(<int32_t>triangles.shape[0]):
            add_triangle(&mesh, &metric[0, 0], t, &sums)
    return sums.energy


def move(
    double[:, ::1] points,         # INOUT (N, 2)
    const uint8_t[::1] fixed,      # IN (N,): 1 for vertices that stay, 2 for those that are moved whole or not at all
    double[:, ::1] steps,          # INOUT (N, 2): wanted steps; those that were made
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # IN (T, 3)
    uint8_t[:, ::1] borders,       # IN (T, 3)
    int32_t[::1] corners,          # IN (N,)
    double[::1] least,             # scratch (T,)
    uint8_t[::1] is_late,          # scratch (N,)
):
    """Move vertices, by a part of their steps where a triangle would turn over."""
    cdef c_mesh mesh = as_mesh(points, triangles, twins, borders, corners)
    with nogil:
        move_vertices(
            &mesh, &points[0, 0], &fixed[0], &steps[0, 0], <int32_t>points.shape[0], <int32_t>triangles.shape[0],
            &least[0], &is_late[0],
        )


def mean_square(
    const double[:, ::1] points,     # IN (N, 2)
    const double[:, ::1] metric,     # IN (N, 3)
    const int32_t[:, ::1] triangles, # IN (T, 3)
    const int32_t[:, ::1] twins,     # IN (T, 3)
):
    """Return the mean of the squared lengths of edges, in the metric halfway."""
    cdef int32_t t, k, a, b
    cdef Py_ssize_t n = 0
    cdef double x, y, total = 0
    with nogil:
        for t in range(<int32_t>triangles.shape[0]):
            for k in range(3):
                if twins[t, k] > 3 * t + k:
                    continue
                a = triangles[t, (k + 1) % 3]
                b = triangles[t, (k + 2) % 3]
                x = points[a, 0] - points[b, 0]
                y = points[a, 1] - points[b, 1]
                n += 1
                total += 0.5 * (
                    (metric[a, 0] + metric[b, 0]) * x * x
                    + 2 * (metric[a, 1] + metric[b, 1]) * x * y
                    + (metric[a, 2] + metric[b, 2]) * y * y
                )
    return total / n


def even(
    double[:, ::1] points,         # INOUT (N, 2)
    const double[:, ::1] metric,   # IN (N, 3)
    const uint8_t[::1] fixed,      # IN (N,): 1 for vertices that stay, 2 for those that slide
    double[:, ::1] steps,          # INOUT (N, 2): tangents of those that slide; the steps that they should make
    double mean,                   # IN: the square of the length that edges should have, in the metric
    double share,                  # IN: of the best steps
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # IN (T, 3)
    uint8_t[:, ::1] borders,       # IN (T, 3)
    int32_t[::1] corners,          # IN (N,)
):
    """Move vertices one after the other, so that the edges at each get more even; those that slide are not moved."""
    cdef c_mesh mesh = as_mesh(points, triangles, twins, borders, corners)
    cdef int32_t vertex
    cdef double step[2]
    cdef bint moves
    with nogil:
        for vertex in range(<int32_t>points.shape[0]):
            if fixed[vertex] == 1:
                continue
            moves = step_to_even(
                &mesh, &metric[0, 0], vertex, &steps[vertex, 0] if fixed[vertex] == 2 else NULL, mean, share,
                step,
            )
            if not moves:
                step[0] = step[1] = 0
            if fixed[vertex] == 2:
                steps[vertex, 0] = step[0]
                steps[vertex, 1] = step[1]
            else:
                points[vertex, 0] += step[0]
                points[vertex, 1] += step[1]


def smooth(
    double[:, ::1] points,         # INOUT (N, 2)
    const double[:, ::1] metric,   # IN (N, 3)
    const uint8_t[::1] fixed,      # IN (N,)
    int power,                     # IN: the larger, the more the worst triangle counts
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # IN (T, 3)
    uint8_t[:, ::1] borders,       # IN (T, 3)
    int32_t[::1] corners,          # IN (N,)
):
    """Move vertices one after the other, so that the triangles around become more equilateral in the metric."""
    cdef c_mesh mesh = as_mesh(points, triangles, twins, borders, corners)
    cdef int32_t vertex
    with nogil:
        for vertex in range(<int32_t>points.shape[0]):
            if not fixed[vertex]:
                smooth_vertex(&mesh, &points[vertex, 0], vertex, &metric[vertex, 0], power)


def locate(
    const double[:, ::1] points,     # IN (N, 2)
    const int32_t[:, ::1] triangles, # IN (T, 3)
    const int32_t[:, ::1] twins,     # IN (T, 3)
    const double[:, ::1] places,     # IN (M, 2)
    int32_t[::1] found,              # INOUT (M,): where to begin; the triangle of each place, or the last on the way
    double[:, ::1] shares,           # OUT (M, 3): barycentric coordinates there, < 0 if it is outside
):
    """Walk to the triangles that hold places."""
    cdef Py_ssize_t i, steps, most = 3 * triangles.shape[0]
    cdef int32_t t, k, worst, beyond
    cdef double area, share[3]
    with nogil:
        for i in range(places.shape[0]):
            t = found[i]
            for steps in range(most):
                area = twice_area(&points[triangles[t, 0], 0], &points[triangles[t, 1], 0], &points[triangles[t, 2], 0])
                worst = 0
                for k in range(3):
                    share[k] = twice_area(
                        &places[i, 0], &points[triangles[t, (k + 1) % 3], 0], &points[triangles[t, (k + 2) % 3], 0],
                    ) / area
                    if share[k] < share[worst]:
                        worst = k
                beyond = twins[t, worst]
                if share[worst] >= -1e-12 or beyond < 0:
                    break
                t = beyond // 3
            found[i] = t
            for k in range(3):
                shares[i, k] = share[k]

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over triangulations of the sphere: insertion, flips, moments of their dual cells, and descent.

`mesh` is a `SphereTriangulation` of N vertices and T = 2 N - 4 triangles. Passes that several threads share fill the rows
start..stop of what they are given.
"""
import numpy as np

from libc.math cimport cos, sqrt
from libc.stdint cimport int32_t, uint8_t

from cvtimg.halfedges.half_edges cimport half_edges, next_edge, seen, squared_distance

cdef extern from "delaunay.h" nogil:
    ctypedef int edge_test(const half_edges *mesh, const double *values, int32_t e)
    ctypedef void edge_update(const half_edges *mesh, double *values, int32_t e)
    int should_flip(const half_edges *mesh, const double *arcs, int32_t e)
    int may_flip(const half_edges *mesh, const double *arcs, int32_t e)
    void update_arcs(const half_edges *mesh, double *arcs, int32_t e)
    Py_ssize_t flip_waiting(
        half_edges *mesh, double *arcs, edge_test should_flip, edge_update update, int32_t *stack, uint8_t *waiting,
        int32_t depth, Py_ssize_t most,
    )

cdef extern from "insertion.h" nogil:
    void start_from_four(half_edges *mesh, const int32_t *four)
    int32_t find_triangle(
        const half_edges *mesh, int32_t n_triangles, int32_t t, const double *inside, const double *place,
    )
    Py_ssize_t insert_vertex(
        half_edges *mesh, int32_t n_triangles, int32_t t, int32_t vertex, int32_t *stack, Py_ssize_t most,
    )

cdef extern from "dual_cells.h" nogil:
    void circumcenter(const half_edges *mesh, int32_t t, double *center)
    bint half_arcs(const half_edges *mesh, int32_t t, double *arcs)
    void uniform_moment(const half_edges *mesh, const double *arcs, int32_t first, double *moment)
    void weighted_moment(
        const half_edges *mesh, const double *centers, const double *at_points, const double *at_centers,
        int32_t first, double *mass, double *moment, double *energy,
    )

cdef extern from "corners.h" nogil:
    int add_corner_slopes(
        const half_edges *mesh, int32_t t, double least_cosine, double largest_cosine, double *slopes,
    )

#: M_PI is not standard C, and not in the headers for Windows.
cdef double PI = 3.141592653589793


def insert(mesh, const int32_t[::1] order, const double[::1] inside, double least, Py_ssize_t most):
    """Insert the points of a mesh in an order (N,); return how many, fewer than N where one is too near to others.

    The first three of the first four are counterclockwise from outside, and `inside` is in their tetrahedron; `least` is
    the least squared distance of points, and `most` the flips for one point. Triangles and twins are filled.
    """
    cdef half_edges c_mesh = seen(mesh)
    cdef int32_t[::1] stack = np.empty(mesh.triangles.size, np.int32)
    cdef int32_t n = 4, t = 0, n_triangles = 4
    cdef int k
    cdef bint too_near = False
    with nogil:
        start_from_four(&c_mesh, &order[0])
        while n < order.shape[0]:
            t = find_triangle(&c_mesh, n_triangles, t, &inside[0], c_mesh.points + 3 * <Py_ssize_t>order[n])
            if t < 0:
                break
            for k in range(3):
                too_near |= squared_distance(
                    c_mesh.points + 3 * <Py_ssize_t>order[n], c_mesh.points + 3 * <Py_ssize_t>c_mesh.vertices[3 * t + k]
                ) < least
            if too_near or insert_vertex(&c_mesh, n_triangles, t, order[n], &stack[0], most) < 0:
                break
            n_triangles += 2
            n += 1
    return n


def fill_half_arcs(
    const double[:, ::1] points, const int32_t[:, ::1] triangles, double[:, ::1] arcs, Py_ssize_t start, Py_ssize_t stop
):
    """For each edge (T, 3), compute the arc from its middle to the circumcenter of its triangle, by its length.

    Returns how many triangles do not turn counterclockwise.
    """
    cdef half_edges c_mesh
    cdef int32_t t
    cdef Py_ssize_t n_turned = 0
    c_mesh.points, c_mesh.vertices = &points[0, 0], <int32_t *>&triangles[0, 0]
    with nogil:
        for t in range(<int32_t>start, <int32_t>stop):
            n_turned += not half_arcs(&c_mesh, t, &arcs[0, 0])
    return n_turned


def find_wrong(mesh, const double[:, ::1] arcs, uint8_t[::1] wrong, Py_ssize_t start, Py_ssize_t stop):
    """Mark edges (3 T,) of triangles that are not Delaunay, each once; return how many."""
    cdef half_edges c_mesh = seen(mesh)
    cdef int32_t e
    cdef Py_ssize_t n_wrong = 0
    with nogil:
        for e in range(<int32_t>(3 * start), <int32_t>(3 * stop)):
            wrong[e] = may_flip(&c_mesh, &arcs[0, 0], e) and c_mesh.twins[e] > e and should_flip(
                &c_mesh, &arcs[0, 0], e
            )
            n_wrong += wrong[e]
    return n_wrong


def flip(mesh, double[:, ::1] arcs, uint8_t[::1] wrong, int32_t[::1] firsts, Py_ssize_t most):
    """Flip edges that are wrong (3 T,) until none is; keep an edge from each vertex (N,); tell if `most` were enough."""
    cdef half_edges c_mesh = seen(mesh)
    cdef int32_t[::1] stack = np.empty(wrong.shape[0], np.int32)
    cdef int32_t e, depth = 0
    cdef Py_ssize_t n_flips
    c_mesh.outgoing = &firsts[0]
    with nogil:
        for e in range(<int32_t>wrong.shape[0]):
            if wrong[e]:
                stack[depth] = e
                depth += 1
        n_flips = flip_waiting(
            &c_mesh, &arcs[0, 0], should_flip, update_arcs, &stack[0], &wrong[0], depth, most,
        )
    return n_flips <= most


def fill_circumcenters(mesh, double[:, ::1] centers, Py_ssize_t start, Py_ssize_t stop):
    """Compute the centers (T, 3) of circumscribed caps: unit vectors."""
    cdef half_edges c_mesh = seen(mesh)
    cdef int32_t t
    with nogil:
        for t in range(<int32_t>start, <int32_t>stop):
            circumcenter(&c_mesh, t, &centers[t, 0])


def sum_uniform(
    mesh, const double[:, ::1] arcs, const int32_t[::1] firsts, double[:, ::1] moments, Py_ssize_t start, Py_ssize_t stop
):
    """Integrate x over cells, exactly: (N, 3)."""
    cdef half_edges c_mesh = seen(mesh)
    cdef Py_ssize_t i
    with nogil:
        for i in range(start, stop):
            uniform_moment(&c_mesh, &arcs[0, 0], firsts[i], &moments[i, 0])


def sum_weighted(
    mesh,
    const double[:, ::1] centers,
    const int32_t[::1] firsts,
    const double[::1] at_points,
    const double[::1] at_centers,
    double[::1] masses,
    double[:, ::1] moments,
    double[::1] energies,
    Py_ssize_t start,
    Py_ssize_t stop,
):
    """Integrate a density, that times x, and that times the squared distance to the vertex, over cells."""
    cdef half_edges c_mesh = seen(mesh)
    cdef Py_ssize_t i
    with nogil:
        for i in range(start, stop):
            weighted_moment(
                &c_mesh, &centers[0, 0], &at_points[0], &at_centers[0], firsts[i], &masses[i], &moments[i, 0],
                &energies[i],
            )


def find_corners(mesh, double least_cosine, double largest_cosine, uint8_t[::1] out, Py_ssize_t start, Py_ssize_t stop):
    """Mark triangles (T,) with angles out of bounds; return how many."""
    cdef half_edges c_mesh = seen(mesh)
    cdef int32_t t
    cdef Py_ssize_t n_out = 0
    with nogil:
        for t in range(<int32_t>start, <int32_t>stop):
            out[t] = add_corner_slopes(&c_mesh, t, least_cosine, largest_cosine, NULL)
            n_out += out[t]
    return n_out


def sum_corner_slopes(mesh, double least_cosine, double largest_cosine, const uint8_t[::1] out):
    """Sum the slopes (N, 3) of what angles out of bounds cost, in triangles that are marked (T,)."""
    cdef half_edges c_mesh = seen(mesh)
    cdef double[:, ::1] slopes = np.zeros(mesh.points.shape)
    cdef int32_t t
    with nogil:
        for t in range(<int32_t>out.shape[0]):
            if out[t]:
                add_corner_slopes(&c_mesh, t, least_cosine, largest_cosine, &slopes[0, 0])
    return np.asarray(slopes)


def limit_growth(
    double[:, ::1] sizes,          # INOUT (H, W): sizes at the pixels of a picture of the globe
    double growth,                 # IN: of sizes for each radian
):
    """Lower sizes, until they grow by no more than this from each pixel to the eight around, across the date line too."""
    cdef Py_ssize_t height = sizes.shape[0], width = sizes.shape[1], row, i, j, x, left, right, step
    cdef double along, across = PI / height, slant, least
    cdef bint changed = True
    with nogil:
        while changed:
            changed = False
            for step in range(-1, 2, 2):  # with rows, and against them
                for i in range(height):
                    row = i if step > 0 else height - 1 - i
                    along = across * cos(PI * (0.5 - (row + 0.5) / height))
                    slant = sqrt(along * along + across * across)
                    for j in range(2 * width):  # twice around, so that what is beyond the date line counts
                        x = (j if step > 0 else 2 * width - 1 - j) % width
                        left, right = (x - 1 + width) % width, (x + 1) % width
                        least = sizes[row, left if step > 0 else right] + growth * along
                        if 0 <= row - step < height:
                            least = min(least, sizes[row - step, x] + growth * across)
                            least = min(least, sizes[row - step, left] + growth * slant)
                            least = min(least, sizes[row - step, right] + growth * slant)
                        if least < sizes[row, x]:
                            changed = True
                            sizes[row, x] = least

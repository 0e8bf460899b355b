# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over triangulations of the sphere: flips, moments of their dual cells, and descent.

`mesh` is a `SphereTriangulation` of N vertices and T = 2 N - 4 triangles. Passes that several threads share fill the rows
start..stop of what they are given.
"""
import numpy as np

from libc.math cimport sqrt
from libc.stdint cimport int32_t, uint8_t

from cvtimg.halfedges.half_edges cimport half_edges, seen

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

cdef extern from "dual_cells.h" nogil:
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


cdef inline double square3(const double *vector) noexcept nogil:
    return vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]


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


def level(
    const double[:, ::1] points, double[:, ::1] moments, double[::1] masses, at_points, double[::1] areas, free,
    Py_ssize_t start, Py_ssize_t stop,
):
    """Take the parts along points out of moments (N, 3); return the sum of these, and that of the squared distances to
    centers of mass, by areas, of points that are free (N,) or all; the others have no moments then.

    Areas are filled in: masses by the density at points; without one, the lengths of moments, which are masses then.
    """
    cdef const double[::1] density = at_points
    cdef const uint8_t[::1] marks = free
    cdef bint is_uniform = density is None, are_all = marks is None
    cdef Py_ssize_t i, k
    cdef double along, all_along = 0, squares = 0
    cdef double *moment
    with nogil:
        for i in range(start, stop):
            moment = &moments[i, 0]
            along = moment[0] * points[i, 0] + moment[1] * points[i, 1] + moment[2] * points[i, 2]
            if is_uniform:
                masses[i] = areas[i] = sqrt(square3(moment))
            else:
                areas[i] = masses[i] / density[i]
            for k in range(3):
                moment[k] = moment[k] - along * points[i, k] if are_all or marks[i] else 0
            all_along += along
            squares += square3(moment) / (masses[i] * masses[i] * areas[i])
    return all_along, squares


def move(
    const double[:, ::1] points, const double[:, ::1] steps, const double[::1] areas, double part, double longest,
    double[:, ::1] there, Py_ssize_t start, Py_ssize_t stop,
):
    """Move points (N, 3) by a part of steps, which are shortened to `longest` times the roots of areas."""
    cdef Py_ssize_t i, k
    cdef double factor, length
    with nogil:
        for i in range(start, stop):
            factor = part * longest / max(longest, sqrt(square3(&steps[i, 0]) / areas[i]))
            for k in range(3):
                there[i, k] = points[i, k] + factor * steps[i, k]
            length = sqrt(square3(&there[i, 0]))
            for k in range(3):
                there[i, k] /= length


def find_corners(mesh, double least_cosine, double largest_cosine, uint8_t[::1] out, Py_ssize_t first):
    """Mark triangles from `first` on (T,) with angles out of bounds."""
    cdef half_edges c_mesh = seen(mesh)
    cdef Py_ssize_t i
    with nogil:
        for i in range(out.shape[0]):
            out[i] = add_corner_slopes(&c_mesh, <int32_t>(first + i), least_cosine, largest_cosine, NULL)


def sum_corner_slopes(mesh, double least_cosine, double largest_cosine, const int32_t[::1] out):
    """Sum the slopes (N, 3) of what angles out of bounds cost in some triangles (T,)."""
    cdef half_edges c_mesh = seen(mesh)
    cdef double[:, ::1] slopes = np.zeros(mesh.points.shape)
    cdef Py_ssize_t i
    with nogil:
        for i in range(out.shape[0]):
            add_corner_slopes(&c_mesh, out[i], least_cosine, largest_cosine, &slopes[0, 0])
    return np.asarray(slopes)

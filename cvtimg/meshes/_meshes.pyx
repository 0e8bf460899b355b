# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over triangulations of the plane and over sizes.

`mesh` is a `PlaneTriangulation` of N vertices and T triangles. A metric has xx, xy and yy in a row.
"""
import numpy as np

from libc.stdint cimport int32_t, uint8_t

from cvtimg.halfedges.half_edges cimport flip_all, half_edges, seen

cdef extern from "delaunay.h" nogil:
    double twice_area(const double *a, const double *b, const double *c)
    int may_flip(const half_edges *mesh, const double *metric, int32_t e)
    int should_flip(const half_edges *mesh, const double *metric, int32_t e)

cdef extern from "cell_moments.h" nogil:
    struct c_sums "sums":
        double *inertia
        double *pull
        double energy

    void add_triangle(const half_edges *mesh, const double *metric, int32_t t, c_sums *sums)

cdef extern from "quality.h" nogil:
    void smooth_vertex(half_edges *mesh, double *place, int32_t vertex, int power)
    bint step_to_even(
        const half_edges *mesh, const double *worth, int32_t vertex, const double *tangent, double mean, double share,
        double *step,
    )


cdef half_edges with_borders(mesh) except *:
    cdef half_edges found = seen(mesh)
    cdef uint8_t[:, ::1] borders = mesh.borders
    cdef int32_t[::1] outgoing = mesh.outgoing
    found.borders = &borders[0, 0]
    found.outgoing = &outgoing[0]
    return found


def flip(mesh, const double[:, ::1] metric, Py_ssize_t most):
    """Flip edges until the triangulation is constrained Delaunay, or `most`; metric (N, 3), None for the Euclidean."""
    cdef half_edges c_mesh = with_borders(mesh)
    cdef int32_t n_edges = <int32_t>mesh.triangles.size
    cdef int32_t[::1] stack = np.empty(n_edges, np.int32)
    cdef uint8_t[::1] waiting = np.zeros(n_edges, np.uint8)
    cdef const double *given = NULL if metric is None else &metric[0, 0]
    with nogil:
        flip_all(&c_mesh, <double *>given, may_flip, should_flip, n_edges, &stack[0], &waiting[0], most)


def sum_cells(mesh, const double[:, ::1] metric):
    """Sum the moments of cells in a metric (N, 3).

    Returns the energy, the mass times the metric (N, 3), and that times the step from vertex to centroid (N, 2).
    """
    cdef half_edges c_mesh = with_borders(mesh)
    cdef double[:, ::1] inertia = np.zeros((metric.shape[0], 3))
    cdef double[:, ::1] pull = np.zeros((metric.shape[0], 2))
    cdef c_sums sums
    cdef int32_t t, n_triangles = <int32_t>len(mesh.triangles)
    sums.inertia = &inertia[0, 0]
    sums.pull = &pull[0, 0]
    sums.energy = 0
    with nogil:
        for t in range(n_triangles):
            add_triangle(&c_mesh, &metric[0, 0], t, &sums)
    return sums.energy, np.asarray(inertia), np.asarray(pull)


def even(mesh, const double[::1] worth, const uint8_t[::1] fixed, double[:, ::1] steps, double mean, double share):
    """Move vertices one after the other, so that edges get nearer to a mean length squared, by a share of the way.

    Squared lengths are multiplied by the mean of `worth` (N,) at both ends. Vertices that slide, marked 2 in `fixed`, do
    not move: `steps` (N, 2) has their tangents, and gets the steps to make.
    """
    cdef half_edges c_mesh = with_borders(mesh)
    cdef double[:, ::1] points = mesh.points
    cdef int32_t vertex
    cdef double step[2]
    with nogil:
        for vertex in range(<int32_t>points.shape[0]):
            if fixed[vertex] == 1:
                continue
            if not step_to_even(
                &c_mesh, &worth[0], vertex, &steps[vertex, 0] if fixed[vertex] == 2 else NULL, mean, share, step
            ):
                step[0] = step[1] = 0
            if fixed[vertex] == 2:
                steps[vertex, 0] = step[0]
                steps[vertex, 1] = step[1]
            else:
                points[vertex, 0] += step[0]
                points[vertex, 1] += step[1]


def smooth(mesh, const uint8_t[::1] fixed, int power):
    """Move vertices one after the other, so that the triangles around become more equilateral.

    The larger the power, the more the worst triangle counts.
    """
    cdef half_edges c_mesh = with_borders(mesh)
    cdef double[:, ::1] points = mesh.points
    cdef int32_t vertex
    with nogil:
        for vertex in range(<int32_t>points.shape[0]):
            if not fixed[vertex]:
                smooth_vertex(&c_mesh, &points[vertex, 0], vertex, power)


def locate(mesh, const double[:, ::1] places, int32_t[::1] found):
    """Walk from triangles (M,) to those that hold places (M, 2), or to the last ones on the way.

    From -1, the walk begins where the one to the place before ended. Returns the barycentric coordinates (M, 3) there,
    < 0 outside; `found` becomes the triangles.
    """
    cdef const double[:, ::1] points = mesh.points
    cdef const int32_t[:, ::1] triangles = mesh.triangles
    cdef const int32_t[:, ::1] twins = mesh.twins
    cdef double[:, ::1] shares = np.empty((places.shape[0], 3))
    cdef Py_ssize_t i, steps, most = 3 * triangles.shape[0]
    cdef int32_t t = 0, k, worst, beyond
    cdef double area, share[3]
    with nogil:
        for i in range(places.shape[0]):
            if found[i] >= 0:
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
                beyond = twins[t, (worst + 1) % 3]
                if share[worst] >= -1e-12 or beyond < 0:
                    break
                t = beyond // 3
            found[i] = t
            for k in range(3):
                shares[i, k] = share[k]
    return np.asarray(shares)

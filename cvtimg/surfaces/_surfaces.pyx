# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over closed triangulated surfaces: collapses, flips, moments of cells, and nearest points.

Nothing here allocates, checks its arguments or decides. Each argument is marked IN, OUT or INOUT. N is the number of
vertices, T that of triangles. Half-edge 3 t + k leads from corner k of triangle t to the next one, counterclockwise
from outside; its twin leads back.
"""
from libc.stdint cimport int32_t, uint8_t

cdef extern from "geometry.h" nogil:
    struct c_mesh "globe":
        const double *points
        int32_t *vertices
        int32_t *twins

    double squared_distance(const double *a, const double *b)
    int32_t end_of(const c_mesh *mesh, int32_t e)
    int collapse_edge(c_mesh *mesh, const double *normals, double most, int32_t e)
    Py_ssize_t flip_surface(
        c_mesh *mesh, const double *normals, int32_t n_edges, Py_ssize_t most, int32_t *stack, uint8_t *waiting,
    )
    int faces_outward(const double *points, const double *normals, const int32_t *corners, double cosine)
    void add_kites(const c_mesh *mesh, const double *density, int32_t t, double *masses, double *pulls)
    int32_t walk_to_nearest(const c_mesh *mesh, int32_t t, double *place)


cdef c_mesh as_mesh(const double[:, ::1] points, int32_t[:, ::1] triangles, int32_t[:, ::1] twins) noexcept:
    cdef c_mesh mesh
    mesh.points = &points[0, 0]
    mesh.vertices = &triangles[0, 0]
    mesh.twins = &twins[0, 0]
    return mesh


def collapse(
    const double[:, ::1] points,   # IN (N, 3)
    const double[:, ::1] normals,  # IN (N, 3): of the surface, of one length
    const double[::1] sizes,       # IN (N,): wanted length of edges
    double part,                   # IN: edges shorter than this part of it are collapsed
    double stretch,                # IN: new edges are no longer than this multiple of that
    Py_ssize_t most,               # IN: collapses at most
    int32_t[:, ::1] triangles,     # INOUT (T, 3): -1 where a triangle is removed
    int32_t[:, ::1] twins,         # INOUT (T, 3)
):
    """Collapse short edges, each to one of its ends; return how many."""
    cdef c_mesh mesh = as_mesh(points, triangles, twins)
    cdef int32_t e, a, b
    cdef Py_ssize_t n = 0
    cdef double limit
    with nogil:
        for e in range(<int32_t>(3 * triangles.shape[0])):
            if n == most:
                break
            a = mesh.vertices[e]
            if a < 0:
                continue
            b = end_of(&mesh, e)
            limit = part * (sizes[a] + sizes[b]) / 2
            if squared_distance(&points[a, 0], &points[b, 0]) < limit * limit:
                n += collapse_edge(&mesh, &normals[0, 0], stretch * limit, e)
    return n


def flip(
    const double[:, ::1] points,   # IN (N, 3)
    const double[:, ::1] normals,  # IN (N, 3): of the surface, of one length
    int32_t[:, ::1] triangles,     # INOUT (T, 3)
    int32_t[:, ::1] twins,         # INOUT (T, 3)
    Py_ssize_t most,               # IN: flips at most
    int32_t[::1] stack,            # scratch (3 T,)
    uint8_t[::1] waiting,          # scratch (3 T,)
):
    """Flip edges until no two opposite angles add up to more than 180 degrees; return how many."""
    cdef c_mesh mesh = as_mesh(points, triangles, twins)
    cdef Py_ssize_t n_flips
    with nogil:
        n_flips = flip_surface(
            &mesh, &normals[0, 0], <int32_t>(3 * triangles.shape[0]), most, &stack[0], &waiting[0],
        )
    return n_flips


def find_inward(
    const double[:, ::1] points,   # IN (N, 3)
    const double[:, ::1] normals,  # IN (N, 3): of the surface, of one length
    const int32_t[:, ::1] triangles,  # IN (T, 3)
    uint8_t[::1] wrong,            # OUT (N,): whether a triangle of the vertex faces inward
):
    """Find triangles that do not face where the surface does at their corners; return how many."""
    cdef int32_t t, k, n = 0
    wrong[:] = 0
    with nogil:
        for t in range(<int32_t>triangles.shape[0]):
            if faces_outward(&points[0, 0], &normals[0, 0], &triangles[t, 0], 0):
                continue
            n += 1
            for k in range(3):
                wrong[triangles[t, k]] = 1
    return n


def sum_cells(
    const double[:, ::1] points,   # IN (N, 3)
    const double[::1] density,     # IN (N,)
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # IN (T, 3)
    double[::1] masses,            # OUT (N,)
    double[:, ::1] pulls,          # OUT (N, 3): mass times the step from the vertex to the centroid
):
    """Sum the moments of the cells, triangle by triangle, each in its plane."""
    cdef c_mesh mesh = as_mesh(points, triangles, twins)
    cdef int32_t t
    masses[:] = 0
    pulls[:] = 0
    with nogil:
        for t in range(<int32_t>triangles.shape[0]):
            add_kites(&mesh, &density[0], t, &masses[0], &pulls[0, 0])


def nearest(
    const double[:, ::1] points,   # IN (N, 3)
    int32_t[:, ::1] triangles,     # IN (T, 3)
    int32_t[:, ::1] twins,         # IN (T, 3)
    Py_ssize_t start,              # IN: the first place
    Py_ssize_t stop,               # IN: the end of places
    double[:, ::1] places,         # INOUT (M, 3)
    int32_t[::1] faces,            # INOUT (M,): where to begin; the triangle of each place
):
    """Move places to the nearest points of the surface around where they were."""
    cdef c_mesh mesh = as_mesh(points, triangles, twins)
    cdef Py_ssize_t i
    with nogil:
        for i in range(start, stop):
            faces[i] = walk_to_nearest(&mesh, faces[i], &places[i, 0])

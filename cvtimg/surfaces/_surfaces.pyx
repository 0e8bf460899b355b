# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over triangulated surfaces: collapses, flips, moments of cells, and nearest points.

`mesh` is a `SurfaceTriangulation` of N vertices and T triangles; `normals` (N, 3) are of the surface, of one length.
"""
import numpy as np

from libc.stdint cimport int32_t, uint8_t

from cvtimg.halfedges.half_edges cimport end_of, flip_all, half_edges, seen, squared_distance

cdef extern from "geometry.h" nogil:
    int may_turn(const half_edges *mesh, const double *normals, int32_t e)
    int should_turn(const half_edges *mesh, const double *normals, int32_t e)
    int collapse_edge(half_edges *mesh, const double *normals, double most, int32_t e, int back)
    int faces_outward(const double *points, const double *normals, const int32_t *corners, double cosine)
    void add_kites(const half_edges *mesh, const double *density, int32_t t, double *masses, double *pulls)
    int32_t walk_to_nearest(const half_edges *mesh, int32_t t, double *place)


def collapse(
    mesh, const double[:, ::1] normals, const double[::1] sizes, const uint8_t[::1] ranks, double part, double stretch,
    Py_ssize_t most
):
    """Collapse edges shorter than a part of the wanted sizes (N,), each to one of its ends; return how many.

    Vertices have ranks: at most `most` of rank 0 vanish, those of rank 1 along the boundary, those of rank 2 stay. The
    number of the others is returned second. New edges are no longer than `stretch` times that part; triangles that are
    removed become -1.
    """
    cdef half_edges c_mesh = seen(mesh)
    cdef int32_t e, a, b, n_edges = <int32_t>mesh.triangles.size
    cdef Py_ssize_t n = 0, n_on_boundary = 0
    cdef double limit
    with nogil:
        for e in range(n_edges):
            a = c_mesh.vertices[e]
            if a < 0:
                continue
            b = end_of(&c_mesh, e)
            limit = part * (sizes[a] + sizes[b]) / 2
            if squared_distance(c_mesh.points + 3 * <Py_ssize_t>a, c_mesh.points + 3 * <Py_ssize_t>b) >= limit * limit:
                continue
            if ranks[a] == 0:
                if n < most:
                    n += collapse_edge(&c_mesh, &normals[0, 0], stretch * limit, e, 0)
            elif c_mesh.twins[e] < 0 and (ranks[a] == 1 or ranks[b] == 1):
                n_on_boundary += collapse_edge(&c_mesh, &normals[0, 0], stretch * limit, e, ranks[a] != 1)
    return n, n_on_boundary


def flip(mesh, const double[:, ::1] normals, Py_ssize_t most):
    """Flip edges until no two opposite angles add up to more than 180 degrees, or `most`."""
    cdef half_edges c_mesh = seen(mesh)
    cdef int32_t n_edges = <int32_t>mesh.triangles.size
    cdef int32_t[::1] stack = np.empty(n_edges, np.int32)
    cdef uint8_t[::1] waiting = np.zeros(n_edges, np.uint8)
    with nogil:
        flip_all(&c_mesh, <double *>&normals[0, 0], may_turn, should_turn, n_edges, &stack[0], &waiting[0], most)


def find_inward(mesh, const double[:, ::1] points, const double[:, ::1] normals):
    """Find the vertices (N,), moved to points, of triangles that do not face where the surface does at their corners."""
    cdef uint8_t[::1] wrong = np.zeros(points.shape[0], np.uint8)
    cdef const int32_t[:, ::1] triangles = mesh.triangles
    cdef int32_t t, k
    with nogil:
        for t in range(<int32_t>triangles.shape[0]):
            if not faces_outward(&points[0, 0], &normals[0, 0], &triangles[t, 0], 0):
                for k in range(3):
                    wrong[triangles[t, k]] = 1
    return np.asarray(wrong).view(np.bool_)


def sum_cells(mesh, const double[::1] density):
    """Sum the moments of cells: masses (N,), and these times the steps from vertices to centroids (N, 3)."""
    cdef half_edges c_mesh = seen(mesh)
    cdef double[::1] masses = np.zeros(density.shape[0])
    cdef double[:, ::1] pulls = np.zeros((density.shape[0], 3))
    cdef int32_t t, n_triangles = <int32_t>len(mesh.triangles)
    with nogil:
        for t in range(n_triangles):
            add_kites(&c_mesh, &density[0], t, &masses[0], &pulls[0, 0])
    return np.asarray(masses), np.asarray(pulls)


def walk(mesh, double[:, ::1] places, int32_t[::1] faces, Py_ssize_t start, Py_ssize_t stop):
    """Move places (M, 3) to the nearest points of the surface around faces (M,), which become those of the places."""
    cdef half_edges c_mesh = seen(mesh)
    cdef Py_ssize_t i
    with nogil:
        for i in range(start, stop):
            faces[i] = walk_to_nearest(&c_mesh, faces[i], &places[i, 0])

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled pass that joins triangles."""
import numpy as np

from libc.stdint cimport int32_t

from cvtimg.halfedges.half_edges cimport next_edge


def find_twins(const int32_t[:, ::1] triangles, Py_ssize_t n_points):
    """Find the half-edge that leads back along each one, (T, 3); -1 if there is none, or the edge has more than two."""
    cdef int32_t[:, ::1] twins = np.empty((triangles.shape[0], 3), np.int32)
    cdef int32_t[::1] heads = np.full(n_points, -1, np.int32)  # a list of the half-edges out of each vertex
    cdef int32_t[::1] following = np.empty(3 * triangles.shape[0], np.int32)
    cdef int32_t e, f, found, n_edges = <int32_t>(3 * triangles.shape[0])
    cdef const int32_t *vertices
    if n_edges:
        vertices = &triangles[0, 0]
        with nogil:
            for e in range(n_edges):
                following[e] = heads[vertices[e]]
                heads[vertices[e]] = e
            for e in range(n_edges):
                f = heads[vertices[next_edge(e)]]
                found = -1
                while f >= 0:
                    if vertices[next_edge(f)] == vertices[e]:
                        if found >= 0:
                            found = -1
                            break
                        found = f
                    f = following[f]
                twins[e // 3, e % 3] = found
            for e in range(n_edges):  # of three, one has found none, and the others that one
                f = twins[e // 3, e % 3]
                if f >= 0 and twins[f // 3, f % 3] != e:
                    twins[e // 3, e % 3] = -1
    return np.asarray(twins)

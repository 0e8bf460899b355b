"""What kernels know of half-edges."""
from libc.stdint cimport int32_t, uint8_t

cdef extern from "half_edges.h" nogil:
    struct half_edges:
        const double *points
        int32_t *vertices
        int32_t *twins
        uint8_t *borders
        int32_t *outgoing

    ctypedef int edge_test(const half_edges *mesh, const double *values, int32_t e)
    int32_t end_of(const half_edges *mesh, int32_t e)
    double squared_distance(const double *a, const double *b)
    Py_ssize_t flip_all(
        half_edges *mesh, double *values, edge_test may_flip, edge_test should_flip, int32_t n_edges, int32_t *stack,
        uint8_t *waiting, Py_ssize_t most,
    )


cdef inline half_edges seen(mesh) except *:
    """See a `cvtimg.halfedges.HalfEdges`, which must keep its arrays meanwhile."""
    cdef half_edges found
    cdef const double[:, ::1] points = mesh.points
    cdef const int32_t[:, ::1] triangles = mesh.triangles
    cdef const int32_t[:, ::1] twins = mesh.twins
    found.points = &points[0, 0]
    found.vertices = <int32_t *>&triangles[0, 0]
    found.twins = <int32_t *>&twins[0, 0]
    found.borders = NULL
    found.outgoing = NULL
    return found

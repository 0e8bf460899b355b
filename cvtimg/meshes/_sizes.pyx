# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled passes over sizes: limits of their growth, over pictures and along edges.

Nothing here allocates, checks its arguments or decides. Each argument is marked IN, OUT or INOUT.
"""
from libc.stdint cimport int32_t


cdef extern from "picture_sizes.h" nogil:
    void limit_sizes(float *sizes, Py_ssize_t height, Py_ssize_t width, float straight, float aslant)


def limit_picture(
    float[:, ::1] sizes,   # INOUT (H, W)
    float straight,        # IN: how much sizes may grow from a pixel to the next
    float aslant,          # IN: and to the next one across a corner
):
    """Lower sizes to what all others allow, along the best way from pixel to pixel."""
    with nogil:
        limit_sizes(&sizes[0, 0], sizes.shape[0], sizes.shape[1], straight, aslant)


def limit_along_edges(
    double[::1] sizes,             # INOUT (N,)
    const int32_t[:, ::1] edges,   # IN (E, 2)
    const double[::1] growths,     # IN (E,): how much sizes may grow along each
):
    """Lower sizes to what neighbors allow, over all edges forth and back. Return whether any changed."""
    cdef Py_ssize_t e, n = edges.shape[0]
    cdef bint changed = False
    cdef int32_t a, b
    with nogil:
        for e in range(2 * n):
            a = edges[e if e < n else 2 * n - 1 - e, 0]
            b = edges[e if e < n else 2 * n - 1 - e, 1]
            if sizes[b] > sizes[a] + growths[e if e < n else 2 * n - 1 - e]:
                sizes[b] = sizes[a] + growths[e if e < n else 2 * n - 1 - e]
                changed = True
            elif sizes[a] > sizes[b] + growths[e if e < n else 2 * n - 1 - e]:
                sizes[a] = sizes[b] + growths[e if e < n else 2 * n - 1 - e]
                changed = True
    return changed


def interpolate_picture(
    const float[:, ::1] values,    # IN (H, W)
    const double[:, ::1] places,   # IN (M, 2): x, y in pixels
    double[::1] found,             # OUT (M,)
):
    """Interpolate bilinearly between the centers of pixels; beyond the outermost, values stay the same."""
    cdef Py_ssize_t i, x, y, right, below, height = values.shape[0], width = values.shape[1]
    cdef double u, v
    with nogil:
        for i in range(places.shape[0]):
            u = min(max(places[i, 0] - 0.5, 0), width - 1)
            v = min(max(places[i, 1] - 0.5, 0), height - 1)
            x = <Py_ssize_t>u
            y = <Py_ssize_t>v
            right = min(x + 1, width - 1)
            below = min(y + 1, height - 1)
            u -= x
            v -= y
            found[i] = (1 - v) * ((1 - u) * values[y, x] + u * values[y, right]) + v * (
                (1 - u) * values[below, x] + u * values[below, right]
            )

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loop of distances on the torus: one pass, over buffers that the caller owns.

Nothing here allocates, checks its arguments or decides when to stop; that is for the Python modules that call.
Each argument is marked IN, OUT or INOUT.
"""
from libc.stdint cimport int32_t
from libc.math cimport fabsf


def assign_on_torus(
    const float[:, ::1] samples,     # IN (m, d), in 0..1
    const float[:, ::1] generators,  # IN (d, n), in 0..1
    float[::1] squares,              # scratch (n,)
    int32_t[::1] labels,             # OUT (m,): the nearest generator, the first on a tie
):
    cdef Py_ssize_t dims = samples.shape[1], n = generators.shape[1], i, j, k, nearest
    cdef float place, apart, least
    with nogil:
        for i in range(samples.shape[0]):
            for k in range(n):
                squares[k] = 0
            for j in range(dims):
                place = samples[i, j]
                for k in range(n):
                    apart = fabsf(place - generators[j, k])
                    apart = min(apart, 1 - apart)
                    squares[k] += apart * apart
            nearest = 0
            least = squares[0]
            for k in range(1, n):
                if squares[k] < least:
                    least = squares[k]
                    nearest = k
            labels[i] = <int32_t>nearest

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loop behind contours: one walk along all cracks between pixels, over buffers that the caller owns.

A crack is the border between two adjacent pixels of different regions; cracks meet at pixel corners. Walked from a
corner in a direction it is the step 4 * corner + direction, where the directions are east, south, west and north.
"""
from libc.stdint cimport int64_t, uint8_t


def follow_rings(
    const uint8_t[::1] corners,  # IN (n_corners,) bits 0..3: a crack leaves in this direction; 4, 5: the pixels across
    #                              the corner that a walk east or west, south or north passes from are one region;
    #                              6: rings begin here rather than elsewhere
    Py_ssize_t width,            # IN corners in a row
    uint8_t[::1] steps_left,     # INOUT (n_corners,) steps that no ring has taken, bits 0..3 of `corners` at first
    int64_t[::1] path,           # OUT (n_steps,) steps, ring after ring
    int64_t[::1] starts,         # OUT (n_steps / 4,) where in the path each ring begins
):
    """Walk around every region with the region to the right, and return the number of rings.

    A walk keeps to pixels that share a side, except where one region touches itself across a corner: it goes
    straight over, so that no ring passes a corner twice.
    """
    cdef Py_ssize_t n_rings = 0, n_done = 0, first, corner
    cdef int sweep, direction, turn
    cdef Py_ssize_t[4] reach = [1, width, -1, -width]
    with nogil:
        for sweep in range(2):
            for first in range(corners.shape[0]):
                while steps_left[first] and (sweep or corners[first] & 64):
                    direction = 0
                    while not steps_left[first] >> direction & 1:
                        direction += 1
                    starts[n_rings] = n_done
                    n_rings += 1
                    corner = first
                    while steps_left[corner] >> direction & 1:
                        steps_left[corner] ^= 1 << direction
                        path[n_done] = 4 * corner + direction
                        n_done += 1
                        corner += reach[direction]
                        turn = 3 if corners[corner] & 16 << (direction & 1) else 1
                        while not corners[corner] >> (direction + turn & 3) & 1:
                            turn -= 1
                        direction = direction + turn & 3
    return n_rings

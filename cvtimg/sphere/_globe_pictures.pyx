# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled pass over pictures of the globe. Each argument is marked IN, OUT or INOUT."""
from libc.math cimport cos, sqrt

#: M_PI is not standard C, and not in the headers for Windows.
cdef double PI = 3.141592653589793


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

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of dithering: one pass each, over buffers that the caller owns.

Places have four coordinates here, the last of which may be 0 everywhere: one loop serves grey, color and alpha, and
processors add four floats at once. Each argument is marked IN, OUT or INOUT.
"""
from libc.math cimport sqrtf
from libc.stdint cimport int32_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.string cimport memcpy, memset

import numpy as np

DIMS = WIDTH

cdef enum:
    WIDTH = 4

cdef extern from *:
    uint64_t UINT64_MAX


cdef struct Box:
    float low[WIDTH]
    float high[WIDTH]


cdef inline uint32_t bits_of(float x) noexcept nogil:
    """Bits of a float >= 0, which sort like the floats."""
    cdef uint32_t bits
    memcpy(&bits, &x, sizeof(x))
    return bits


cdef inline float squared_distance(const float *a, const float *b) noexcept nogil:
    cdef float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2], w = a[3] - b[3]
    return (x * x + y * y) + (z * z + w * w)


cdef inline Py_ssize_t nearest(
    const float *place, const float *palette, const uint16_t *names, Py_ssize_t n_names
) noexcept nogil:
    """The nearest of the named entries; the first on a tie."""
    cdef uint64_t least = UINT64_MAX, key
    cdef Py_ssize_t i
    for i in range(n_names):
        key = <uint64_t>bits_of(squared_distance(place, palette + WIDTH * names[i])) << 32 | names[i]
        least = min(least, key)
    return <Py_ssize_t>(least & 0xFFFF)


cdef Py_ssize_t near_a_box(
    const Box *box, const float *palette, const uint16_t *names, Py_ssize_t n_names, uint16_t *near
) noexcept nogil:
    """Keep the entries that are nearest to some place in a box, and perhaps a few more; return how many.

    The entry nearest to the middle rules out every other that is farther away even from the corner of the box in its
    direction (Kanungo et al., IEEE Trans. PAMI 24, 2002, doi 10.1109/TPAMI.2002.1017616).
    """
    cdef float middle[WIDTH]
    cdef float step, corner, farther, scale
    cdef const float *other
    cdef const float *best
    cdef Py_ssize_t i, d, n_near = 0
    for d in range(WIDTH):
        middle[d] = <float>0.5 * (box.low[d] + box.high[d])
    best = palette + WIDTH * nearest(middle, palette, names, n_names)
    for i in range(n_names):
        other = palette + WIDTH * names[i]
        farther = scale = 0
        for d in range(WIDTH):
            step = other[d] - best[d]
            corner = box.high[d] if step > 0 else box.low[d]
            farther += step * (<float>0.5 * (other[d] + best[d]) - corner)
            scale += (other[d] - corner) * (other[d] - corner)
        near[n_near] = names[i]
        n_near += farther <= <float>1e-5 * scale  # kept when rounding leaves a doubt
    return n_near


cdef struct Cells:  # of a grid
    const float *palette
    int32_t *bounds         # (n_kinds, n_all, 2): first and last + 1 of the candidates of each cell
    uint16_t *candidates    # entries that are nearest to some place in a cell
    Py_ssize_t room, n_all  # for candidates; number of cells
    float low[WIDTH]        # lowest corner
    float sides[WIDTH]      # of a cell
    float per_unit[WIDTH]   # cells
    float outside[WIDTH]    # how much farther out the outermost cells reach
    int32_t n_cells[WIDTH]  # in each direction
    int32_t strides[WIDTH]  # steps from a cell to the next in each direction


cdef Py_ssize_t list_candidates(
    const Cells *grid, const int32_t *first, const int32_t *n_cells, const uint16_t *names, Py_ssize_t n_names,
    uint16_t *near, int32_t *bounds, Py_ssize_t at,
) noexcept nogil:
    """List the candidates of a box of cells, half by half; return where the list ends, possibly beyond its room."""
    cdef Box box
    cdef int32_t middle[WIDTH]
    cdef int32_t half[WIDTH]
    cdef int32_t rest[WIDTH]
    cdef Py_ssize_t cell = 0, widest = 0, d, i, n_near
    for d in range(WIDTH):
        # A little larger: rounding may put a place into a neighbor of its cell.
        box.low[d] = grid.low[d] + (first[d] - <float>0.03) * grid.sides[d]
        box.high[d] = grid.low[d] + (first[d] + n_cells[d] + <float>0.03) * grid.sides[d]
        if first[d] == 0:
            box.low[d] -= grid.outside[d]
        if first[d] + n_cells[d] == grid.n_cells[d]:
            box.high[d] += grid.outside[d]
        cell += first[d] * grid.strides[d]
        widest = d if n_cells[d] > n_cells[widest] else widest
        middle[d], half[d], rest[d] = first[d], n_cells[d], n_cells[d]
    n_near = near_a_box(&box, grid.palette, names, n_names, near)
    if n_cells[widest] > 1:
        half[widest] = n_cells[widest] // 2
        middle[widest] += half[widest]
        rest[widest] -= half[widest]
        at = list_candidates(grid, first, half, near, n_near, near + n_near, bounds, at)
        return list_candidates(grid, middle, rest, near, n_near, near + n_near, bounds, at)
    for i in range(min(n_near, grid.room - at)):
        grid.candidates[at + i] = near[i]
    bounds[2 * cell], bounds[2 * cell + 1] = <int32_t>at, <int32_t>(at + n_near)
    return at + n_near


cdef class Grid:
    """A box cut into cells that know the entries of a palette that can be nearest in them."""

    cdef Cells cells
    cdef object arrays  # kept alive

    def __init__(
        self,
        const float[:, ::1] palette,  # (K, 4)
        const uint8_t[:, ::1] allowed,  # (n_kinds, K): whether a kind of color may take an entry
        const float[:, ::1] form,     # (3, 4): lowest corner, sides of a cell, how much farther the outermost reach
        const int32_t[::1] n_cells,   # (4,): in each direction
    ):
        cdef Py_ssize_t kind, at = 0, d
        cdef int32_t[:, :, ::1] bounds
        cdef uint16_t[::1] candidates, names, scratch
        cdef int32_t[WIDTH] origin = [0, 0, 0, 0]
        self.cells.palette, self.cells.n_all, self.cells.room = &palette[0, 0], 1, 0
        for d in range(WIDTH - 1, -1, -1):
            self.cells.low[d], self.cells.sides[d], self.cells.outside[d] = form[0, d], form[1, d], form[2, d]
            self.cells.per_unit[d] = 1 / form[1, d] if form[1, d] > 0 else 0
            self.cells.n_cells[d], self.cells.strides[d] = n_cells[d], <int32_t>self.cells.n_all
            self.cells.n_all *= n_cells[d]
        bounds = np.empty((len(allowed), self.cells.n_all, 2), np.int32)
        # The boxes of cells that one cell is in, each with its near entries.
        scratch = np.empty((2 + WIDTH + int(self.cells.n_all).bit_length()) * len(palette), np.uint16)
        while at >= self.cells.room:  # once, and again if there was too little room
            self.cells.room = max(4 * bounds.size, at + 1)
            candidates = np.empty(self.cells.room, np.uint16)
            self.cells.candidates, at = &candidates[0], 0
            for kind in range(len(allowed)):
                names = np.flatnonzero(allowed[kind]).astype(np.uint16)
                at = list_candidates(
                    &self.cells, origin, self.cells.n_cells, &names[0], len(names), &scratch[0], &bounds[kind, 0, 0], at
                )  # fmt: skip
        self.cells.bounds = &bounds[0, 0, 0]
        self.arrays = palette, bounds, candidates


cdef inline Py_ssize_t look_up(const Cells *grid, const float *place, Py_ssize_t kind) noexcept nogil:
    """The nearest entry that a kind of color may take, the first on a tie, for a place in reach of the grid."""
    cdef Py_ssize_t cell = kind * grid.n_all, d
    cdef int32_t at
    cdef const int32_t *bounds
    for d in range(WIDTH):
        at = <int32_t>((place[d] - grid.low[d]) * grid.per_unit[d])
        cell += max(0, min(at, grid.n_cells[d] - 1)) * grid.strides[d]
    bounds = grid.bounds + 2 * cell
    return nearest(place, grid.palette, grid.candidates + bounds[0], bounds[1] - bounds[0])


cdef inline void miss(
    const float *place, const float *entry, float strength, float most, float *missed
) noexcept nogil:
    """The error handed on: the fraction `strength` of the step from an entry to a place, shortened to `most`."""
    cdef float squared = squared_distance(place, entry)
    if squared > most * most:
        strength *= most / sqrtf(squared)
    for d in range(WIDTH):
        missed[d] = (place[d] - entry[d]) * strength


def diffuse(
    const float[:, ::1] places,       # IN (M, 4): of the colors
    const uint8_t[::1] kinds,         # IN (M,): which entries a color may take
    const int32_t[:, ::1] inverse,    # IN (H, W): color of each pixel
    Grid finder,                      # IN
    const float[::1] strengths,       # IN (n_kinds,): fraction of its error that a kind of color hands on
    float most,                       # IN: longest error handed on
    const uint8_t[:, ::1] clean,      # IN (H, W): pixels that get their own nearest entry, and hand on nothing
    int32_t[:, ::1] labels,           # OUT (H, W)
):
    """Give each pixel the nearest entry, and hand the error to its neighbors, in alternating directions row by row."""
    cdef Cells grid = finder.cells
    cdef Py_ssize_t n_rows = inverse.shape[0], width = inverse.shape[1], x, y, step, i, d, label
    # Errors handed to this row and the next, from column 1.
    cdef float[:, :, ::1] rows = np.zeros((2, width + 2, WIDTH), np.float32)
    cdef uint8_t[::1] row_kinds = np.empty(width, np.uint8)
    cdef float place[WIDTH]
    cdef float ahead[WIDTH]
    cdef float missed[WIDTH]
    cdef float strength
    cdef float *here
    cdef float *below
    with nogil:
        for y in range(n_rows):
            here, below = &rows[y & 1, 1, 0], &rows[1 - (y & 1), 1, 0]
            # Fetched ahead of use, so that no fetch waits for the choice of the previous pixel.
            for x in range(width):
                row_kinds[x] = kinds[inverse[y, x]]
                for d in range(WIDTH):
                    here[WIDTH * x + d] += places[inverse[y, x], d]
            memset(below - WIDTH, 0, (width + 2) * WIDTH * sizeof(float))
            memset(ahead, 0, sizeof(ahead))
            step = 1 - 2 * (y & 1)
            x = 0 if step > 0 else width - 1
            for i in range(width):
                for d in range(WIDTH):
                    place[d] = places[inverse[y, x], d] if clean[y, x] else here[WIDTH * x + d] + ahead[d]
                label = look_up(&grid, place, row_kinds[x])
                labels[y, x] = <int32_t>label
                strength = 0 if clean[y, x] else strengths[row_kinds[x]]
                miss(place, grid.palette + WIDTH * label, strength, most, missed)
                for d in range(WIDTH):
                    ahead[d] = missed[d] * <float>(7. / 16)
                    below[WIDTH * (x - step) + d] += missed[d] * <float>(3. / 16)
                    below[WIDTH * x + d] += missed[d] * <float>(5. / 16)
                    below[WIDTH * (x + step) + d] += missed[d] * <float>(1. / 16)
                x += step


def mix(
    const float[:, ::1] places,       # IN (M, 4): of the colors
    const uint8_t[::1] kinds,         # IN (M,): which entries a color may take
    Grid finder,                      # IN
    const float[::1] strengths,       # IN (n_kinds,): fraction of its error that a kind of color hands on
    float most,                       # IN: longest error handed on
    const uint16_t[::1] ranks,        # IN (K,): rank of each entry by brightness
    uint16_t[:, ::1] mixtures,        # OUT (M, N): entries whose mean is the color, by rank
):
    """List the entries to mix for each color: each is the nearest to the color plus the error of those before it."""
    cdef Cells grid = finder.cells
    cdef Py_ssize_t n_colors = places.shape[0], n_mixed = mixtures.shape[1], color, i, at, d, entry
    cdef float place[WIDTH]
    cdef float missed[WIDTH]
    cdef uint16_t *mixture
    with nogil:
        for color in range(n_colors):
            mixture = &mixtures[color, 0]
            memset(missed, 0, sizeof(missed))
            for i in range(n_mixed):
                for d in range(WIDTH):
                    place[d] = places[color, d] + missed[d]
                entry = look_up(&grid, place, kinds[color])
                miss(place, grid.palette + WIDTH * entry, strengths[kinds[color]], most, missed)
                at = i
                while at > 0 and ranks[mixture[at - 1]] > ranks[entry]:
                    mixture[at] = mixture[at - 1]
                    at -= 1
                mixture[at] = <uint16_t>entry


def arrange(
    const uint16_t[:, ::1] mixtures,  # IN (M, N)
    const int32_t[:, ::1] inverse,    # IN (H, W): color of each pixel
    const uint8_t[:, ::1] mask,       # IN (S, S): which of the N entries a pixel takes; repeats over the image
    Py_ssize_t first,                 # IN: row of the image that the first row is
    int32_t[:, ::1] labels,           # OUT (H, W)
):
    """Take from the mixture of each pixel's color the entry that the mask names at its place."""
    cdef Py_ssize_t n_rows = inverse.shape[0], width = inverse.shape[1], side = mask.shape[0], x, y
    cdef const uint8_t *turn
    with nogil:
        for y in range(n_rows):
            turn = &mask[(first + y) % side, 0]
            for x in range(width):
                labels[y, x] = mixtures[inverse[y, x], turn[x % side]]


def measure(
    const float[:, ::1] places,       # IN (M, 4): of the colors
    const float[:, ::1] palette,      # IN (K, 4)
    const int32_t[:, ::1] inverse,    # IN (H, W): color of each pixel
    const int32_t[:, ::1] labels,     # IN (H, W): its entry
    double[::1] energies,             # OUT (H,): sum of the squared distances in each row
):
    cdef Py_ssize_t n_rows = inverse.shape[0], width = inverse.shape[1], x, y, d
    cdef double total, step
    with nogil:
        for y in range(n_rows):
            total = 0
            for x in range(width):
                for d in range(WIDTH):
                    step = places[inverse[y, x], d] - palette[labels[y, x], d]
                    total += step * step
            energies[y] = total

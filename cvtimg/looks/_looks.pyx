# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of looks: one pass each. Scratch is allocated here."""

from libc.stdint cimport int16_t, int32_t, uint8_t, uint16_t

import numpy as np

N_ERRORS = 6
LONGEST = RATE_LONGEST
FARTHEST = RATE_FARTHEST
MOST_PATHS = LZW_MOST_PATHS

cdef extern from "similarity.h" nogil:
    enum: BLUR_RADIUS
    void blur_rows(
        const float *plane, const float *weights, Py_ssize_t height, Py_ssize_t width, Py_ssize_t first, Py_ssize_t last,
        float *line, float *out,
    )
    void sum_errors(
        const float *a, const float *b, const float *mean_a, const float *mean_b, const float *square_a,
        const float *square_b, const float *product, Py_ssize_t n_rows, Py_ssize_t width, double *sums,
    )

cdef extern from "rate.h" nogil:
    enum: RATE_LONGEST, RATE_FARTHEST, RATE_WIDTH, RATE_CELLS, RATE_LANES
    ctypedef struct rate_band:
        Py_ssize_t width, n_entries
        int shift, n_matches
        const float *targets
        const float *visibility
        const float *entries
        const float *lengths
        const float *distances
        float price, literal, side, strength, longest
        uint8_t *indices
    ctypedef struct rate_node:
        pass
    ctypedef struct rate_near:
        pass
    ctypedef struct rate_cell:
        pass
    ctypedef struct rate_scratch:
        rate_node *nodes
        rate_cell *cells
        rate_near *near
        float *above
        float *below
        float *floor
        uint16_t *stream
        int32_t *recent
        Py_ssize_t stride, run
    void rate_map_row(const rate_band *band, rate_scratch *scratch, Py_ssize_t row)

cdef extern from "lzw.h" nogil:
    enum: LZW_CODES, LZW_MOST_PATHS, LZW_DECIDED, LZW_AHEAD
    ctypedef struct lzw_paths:
        pass
    ctypedef struct lzw_book:
        int16_t (*longer)[256]
        int next, bits, phrase
    ctypedef struct lzw_scratch:
        lzw_book book
        int n_paths
        const float *kept
        rate_cell *cells
        float *above
        float *below
        lzw_paths *paths
        int16_t *slots
    void lzw_map(const rate_band *band, lzw_scratch *scratch, Py_ssize_t n_rows)


def blur(const float[:, ::1] plane, const float[::1] weights, Py_ssize_t first, float[:, ::1] out):
    """Blur rows of a plane (H, W), from the first on as many as `out` has, by the weights of 11 pixels along each axis."""
    cdef Py_ssize_t height = plane.shape[0], width = plane.shape[1], last = first + out.shape[0]
    cdef float[::1] line = np.empty(width + 2 * BLUR_RADIUS, np.float32)
    with nogil:
        blur_rows(&plane[0, 0], &weights[0], height, width, first, last, &line[0], &out[0, 0])


def errors(
    const float[:, ::1] a, const float[:, ::1] b, const float[:, ::1] mean_a, const float[:, ::1] mean_b,
    const float[:, ::1] square_a, const float[:, ::1] square_b, const float[:, ::1] product,
):
    """(H, 6) sums of the errors d and d^4 of rows in structure, artifacts and lost detail, from planes and their blurs."""
    sums = np.empty((a.shape[0], N_ERRORS))
    cdef double[:, ::1] out = sums
    with nogil:
        sum_errors(
            &a[0, 0], &b[0, 0], &mean_a[0, 0], &mean_b[0, 0], &square_a[0, 0], &square_b[0, 0], &product[0, 0],
            a.shape[0], a.shape[1], &out[0, 0],
        )
    return sums


def map_band(
    const float[:, :, ::1] targets, const float[:, ::1] visibility, const float[:, ::1] entries,
    const float[::1] lengths, const float[::1] distances, int shift, int n_matches, float price, float literal,
    float side, float strength, float longest, uint8_t[:, ::1] indices,
):
    """Map a band of rows by rate, into `indices`; the arguments are those of `rate_band`, see there."""
    cdef Py_ssize_t height = targets.shape[0], width = targets.shape[1], n_entries = len(entries) - 1, row
    # A row begins with the byte of its filter, which no match goes across, and with a new byte.
    cdef Py_ssize_t stride = ((width - 1 >> shift) + 2) << shift, run = (height + 1) * stride
    cdef rate_band band = rate_band(
        width, n_entries, shift, n_matches, &targets[0, 0, 0], &visibility[0, 0], &entries[0, 0], &lengths[0],
        &distances[0], price, literal, side, strength, longest, &indices[0, 0],
    )
    nodes = np.empty((width + 1) * sizeof(rate_node), np.uint8)
    near = np.empty(width * sizeof(rate_near), np.uint8)
    cells = np.full(RATE_CELLS * sizeof(rate_cell), 0x80, np.uint8)  # whose corners are far from all pixels
    rows = np.zeros((2, width + 2, RATE_WIDTH), np.float32)
    floor = np.empty(width, np.float32)
    runs = np.repeat(np.arange(n_entries, dtype=np.uint16), RATE_LONGEST << shift)
    stream = np.concatenate([np.full(run, n_entries, np.uint16), runs])
    recent = np.zeros((1 << 16) * RATE_LANES, np.int32)
    cdef uint8_t[::1] node_bytes = nodes, near_bytes = near, cell_bytes = cells
    cdef float[:, :, ::1] handed = rows
    cdef float[::1] of_row = floor
    cdef uint16_t[::1] of_stream = stream
    cdef int32_t[::1] of_pairs = recent
    cdef rate_scratch scratch = rate_scratch(
        <rate_node *>&node_bytes[0], <rate_cell *>&cell_bytes[0], <rate_near *>&near_bytes[0], &handed[0, 0, 0],
        &handed[1, 0, 0], &of_row[0], &of_stream[0], &of_pairs[0], stride, run,
    )
    with nogil:
        for row in range(height):
            rate_map_row(&band, &scratch, row)


def map_phrases(
    const float[:, :, ::1] targets, const float[:, ::1] visibility, const float[:, ::1] entries,
    const float[:, :, ::1] kept, int n_paths, float price, float side, float strength,
    float longest, uint8_t[:, ::1] indices,
):
    """Map an image by rate for LZW, into `indices`, by at most `n_paths` paths; `kept` may be None, see `lzw_scratch`."""
    cdef Py_ssize_t height = targets.shape[0], width = targets.shape[1], n_entries = len(entries) - 1
    cdef rate_band band = rate_band(
        width, n_entries, 0, 0, &targets[0, 0, 0], &visibility[0, 0], &entries[0, 0], NULL, NULL, price, 0, side,
        strength, longest, &indices[0, 0],
    )
    longer, slots = np.empty((LZW_CODES + 1, 256), np.int16), np.full(LZW_CODES, -1, np.int16)
    rows = np.zeros((2, width + 2, RATE_WIDTH), np.float32)
    cells = np.full(RATE_CELLS * sizeof(rate_cell), 0x80, np.uint8)
    paths = np.empty((LZW_DECIDED + LZW_AHEAD + 1) * sizeof(lzw_paths), np.uint8)
    cdef int16_t[:, ::1] of_book = longer
    cdef int16_t[::1] of_slots = slots
    cdef float[:, :, ::1] handed = rows
    cdef uint8_t[::1] of_paths = paths, of_cells = cells
    cdef lzw_scratch scratch
    scratch.book.longer = <int16_t (*)[256]>&of_book[0, 0]
    scratch.n_paths = n_paths
    scratch.kept = NULL if kept is None else &kept[0, 0, 0]
    scratch.above, scratch.below = &handed[0, 0, 0], &handed[1, 0, 0]
    scratch.cells = <rate_cell *>&of_cells[0]
    scratch.paths, scratch.slots = <lzw_paths *>&of_paths[0], &of_slots[0]
    with nogil:
        lzw_map(&band, &scratch, height)

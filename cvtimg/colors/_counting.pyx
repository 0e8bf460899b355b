# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops that count distinct colors: one pass each, over buffers that the caller owns.

They allocate nothing, check nothing and decide nothing; the Python modules that call them do. Each argument is marked
IN, OUT or INOUT.
"""
from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.string cimport memcmp

PAGE_SIZE = PAGE

cdef enum:
    PAGE = 512  # 2 KiB of counts: 8 x 8 x 8 neighboring colors


cdef inline uint32_t key_of(const uint8_t *pixel, Py_ssize_t n_bytes, const uint32_t *key_bits) noexcept nogil:
    cdef uint32_t key = key_bits[pixel[0]]
    cdef Py_ssize_t b
    for b in range(1, n_bytes):
        key = key | key_bits[b * 256 + pixel[b]]
    return key


def count_keys(
    const uint8_t[::1] pixels,      # IN (N * B,): the bytes of each pixel
    const uint32_t[:, ::1] key_bits,  # IN (B, 256): bits of the key that each byte sets
    uint16_t[::1] pages,            # INOUT: for each PAGE of keys its place in `counts`, or 0 before its first use
    uint32_t[:, ::1] counts,        # INOUT (n_pages + 1, PAGE): += 1 at the key of each pixel
    Py_ssize_t used,                # IN: pages in use
):
    """Return the number of pages in use."""
    # Neighboring keys are similar colors, so a photograph fills few pages, and only their memory is touched.
    cdef Py_ssize_t n_bytes = key_bits.shape[0], n = pixels.shape[0] // n_bytes, p
    cdef const uint8_t *pixel = &pixels[0]
    cdef const uint32_t *bits = &key_bits[0, 0]
    cdef uint16_t *page_of = &pages[0]
    cdef uint32_t *count = &counts[0, 0]
    cdef uint32_t key, page
    with nogil:
        for p in range(n):
            key = key_of(pixel, 3, bits) if n_bytes == 3 else key_of(pixel, n_bytes, bits)
            page = page_of[key // PAGE]
            if page == 0:
                used += 1
                page = <uint32_t>used
                page_of[key // PAGE] = <uint16_t>page
            count[page * PAGE + key % PAGE] += 1
            pixel += n_bytes
    return used


def count_pages(
    const uint8_t[:, ::1] pixels,   # IN (N, B)
    const uint32_t[:, ::1] key_bits,  # IN (B, 256)
    int32_t[::1] sizes,             # INOUT: += pixels in each page of keys
):
    cdef Py_ssize_t n_bytes = key_bits.shape[0], p
    with nogil:
        for p in range(pixels.shape[0]):
            sizes[key_of(&pixels[p, 0], n_bytes, &key_bits[0, 0]) // PAGE] += 1


def sort_keys(
    const uint8_t[:, ::1] pixels,   # IN (N, B)
    const uint32_t[:, ::1] key_bits,  # IN (B, 256)
    int64_t[::1] starts,            # INOUT: where the next key with these high bits goes
    uint16_t[::1] keys,             # OUT: the low 16 bits of the keys of pixels, by their high bits
):
    cdef Py_ssize_t n_bytes = key_bits.shape[0], p
    cdef uint32_t key
    with nogil:
        for p in range(pixels.shape[0]):
            key = key_of(&pixels[p, 0], n_bytes, &key_bits[0, 0])
            keys[starts[key >> 16]] = <uint16_t>key
            starts[key >> 16] += 1


def count_sorted(
    const uint16_t[::1] keys,       # IN: keys, less the first one of `pages`
    const uint16_t[::1] pages,      # IN: the place in `counts` of each page from there on
    uint32_t[:, ::1] counts,        # INOUT: += 1 at each key
):
    cdef Py_ssize_t p
    with nogil:
        for p in range(keys.shape[0]):
            counts[pages[keys[p] // PAGE], keys[p] % PAGE] += 1


def number_keys(
    const uint16_t[::1] pages,  # IN
    uint32_t[:, ::1] counts,    # INOUT: counts; then, for each key that was counted, its rank
    Py_ssize_t first,           # IN: which page of all the first of `pages` is
    Py_ssize_t found,           # IN: keys that were counted in the pages before
    uint32_t[::1] keys,         # OUT: keys that were counted, ascending
    double[::1] density,        # OUT: their counts
):
    """Return how many keys were counted up to the end of these pages."""
    cdef Py_ssize_t n_pages = pages.shape[0], page, entry, block
    cdef uint32_t *count
    cdef uint32_t any_count
    with nogil:
        for page in range(n_pages):
            if pages[page] == 0:
                continue
            count = &counts[pages[page], 0]
            for block in range(0, PAGE, 16):  # most are empty, even for a noisy photograph
                any_count = 0
                for entry in range(block, block + 16):
                    any_count |= count[entry]
                if any_count == 0:
                    continue
                for entry in range(block, block + 16):
                    if count[entry]:
                        keys[found] = <uint32_t>((first + page) * PAGE + entry)
                        density[found] = count[entry]
                        count[entry] = <uint32_t>found
                        found += 1
    return found


def look_up_keys(
    const uint8_t[::1] pixels,      # IN (N * B,)
    const uint32_t[:, ::1] key_bits,  # IN (B, 256)
    const uint16_t[::1] pages,      # IN
    const uint32_t[:, ::1] ranks,   # IN (n_pages + 1, PAGE)
    int32_t[::1] inverse,           # OUT (N,): rank of the key of each pixel
):
    cdef Py_ssize_t n_bytes = key_bits.shape[0], n = inverse.shape[0], p
    cdef const uint8_t *pixel = &pixels[0]
    cdef const uint32_t *bits = &key_bits[0, 0]
    cdef const uint32_t *rank = &ranks[0, 0]
    cdef uint32_t key
    with nogil:
        for p in range(n):
            key = key_of(pixel + 3 * p, 3, bits) if n_bytes == 3 else key_of(pixel + n_bytes * p, n_bytes, bits)
            inverse[p] = rank[<uint32_t>pages[key // PAGE] * PAGE + key % PAGE]


cdef inline uint64_t hash_bytes(const uint8_t *row, Py_ssize_t n_bytes) noexcept nogil:
    # FNV-1a, with a final mix because the table is indexed by the low bits.
    cdef uint64_t value = <uint64_t>0xCBF29CE484222325
    cdef Py_ssize_t b
    for b in range(n_bytes):
        value = (value ^ row[b]) * <uint64_t>0x100000001B3
    value = value ^ (value >> 32)
    return value * <uint64_t>0x9E3779B97F4A7C15 >> 20


def count_rows(
    const uint8_t[:, ::1] rows,  # IN (N, B): the bytes of each row
    Py_ssize_t start,            # IN: first row not yet counted
    int32_t[::1] slots,          # INOUT: hash table, a power of two: rank of the row kept there, or -1
    int64_t[::1] firsts,         # INOUT: where each distinct row was first seen
    double[::1] counts,          # INOUT: how often
    int32_t[::1] ranks,          # INOUT (N,): rank of each row
    Py_ssize_t found,            # IN: distinct rows so far
):
    """Count rows until all are done or `firsts` is full; return (next row, distinct rows)."""
    cdef Py_ssize_t n = rows.shape[0], n_bytes = rows.shape[1], capacity = firsts.shape[0], p = start
    cdef uint64_t mask = slots.shape[0] - 1, slot
    cdef int32_t rank
    with nogil:
        while p < n:
            slot = hash_bytes(&rows[p, 0], n_bytes) & mask
            while True:
                rank = slots[slot]
                if rank < 0 or memcmp(&rows[firsts[rank], 0], &rows[p, 0], n_bytes) == 0:
                    break
                slot = (slot + 1) & mask
            if rank < 0:
                if found == capacity:
                    break
                rank = <int32_t>found
                slots[slot] = rank
                firsts[rank] = p
                counts[rank] = 0
                found += 1
            counts[rank] += 1
            ranks[p] = rank
            p += 1
    return p, found


def rehash(
    const uint8_t[:, ::1] rows,   # IN (N, B)
    const int64_t[::1] firsts,    # IN (found,)
    int32_t[::1] slots,           # INOUT: a larger table, all -1
):
    cdef Py_ssize_t n_bytes = rows.shape[1], rank
    cdef uint64_t mask = slots.shape[0] - 1, slot
    with nogil:
        for rank in range(firsts.shape[0]):
            slot = hash_bytes(&rows[firsts[rank], 0], n_bytes) & mask
            while slots[slot] >= 0:
                slot = (slot + 1) & mask
            slots[slot] = <int32_t>rank

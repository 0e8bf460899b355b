# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loop that merges small pieces of label images, over buffers that the caller owns.

Nothing here allocates, checks its arguments or decides when to stop; `components.py` does. Each argument is marked IN,
OUT or INOUT.
"""
from libc.stdint cimport int32_t, int64_t


cdef inline int32_t root_of(int32_t *parents, int32_t region) noexcept nogil:
    while parents[region] != region:
        parents[region] = parents[parents[region]]
        region = parents[region]
    return region


def absorb(
    int64_t[::1] sizes,        # INOUT (R,): pixels of each region
    double[:, ::1] means,      # INOUT (R, D)
    int32_t[::1] heads,        # INOUT (R,): first border of each region, or -1
    int32_t[::1] tails,        # INOUT (R,): last border
    int32_t[::1] following,    # INOUT (B,): the next border of the same region, or -1
    const int32_t[::1] others,  # IN (B,): the region beyond each border
    const double[::1] lengths,  # IN (B,)
    int32_t[::1] parents,      # INOUT (R,): each its own; then the region that absorbed it, and at the end its root
    int32_t[::1] queues,       # INOUT (min_size,): first entry of the regions of each size, or -1
    int32_t[::1] entries,      # INOUT (2 R,): the next entry of the same queue
    int32_t[::1] queued,       # INOUT (2 R,): the region of each entry
    int64_t n_entries,         # IN: entries so far
    double length_price,       # IN: price per pixel of border
    double[::1] touching,      # scratch (R,), zeros
    int32_t[::1] found,        # scratch (R,)
):
    """Merge regions smaller than min_size, the smallest first, into the neighbor that raises the energy least."""
    cdef Py_ssize_t dims = means.shape[1], size, f, n_found, d
    cdef int32_t region, other, best, border, entry
    cdef int32_t *parent = &parents[0]
    cdef double cost, least, step, share
    with nogil:
        for size in range(1, queues.shape[0]):
            entry = queues[size]
            while entry >= 0:
                region = queued[entry]
                entry = entries[entry]
                if parent[region] != region or sizes[region] != size:
                    continue
                n_found = 0
                border = heads[region]
                while border >= 0:
                    other = root_of(parent, others[border])
                    if other != region:
                        if touching[other] == 0:
                            found[n_found] = other
                            n_found += 1
                        touching[other] += lengths[border]
                    border = following[border]
                best = -1
                least = 0
                for f in range(n_found):
                    other = found[f]
                    cost = 0
                    for d in range(dims):
                        step = means[region, d] - means[other, d]
                        cost = cost + step * step
                    cost = cost * size * sizes[other] / (size + sizes[other]) - length_price * touching[other]
                    if best < 0 or cost < least or (cost == least and other < best):
                        best = other
                        least = cost
                    touching[other] = 0
                if best < 0:
                    continue
                share = size / <double>(size + sizes[best])
                for d in range(dims):
                    means[best, d] += share * (means[region, d] - means[best, d])
                sizes[best] += size
                parent[region] = best
                following[tails[best]] = heads[region]
                tails[best] = tails[region]
                if sizes[best] < queues.shape[0]:
                    queued[n_entries] = best
                    entries[n_entries] = queues[sizes[best]]
                    queues[sizes[best]] = <int32_t>n_entries
                    n_entries += 1
        for region in range(parents.shape[0]):
            parent[region] = root_of(parent, region)

# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The compiled loops of the engine: one pass each, over buffers that the caller owns.

They allocate nothing, check nothing and decide nothing; the Python modules that call them do. Each argument is marked
IN, OUT or INOUT. Points are packed in tiles of LANES points, (n_tiles, D, LANES), the
last tile padded with points of density 0.
"""
import os

cimport cython
from libc.float cimport DBL_MAX, FLT_MAX
from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t

cdef extern from "cell_weight.h" nogil:
    double cell_weight(double share, double power)

cdef extern from "nearest.h" nogil:
    enum: LANES, FEW_DIMS, TILES_IN_GROUP
    cdef struct nearest_functions:
        void (*one)(
            const void *tile, int dims, const void *generators, const void *half_norms, int n_generators,
            int32_t *nearest, void *gap) noexcept nogil
        void (*next)(
            const void *tile, int dims, const void *generators, const void *half_norms, int n_generators,
            const void *inverse_masses, const void *weights, const int32_t *own, int32_t *nearest,
            void *gap) noexcept nogil
        void (*group)(
            const void *tiles, const void *boxes, int n_tiles, int dims, const void *columns, Py_ssize_t width,
            const void *generators, const void *half_norms, int n_generators, int32_t *nearest,
            void *gap) noexcept nogil
        void (*squares)(const void *tile, int dims, const void *places, int n_places, void *distances) noexcept nogil
        void (*sum)(const void *tile, int dims, const double *density, const int32_t *labels, double *sums) noexcept nogil
    const nearest_functions *nearest_at(int level, int exact)

SIMD_LEVELS = ("baseline", "avx2", "avx512")
TILE = LANES
MAX_GROUPED_DIMS = FEW_DIMS

ctypedef fused sample_t:
    uint8_t
    uint16_t
    float
    double

# Coordinates of points and generators: float, or double where float is too coarse. There half norms are 0.
ctypedef fused real:
    float
    double

# For float and for double: `search[sizeof(real) == 8]`.
cdef const nearest_functions *search[2]


def _choose_level():
    """Use the processor's best level, or the lower one that CVTIMG_SIMD names; that there is, if only one is compiled."""
    wanted = os.environ.get("CVTIMG_SIMD") or "avx512"
    if wanted not in SIMD_LEVELS:
        raise ImportError(f"CVTIMG_SIMD={wanted!r} must be one of {', '.join(SIMD_LEVELS)}")
    cdef int most = SIMD_LEVELS.index(wanted), level
    for level in (*range(most, -1, -1), *range(most + 1, 3)):
        search[0], search[1] = nearest_at(level, False), nearest_at(level, True)
        if search[0] != NULL:
            return SIMD_LEVELS[level]
    raise ImportError("cvtimg was compiled for instructions that this processor does not have")


simd = _choose_level()


def pack_tiles(
    const sample_t[:, ::1] rows,  # IN (N, D)
    const double[::1] center,     # IN (D,)
    double scale,                 # IN
    real[:, :, ::1] tiles,       # OUT (n_tiles, D, LANES): (row - center) scale; the last row fills the padding
):
    cdef Py_ssize_t n = rows.shape[0], dims = rows.shape[1], n_tiles = tiles.shape[0]
    cdef Py_ssize_t t, d, i
    with nogil:
        for t in range(n_tiles):
            for d in range(dims):
                for i in range(LANES):
                    tiles[t, d, i] = <real>((rows[min(t * LANES + i, n - 1), d] - center[d]) * scale)


def assign(
    const real[:, :, ::1] tiles,       # IN (n_tiles, D, LANES)
    const real[:, :, ::1] boxes,       # IN (n_tiles, 2, D): least and greatest coordinates of each tile
    const real[:, ::1] columns,        # IN (D, width): generators, filled up with 1e18 to a multiple of LANES; or None
    const real[:, ::1] generators,     # IN (K, D)
    const real[::1] half_norms,        # IN (K,): |generator|^2 / 2
    int32_t[::1] labels,                # OUT (n_tiles * LANES,): nearest generator, the lowest index on a tie
    real[::1] gaps,                     # OUT (n_tiles * LANES,) or None: how much farther the second is, squared
):
    """Find the nearest generators; with columns, D <= MAX_GROUPED_DIMS, faster where tiles have points that are near."""
    cdef Py_ssize_t n_tiles = tiles.shape[0], t = 0
    cdef int dims = tiles.shape[1], n_generators = generators.shape[0]
    cdef bint grouped = columns is not None
    cdef const real *column = &columns[0, 0] if grouped else NULL
    cdef Py_ssize_t width = columns.shape[1] if grouped else 0
    cdef real *gap = NULL if gaps is None else &gaps[0]
    with nogil:
        while t < n_tiles:
            if grouped:
                search[sizeof(real) == 8].group(
                    &tiles[t, 0, 0], &boxes[t, 0, 0], <int>min(n_tiles - t, TILES_IN_GROUP), dims, column, width,
                    &generators[0, 0], &half_norms[0], n_generators, &labels[t * LANES],
                    gap + t * LANES if gap != NULL else NULL)
            else:
                search[sizeof(real) == 8].one(
                    &tiles[t, 0, 0], dims, &generators[0, 0], &half_norms[0], n_generators, &labels[t * LANES],
                    gap + t * LANES if gap != NULL else NULL)
            t += TILES_IN_GROUP if grouped else 1


def assign_next(
    const real[:, :, ::1] tiles,       # IN (n_tiles, D, LANES)
    const real[:, ::1] generators,     # IN (K, D), K >= 2
    const real[::1] half_norms,        # IN (K,)
    const int32_t[::1] labels,          # IN (n_tiles * LANES,)
    int32_t[::1] seconds,               # OUT (n_tiles * LANES,): nearest generator but for that of the label
    real[::1] gaps,                    # OUT (n_tiles * LANES,): how much farther that is, in squared distance
):
    cdef Py_ssize_t n_tiles = tiles.shape[0], t, at
    cdef int dims = tiles.shape[1], n_generators = generators.shape[0]
    with nogil:
        for t in range(n_tiles):
            at = t * LANES
            search[sizeof(real) == 8].next(
                &tiles[t, 0, 0], dims, &generators[0, 0], &half_norms[0], n_generators, NULL, NULL,
                &labels[at], &seconds[at], &gaps[at])


def accumulate(
    const real[:, :, ::1] tiles,   # IN (n_tiles, D, LANES)
    const double[::1] density,      # IN (n_tiles * LANES,)
    const int32_t[::1] labels,      # IN (n_tiles * LANES,)
    double[:, ::1] sums,            # INOUT (K, D + 1): += density times (point, 1), by label
):
    cdef Py_ssize_t n_tiles = tiles.shape[0], t
    cdef int dims = tiles.shape[1]
    with nogil:
        for t in range(n_tiles):
            search[sizeof(real) == 8].sum(
                &tiles[t, 0, 0], dims, &density[t * LANES], &labels[t * LANES], &sums[0, 0])


def descend_sets(
    const real[:, :, ::1] tiles,     # IN (n_tiles, D, LANES)
    const double[::1] density,        # IN (n_tiles * LANES,)
    double spread,                    # IN: sum of density times squared distance to the origin
    Py_ssize_t n_locked,              # IN: the first generators of each set stay
    double lightest,                  # IN: least density > 0; a cell of less than half of it is empty
    double tolerance,                 # IN: a set rests when a move lowers its energy by at most this fraction
    Py_ssize_t most,                  # IN: or after this number of moves
    double[:, :, ::1] generators,     # INOUT (n_sets, K, D)
    double[:, :, ::1] sums,           # OUT (n_sets, K, D + 1), at first 0: density times (point, 1) of the cells
    int32_t[:, ::1] labels,           # OUT (n_sets, n_tiles * LANES), at first -1: the cells
    real[:, ::1] single,             # OUT (K, D): scratch
    real[::1] half_norms,            # OUT (K,): scratch
    double[::1] energies,             # OUT (n_sets,)
):
    """Find the cells of each set, and move its generators to their means until it rests.

    The generator of an empty cell stays. Only points that change cells are summed, and energies follow from the sums;
    in double precision all points are, as what differences leave of large sums would be too much.
    """
    cdef Py_ssize_t n_sets = generators.shape[0], n_tiles = tiles.shape[0]
    cdef Py_ssize_t s, n, t, k, d, i, p
    cdef int dims = tiles.shape[1], n_generators = generators.shape[1]
    cdef int32_t nearest[LANES]
    cdef double norm, cross, total, moved, step
    cdef int32_t before
    with nogil:
        for s in range(n_sets):
            for n in range(most + 1):
                for k in range(n_generators):
                    if k >= n_locked and sums[s, k, dims] > 0.5 * lightest:
                        for d in range(dims):
                            generators[s, k, d] = sums[s, k, d] / sums[s, k, dims]
                    _set_place(single, half_norms, k, &generators[s, k, 0])
                total = 0
                if real is double:
                    sums[s] = 0
                    labels[s] = -1
                for t in range(n_tiles):
                    search[sizeof(real) == 8].one(
                        &tiles[t, 0, 0], dims, &single[0, 0], &half_norms[0], n_generators, nearest, NULL)
                    for i in range(LANES):
                        p = t * LANES + i
                        before = labels[s, p]
                        if real is double:
                            for d in range(dims):
                                step = tiles[t, d, i] - generators[s, nearest[i], d]
                                total = total + density[p] * step * step
                        if before == nearest[i]:
                            continue
                        labels[s, p] = nearest[i]
                        for d in range(dims):
                            moved = density[p] * tiles[t, d, i]
                            sums[s, nearest[i], d] += moved
                            if before >= 0:
                                sums[s, before, d] -= moved
                        sums[s, nearest[i], dims] += density[p]
                        if before >= 0:
                            sums[s, before, dims] -= density[p]
                if real is float:
                    total = spread
                    for k in range(n_generators):
                        norm = cross = 0
                        for d in range(dims):
                            norm = norm + generators[s, k, d] * generators[s, k, d]
                            cross = cross + generators[s, k, d] * sums[s, k, d]
                        total = total + sums[s, k, dims] * norm - 2 * cross
                moved = energies[s] - total
                energies[s] = max(total, 0)
                if n > 0 and moved <= tolerance * (total + moved):
                    break


def seed_sets(
    const real[:, :, ::1] tiles,      # IN (n_tiles, D, LANES)
    const double[::1] density,        # IN (n_tiles * LANES,)
    Py_ssize_t n_given,               # IN: the first generators of each set are given
    Py_ssize_t n_locked,              # IN: of these, the first that are never replaced
    const double[:, :, ::1] heights,  # IN (n_sets, n_steps, L): 0 to 1, where in the energies summed up each draw is
    double worthwhile,                # IN: a replacement must leave less than this part of the energy
    double[:, :, ::1] generators,     # INOUT (n_sets, K, D)
    int64_t[::1] n_seeded,            # OUT (n_sets,): generators that there are; fewer if all energy is gone
    int32_t[:, ::1] cells,            # OUT (2, (n_tiles + 1) * LANES): scratch, the nearest and the next generator
    real[:, ::1] squares,             # OUT (2, (n_tiles + 1) * LANES): scratch, the squared distances to these
    real[:, :, ::1] apart,            # OUT (n_tiles, L, LANES): scratch, those to the draws
    double[::1] shares,               # OUT (n_tiles,): scratch, energies of tiles
    real[:, ::1] places,              # OUT (K + L, D): scratch, all generators and the draws
    real[::1] half_norms,             # OUT (K,): scratch
    real[:, ::1] some,                # OUT (D, LANES): scratch, points whose generators went
    double[:, ::1] losses,            # OUT (L, K + 1): scratch; what a draw adds if a generator goes, and the rest
):
    """Draw points by their energy, and put a generator at the draw that leaves the lowest.

    Once there are K, the generator that is then missed least is replaced: the local search of S. Lattanzi, C. Sohler, ICML
    2019, PMLR 97, 3662-3671.
    """
    cdef Py_ssize_t n_tiles = tiles.shape[0], n_points = density.shape[0], n_cells = generators.shape[1]
    cdef Py_ssize_t n_draws = heights.shape[2], s, n, k, t, i, p, d, draw, best, gone, found, n_some
    cdef int dims = tiles.shape[1]
    cdef double total, least, energy
    cdef real first, square
    cdef int32_t own
    cdef Py_ssize_t members[LANES]
    with nogil:
        for s in range(generators.shape[0]):
            found = 0
            cells[:, :] = -1
            squares[:, :] = FLT_MAX
            while found < n_given:
                _set_place(places, half_norms, found, &generators[s, found, 0])
                found += 1
            for t in range(n_tiles if found > 0 else 0):
                _find_two(&tiles[t, 0, 0], places, half_norms, found, cells, squares, t * LANES, heights.shape[1] > 1)
            for n in range(heights.shape[1]):
                energy = 0
                for t in range(n_tiles):
                    shares[t] = 0
                    for p in range(t * LANES, (t + 1) * LANES):
                        shares[t] += density[p] * (squares[0, p] if found else 1)
                    energy = energy + shares[t]
                if energy <= 0:
                    break
                for draw in range(n_draws):
                    total = heights[s, n, draw] * energy
                    t = p = 0
                    while t < n_tiles - 1 and total >= shares[t]:
                        total = total - shares[t]
                        t += 1
                    for i in range(t * LANES, (t + 1) * LANES):
                        least = density[i] * (squares[0, i] if found else 1)
                        if least > 0:
                            p = i
                            total = total - least
                            if total < 0:
                                break
                    for d in range(dims):
                        places[n_cells + draw, d] = tiles[p // LANES, d, p % LANES]
                losses[:, :] = 0
                for t in range(n_tiles):
                    search[sizeof(real) == 8].squares(
                        &tiles[t, 0, 0], dims, &places[n_cells, 0], <int>n_draws, &apart[t, 0, 0])
                    for draw in range(n_draws):
                        for i in range(LANES):
                            p = t * LANES + i
                            square = apart[t, draw, i]
                            first = min(squares[0, p], square)
                            losses[draw, n_cells] += density[p] * first
                            if found == n_cells:
                                losses[draw, cells[0, p]] += density[p] * (min(squares[1, p], square) - first)
                best = gone = -1
                least = energy * worthwhile if found == n_cells else DBL_MAX
                for draw in range(n_draws):
                    for k in range(n_locked if found == n_cells else found, min(found + 1, n_cells)):
                        total = losses[draw, n_cells] + losses[draw, k]
                        if total < least:
                            least = total
                            best = draw
                            gone = k
                if best < 0:
                    continue
                for d in range(dims):
                    places[gone, d] = places[n_cells + best, d]
                _set_norm(places, half_norms, gone)
                found = min(found + 1, n_cells)
                if n == heights.shape[1] - 1:
                    break
                n_some = 0
                for p in range(n_points):
                    own = cells[0, p]
                    square = apart[p // LANES, best, p % LANES]
                    if own == gone or cells[1, p] == gone:
                        for d in range(dims):
                            some[d, n_some] = tiles[p // LANES, d, p % LANES]
                        members[n_some] = p
                        n_some += 1
                    elif square < squares[0, p]:
                        cells[1, p] = own
                        squares[1, p] = squares[0, p]
                        cells[0, p] = <int32_t>gone
                        squares[0, p] = square
                    elif square < squares[1, p]:
                        cells[1, p] = <int32_t>gone
                        squares[1, p] = square
                    if n_some == LANES or (n_some > 0 and p == n_points - 1):
                        _find_two(&some[0, 0], places, half_norms, found, cells, squares, n_points, True)
                        for i in range(n_some):
                            for k in range(2):
                                cells[k, members[i]] = cells[k, n_points + i]
                                squares[k, members[i]] = squares[k, n_points + i]
                        n_some = 0
            n_seeded[s] = found
            for k in range(found):
                for d in range(dims):
                    generators[s, k, d] = places[k, d]


cdef inline void _set_place(
    real[:, ::1] places, real[::1] half_norms, Py_ssize_t k, const double *place
) noexcept nogil:
    cdef Py_ssize_t d
    for d in range(places.shape[1]):
        places[k, d] = <real>place[d]
    _set_norm(places, half_norms, k)


cdef inline void _set_norm(real[:, ::1] places, real[::1] half_norms, Py_ssize_t k) noexcept nogil:
    cdef double norm = 0
    cdef Py_ssize_t d
    for d in range(places.shape[1]):
        norm = norm + <double>places[k, d] * places[k, d]
    half_norms[k] = <real>(0.5 * norm) if real is float else 0


cdef inline void _find_two(
    const real *tile, real[:, ::1] places, real[::1] half_norms, Py_ssize_t n_places, int32_t[:, ::1] cells,
    real[:, ::1] squares, Py_ssize_t first, bint named
) noexcept nogil:
    """Find the two places nearest to each point of a tile, from that number on, and the squared distances; perhaps not the second's name."""
    cdef int dims = places.shape[1]
    cdef Py_ssize_t i, d
    cdef real step
    cdef real gaps[LANES]
    cdef real total[LANES]
    cdef const real *own[LANES]
    search[sizeof(real) == 8].one(
        tile, dims, &places[0, 0], &half_norms[0], <int>n_places, &cells[0, first], gaps)
    if n_places > 1 and named:
        search[sizeof(real) == 8].next(
            tile, dims, &places[0, 0], &half_norms[0], <int>n_places, NULL, NULL, &cells[0, first], &cells[1, first], gaps)
    for i in range(LANES):
        own[i] = &places[cells[0, first + i], 0]
        total[i] = 0
    for d in range(dims):
        for i in range(LANES):
            step = tile[d * LANES + i] - own[i][d]
            total[i] += step * step
    for i in range(LANES):
        squares[0, first + i] = total[i]
        squares[1, first + i] = total[i] + max(gaps[i], <real>0) if n_places > 1 else FLT_MAX


def distances_to_own(
    const real[:, :, ::1] tiles,     # IN (n_tiles, D, LANES)
    const double[:, ::1] generators,  # IN (K, D)
    const int32_t[::1] labels,        # IN (n_tiles * LANES,)
    double[::1] distances,            # OUT (n_tiles * LANES,): squared, to the own generator
):
    cdef Py_ssize_t n_tiles = tiles.shape[0], dims = tiles.shape[1], t, i, d
    cdef const double *own[LANES]
    cdef double total[LANES]
    cdef double step
    with nogil:
        for t in range(n_tiles):
            for i in range(LANES):
                own[i] = &generators[labels[t * LANES + i], 0]
                total[i] = 0
            for d in range(dims):
                for i in range(LANES):
                    step = tiles[t, d, i] - own[i][d]
                    total[i] = total[i] + step * step
            for i in range(LANES):
                distances[t * LANES + i] = total[i]


def transfer(
    const real[:, :, ::1] tiles,   # IN (n_tiles, D, LANES)
    const double[::1] density,      # IN (n_tiles * LANES,)
    int32_t[:, ::1] labels,         # INOUT (n_sets, n_tiles * LANES)
    double[:, ::1] masses,          # INOUT (n_sets, K)
    double[:, :, ::1] means,        # INOUT (n_sets, K, D)
    double[:, ::1] energies,        # INOUT (n_sets, K): of each cell about its mean
    real[:, ::1] single,           # OUT (K, D): scratch
    real[:, ::1] scalars,          # OUT (2, K): scratch
    Py_ssize_t n_locked,            # IN: the means of the first cells stay in place
    double power,                   # IN: a cell counts by its share of the mass to this power
    double total,                   # IN: mass of all cells
    double tolerance,               # IN: the last sweep of a set lowers the weighted energy by at most this fraction
    Py_ssize_t most,                # IN: or it is this one
):
    """Move each point to the cell where the weighted energy is least, one after the other; return how many moved."""
    cdef Py_ssize_t s, n, n_moved = 0
    cdef double before
    with nogil:
        for s in range(labels.shape[0]):
            for n in range(most):
                before = _weighted(masses[s], energies[s], power, total)
                n_moved = _sweep(
                    tiles, density, labels[s], masses[s], means[s], energies[s], single, scalars, n_locked, power, total)
                if before - _weighted(masses[s], energies[s], power, total) <= tolerance * before:
                    break
    return n_moved


cdef double _weighted(double[::1] masses, double[::1] energies, double power, double total) noexcept nogil:
    cdef double sum = 0
    cdef Py_ssize_t k
    for k in range(masses.shape[0]):
        sum += cell_weight(masses[k] / total, power) * energies[k]
    return sum


cdef Py_ssize_t _sweep(
    const real[:, :, ::1] tiles, const double[::1] density, int32_t[::1] labels, double[::1] masses,
    double[:, ::1] means, double[::1] energies, real[:, ::1] single, real[:, ::1] scalars,
    Py_ssize_t n_locked, double power, double total,
) noexcept nogil:
    cdef Py_ssize_t dims = tiles.shape[1], n_cells = masses.shape[0], t, p, d, i, k, own, best, n_moved = 0
    cdef double mass, square, before, after, change, gain, least, own_change
    cdef real weights[LANES], gaps[LANES]
    cdef int32_t next[LANES]
    for k in range(n_cells):
        _round(means, masses[k] / total, k, k < n_locked, single, scalars)
    for t in range(tiles.shape[0]):
        if power == 0:
            for i in range(LANES):
                weights[i] = <real>(density[t * LANES + i] / total)
            search[sizeof(real) == 8].next(
                &tiles[t, 0, 0], <int>dims, &single[0, 0], &scalars[0, 0], <int>n_cells, &scalars[1, 0], weights,
                &labels[t * LANES], next, gaps)
        for i in range(LANES):
            p = t * LANES + i
            mass = density[p]
            own = labels[p]
            best = own if power else next[i]
            if mass == 0 or masses[own] <= mass or (power == 0 and gaps[i] >= 0):
                continue  # the last point of a cell stays: there are as many cells as asked for
            before = cell_weight(masses[own] / total, power)
            after = cell_weight((masses[own] - mass) / total, power)
            own_change = mass * _square(tiles, t, i, means, own)
            if own >= n_locked:
                own_change *= masses[own] / (masses[own] - mass)
            gain = after * own_change + (before - after) * energies[own]
            if power:
                least = gain
                for k in range(n_cells):
                    square = _square(tiles, t, i, means, k)
                    change = _growth(mass, square, masses[k], energies[k], k < n_locked, power, total)
                    if k != own and change < least:
                        least = change
                        best = k
            square = _square(tiles, t, i, means, best)
            change = _growth(mass, square, masses[best], energies[best], best < n_locked, power, total)
            if best == own or change >= gain * (1 - 1e-12):  # less is rounding, and might go round in circles
                continue
            n_moved += 1
            labels[p] = <int32_t>best
            energies[own] -= own_change
            energies[best] += mass * square * (1 if best < n_locked else masses[best] / (masses[best] + mass))
            for d in range(dims):
                if own >= n_locked:
                    means[own, d] -= (tiles[t, d, i] - means[own, d]) * mass / (masses[own] - mass)
                if best >= n_locked:
                    means[best, d] += (tiles[t, d, i] - means[best, d]) * mass / (masses[best] + mass)
            masses[own] -= mass
            masses[best] += mass
            _round(means, masses[own] / total, own, own < n_locked, single, scalars)
            _round(means, masses[best] / total, best, best < n_locked, single, scalars)
    return n_moved


cdef inline void _round(
    const double[:, ::1] means, double mass, Py_ssize_t k, bint locked, real[:, ::1] single, real[:, ::1] scalars
) noexcept nogil:
    """Set the mean of a cell, half its squared norm and the inverse of its mass in single precision."""
    _set_place(single, scalars[0], k, &means[k, 0])
    scalars[1, k] = <real>(0 if locked else 1 / max(mass, 1e-12))


cdef inline double _square(
    const real[:, :, ::1] tiles, Py_ssize_t t, Py_ssize_t i, const double[:, ::1] means, Py_ssize_t k
) noexcept nogil:
    """Return the squared distance of a point to a mean."""
    cdef double step, square = 0
    cdef Py_ssize_t d
    for d in range(tiles.shape[1]):
        step = tiles[t, d, i] - means[k, d]
        square = square + step * step
    return square


cdef inline double _growth(
    double mass, double square, double cell_mass, double energy, bint locked, double power, double total
) noexcept nogil:
    """Return by how much the weighted energy of a cell grows with a point at this squared distance of its mean."""
    cdef double change = mass * square, after
    if not locked:
        change *= cell_mass / (cell_mass + mass)
    if power == 0:
        return change
    after = cell_weight((cell_mass + mass) / total, power)
    return after * change + (after - cell_weight(cell_mass / total, power)) * energy


def divide_cells(
    const real[:, :, ::1] tiles,   # IN (n_tiles, D, LANES)
    const double[::1] density,      # IN (n_tiles * LANES,)
    int32_t[::1] labels,            # INOUT (n_tiles * LANES,): points above the plane of their cell get its child
    const int32_t[::1] children,    # IN (K,): the child of each cell that is divided, -1 for the others
    const double[:, ::1] axes,      # IN (K, D): normals of the planes
    const double[::1] offsets,      # IN (K,): above the plane is axis . point >= offset
    int64_t[::1] counts,            # INOUT (K,): += points of positive density that came to each child
    double[:, :, ::1] moments,      # INOUT (K, D + 1, D + 1): += density times (1, point)^T (1, point), lower half
):
    cdef Py_ssize_t n_points = density.shape[0], dims = tiles.shape[1], p, d, e, t, i
    cdef int32_t cell, child
    cdef double height, weight, product
    cdef double *moment
    with nogil:
        for p in range(n_points):
            cell = labels[p]
            child = children[cell]
            if child < 0 or density[p] == 0:
                continue
            t = p // LANES
            i = p % LANES
            height = 0
            for d in range(dims):
                height = height + axes[cell, d] * tiles[t, d, i]
            if height < offsets[cell]:
                continue
            labels[p] = child
            counts[child] += 1
            weight = density[p]
            moment = &moments[child, 0, 0]
            moment[0] += weight
            for d in range(dims):
                product = weight * tiles[t, d, i]
                moment[(d + 1) * (dims + 1)] += product
                for e in range(d + 1):
                    moment[(d + 1) * (dims + 1) + e + 1] += product * tiles[t, e, i]


def draw_means(
    const real[:, :, ::1] tiles,   # IN (n_tiles, D, LANES)
    const int64_t[::1] drawn,       # IN (n,): points, in the order in which they were drawn
    const double[::1] weights,      # IN (n,): of each of them, >= 0
    double[:, ::1] means,           # INOUT (D, K)
    double[::1] counts,             # INOUT (K,): weight of the points that each mean is the mean of
    double[::1] squares,            # OUT (K,): scratch
    Py_ssize_t n_locked,            # IN: the first means stay in place
):
    """Add one point after the other to the mean that is nearest to it by then, the first one on a tie."""
    cdef Py_ssize_t n_drawn = drawn.shape[0], dims = tiles.shape[1], n_cells = counts.shape[0], n, d, k, t, i, nearest
    cdef double step, least, total
    with nogil:
        for n in range(n_drawn):
            t = drawn[n] // LANES
            i = drawn[n] % LANES
            squares[:] = 0
            for d in range(dims):
                for k in range(n_cells):
                    step = tiles[t, d, i] - means[d, k]
                    squares[k] += step * step
            least = squares[0]
            for k in range(1, n_cells):
                least = min(least, squares[k])
            nearest = 0
            while squares[nearest] != least:
                nearest += 1
            if nearest < n_locked or weights[n] == 0:
                continue
            total = counts[nearest] + weights[n]
            for d in range(dims):
                means[d, nearest] = (counts[nearest] * means[d, nearest] + weights[n] * tiles[t, d, i]) / total
            counts[nearest] = total


cdef inline double rest_of_sum(double first, double second, double total) noexcept nogil:
    """Return what rounding took from the sum of two numbers (D. Knuth)."""
    cdef double part = total - first
    return (first - (total - part)) + (second - part)


cdef inline double rest_of_product(double first, double second, double product) noexcept nogil:
    """Return what rounding took from a product: T. Dekker, Numer. Math. 18 (1971), doi 10.1007/BF01397083."""
    cdef double high = 134217729.0 * first, other = 134217729.0 * second, low, rest
    high = high - (high - first)
    low = first - high
    other = other - (other - second)
    rest = second - other
    return ((high * other - product) + high * rest + low * other) + low * rest


def sum_levels(
    const double[::1] values,   # IN (M,)
    const double[::1] density,  # IN (M,)
    double[:, ::1] moments,     # OUT (M + 1, 6): sums of density times (1, y, y^2) before each, then what rounding took
):
    """Sum outwards from the middle, so that no sum has a level that is far away but those beyond it."""
    cdef Py_ssize_t n = values.shape[0], middle = n // 2, step, i, before, after, power
    cdef double term[3]
    cdef double rest[3]
    with nogil:
        moments[middle, :] = 0
        for step in range(n):
            i = middle + step if step < n - middle else n - 1 - step
            before, after = (i, i + 1) if i >= middle else (i + 1, i)
            term[0], rest[0] = density[i] if i >= middle else -density[i], 0
            for power in range(1, 3):
                term[power] = term[power - 1] * values[i]
                rest[power] = rest[power - 1] * values[i] + rest_of_product(term[power - 1], values[i], term[power])
            for power in range(3):
                moments[after, power] = moments[before, power] + term[power]
                rest[power] = rest[power] + rest_of_sum(moments[before, power], term[power], moments[after, power])
                moments[after, 3 + power] = moments[before, 3 + power] + rest[power]


cdef inline double cell_energy(const double[:, ::1] moments, Py_ssize_t first, Py_ssize_t end) noexcept nogil:
    """Energy about their mean of levels first..end-1, from the sums over those before each, in twice the digits."""
    cdef double sums[3]
    cdef double rests[3]
    cdef double square, product, share, energy
    cdef Py_ssize_t power
    for power in range(3):
        sums[power] = moments[end, power] - moments[first, power]
    share = sums[1] * sums[1] / sums[0]
    if sums[2] - share > 1e-6 * (fabs(moments[first, 2]) + fabs(moments[end, 2])):  # nine digits are left
        return sums[2] - share
    for power in range(3):
        rests[power] = rest_of_sum(moments[end, power], -moments[first, power], sums[power])
        rests[power] = rests[power] + (moments[end, 3 + power] - moments[first, 3 + power])
    # sum^2 / mass is `share`, and what is left of the square divided by the mass.
    square = sums[1] * sums[1]
    product = share * sums[0]
    square = (square - product) - rest_of_product(share, sums[0], product) - share * rests[0] \
        + (rest_of_product(sums[1], sums[1], square) + 2 * sums[1] * rests[1])
    energy = sums[2] - share
    return max(energy + (rest_of_sum(sums[2], -share, energy) + rests[2] - square / sums[0]), 0)


cdef inline double through(
    const double[:, ::1] moments, const double[::1] costs, Py_ssize_t first, Py_ssize_t end
) noexcept nogil:
    """Cost of levels 0..end-1 if their last cell begins at `first`, but for the price of that cell."""
    return costs[first] + cell_energy(moments, first, end)


cdef inline Py_ssize_t takes_over(
    const double[:, ::1] moments, const double[::1] costs, Py_ssize_t older, Py_ssize_t newer, Py_ssize_t worse
) noexcept nogil:
    """First end from which a last cell better begins at `newer`, given that at `worse` it does not; or M + 1."""
    # The place is near: steps that double find it sooner than halving all that is left.
    cdef Py_ssize_t n = moments.shape[0] - 1, stride = 1, better = n + 1, middle
    while worse + stride <= n:
        if through(moments, costs, newer, worse + stride) < through(moments, costs, older, worse + stride):
            better = worse + stride
            break
        worse += stride
        stride *= 2
    while better - worse > 1:
        middle = (worse + better) // 2
        if through(moments, costs, newer, middle) < through(moments, costs, older, middle):
            better = middle
        else:
            worse = middle
    return better


def cut_levels(
    const double[:, ::1] moments,   # IN (M + 1, 6): of `sum_levels`, where all density is > 0
    double price,                   # IN: of a cell
    double[::1] costs,              # OUT (M + 1,): least sum of energies and prices for the levels before each
    int32_t[::1] firsts,            # OUT (M + 1,): where the last of their cells begins
    int32_t[::1] queue,             # OUT (M + 1,): scratch; beginnings of a last cell that are still to serve
    int32_t[::1] since,             # OUT (M + 1,): scratch; the end from which each of these is best
    int32_t[::1] bounds,            # OUT (M + 1,): M, and where each cell begins, the last one first
):
    """Cut sorted levels into cells at the least sum of energies and prices; return the number of cells."""
    # A later beginning that is better for some end is better for all ends after that. So those that will ever be
    # best stand in a queue, and a new one takes the ends behind some place from those before it.
    cdef Py_ssize_t n = moments.shape[0] - 1, head = 0, last = 0, end, start, n_cells = 0
    with nogil:
        costs[0] = 0
        queue[0] = 0
        since[0] = 1
        for end in range(1, n + 1):
            while head < last and since[head + 1] <= end:
                head += 1
            firsts[end] = queue[head]
            costs[end] = through(moments, costs, queue[head], end) + price
            if end == n:
                break
            while True:
                if last < head:
                    start = end + 1
                    break
                start = max(<Py_ssize_t>since[last], end + 1)
                if through(moments, costs, end, start) >= through(moments, costs, queue[last], start):
                    start = takes_over(moments, costs, queue[last], end, start)
                    break
                last -= 1
            if start <= n:
                last += 1
                queue[last] = <int32_t>end
                since[last] = <int32_t>start
        start = n
        while start > 0:
            bounds[n_cells] = <int32_t>start
            start = firsts[start]
            n_cells += 1
        bounds[n_cells] = 0
    return n_cells

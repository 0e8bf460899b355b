/* The loops of nearest.h for one instruction set and one precision, which the compiler's arguments choose: SIMD is the
 * name of the set, and EXACT stands for double precision.
 *
 * Points come in tiles of LANES points, one coordinate after the other, so that points lie in SIMD lanes and each
 * generator is broadcast to a whole tile. In single precision |z|^2 / 2 - x.z is compared in place of |x - z|^2 / 2, which
 * leaves one multiply-add a dimension; callers center the data, and know what the product form loses. In double
 * precision, where that would be too much, the score is |x - z|^2 / 2 itself, and half norms are 0.
 *
 * They vectorise only with -ffinite-math-only -fno-signed-zeros -fno-trapping-math.
 */
#include "nearest.h"

#include <float.h>
#include <string.h>

/* Sums of many dimensions are kept for four generators at a time, so that each load of a point serves four of them. */
enum { GENERATORS_AT_ONCE = 4, DIMS_AT_ONCE = 2 };

#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif

#ifdef EXACT
typedef double real;
#define REAL_MAX DBL_MAX
#define TOWARDS(score, x, z) (score) += (real)0.5 * square((x) - (z))
#define SQUARE_OF_POINT(x) 0
#define HALF_NORM(z) 0
#define MIDDLE(low, high) 0
#else
typedef float real;
#define REAL_MAX FLT_MAX
#define TOWARDS(score, x, z) (score) -= (x) * (z)
#define SQUARE_OF_POINT(x) square(x)
#define HALF_NORM(z) 0.5f * square(z)
#define MIDDLE(low, high) (0.5f * ((low) + (high)))
#endif

INLINE real square(real x)
{
    return x * x;
}

INLINE real positive(real x)
{
    return x > 0 ? x : 0;
}

/* Keep the least score and its generator; and the second least, unless `second` is NULL. */
INLINE void keep_nearer(const real *restrict score, int generator, real *restrict least, int32_t *restrict nearest,
                        real *restrict second)
{
    for (int i = 0; i < LANES; i++) {
        int closer = score[i] < least[i];
        if (second) {
            real other = closer ? least[i] : score[i];
            second[i] = other < second[i] ? other : second[i];
        }
        least[i] = closer ? score[i] : least[i];
        nearest[i] = closer ? generator : nearest[i];
    }
}

/* How much farther than the nearest the second is, in squared distance. */
INLINE void keep_gap(const real *restrict least, const real *restrict second, real *restrict gap)
{
    for (int i = 0; gap && i < LANES; i++)
        gap[i] = second[i] < REAL_MAX ? 2 * (second[i] - least[i]) : REAL_MAX;
}

/* Few dimensions: `dims` is known to the compiler, the whole tile stays in registers. */
INLINE void nearest_few_dims(const real *restrict tile, int dims, const real *restrict generators,
                             const real *restrict half_norms, int n_generators, int32_t *restrict nearest,
                             real *restrict gap)
{
    real least[LANES], second[LANES];
    int32_t index[LANES];

    for (int i = 0; i < LANES; i++) {
        least[i] = second[i] = REAL_MAX;
        index[i] = 0;
    }
    for (int k = 0; k < n_generators; k++) {
        const real *z = generators + (ptrdiff_t)k * dims;
        /* One loop, not a call of keep_nearer on an array of scores: the scores then never leave the registers. */
        for (int i = 0; i < LANES; i++) {
            real score = half_norms[k];
            for (int d = 0; d < dims; d++)
                TOWARDS(score, tile[d * LANES + i], z[d]);
            int closer = score < least[i];
            if (gap) {
                real other = closer ? least[i] : score;
                second[i] = other < second[i] ? other : second[i];
            }
            least[i] = closer ? score : least[i];
            index[i] = closer ? k : index[i];
        }
    }
    memcpy(nearest, index, sizeof index);
    keep_gap(least, second, gap);
}

INLINE void subtract_products(const real *restrict tile, int n_dims, const real *restrict generators, int dims,
                              int n_generators, real score[][LANES])
{
    for (int i = 0; i < LANES; i++)
        for (int g = 0; g < n_generators; g++)
            for (int d = 0; d < n_dims; d++)
                TOWARDS(score[g][i], tile[d * LANES + i], generators[(ptrdiff_t)g * dims + d]);
}

INLINE void score_generators(const real *restrict tile, int dims, const real *restrict generators,
                             const real *restrict half_norms, int first, int n_generators, real score[][LANES])
{
    int d = 0;

    for (int g = 0; g < n_generators; g++)
        for (int i = 0; i < LANES; i++)
            score[g][i] = half_norms[first + g];
    generators += (ptrdiff_t)first * dims;
    for (; d + DIMS_AT_ONCE <= dims; d += DIMS_AT_ONCE)
        subtract_products(tile + d * LANES, DIMS_AT_ONCE, generators + d, dims, n_generators, score);
    for (; d < dims; d++)
        subtract_products(tile + d * LANES, 1, generators + d, dims, n_generators, score);
}

/* Score the generators from `first` on, as many as go at once; return their number. */
INLINE int score_some(const real *restrict tile, int dims, const real *restrict generators,
                      const real *restrict half_norms, int first, int n_generators, real score[][LANES])
{
    int n = n_generators - first < GENERATORS_AT_ONCE ? n_generators - first : GENERATORS_AT_ONCE;

    switch (n) { /* so that the compiler knows it */
    case 1: score_generators(tile, dims, generators, half_norms, first, 1, score); break;
    case 2: score_generators(tile, dims, generators, half_norms, first, 2, score); break;
    case 3: score_generators(tile, dims, generators, half_norms, first, 3, score); break;
    default: score_generators(tile, dims, generators, half_norms, first, GENERATORS_AT_ONCE, score);
    }
    return n;
}

INLINE void nearest_any_dims(const real *restrict tile, int dims, const real *restrict generators,
                             const real *restrict half_norms, int n_generators, int32_t *restrict nearest,
                             real *restrict gap)
{
    real least[LANES], second[LANES], score[GENERATORS_AT_ONCE][LANES];

    for (int i = 0; i < LANES; i++) {
        least[i] = second[i] = REAL_MAX;
        nearest[i] = 0;
    }
    for (int k = 0, n; k < n_generators; k += n) {
        n = score_some(tile, dims, generators, half_norms, k, n_generators, score);
        for (int g = 0; g < n; g++)
            keep_nearer(score[g], k + g, least, nearest, gap ? second : NULL);
    }
    keep_gap(least, second, gap);
}

/* The cell other than its own in which each point costs least, and how much more than in its own: a point of weight w at
 * a squared distance s from the mean of a cell of mass m costs s / (1 + w / m), in its own s / (1 - w / m), times w. Without
 * inverse masses the costs are squared distances. */
INLINE void next_cell(const real *restrict tile, int dims, const real *restrict generators,
                      const real *restrict half_norms, int n_generators, const real *restrict inverse_masses,
                      const real *restrict weights, const int32_t *restrict own, int32_t *restrict next,
                      real *restrict gap)
{
    real squares[LANES] = {0}, least[LANES], at_home[LANES], cost[GENERATORS_AT_ONCE][LANES];

    for (int i = 0; i < LANES; i++) {
        least[i] = REAL_MAX;
        next[i] = 0;
        at_home[i] = half_norms[own[i]];
    }
    for (int d = 0; d < dims; d++)
        for (int i = 0; i < LANES; i++) {
            squares[i] += SQUARE_OF_POINT(tile[d * LANES + i]);
            TOWARDS(at_home[i], tile[d * LANES + i], generators[(ptrdiff_t)own[i] * dims + d]);
        }
    for (int k = 0, n; k < n_generators; k += n) {
        n = score_some(tile, dims, generators, half_norms, k, n_generators, cost);
        for (int g = 0; g < n; g++) {
            if (inverse_masses)
                for (int i = 0; i < LANES; i++)
                    cost[g][i] = positive(squares[i] + 2 * cost[g][i]) / (1 + weights[i] * inverse_masses[k + g]);
            for (int i = 0; i < LANES; i++)
                cost[g][i] = own[i] == k + g ? REAL_MAX : cost[g][i];
            keep_nearer(cost[g], k + g, least, next, NULL);
        }
    }
    for (int i = 0; i < LANES; i++) {
        real home = positive(squares[i] + 2 * at_home[i]);
        gap[i] = inverse_masses ? least[i] - home / (1 - weights[i] * inverse_masses[own[i]])
                                : 2 * (least[i] - at_home[i]);
    }
}

/* ---- Few dimensions, tiles of neighbouring points: only the generators that can be nearest are compared ---- */

/* Candidates that a group, or a tile, may have; with more, all generators are compared. */
enum { MOST_NEAR = 1024 };

/* Fills columns up; its square is still a float. */
#define FAR_AWAY 1e18f

/* Generators in columns, (dims, width), so that they lie in lanes; width is a multiple of LANES. */
struct columns {
    const real *at;
    ptrdiff_t width;
    const int32_t *names; /* which generator each column is, or NULL where that is the number of the column */
};

/* The column nearest to a place. */
INLINE ptrdiff_t nearest_column(struct columns z, int dims, const real *restrict place)
{
    real least[LANES];
    int32_t index[LANES];
    int32_t best = INT32_MAX;
    real minimum = REAL_MAX;

    for (int i = 0; i < LANES; i++)
        least[i] = REAL_MAX;
    for (ptrdiff_t k = 0; k < z.width; k += LANES) {
        for (int i = 0; i < LANES; i++) {
            real distance = 0;
            for (int d = 0; d < dims; d++)
                distance += square(z.at[d * z.width + k + i] - place[d]);
            int closer = distance < least[i];
            least[i] = closer ? distance : least[i];
            index[i] = closer ? (int32_t)k + i : index[i];
        }
    }
    for (int i = 0; i < LANES; i++)
        minimum = least[i] < minimum ? least[i] : minimum;
    for (int i = 0; i < LANES; i++)
        best = least[i] == minimum && index[i] < best ? index[i] : best;
    return best;
}

/* Columns that are nearest to some point of a box; their number, or -1 if there are more than fit.
 *
 * The one nearest to the middle of the box rules out every other that is farther away even from the corner of the
 * box that lies most in its direction (Kanungo et al., IEEE Trans. PAMI 24, 2002, doi 10.1109/TPAMI.2002.1017616).
 */
INLINE int columns_near(struct columns z, int dims, const real *restrict low, const real *restrict high,
                        int32_t *restrict nearby)
{
    real place[FEW_DIMS], size = 0;
    int n_near = 0;

    for (int d = 0; d < dims; d++) {
        place[d] = 0.5f * (low[d] + high[d]);
        size += square(high[d] - low[d]);
    }
    ptrdiff_t middle = nearest_column(z, dims, place);
    for (int d = 0; d < dims; d++)
        place[d] = z.at[d * z.width + middle];
    for (ptrdiff_t k = 0; k < z.width; k += LANES) {
        real farther[LANES], scale[LANES];
        if (n_near > MOST_NEAR - LANES)
            return -1;
        for (int i = 0; i < LANES; i++) {
            farther[i] = 0;
            scale[i] = size;
            for (int d = 0; d < dims; d++) {
                real other = z.at[d * z.width + k + i], step = other - place[d];
                real corner = step > 0 ? high[d] : low[d];
                farther[i] += step * (0.5f * (other + place[d]) - corner);
                scale[i] += square(other - corner);
            }
        }
        /* A generator is kept when rounding leaves a doubt: the margin is some ulp of the distances compared. */
        for (int i = 0; i < LANES; i++) {
            nearby[n_near] = (int32_t)k + i;
            n_near += farther[i] <= 1e-6f * scale[i];
        }
    }
    return n_near;
}

/* One tile against some columns; products have the middle of its box as origin, about which they keep their precision. */
INLINE void nearest_of_columns(const real *restrict tile, int dims, struct columns z, const real *restrict low,
                               const real *restrict high, const int32_t *restrict nearby, int n_near,
                               int32_t *restrict nearest, real *restrict gap)
{
    real points[FEW_DIMS * LANES], generators[FEW_DIMS * MOST_NEAR], half_norms[MOST_NEAR];
    int32_t index[LANES], name[MOST_NEAR];

    for (int d = 0; d < dims; d++)
        for (int i = 0; i < LANES; i++)
            points[d * LANES + i] = tile[d * LANES + i] - MIDDLE(low[d], high[d]);
    for (int k = 0; k < n_near; k++) {
        name[k] = z.names ? z.names[nearby[k]] : nearby[k];
        half_norms[k] = 0;
        for (int d = 0; d < dims; d++) {
            real step = z.at[d * z.width + nearby[k]] - MIDDLE(low[d], high[d]);
            generators[k * dims + d] = step;
            half_norms[k] += HALF_NORM(step);
        }
    }
    nearest_few_dims(points, dims, generators, half_norms, n_near, index, gap);
    for (int i = 0; i < LANES; i++)
        nearest[i] = name[index[i]];
}

/* Tiles that follow each other, against the generators that can be nearest to any of their points. */
INLINE void nearest_in_group(const real *restrict tiles, const real *restrict boxes, int n_tiles, int dims,
                             struct columns z, const real *restrict generators, const real *restrict half_norms,
                             int n_generators, int32_t *restrict nearest, real *restrict gap)
{
    real low[FEW_DIMS], high[FEW_DIMS], at[FEW_DIMS * MOST_NEAR];
    int32_t in_group[MOST_NEAR], in_tile[MOST_NEAR];

    for (int d = 0; d < dims; d++) {
        low[d] = boxes[d];
        high[d] = boxes[dims + d];
        for (int t = 1; t < n_tiles; t++) {
            const real *box = boxes + (ptrdiff_t)t * 2 * dims;
            low[d] = box[d] < low[d] ? box[d] : low[d];
            high[d] = box[dims + d] > high[d] ? box[dims + d] : high[d];
        }
    }
    int n_near = columns_near(z, dims, low, high, in_group);
    struct columns group = z;
    if (n_near >= 0) {
        group = (struct columns){at, (n_near + LANES - 1) / LANES * LANES, in_group};
        for (int d = 0; d < dims; d++)
            for (int k = 0; k < group.width; k++)
                at[d * group.width + k] = k < n_near ? z.at[d * z.width + in_group[k]] : FAR_AWAY;
    }
    for (int t = 0; t < n_tiles; t++) {
        const real *tile = tiles + (ptrdiff_t)t * dims * LANES, *box = boxes + (ptrdiff_t)t * 2 * dims;
        int32_t *labels = nearest + (ptrdiff_t)t * LANES;
        real *farther = gap ? gap + (ptrdiff_t)t * LANES : NULL;
        int n = columns_near(group, dims, box, box + dims, in_tile);
        if (n >= 0)
            nearest_of_columns(tile, dims, group, box, box + dims, in_tile, n, labels, farther);
        else
            nearest_few_dims(tile, dims, generators, half_norms, n_generators, labels, farther);
    }
}

/* Points that follow each other mostly share few cells. While a cell has WORTH_ALL_LANES points left in a tile, summing it in
 * all lanes at once takes less than going from point to point. */
enum { WORTH_ALL_LANES = 10, SUMS_AT_ONCE = 8 };

/* Without values, the sum of the weights. */
INLINE double sum_products(const double *restrict weight, const real *restrict values)
{
    double sums[SUMS_AT_ONCE] = {0};

    for (int i = 0; i < LANES; i += SUMS_AT_ONCE)
        for (int lane = 0; lane < SUMS_AT_ONCE; lane++)
            sums[lane] += values ? weight[i + lane] * values[i + lane] : weight[i + lane];
    for (int half = SUMS_AT_ONCE / 2; half; half /= 2)
        for (int lane = 0; lane < half; lane++)
            sums[lane] += sums[lane + half];
    return sums[0];
}

/* Add the points of one cell in a tile to its sums, strike them off the labels left, and count them. */
INLINE int sum_one_cell(const real *restrict tile, int dims, const double *restrict density, int32_t label,
                        int32_t *restrict left, double *restrict cell)
{
    double weight[LANES];
    int n_members = 0;

    for (int i = 0; i < LANES; i++) {
        int member = left[i] == label;
        weight[i] = member ? density[i] : 0;
        left[i] = member ? -1 : left[i];
        n_members += member;
    }
    for (int d = 0; d < dims; d++)
        cell[d] += sum_products(weight, tile + d * LANES);
    cell[dims] += sum_products(weight, NULL);
    return n_members;
}

/* Add density times (point, 1) to the sums of each point's cell. */
INLINE void sum_tile(const real *restrict tile, int dims, const double *restrict density,
                     const int32_t *restrict labels, double *restrict sums)
{
    int32_t left[LANES];
    int n_left = LANES, n_members = dims <= FEW_DIMS ? LANES : 0, first = 0;

    memcpy(left, labels, sizeof left);
    while (n_left && n_members >= WORTH_ALL_LANES) {
        while (left[first] < 0)
            first++;
        n_members = sum_one_cell(tile, dims, density, labels[first], left,
                                 sums + (ptrdiff_t)labels[first] * (dims + 1));
        n_left -= n_members;
    }
    for (int i = first; n_left && i < LANES; i++) {
        if (left[i] < 0)
            continue;
        double *cell = sums + (ptrdiff_t)left[i] * (dims + 1);
        for (int d = 0; d < dims; d++)
            cell[d] += density[i] * tile[d * LANES + i];
        cell[dims] += density[i];
        n_left--;
    }
}

#define BY_DIMS(dims, call) \
    switch (dims) {         \
    case 1: call(1); break; \
    case 2: call(2); break; \
    case 3: call(3); break; \
    case 4: call(4); break; \
    default: call(0);       \
    }

#define NEAREST(D)                                                                        \
    D ? nearest_few_dims(tile, D, generators, half_norms, n_generators, nearest, NULL)    \
      : nearest_any_dims(tile, dims, generators, half_norms, n_generators, nearest, NULL)

#define NEAREST_AND_GAP(D)                                                               \
    D ? nearest_few_dims(tile, D, generators, half_norms, n_generators, nearest, gap)    \
      : nearest_any_dims(tile, dims, generators, half_norms, n_generators, nearest, gap)

#define NEXT(D) \
    next_cell(tile, D ? D : dims, generators, half_norms, n_generators, inverse_masses, weights, own, nearest, gap)

#define NEAREST_IN_GROUP(D) \
    nearest_in_group(tiles, boxes, n_tiles, D, z, generators, half_norms, n_generators, nearest, gap)

#define SUM(D) sum_tile(tile, D ? D : dims, density, labels, sums)

static void one(const void *tile, int dims, const void *generators, const void *half_norms, int n_generators,
                int32_t *nearest, void *gap)
{
    if (gap)
        BY_DIMS(dims, NEAREST_AND_GAP)
    else
        BY_DIMS(dims, NEAREST)
}

static void next(const void *tile, int dims, const void *generators, const void *half_norms, int n_generators,
                 const void *inverse_masses, const void *weights, const int32_t *own, int32_t *nearest, void *gap)
{
    BY_DIMS(dims, NEXT)
}

static void group(const void *tiles, const void *boxes, int n_tiles, int dims, const void *columns, ptrdiff_t width,
                  const void *generators, const void *half_norms, int n_generators, int32_t *nearest, void *gap)
{
    struct columns z = {columns, width, NULL};

    BY_DIMS(dims, NEAREST_IN_GROUP)
}

static void squares(const void *tile, int dims, const void *places, int n_places, void *distances)
{
    const real *restrict x = tile;

    for (int n = 0; n < n_places; n++) {
        const real *restrict place = (const real *)places + (ptrdiff_t)n * dims;
        real total[LANES] = {0};
        for (int d = 0; d < dims; d++)
            for (int i = 0; i < LANES; i++)
                total[i] += square(x[(ptrdiff_t)d * LANES + i] - place[d]);
        memcpy((real *)distances + (ptrdiff_t)n * LANES, total, sizeof total);
    }
}

static void sum(const void *tile, int dims, const double *density, const int32_t *labels, double *sums)
{
    BY_DIMS(dims, SUM)
}

#define JOIN(first, second) first##second
#ifdef EXACT
#define NAME(simd) JOIN(nearest_exact_, simd)
#else
#define NAME(simd) JOIN(nearest_, simd)
#endif
const struct nearest_functions NAME(SIMD) = {one, next, group, squares, sum};

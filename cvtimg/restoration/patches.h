/* Patches of an image in groups: their covariances, the filters that follow from these, and groups cut in two.
 *
 * Products of small matrices are taken in blocks of 4 x 16 sums, which stay in registers. The loops are written once and
 * compiled for two instruction sets. All strides are in numbers, not in bytes.
 */
#ifndef CVTIMG_PATCHES_H
#define CVTIMG_PATCHES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif

enum { SIDE = 5, REACH = SIDE / 2 };
/* Rows of a matrix are padded with zeros to a multiple of this. */
enum { LANES = 16, ROWS_AT_ONCE = 4 };
/* Largest numbers of bands, of values of a padded patch, and of features. */
enum { MAX_BANDS = 4, MAX_COLUMNS = 112, MAX_FEATURES = 32 };
/* Multiplications of a vector by the covariance of so many members that find its main axis, and steps of Lloyd from there. */
enum { POWERS = 12, SAMPLE = 1024, LLOYD_STEPS = 3 };

/* A padded image: patch (y, x) begins at pixel (y, x) of it. */
struct picture {
    const float *values;
    ptrdiff_t width, padded_width;
    int n_bands;
};

INLINE const float *patch_at(struct picture image, ptrdiff_t pixel)
{
    return image.values + (pixel / image.width * image.padded_width + pixel % image.width) * image.n_bands;
}

INLINE ptrdiff_t padded(ptrdiff_t n) { return (n + LANES - 1) / LANES * LANES; }

/* Copy a patch: pixels row by row, the bands of each side by side. */
INLINE void copy_patch(struct picture image, ptrdiff_t pixel, float *out)
{
    const float *from = patch_at(image, pixel);
    const ptrdiff_t row = SIDE * image.n_bands;
    for (int y = 0; y < SIDE; y++)
        memcpy(out + y * row, from + y * image.padded_width * image.n_bands, row * sizeof(float));
}

#if defined(__GNUC__)
/* Named vectors, because compilers do not keep an array of sums in registers by themselves. */
typedef float eight __attribute__((vector_size(32), aligned(4), may_alias));

INLINE void multiply_block(const float *restrict a, ptrdiff_t a_row, ptrdiff_t a_column, ptrdiff_t n_inner,
                           const float *restrict b, ptrdiff_t b_row, float *restrict out)
{
    eight sums[ROWS_AT_ONCE][2] = {{{0}}};
    for (ptrdiff_t k = 0; k < n_inner; k++, a += a_column, b += b_row) {
        const eight left = *(const eight *)b, right = *(const eight *)(b + 8);
#pragma GCC unroll 4
        for (int i = 0; i < ROWS_AT_ONCE; i++) {
            sums[i][0] += a[i * a_row] * left;
            sums[i][1] += a[i * a_row] * right;
        }
    }
    for (int i = 0; i < ROWS_AT_ONCE; i++)
        memcpy(out + i * b_row, sums[i], sizeof sums[i]);
}
#else
INLINE void multiply_block(const float *restrict a, ptrdiff_t a_row, ptrdiff_t a_column, ptrdiff_t n_inner,
                           const float *restrict b, ptrdiff_t b_row, float *restrict out)
{
    float sums[ROWS_AT_ONCE][LANES] = {{0}};
    for (ptrdiff_t k = 0; k < n_inner; k++)
        for (int i = 0; i < ROWS_AT_ONCE; i++)
            for (int j = 0; j < LANES; j++)
                sums[i][j] += a[i * a_row + k * a_column] * b[k * b_row + j];
    for (int i = 0; i < ROWS_AT_ONCE; i++)
        memcpy(out + i * b_row, sums[i], sizeof sums[i]);
}
#endif

/* out = a b; rows in fours, columns in sixteens; `symmetric` leaves out blocks below the diagonal. */
INLINE void multiply(const float *a, ptrdiff_t a_row, ptrdiff_t a_column, ptrdiff_t n_rows, ptrdiff_t n_inner,
                     const float *b, ptrdiff_t n_columns, float *out, int symmetric)
{
    for (ptrdiff_t i = 0; i < n_rows; i += ROWS_AT_ONCE)
        for (ptrdiff_t j = symmetric ? i / LANES * LANES : 0; j < n_columns; j += LANES)
            multiply_block(a + i * a_row, a_row, a_column, n_inner, b + j, n_columns, out + i * n_columns + j);
}

/* Mean patch of a group of `n`, and the (size, size) covariance of the patches; `patches` holds n rows, `products` size. */
INLINE void measure_group(struct picture image, const int32_t *members, ptrdiff_t n, ptrdiff_t size, float *patches,
                          float *products, float *mean, double *covariance)
{
    const ptrdiff_t columns = padded(size);
    double sums[MAX_COLUMNS] = {0};
    memset(patches, 0, n * columns * sizeof(float));
    for (ptrdiff_t i = 0; i < n; i++) {
        float *patch = patches + i * columns;
        copy_patch(image, members[i], patch);
        for (ptrdiff_t j = 0; j < size; j++)
            sums[j] += patch[j];
    }
    for (ptrdiff_t j = 0; j < size; j++)
        mean[j] = (float)(sums[j] / n);
    for (ptrdiff_t i = 0; i < n; i++)
        for (ptrdiff_t j = 0; j < size; j++)
            patches[i * columns + j] -= mean[j];
    multiply(patches, 1, columns, columns, n, patches, columns, products, 1);
    for (ptrdiff_t i = 0; i < size; i++)
        for (ptrdiff_t j = i; j < size; j++)
            covariance[i * size + j] = covariance[j * size + i] = (double)products[i * columns + j] / n;
}

/* filter = I - v (C + v I)^-1, in rows of padded(size); the covariance C is used up.
 *
 * A positive definite matrix turns into its negative inverse by sweeps, one for each row, which need no pivoting. It stays
 * symmetric, so that what is above the diagonal is enough.
 */
INLINE void make_filter(double *restrict covariance, ptrdiff_t size, double variance, float *restrict filter)
{
    const ptrdiff_t columns = padded(size);
    double pivots[MAX_COLUMNS];
    for (ptrdiff_t i = 0; i < size; i++)
        covariance[i * size + i] += variance;
    for (ptrdiff_t k = 0; k < size; k++) {
        for (ptrdiff_t i = 0; i < size; i++)
            pivots[i] = covariance[i < k ? i * size + k : k * size + i];
        const double inverse = 1 / pivots[k];
        pivots[k] = 0;
        for (ptrdiff_t i = 0; i < size; i++) {
            double *restrict row = covariance + i * size;
            const double factor = pivots[i] * inverse;
            for (ptrdiff_t j = i; j < size; j++)
                row[j] -= factor * pivots[j];
        }
        for (ptrdiff_t i = 0; i < size; i++)
            covariance[i < k ? i * size + k : k * size + i] = pivots[i] * inverse;
        covariance[k * size + k] = -inverse;
    }
    memset(filter, 0, size * columns * sizeof(float));
    for (ptrdiff_t i = 0; i < size; i++)
        for (ptrdiff_t j = i; j < size; j++)
            filter[i * columns + j] = filter[j * columns + i] = (float)((i == j) + variance * covariance[i * size + j]);
}

/* Filter what patches of image + step * change differ by from their mean; `patches` and `filtered` hold n rows, n a
 * multiple of four. */
INLINE void filter_group(struct picture image, struct picture change, float step, const int32_t *members, ptrdiff_t n,
                         ptrdiff_t size, const float *mean, const float *filter, float *patches, float *filtered,
                         float *out)
{
    const ptrdiff_t columns = padded(size), rows = (n + ROWS_AT_ONCE - 1) / ROWS_AT_ONCE * ROWS_AT_ONCE;
    float moved[MAX_COLUMNS];
    memset(patches, 0, rows * columns * sizeof(float));
    for (ptrdiff_t i = 0; i < n; i++) {
        float *patch = patches + i * columns;
        copy_patch(image, members[i], patch);
        copy_patch(change, members[i], moved);
        for (ptrdiff_t j = 0; j < size; j++)
            patch[j] += step * moved[j] - mean[j];
    }
    multiply(patches, columns, 1, rows, size, filter, columns, filtered, 0);
    for (ptrdiff_t i = 0; i < n; i++)
        for (ptrdiff_t j = 0; j < size; j++)
            out[members[i] * size + j] = filtered[i * columns + j] + mean[j];
}

/* The k-th smallest of n numbers, which are reordered. */
INLINE float select_kth(float *numbers, ptrdiff_t n, ptrdiff_t k)
{
    ptrdiff_t first = 0, last = n - 1;
    while (first < last) {
        const float pivot = numbers[first + (last - first) / 2];
        ptrdiff_t i = first, j = last;
        while (i <= j) {
            while (numbers[i] < pivot)
                i++;
            while (numbers[j] > pivot)
                j--;
            if (i <= j) {
                const float kept = numbers[i];
                numbers[i++] = numbers[j];
                numbers[j--] = kept;
            }
        }
        if (k <= j)
            last = j;
        else if (k >= i)
            first = i;
        else
            break;
    }
    return numbers[k];
}

/* The main axis of a group: the covariance times a vector, again and again. A sample of a large group has the same. */
INLINE void main_axis(const float *restrict features, int n_features, const int32_t *members, ptrdiff_t n,
                      double *mean, double *axis)
{
    double covariance[MAX_FEATURES][MAX_FEATURES] = {{0}};
    const ptrdiff_t step = 1 + n / SAMPLE, n_seen = (n + step - 1) / step;
    memset(mean, 0, n_features * sizeof(double));
    for (ptrdiff_t i = 0; i < n; i += step)
        for (int a = 0; a < n_features; a++)
            mean[a] += features[(ptrdiff_t)members[i] * n_features + a];
    for (int a = 0; a < n_features; a++)
        mean[a] /= n_seen;
    for (ptrdiff_t i = 0; i < n; i += step) {
        double apart[MAX_FEATURES];
        for (int a = 0; a < n_features; a++)
            apart[a] = features[(ptrdiff_t)members[i] * n_features + a] - mean[a];
        for (int a = 0; a < n_features; a++)
            for (int b = 0; b < n_features; b++)
                covariance[a][b] += apart[a] * apart[b];
    }
    int widest = 0;
    for (int a = 1; a < n_features; a++)
        if (covariance[a][a] > covariance[widest][widest])
            widest = a;
    memcpy(axis, covariance[widest], n_features * sizeof(double));
    for (int power = 0; power <= POWERS; power++) {
        double product[MAX_FEATURES], norm = 0;
        for (int a = 0; a < n_features; a++)
            norm += axis[a] * axis[a];
        norm = norm > 0 ? 1 / sqrt(norm) : 0;
        for (int a = 0; a < n_features; a++)
            axis[a] *= norm;
        if (power == POWERS)
            break;
        for (int a = 0; a < n_features; a++) {
            product[a] = 0;
            for (int b = 0; b < n_features; b++)
                product[a] += covariance[a][b] * axis[b];
        }
        memcpy(axis, product, n_features * sizeof(double));
    }
}

/* Take a step of Lloyd with two generators: the side of each member, and how many are on the second one. */
INLINE ptrdiff_t lloyd_step(const float *restrict features, int n_features, const int32_t *members, ptrdiff_t n,
                            ptrdiff_t n_second, uint8_t *sides)
{
    double means[2][MAX_FEATURES] = {{0}}, normal[MAX_FEATURES], middle = 0;
    for (ptrdiff_t i = 0; i < n; i++)
        for (int a = 0; a < n_features; a++)
            means[sides[i]][a] += features[(ptrdiff_t)members[i] * n_features + a];
    for (int a = 0; a < n_features; a++) {
        means[0][a] /= n - n_second;
        means[1][a] /= n_second;
        normal[a] = means[1][a] - means[0][a];
        middle += normal[a] * (means[0][a] + means[1][a]) / 2;
    }
    n_second = 0;
    for (ptrdiff_t i = 0; i < n; i++) {
        double at = -middle;
        for (int a = 0; a < n_features; a++)
            at += normal[a] * features[(ptrdiff_t)members[i] * n_features + a];
        n_second += sides[i] = at > 0;
    }
    return n_second;
}

/* Cut a group in two and order its members by side; returns how many are on the first.
 *
 * Two generators begin on both sides of the mean along the main axis. Where they would leave one side with less than an
 * eighth, the group is cut at the median along the axis.
 */
INLINE ptrdiff_t halve_group(const float *restrict features, int n_features, int32_t *members, ptrdiff_t n,
                             uint8_t *sides, float *along, float *sorted, int32_t *second)
{
    double mean[MAX_FEATURES], axis[MAX_FEATURES];
    main_axis(features, n_features, members, n, mean, axis);
    ptrdiff_t n_second = 0;
    for (ptrdiff_t i = 0; i < n; i++) {
        double at = 0;
        for (int a = 0; a < n_features; a++)
            at += axis[a] * (features[(ptrdiff_t)members[i] * n_features + a] - mean[a]);
        along[i] = (float)at;
        n_second += sides[i] = at > 0;
    }
    for (int step = 0; step < LLOYD_STEPS && n_second > 0 && n_second < n; step++)
        n_second = lloyd_step(features, n_features, members, n, n_second, sides);
    const ptrdiff_t fewer = n_second < n - n_second ? n_second : n - n_second;
    if (fewer < 8 || fewer < n / 8) {
        memcpy(sorted, along, n * sizeof(float));
        const float median = select_kth(sorted, n, n / 2);
        ptrdiff_t left = n / 2; /* for members at the median */
        for (ptrdiff_t i = 0; i < n; i++)
            left -= along[i] < median;
        for (ptrdiff_t i = 0; i < n; i++)
            sides[i] = !(along[i] < median || (along[i] == median && left-- > 0));
    }
    ptrdiff_t n_first = 0;
    n_second = 0;
    for (ptrdiff_t i = 0; i < n; i++) {
        if (sides[i])
            second[n_second++] = members[i];
        else
            members[n_first++] = members[i];
    }
    memcpy(members + n_first, second, n_second * sizeof(int32_t));
    return n_first;
}

typedef void measure_function(struct picture, const int32_t *, ptrdiff_t, ptrdiff_t, float *, float *, float *, double *);
typedef void make_function(double *, ptrdiff_t, double, float *);
typedef void filter_function(struct picture, struct picture, float, const int32_t *, ptrdiff_t, ptrdiff_t, const float *,
                             const float *, float *, float *, float *);
typedef ptrdiff_t halve_function(const float *, int, int32_t *, ptrdiff_t, uint8_t *, float *, float *, int32_t *);

struct patch_functions {
    measure_function *measure;
    make_function *make;
    filter_function *filter;
    halve_function *halve;
};

#define DEFINE_PATCHES(level, attribute)                                                                               \
    attribute static void measure_##level(struct picture image, const int32_t *members, ptrdiff_t n, ptrdiff_t size,   \
                                          float *patches, float *products, float *mean, double *covariance)            \
    {                                                                                                                  \
        measure_group(image, members, n, size, patches, products, mean, covariance);                                   \
    }                                                                                                                  \
    attribute static void make_##level(double *covariance, ptrdiff_t size, double variance, float *filter)             \
    {                                                                                                                  \
        make_filter(covariance, size, variance, filter);                                                               \
    }                                                                                                                  \
    attribute static void filter_##level(struct picture image, struct picture change, float step,                      \
                                         const int32_t *members, ptrdiff_t n, ptrdiff_t size, const float *mean,       \
                                         const float *filter, float *patches, float *filtered, float *out)             \
    {                                                                                                                  \
        filter_group(image, change, step, members, n, size, mean, filter, patches, filtered, out);                     \
    }                                                                                                                  \
    attribute static ptrdiff_t halve_##level(const float *features, int n_features, int32_t *members, ptrdiff_t n,     \
                                             uint8_t *sides, float *along, float *sorted, int32_t *second)             \
    {                                                                                                                  \
        return halve_group(features, n_features, members, n, sides, along, sorted, second);                            \
    }                                                                                                                  \
    static const struct patch_functions functions_##level = {measure_##level, make_##level, filter_##level,            \
                                                             halve_##level};

DEFINE_PATCHES(baseline, )

#if defined(__GNUC__) && defined(__x86_64__)
DEFINE_PATCHES(avx2, __attribute__((target("avx2,fma"))))

/* The loops for the best instruction set that this processor has. */
static const struct patch_functions *patch_functions(void)
{
    __builtin_cpu_init();
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? &functions_avx2 : &functions_baseline;
}
#else
static const struct patch_functions *patch_functions(void)
{
    return &functions_baseline;
}
#endif

#endif

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
/* Largest numbers of bands, of values of a padded patch, and of features, which come in eights. */
enum { MAX_BANDS = 4, MAX_COLUMNS = 112, MAX_FEATURES = 32, EIGHT = 8 };
/* Multiplications of a vector by the covariance that find its main axis, steps of Lloyd from there, and about how many
 * members of a group take part in both. */
enum { POWERS = 12, LLOYD_STEPS = 3, SAMPLE = 512 };

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

INLINE float dot(const float *a, const float *b, int n)
{
    eight sum = {0};
    for (int i = 0; i < n; i += EIGHT)
        sum += *(const eight *)(a + i) * *(const eight *)(b + i);
    return ((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7]));
}

INLINE void add_scaled(float *sum, float factor, const float *values, int n)
{
    for (int i = 0; i < n; i += EIGHT)
        *(eight *)(sum + i) += factor * *(const eight *)(values + i);
}

INLINE void multiply_block(const float *restrict a, ptrdiff_t a_row, ptrdiff_t a_column, ptrdiff_t n_inner,
                           const float *restrict b, ptrdiff_t b_row, float *restrict out, int add)
{
    eight sums[ROWS_AT_ONCE][2] = {{{0}}};
    for (int i = 0; add && i < ROWS_AT_ONCE; i++)
        memcpy(sums[i], out + i * b_row, sizeof sums[i]);
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
INLINE float dot(const float *a, const float *b, int n)
{
    float sum = 0;
    for (int i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

INLINE void add_scaled(float *sum, float factor, const float *values, int n)
{
    for (int i = 0; i < n; i++)
        sum[i] += factor * values[i];
}

INLINE void multiply_block(const float *restrict a, ptrdiff_t a_row, ptrdiff_t a_column, ptrdiff_t n_inner,
                           const float *restrict b, ptrdiff_t b_row, float *restrict out, int add)
{
    float sums[ROWS_AT_ONCE][LANES] = {{0}};
    for (int i = 0; add && i < ROWS_AT_ONCE; i++)
        memcpy(sums[i], out + i * b_row, sizeof sums[i]);
    for (ptrdiff_t k = 0; k < n_inner; k++)
        for (int i = 0; i < ROWS_AT_ONCE; i++)
            for (int j = 0; j < LANES; j++)
                sums[i][j] += a[i * a_row + k * a_column] * b[k * b_row + j];
    for (int i = 0; i < ROWS_AT_ONCE; i++)
        memcpy(out + i * b_row, sums[i], sizeof sums[i]);
}
#endif

/* out = a b, or out += a b; rows in fours, columns in sixteens; `symmetric` leaves out blocks below the diagonal. */
INLINE void multiply(const float *a, ptrdiff_t a_row, ptrdiff_t a_column, ptrdiff_t n_rows, ptrdiff_t n_inner,
                     const float *b, ptrdiff_t n_columns, float *out, int symmetric, int add)
{
    for (ptrdiff_t i = 0; i < n_rows; i += ROWS_AT_ONCE)
        for (ptrdiff_t j = symmetric ? i / LANES * LANES : 0; j < n_columns; j += LANES)
            multiply_block(a + i * a_row, a_row, a_column, n_inner, b + j, n_columns, out + i * n_columns + j, add);
}

/* Mean patch of a group of `n`, and the (size, columns) covariance of the patches; `patches` holds n rows. */
INLINE void measure_group(struct picture image, const int32_t *members, ptrdiff_t n, ptrdiff_t size, float *patches,
                          float *mean, float *covariance)
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
    multiply(patches, 1, columns, columns, n, patches, columns, covariance, 1, 0);
    for (ptrdiff_t i = 0; i < columns; i++)
        for (ptrdiff_t j = i; j < columns; j++)
            covariance[i * columns + j] = covariance[j * columns + i] = covariance[i * columns + j] / n;
}

/* The inverse of a symmetric, positive definite 4 x 4 matrix. */
INLINE void invert_small(float matrix[ROWS_AT_ONCE][ROWS_AT_ONCE])
{
    for (int k = 0; k < ROWS_AT_ONCE; k++) {
        const float inverse = 1 / matrix[k][k];
        matrix[k][k] = 1;
        for (int j = 0; j < ROWS_AT_ONCE; j++)
            matrix[k][j] *= inverse;
        for (int i = 0; i < ROWS_AT_ONCE; i++) {
            const float factor = matrix[i][k];
            if (i == k)
                continue;
            matrix[i][k] = 0;
            for (int j = 0; j < ROWS_AT_ONCE; j++)
                matrix[i][j] -= factor * matrix[k][j];
        }
    }
}

/* filter = I - v (C + v I)^-1; both have rows of padded(size), and the covariance C is used up.
 *
 * A positive definite matrix turns into its negative inverse by sweeps, one for each row, which need no pivoting; four are
 * made at once. It stays symmetric, so that what is above the diagonal is enough. Padding adds rows of the identity.
 */
INLINE void make_filter(float *restrict covariance, ptrdiff_t size, float variance, float *restrict filter)
{
    const ptrdiff_t columns = padded(size);
    float rows[ROWS_AT_ONCE * MAX_COLUMNS], solved[ROWS_AT_ONCE * MAX_COLUMNS], pivot[ROWS_AT_ONCE][ROWS_AT_ONCE];
    for (ptrdiff_t i = 0; i < columns; i++)
        covariance[i * columns + i] += variance;
    for (ptrdiff_t k = 0; k < size; k += ROWS_AT_ONCE) {
        for (int r = 0; r < ROWS_AT_ONCE; r++) {
            float *row = rows + r * columns;
            for (ptrdiff_t i = 0; i < k + r; i++)
                row[i] = covariance[i * columns + k + r];
            memcpy(row + k + r, covariance + (k + r) * columns + k + r, (columns - k - r) * sizeof(float));
            memcpy(pivot[r], row + k, sizeof pivot[r]);
            memset(row + k, 0, sizeof pivot[r]);
        }
        invert_small(pivot);
        for (int r = 0; r < ROWS_AT_ONCE; r++)
            for (int j = 0; j < ROWS_AT_ONCE; j++)
                pivot[r][j] = -pivot[r][j];
        multiply(pivot[0], ROWS_AT_ONCE, 1, ROWS_AT_ONCE, ROWS_AT_ONCE, rows, columns, solved, 0, 0);
        multiply(rows, 1, columns, columns, ROWS_AT_ONCE, solved, columns, covariance, 1, 1);
        for (int r = 0; r < ROWS_AT_ONCE; r++) {
            float *row = solved + r * columns;
            for (ptrdiff_t i = 0; i < columns; i++)
                row[i] = -row[i];
            memcpy(row + k, pivot[r], sizeof pivot[r]);
            for (ptrdiff_t i = 0; i < k + r; i++)
                covariance[i * columns + k + r] = row[i];
            memcpy(covariance + (k + r) * columns + k + r, row + k + r, (columns - k - r) * sizeof(float));
        }
    }
    memset(filter, 0, size * columns * sizeof(float));
    for (ptrdiff_t i = 0; i < size; i++)
        for (ptrdiff_t j = i; j < size; j++)
            filter[i * columns + j] = filter[j * columns + i] = (i == j) + variance * covariance[i * columns + j];
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
    multiply(patches, columns, 1, rows, size, filter, columns, filtered, 0, 0);
    for (ptrdiff_t i = 0; i < n; i++)
        for (ptrdiff_t j = 0; j < size; j++)
            out[members[i] * size + j] = filtered[i * columns + j] + mean[j];
}

/* The plane through the mean of some members of a group, across its main axis: the covariance times a vector, again and
 * again. */
INLINE void middle_plane(const float *features, int n_features, const int32_t *members, ptrdiff_t n, ptrdiff_t step,
                         float *axis, float *level)
{
    float mean[MAX_FEATURES] = {0}, covariance[MAX_FEATURES][MAX_FEATURES] = {{0}};
    const float share = 1 / (float)((n + step - 1) / step);
    for (ptrdiff_t i = 0; i < n; i += step)
        add_scaled(mean, share, features + (ptrdiff_t)members[i] * n_features, n_features);
    for (ptrdiff_t i = 0; i < n; i += step) {
        float apart[MAX_FEATURES];
        memcpy(apart, features + (ptrdiff_t)members[i] * n_features, n_features * sizeof(float));
        add_scaled(apart, -1, mean, n_features);
        for (int a = 0; a < n_features; a++)
            add_scaled(covariance[a], share * apart[a], apart, n_features);
    }
    int widest = 0;
    for (int a = 1; a < n_features; a++)
        if (covariance[a][a] > covariance[widest][widest])
            widest = a;
    memcpy(axis, covariance[widest], n_features * sizeof(float));
    for (int power = 0; power <= POWERS; power++) {
        float unit[MAX_FEATURES];
        const float square = dot(axis, axis, n_features), inverse = square > 0 ? 1 / sqrtf(square) : 0;
        for (int a = 0; a < n_features; a++)
            unit[a] = inverse * axis[a];
        for (int a = 0; a < n_features; a++)
            axis[a] = power < POWERS ? dot(covariance[a], unit, n_features) : unit[a];
    }
    *level = dot(axis, mean, n_features);
}

/* Which side of a plane each of some members is on, and how many are on the second one. */
INLINE ptrdiff_t cut_by(const float *features, int n_features, const int32_t *members, ptrdiff_t n, ptrdiff_t step,
                        const float *normal, float level, uint8_t *sides)
{
    ptrdiff_t n_second = 0;
    for (ptrdiff_t i = 0; i < n; i += step)
        n_second += sides[i] = dot(normal, features + (ptrdiff_t)members[i] * n_features, n_features) > level;
    return n_second;
}

/* The plane between the means of both sides. */
INLINE void plane_between(const float *features, int n_features, const int32_t *members, ptrdiff_t n, ptrdiff_t step,
                          const uint8_t *sides, ptrdiff_t n_second, float *normal, float *level)
{
    float means[2][MAX_FEATURES] = {{0}};
    const float shares[2] = {1 / (float)((n + step - 1) / step - n_second), 1 / (float)n_second};
    for (ptrdiff_t i = 0; i < n; i += step)
        add_scaled(means[sides[i]], shares[sides[i]], features + (ptrdiff_t)members[i] * n_features, n_features);
    for (int a = 0; a < n_features; a++)
        normal[a] = means[1][a] - means[0][a];
    *level = (dot(normal, means[0], n_features) + dot(normal, means[1], n_features)) / 2;
}

/* Whether one side has less than an eighth, or than a few. */
INLINE int is_uneven(ptrdiff_t n_second, ptrdiff_t n)
{
    const ptrdiff_t fewer = n_second < n - n_second ? n_second : n - n_second;
    return fewer < 8 || fewer < n / 8;
}

/* Cut a group in two and order its members by side; returns how many are on the first.
 *
 * Two generators begin on both sides of the mean along the main axis. Where they would leave one side with less than an
 * eighth, the group is cut at the mean; and where that would, in two parts of the image.
 */
INLINE ptrdiff_t halve_group(const float *features, int n_features, int32_t *members, ptrdiff_t n, uint8_t *sides,
                             int32_t *second)
{
    const ptrdiff_t step = 1 + n / SAMPLE, n_seen = (n + step - 1) / step;
    float axis[MAX_FEATURES], normal[MAX_FEATURES], middle, level;
    middle_plane(features, n_features, members, n, step, axis, &middle);
    memcpy(normal, axis, sizeof normal);
    level = middle;
    for (int lloyd = 0; lloyd < LLOYD_STEPS; lloyd++) {
        const ptrdiff_t n_second = cut_by(features, n_features, members, n, step, normal, level, sides);
        if (n_second == 0 || n_second == n_seen)
            break;
        plane_between(features, n_features, members, n, step, sides, n_second, normal, &level);
    }
    if (is_uneven(cut_by(features, n_features, members, n, 1, normal, level, sides), n)
        && is_uneven(cut_by(features, n_features, members, n, 1, axis, middle, sides), n))
        for (ptrdiff_t i = 0; i < n; i++)
            sides[i] = i >= n / 2;
    ptrdiff_t n_first = 0, n_second = 0;
    for (ptrdiff_t i = 0; i < n; i++) {
        if (sides[i])
            second[n_second++] = members[i];
        else
            members[n_first++] = members[i];
    }
    memcpy(members + n_first, second, n_second * sizeof(int32_t));
    return n_first;
}

typedef void measure_function(struct picture, const int32_t *, ptrdiff_t, ptrdiff_t, float *, float *, float *);
typedef void make_function(float *, ptrdiff_t, float, float *);
typedef void filter_function(struct picture, struct picture, float, const int32_t *, ptrdiff_t, ptrdiff_t, const float *,
                             const float *, float *, float *, float *);
typedef ptrdiff_t halve_function(const float *, int, int32_t *, ptrdiff_t, uint8_t *, int32_t *);

struct patch_functions {
    measure_function *measure;
    make_function *make;
    filter_function *filter;
    halve_function *halve;
};

#define DEFINE_PATCHES(level, attribute)                                                                               \
    attribute static void measure_##level(struct picture image, const int32_t *members, ptrdiff_t n, ptrdiff_t size,   \
                                          float *patches, float *mean, float *covariance)                              \
    {                                                                                                                  \
        measure_group(image, members, n, size, patches, mean, covariance);                                             \
    }                                                                                                                  \
    attribute static void make_##level(float *covariance, ptrdiff_t size, float variance, float *filter)               \
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
                                             uint8_t *sides, int32_t *second)                                          \
    {                                                                                                                  \
        return halve_group(features, n_features, members, n, sides, second);                                           \
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

/* Groups of patches cut in two. */
#ifndef CVTIMG_PATCHES_H
#define CVTIMG_PATCHES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Largest number of features, which come in eights. */
enum { MAX_FEATURES = 32, EIGHT = 8 };
/* Multiplications of a vector by the covariance that find its main axis, steps of Lloyd from there, and about how many
 * members of a group take part in both. */
enum { POWERS = 12, LLOYD_STEPS = 3, SAMPLE = 512 };

static inline float dot(const float *a, const float *b, int n)
{
    float sums[EIGHT] = {0};
    for (int i = 0; i < n; i += EIGHT)
        for (int lane = 0; lane < EIGHT; lane++)
            sums[lane] += a[i + lane] * b[i + lane];
    return ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
}

static inline void add_scaled(float *sum, float factor, const float *values, int n)
{
    for (int i = 0; i < n; i++)
        sum[i] += factor * values[i];
}

/* The plane through the mean of some members of a group, across its main axis: the covariance times a vector, again and
 * again. */
static inline void middle_plane(const float *features, int n_features, const int32_t *members, ptrdiff_t n,
                                ptrdiff_t step, float *axis, float *level)
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
static inline ptrdiff_t cut_by(const float *features, int n_features, const int32_t *members, ptrdiff_t n,
                               ptrdiff_t step, const float *normal, float level, uint8_t *sides)
{
    ptrdiff_t n_second = 0;
    for (ptrdiff_t i = 0; i < n; i += step)
        n_second += sides[i] = dot(normal, features + (ptrdiff_t)members[i] * n_features, n_features) > level;
    return n_second;
}

/* The plane between the means of both sides. */
static inline void plane_between(const float *features, int n_features, const int32_t *members, ptrdiff_t n,
                                 ptrdiff_t step, const uint8_t *sides, ptrdiff_t n_second, float *normal, float *level)
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
static inline int is_uneven(ptrdiff_t n_second, ptrdiff_t n)
{
    const ptrdiff_t fewer = n_second < n - n_second ? n_second : n - n_second;
    return fewer < 8 || fewer < n / 8;
}

/* Cut a group in two and order its members by side; returns how many are on the first.
 *
 * Two generators begin on both sides of the mean along the main axis. Where they would leave one side with less than an
 * eighth, the group is cut at the mean; and where that would, in two parts of the image.
 */
static inline ptrdiff_t halve_group(const float *features, int n_features, int32_t *members, ptrdiff_t n,
                                    uint8_t *sides, int32_t *second)
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

#endif

/* The nearest generator of each point: the inner loop of every tessellation.
 *
 * Points come in tiles of LANES points, one coordinate after the other, so that points lie in SIMD lanes and each
 * generator is broadcast to a whole tile. Comparing |z|^2 / 2 - x.z in place of |x - z|^2 leaves one multiply-add
 * a dimension; callers centre the data, so that the product form loses nothing that matters in float32.
 *
 * The loops are written once and compiled for three instruction sets; nearest_in_tile[] is indexed by level.
 * They vectorise only with -ffinite-math-only -fno-signed-zeros -fno-trapping-math.
 */
#ifndef CVTIMG_NEAREST_H
#define CVTIMG_NEAREST_H

#include <float.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* At D = 3 a tile of 64 points fills 12 of the 32 AVX-512 registers, and the running minima 8 more. */
enum { LANES = 64 };

/* Sums of many dimensions are kept for four generators at a time, so that each load of a point serves four of them. */
enum { GENERATORS_AT_ONCE = 4, DIMS_AT_ONCE = 2 };

#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif

INLINE void keep_nearer(const float *restrict score, int generator, float *restrict least, int32_t *restrict nearest)
{
    for (int i = 0; i < LANES; i++) {
        int closer = score[i] < least[i];
        least[i] = closer ? score[i] : least[i];
        nearest[i] = closer ? generator : nearest[i];
    }
}

/* Few dimensions: `dims` is known to the compiler, the whole tile stays in registers. */
INLINE void nearest_few_dims(const float *restrict tile, int dims, const float *restrict generators,
                             const float *restrict half_norms, int n_generators, int32_t *restrict nearest)
{
    float least[LANES];
    int32_t index[LANES];

    for (int i = 0; i < LANES; i++) {
        least[i] = FLT_MAX;
        index[i] = 0;
    }
    for (int k = 0; k < n_generators; k++) {
        const float *z = generators + (ptrdiff_t)k * dims;
        /* One loop, not a call of keep_nearer on an array of scores: the scores then never leave the registers. */
        for (int i = 0; i < LANES; i++) {
            float score = half_norms[k];
            for (int d = 0; d < dims; d++)
                score -= tile[d * LANES + i] * z[d];
            int closer = score < least[i];
            least[i] = closer ? score : least[i];
            index[i] = closer ? k : index[i];
        }
    }
    memcpy(nearest, index, sizeof index);
}

INLINE void subtract_products(const float *restrict tile, int n_dims, const float *restrict generators, int dims,
                              int n_generators, float score[][LANES])
{
    for (int i = 0; i < LANES; i++)
        for (int g = 0; g < n_generators; g++)
            for (int d = 0; d < n_dims; d++)
                score[g][i] -= tile[d * LANES + i] * generators[(ptrdiff_t)g * dims + d];
}

INLINE void score_generators(const float *restrict tile, int dims, const float *restrict generators,
                             const float *restrict half_norms, int first, int n_generators,
                             float *restrict least, int32_t *restrict nearest)
{
    float score[GENERATORS_AT_ONCE][LANES];
    int d = 0;

    for (int g = 0; g < n_generators; g++)
        for (int i = 0; i < LANES; i++)
            score[g][i] = half_norms[first + g];
    generators += (ptrdiff_t)first * dims;
    for (; d + DIMS_AT_ONCE <= dims; d += DIMS_AT_ONCE)
        subtract_products(tile + d * LANES, DIMS_AT_ONCE, generators + d, dims, n_generators, score);
    for (; d < dims; d++)
        subtract_products(tile + d * LANES, 1, generators + d, dims, n_generators, score);
    for (int g = 0; g < n_generators; g++)
        keep_nearer(score[g], first + g, least, nearest);
}

INLINE void nearest_any_dims(const float *restrict tile, int dims, const float *restrict generators,
                             const float *restrict half_norms, int n_generators, int32_t *restrict nearest)
{
    float least[LANES];
    int k = 0;

    for (int i = 0; i < LANES; i++) {
        least[i] = FLT_MAX;
        nearest[i] = 0;
    }
    for (; k + GENERATORS_AT_ONCE <= n_generators; k += GENERATORS_AT_ONCE)
        score_generators(tile, dims, generators, half_norms, k, GENERATORS_AT_ONCE, least, nearest);
    for (; k < n_generators; k++)
        score_generators(tile, dims, generators, half_norms, k, 1, least, nearest);
}

typedef void nearest_function(const float *tile, int dims, const float *generators, const float *half_norms,
                              int n_generators, int32_t *nearest);

#define DEFINE_NEAREST(name, target)                                                                        \
    target static void name(const float *tile, int dims, const float *generators, const float *half_norms,  \
                            int n_generators, int32_t *nearest)                                             \
    {                                                                                                       \
        switch (dims) {                                                                                     \
        case 1: nearest_few_dims(tile, 1, generators, half_norms, n_generators, nearest); break;            \
        case 2: nearest_few_dims(tile, 2, generators, half_norms, n_generators, nearest); break;            \
        case 3: nearest_few_dims(tile, 3, generators, half_norms, n_generators, nearest); break;            \
        case 4: nearest_few_dims(tile, 4, generators, half_norms, n_generators, nearest); break;            \
        default: nearest_any_dims(tile, dims, generators, half_norms, n_generators, nearest);               \
        }                                                                                                   \
    }

DEFINE_NEAREST(nearest_baseline, )

#if defined(__GNUC__) && defined(__x86_64__)
DEFINE_NEAREST(nearest_avx2, __attribute__((target("avx2,fma"))))
#if defined(__clang__)
DEFINE_NEAREST(nearest_avx512, __attribute__((target("avx2,fma,avx512f,avx512dq,avx512bw,avx512vl"))))
#else
DEFINE_NEAREST(nearest_avx512,
               __attribute__((target("avx2,fma,avx512f,avx512dq,avx512bw,avx512vl,prefer-vector-width=512"))))
#endif

/* The best level that this processor runs: 0 baseline, 1 AVX2, 2 AVX-512. */
static int supported_simd_level(void)
{
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma"))
        return 0;
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                   __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl")
               ? 2
               : 1;
}

static nearest_function *const nearest_in_tile[] = {nearest_baseline, nearest_avx2, nearest_avx512};
#else
static int supported_simd_level(void)
{
    return 0;
}

static nearest_function *const nearest_in_tile[] = {nearest_baseline, nearest_baseline, nearest_baseline};
#endif

#endif

/* The nearest generator of each point: the inner loop of every tessellation.
 *
 * The loops of nearest.c are compiled for each instruction set, which meson.build lists, in float and in double; the
 * best set that is there and that the processor runs is used.
 */
#ifndef CVTIMG_NEAREST_H
#define CVTIMG_NEAREST_H

#include <stddef.h>
#include <stdint.h>

/* At D = 3 a tile of 64 points fills 12 of the 32 AVX-512 registers, and the running minima 8 more. */
enum { LANES = 64, FEW_DIMS = 4, TILES_IN_GROUP = 16 };

/* What points to void is float or double. */
struct nearest_functions {
    /* The nearest generator of each point of a tile; and how much farther the second is, unless `gap` is NULL. */
    void (*one)(const void *tile, int dims, const void *generators, const void *half_norms, int n_generators,
                int32_t *nearest, void *gap);
    /* The cell other than its own where each point costs least, and how much more than there. */
    void (*next)(const void *tile, int dims, const void *generators, const void *half_norms, int n_generators,
                 const void *inverse_masses, const void *weights, const int32_t *own, int32_t *nearest, void *gap);
    /* As `one` for tiles that follow each other, whose points are near each other; dims <= FEW_DIMS. */
    void (*group)(const void *tiles, const void *boxes, int n_tiles, int dims, const void *columns,
                  ptrdiff_t width, const void *generators, const void *half_norms, int n_generators,
                  int32_t *nearest, void *gap);
    /* Squared distances of the points of a tile to some places, (n_places, LANES), by differences. */
    void (*squares)(const void *tile, int dims, const void *places, int n_places, void *distances);
    /* Add density times (point, 1) to the sums of each point's cell. */
    void (*sum)(const void *tile, int dims, const double *density, const int32_t *labels, double *sums);
};

extern const struct nearest_functions nearest_baseline, nearest_avx2, nearest_avx512;
extern const struct nearest_functions nearest_exact_baseline, nearest_exact_avx2, nearest_exact_avx512;

/* The functions of a level (0 baseline, 1 AVX2, 2 AVX-512), in float or, if exact, in double; NULL if they are not compiled or the processor does not
 * run them. */
static const struct nearest_functions *nearest_at(int level, int exact)
{
#ifdef SIMD_AVX512
    __builtin_cpu_init();
    if (level == 2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
        return exact ? &nearest_exact_avx512 : &nearest_avx512;
#endif
#ifdef SIMD_AVX2
    __builtin_cpu_init();
    if (level == 1 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        return exact ? &nearest_exact_avx2 : &nearest_avx2;
#endif
#ifdef SIMD_BASELINE
    if (level == 0)
        return exact ? &nearest_exact_baseline : &nearest_baseline;
#endif
    return NULL;
}

#endif

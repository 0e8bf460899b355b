/* Chi-square distances between the histograms of two half discs.
 *
 * A histogram fills a slot: bin b is at REACH + b, so that smoothing reads only zeros beyond the ends, and the bin
 * HIDDEN, which takes what is outside of the picture or masked, is out of its reach. */
#ifndef CVTIMG_HALF_DISCS_H
#define CVTIMG_HALF_DISCS_H

#define N_LEVELS 24
#define N_TEXTONS 32
#define REACH 6
#define SLOT 64
#define HIDDEN (SLOT - 1 - REACH)
#define MAX_CHANNELS 4
#define LANES 8

/* Half the sum of (u - v)^2 / (u + v), both scaled to sum 1; 0 if one is empty. n is a multiple of LANES. */
static inline float chi_square(const float *restrict u, const float *restrict v, int n)
{
    float sums_u[LANES] = {0}, sums_v[LANES] = {0}, parts[LANES] = {0}, sum_u = 0, sum_v = 0, total = 0;
    for (int i = 0; i < n; i += LANES)
        for (int lane = 0; lane < LANES; lane++) {
            sums_u[lane] += u[i + lane];
            sums_v[lane] += v[i + lane];
        }
    for (int lane = 0; lane < LANES; lane++) {
        sum_u += sums_u[lane];
        sum_v += sums_v[lane];
    }
    if (sum_u <= 0 || sum_v <= 0)
        return 0;
    const float per_u = 1 / sum_u, per_v = 1 / sum_v;
    for (int i = 0; i < n; i += LANES)
        for (int lane = 0; lane < LANES; lane++) {
            const float p = u[i + lane] * per_u, q = v[i + lane] * per_v;
            parts[lane] += (p - q) * (p - q) / (p + q + 1e-20f);
        }
    for (int lane = 0; lane < LANES; lane++)
        total += parts[lane];
    return total / 2;
}

static inline void smooth_levels(const float *restrict slot, const float *restrict taps, float *restrict smooth)
{
    for (int bin = 0; bin < N_LEVELS; bin++)
        smooth[bin] = 0;
    for (int tap = 0; tap <= 2 * REACH; tap++)
        for (int bin = 0; bin < N_LEVELS; bin++)
            smooth[bin] += taps[tap] * slot[bin + tap];
}

/* Distances of the two slots of a channel: levels are smoothed, textons are not. */
static inline float channel_distance(const float *slots, const float *taps, int is_texton)
{
    float left[N_LEVELS], right[N_LEVELS];
    if (is_texton)
        return chi_square(slots + REACH, slots + SLOT + REACH, N_TEXTONS);
    smooth_levels(slots, taps, left);
    smooth_levels(slots + SLOT, taps, right);
    return chi_square(left, right, N_LEVELS);
}

#endif

/* Masses and first moments of cells over a density of pixels, and the nearest generator of each pixel. */
#ifndef CVTIMG_MOMENTS_H
#define CVTIMG_MOMENTS_H

#include "cells.h"

/* Running sums along a row: of the density, and of x times it. Beside each other, for they are read together. */
struct running {
    double mass, x_mass;
};

struct sums {
    double mass, x_mass, y_mass;
};

struct moments_state {
    const struct running *running; /* of the rows of the band: width + 1 each */
    int width, top;
    struct sums *sums; /* in the order of buckets */
};

static void sum_rows(const float *density, int width, int n_rows, struct running *running)
{
    for (int row = 0; row < n_rows; row++) {
        struct running last = {0, 0};
        *running++ = last;
        for (int x = 0; x < width; x++) {
            double here = *density++;
            last.mass += here;
            last.x_mass += here * (x + 0.5);
            *running++ = last;
        }
    }
}

/* The running sums at any x, the density being constant over each pixel. */
INLINE struct running sum_until(const struct running *row, int width, double x)
{
    int column = (int)x < width ? (int)x : width - 1;
    double part = x - column, here = row[column + 1].mass - row[column].mass;
    struct running until = {row[column].mass + part * here,
                            row[column].x_mass + part * here * (column + 0.5 * part)};
    return until;
}

INLINE void add_interval(struct sums *sums, struct running from, struct running to, double y)
{
    double mass = to.mass - from.mass;

    sums->mass += mass;
    sums->x_mass += to.x_mass - from.x_mass;
    sums->y_mass += mass * y;
}

static void visit_moments(void *pointer, struct box box, int x_corner, int y_corner, struct owners sorted)
{
    const struct moments_state *state = pointer;
    const struct running *row = state->running + (ptrdiff_t)(box.y0 - state->top) * (state->width + 1);

    for (int y = box.y0; y < box.y1; y++, row += state->width + 1) {
        struct running from = row[box.x0];
        int n = cut_row(sorted, y + 0.5 - y_corner, box.x0 - x_corner, box.x1 - x_corner);
        for (int i = 0; i < n - 1; i++) {
            struct running to = sum_until(row, state->width, sorted.starts[i + 1] + x_corner);
            add_interval(state->sums + sorted.index[sorted.own[i]], from, to, y + 0.5);
            from = to;
        }
        add_interval(state->sums + sorted.index[sorted.own[n - 1]], from, row[box.x1], y + 0.5);
    }
}

/* Add the moments over rows of buckets first..last-1 to `sums`; the generators low..high-1 have been touched. */
static void sum_bands(const float *density, int width, int height, struct buckets buckets, int first, int last,
                      struct owners scratch, struct running *running, struct sums *sums, int32_t *low,
                      int32_t *high)
{
    struct moments_state state = {running, width, 0, sums};
    struct pass pass = {buckets, width, height, scratch, visit_moments, &state, first, first - 1};

    for (int band = first; band < last; band++) {
        int n_rows = buckets.side;
        state.top = band * buckets.side;
        n_rows = n_rows < height - state.top ? n_rows : height - state.top;
        sum_rows(density + (ptrdiff_t)state.top * width, width, n_rows, running);
        for (int column = 0; column < buckets.columns; column++) {
            int x0 = column * buckets.side, x1 = x0 + buckets.side < width ? x0 + buckets.side : width, y = 0;
            while (y < n_rows && running[(ptrdiff_t)y * (width + 1) + x1].mass ==
                                     running[(ptrdiff_t)y * (width + 1) + x0].mass)
                y++;
            if (y == n_rows)
                continue; /* nothing is there */
            gather_tile(&pass, column, band);
            visit_tile(&pass);
        }
    }
    *low = buckets.first[(ptrdiff_t)pass.low * buckets.columns];
    *high = buckets.first[(ptrdiff_t)(pass.high + 1) * buckets.columns];
}

struct labels_state {
    int32_t *labels;
    const int32_t *order;
    int width;
};

static void visit_labels(void *pointer, struct box box, int x_corner, int y_corner, struct owners sorted)
{
    const struct labels_state *state = pointer;

    for (int y = box.y0; y < box.y1; y++) {
        int32_t *row = state->labels + (ptrdiff_t)y * state->width;
        int n = cut_row(sorted, y + 0.5 - y_corner, box.x0 - x_corner, box.x1 - x_corner);
        int x = box.x0;
        for (int i = 0; i < n; i++)
            for (; x < box.x1 && (i == n - 1 || x + 0.5 - x_corner < sorted.starts[i + 1]); x++)
                row[x] = state->order[sorted.index[sorted.own[i]]];
    }
}

static void label_bands(int32_t *labels, int width, int height, struct buckets buckets, const int32_t *order,
                        int first, int last, struct owners scratch)
{
    struct labels_state state = {labels, order, width};
    struct pass pass = {buckets, width, height, scratch, visit_labels, &state, first, first - 1};

    for (int band = first; band < last; band++)
        for (int column = 0; column < buckets.columns; column++) {
            gather_tile(&pass, column, band);
            visit_tile(&pass);
        }
}

#endif

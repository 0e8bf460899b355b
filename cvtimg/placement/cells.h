/* Voronoi cells of points, cut by rows of pixels: the frame of every pass over a picture.
 *
 * A cell meets the middle line of a row in one interval, so that a pass costs as much as cells have boundary, not as
 * pixels there are. Generators lie in buckets. A tile of a bucket's size gathers those that may own a part of it, and
 * is split into boxes of few owners each; the boxes are given to a visitor, which asks for the intervals row by row.
 *
 * |p - z|^2 is compared as c - 2 p.z with c = |z|^2, for p and z counted from the corner of the tile, so that nothing
 * is lost to cancellation.
 */
#ifndef CVTIMG_CELLS_H
#define CVTIMG_CELLS_H

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif

/* A box is no longer split when so few may own it, or its sides are so short in pixels; larger leaves compare more
 * parabolas in each row, smaller ones have more rows. */
enum { FEW_OWNERS = 8, SHORT_SIDE = 8 };

/* Generators, in the order of square buckets, row by row of the grid. Those outside of the picture lie in the nearest
 * bucket. */
struct buckets {
    int side, columns, rows;
    const int32_t *first; /* of each bucket, and the end of the last */
    const double *places; /* x, y of each */
};

struct box {
    int x0, x1, y0, y1;
};

/* Generators that may own a part of a box, from the corner of the tile. */
struct owners {
    double *x, *y, *c;
    int32_t *index; /* in the order of buckets */
    ptrdiff_t n;
    /* Of the intervals of a row: who owns each, where it starts, and the height of each parabola. */
    int32_t *own;
    double *starts, *heights;
};

typedef void visitor(void *state, struct box box, int x_corner, int y_corner, struct owners sorted);

struct pass {
    struct buckets buckets;
    int width, height;
    struct owners scratch; /* n: its room */
    visitor *visit;
    void *state;
    int low, high; /* rows of buckets that have been gathered from */
    struct box tile;
    ptrdiff_t n_owners; /* of the tile, at the start of the scratch */
};

/* Keep the generators that beat the one nearest to the middle of a box in one of its corners. */
INLINE ptrdiff_t keep_owners(struct owners from, double x, double y, double half_x, double half_y, struct owners to)
{
    double least = DBL_MAX;
    ptrdiff_t n = 0, nearest = 0;

    for (ptrdiff_t i = 0; i < from.n; i++) {
        double score = from.c[i] - 2 * (x * from.x[i] + y * from.y[i]);
        least = score < least ? score : least;
    }
    for (; nearest < from.n - 1; nearest++)
        if (from.c[nearest] - 2 * (x * from.x[nearest] + y * from.y[nearest]) <= least)
            break;
    double own_x = from.x[nearest], own_y = from.y[nearest];
    least = from.c[nearest] - 2 * (x * own_x + y * own_y);
    int32_t own = from.index[nearest];
    for (ptrdiff_t i = 0; i < from.n; i++) {
        double ox = from.x[i], oy = from.y[i], oc = from.c[i];
        int32_t index = from.index[i];
        double score = oc - 2 * (x * ox + y * oy);
        double lowest = score - least - 2 * (half_x * fabs(ox - own_x) + half_y * fabs(oy - own_y));
        to.x[n] = ox;
        to.y[n] = oy;
        to.c[n] = oc;
        to.index[n] = index;
        /* One that ties everywhere lies at the same place, and owns nothing. */
        n += (lowest < 0) | (index == own);
    }
    return n;
}

/* Sort owners from left to right, which is the order of their intervals in every row: by Shell's method, which few need
 * one round of. */
INLINE void sort_owners(struct owners all)
{
    for (ptrdiff_t gap = all.n > 64 ? all.n / 2 : 1; gap > 0; gap /= 2)
        for (ptrdiff_t i = gap; i < all.n; i++) {
            double x = all.x[i], y = all.y[i], c = all.c[i];
            int32_t index = all.index[i];
            ptrdiff_t j = i;
            for (; j >= gap && all.x[j - gap] > x; j -= gap) {
                all.x[j] = all.x[j - gap];
                all.y[j] = all.y[j - gap];
                all.c[j] = all.c[j - gap];
                all.index[j] = all.index[j - gap];
            }
            all.x[j] = x;
            all.y[j] = y;
            all.c[j] = c;
            all.index[j] = index;
        }
}

/* The intervals of a row: the lower envelope of the owners' parabolas, kept as a stack. Returns how many there are.
 * `starts` gets one more entry, the end. */
INLINE int cut_row(struct owners sorted, double y, double from, double to)
{
    double *height = sorted.heights, *starts = sorted.starts;
    int32_t *own = sorted.own;
    int top = 0;

    for (ptrdiff_t i = 0; i < sorted.n; i++)
        height[i] = sorted.c[i] - 2 * y * sorted.y[i];
    own[0] = 0;
    starts[0] = from;
    for (int i = 1; i < sorted.n; i++) {
        double start;
        for (;;) {
            double step = sorted.x[i] - sorted.x[own[top]], rise = height[i] - height[own[top]];
            start = step > 0 ? 0.5 * rise / step : rise < 0 ? -DBL_MAX : DBL_MAX;
            if (start > starts[top])
                break;
            if (--top < 0)
                break;
        }
        if (top < 0)
            start = from;
        if (start < to) {
            own[++top] = i;
            starts[top] = start;
        }
    }
    starts[top + 1] = to;
    return top + 1;
}

static void split_box(struct pass *pass, struct box box, int x_corner, int y_corner, struct owners all,
                      ptrdiff_t room)
{
    int width = box.x1 - box.x0, height = box.y1 - box.y0;

    if (all.n <= FEW_OWNERS || (width <= SHORT_SIDE && height <= SHORT_SIDE) || room < all.n) {
        sort_owners(all);
        pass->visit(pass->state, box, x_corner, y_corner, all);
        return;
    }
    int halves_x = 1 + (2 * width > height && width > 1), halves_y = 1 + (2 * height > width && height > 1);
    struct owners part = all;
    part.x += all.n;
    part.y += all.n;
    part.c += all.n;
    part.index += all.n;
    for (int i = 0; i < halves_x; i++)
        for (int j = 0; j < halves_y; j++) {
            struct box half = {box.x0 + width * i / halves_x, box.x0 + width * (i + 1) / halves_x,
                               box.y0 + height * j / halves_y, box.y0 + height * (j + 1) / halves_y};
            part.n = keep_owners(all, 0.5 * (half.x0 + half.x1) - x_corner, 0.5 * (half.y0 + half.y1) - y_corner,
                                 0.5 * (half.x1 - half.x0), 0.5 * (half.y1 - half.y0 - 1), part);
            split_box(pass, half, x_corner, y_corner, part, room - all.n);
        }
}

/* Append the generators of buckets first..last of a row of buckets; return the least largest distance so far. */
INLINE double gather_buckets(const struct buckets *buckets, ptrdiff_t first, ptrdiff_t last, struct box box,
                             struct owners *to, double least)
{
    double half_x = 0.5 * (box.x1 - box.x0), half_y = 0.5 * (box.y1 - box.y0 - 1), above = 0.5 * (box.y1 - box.y0);

    for (int32_t i = buckets->first[first]; i < buckets->first[last + 1]; i++) {
        const double *place = buckets->places + 2 * (ptrdiff_t)i;
        double x = place[0] - box.x0, y = place[1] - box.y0;
        double far_x = fabs(x - half_x) + half_x, far_y = fabs(y - above) + half_y;
        double farthest = far_x * far_x + far_y * far_y;
        least = farthest < least ? farthest : least;
        to->x[to->n] = x;
        to->y[to->n] = y;
        to->c[to->n] = x * x + y * y;
        to->index[to->n] = i;
        to->n++;
    }
    return least;
}

/* Find the owners of the tile of a bucket: rings of buckets, until a ring is farther than somebody is from all of it. */
static void gather_tile(struct pass *pass, int column, int row)
{
    const struct buckets *buckets = &pass->buckets;
    int side = buckets->side, columns = buckets->columns, rows = buckets->rows;
    struct box box = {column * side, (column + 1) * side, row * side, (row + 1) * side};
    struct owners all = pass->scratch;
    double least = DBL_MAX;

    box.x1 = box.x1 < pass->width ? box.x1 : pass->width;
    box.y1 = box.y1 < pass->height ? box.y1 : pass->height;
    all.n = 0;
    for (int ring = 0; ring < columns || ring < rows; ring++) {
        double gap = (double)(ring - 1) * side;
        if (ring > 1 && gap * gap > least)
            break;
        int left = column - ring, right = column + ring, top = row - ring, bottom = row + ring;
        int first = left < 0 ? 0 : left, last = right < columns ? right : columns - 1;
        for (int y = top < 0 ? 0 : top; y <= bottom && y < rows; y++) {
            ptrdiff_t start = (ptrdiff_t)y * columns;
            if (y == top || y == bottom) {
                least = gather_buckets(buckets, start + first, start + last, box, &all, least);
                continue;
            }
            if (left >= 0)
                least = gather_buckets(buckets, start + left, start + left, box, &all, least);
            if (right < columns)
                least = gather_buckets(buckets, start + right, start + right, box, &all, least);
        }
        pass->low = top < pass->low ? (top < 0 ? 0 : top) : pass->low;
        pass->high = bottom > pass->high ? (bottom < rows ? bottom : rows - 1) : pass->high;
    }
    all.n = keep_owners(all, 0.5 * (box.x1 - box.x0), 0.5 * (box.y1 - box.y0), 0.5 * (box.x1 - box.x0),
                        0.5 * (box.y1 - box.y0 - 1), all);
    pass->tile = box;
    pass->n_owners = all.n;
}

/* Give the visitor the boxes of the tile that was gathered. */
static void visit_tile(struct pass *pass)
{
    struct owners all = pass->scratch;

    all.n = pass->n_owners;
    split_box(pass, pass->tile, pass->tile.x0, pass->tile.y0, all, pass->scratch.n - all.n);
}

#endif

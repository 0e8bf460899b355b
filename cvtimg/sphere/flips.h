/* Flips until a triangulation of points on a sphere is Delaunay, which is their convex hull.
 *
 * C. L. Lawson, Software for C1 surface interpolation, in Mathematical Software III (1977) 161-194. */
#ifndef CVTIMG_SPHERE_FLIPS_H
#define CVTIMG_SPHERE_FLIPS_H

#include "dual_cells.h"

/* Rounding changes a determinant of differences by less than this part of the sum of its terms' sizes, as
 * J. R. Shewchuk, Discrete & Computational Geometry 18 (1997) 305-363, doi 10.1007/PL00009321, proves. Each flip surely
 * adds volume then, so that flipping ends. */
#define ROUNDING 1e-15
#define UNSURE 0.05

/* Whether d is surely above the plane of a, b, c, counterclockwise from outside: in their circumscribed cap. */
static inline int is_above(const double *a, const double *b, const double *c, const double *d)
{
    double u[3], v[3], w[3];

    subtract3(u, a, d);
    subtract3(v, b, d);
    subtract3(w, c, d);
    double yz = v[1] * w[2], zy = v[2] * w[1], zx = v[2] * w[0], xz = v[0] * w[2], xy = v[0] * w[1], yx = v[1] * w[0];
    double sum = u[0] * (yz - zy) + u[1] * (zx - xz) + u[2] * (xy - yx);
    if (sum >= 0)
        return 0; /* nearly always */
    double sizes = fabs(u[0]) * (fabs(yz) + fabs(zy)) + fabs(u[1]) * (fabs(zx) + fabs(xz)) +
                   fabs(u[2]) * (fabs(xy) + fabs(yx));
    return -sum > ROUNDING * sizes;
}

static inline int should_flip(const struct globe *globe, int32_t e)
{
    int32_t f = globe->twins[e];
    return is_above(origin_of(globe, e), origin_of(globe, f), origin_of(globe, last_edge(e)),
                    origin_of(globe, last_edge(f)));
}

/* Whether the edge may have to flip, by the half arcs of both triangles: together they are the side of the dual cell, which
 * is negative then but for rounding. Roundings of vertices as near as 1e-7 change it by hundredths. */
static inline int may_flip(const double *arcs, int32_t e, int32_t f)
{
    return arcs[e] + arcs[f] < UNSURE * (1 + fabs(arcs[e]) + fabs(arcs[f]));
}

/* Replace the edge a b between the triangles a b c and b a d by c d: e is d b then, and its twin c a. */
static inline void flip_edge(struct globe *globe, int32_t e)
{
    int32_t f = globe->twins[e], e2 = last_edge(e), f2 = last_edge(f);
    int32_t beyond_e2 = globe->twins[e2], beyond_f2 = globe->twins[f2];

    globe->vertices[e] = globe->vertices[f2];
    globe->vertices[f] = globe->vertices[e2];
    join_twins(globe, e, beyond_f2);
    join_twins(globe, f, beyond_e2);
    join_twins(globe, e2, f2);
}

/* Flip the edges that are waiting, and those that this makes wrong. The stack has room for all edges, `waiting` marks
 * those on it, and `arcs` are kept up to date. Returns the flips, or -1 if there were more than `most`. */
static ptrdiff_t flip_waiting(struct globe *globe, double *arcs, int32_t *stack, uint8_t *waiting, int32_t depth,
                              ptrdiff_t most)
{
    ptrdiff_t n_flips = 0;

    while (depth) {
        int32_t e = stack[--depth];
        waiting[e] = 0;
        if (!should_flip(globe, e))
            continue;
        if (n_flips++ == most)
            return -1;
        int32_t f = globe->twins[e];
        flip_edge(globe, e);
        half_arcs(globe, e / 3, arcs);
        half_arcs(globe, f / 3, arcs);
        int32_t outer[4] = {e, next_edge(e), f, next_edge(f)};
        for (int i = 0; i < 4; i++)
            if (!waiting[outer[i]]) {
                waiting[outer[i]] = 1;
                stack[depth++] = outer[i];
            }
    }
    return n_flips;
}

#endif

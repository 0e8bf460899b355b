/* Flips until the triangulation is constrained Delaunay, in the plane or in a metric.
 *
 * C. L. Lawson, Software for C1 surface interpolation, in Mathematical Software III (1977) 161-194. */
#ifndef CVTIMG_FLIPS_H
#define CVTIMG_FLIPS_H

#include <math.h>

#include "topology.h"

/* An edge is flipped if it fails the test by more than rounding does, */
#define SURELY 1e-10
/* and if no triangle gets less area than this part of what the two have. */
#define LEAST_SHARE 1e-12

static int should_flip(const struct triangulation *mesh, const double *metric, int32_t e)
{
    int32_t f = mesh->twins[e];
    if (f < 0 || mesh->borders[e])
        return 0;
    int32_t quad[4] = {mesh->vertices[e], mesh->vertices[next_corner(e)], mesh->vertices[last_corner(e)],
                       mesh->vertices[f]};
    const double *a = mesh->points + 2 * (ptrdiff_t)quad[0], *b = mesh->points + 2 * (ptrdiff_t)quad[1];
    const double *c = mesh->points + 2 * (ptrdiff_t)quad[2], *d = mesh->points + 2 * (ptrdiff_t)quad[3];
    double xx = 1, xy = 0, yy = 1;

    if (metric) {
        xx = xy = yy = 0;
        for (int i = 0; i < 4; i++) {
            const double *m = metric + 3 * (ptrdiff_t)quad[i];
            xx += m[0], xy += m[1], yy += m[2];
        }
    }
    double abx = b[0] - a[0], aby = b[1] - a[1], acx = c[0] - a[0], acy = c[1] - a[1];
    double dcx = c[0] - d[0], dcy = c[1] - d[1], dbx = b[0] - d[0], dby = b[1] - d[1];
    double cross_a = abx * acy - aby * acx, cross_d = dcx * dby - dcy * dbx;
    double dot_a = xx * abx * acx + xy * (abx * acy + aby * acx) + yy * aby * acy;
    double dot_d = xx * dcx * dbx + xy * (dcx * dby + dcy * dbx) + yy * dcy * dby;
    /* The sine of the sum of the two angles opposite to the edge, but for a factor. */
    double sine = dot_a * cross_d + cross_a * dot_d;

    if (sine >= -SURELY * (fabs(dot_a * cross_d) + fabs(cross_a * dot_d)))
        return 0;
    double least = LEAST_SHARE * (cross_a + cross_d);
    return twice_area(a, b, d) > least && twice_area(d, c, a) > least;
}

/* Tell edges that need no test: in the plane those opposite to no obtuse angle, in a metric those tested from beyond. */
static int may_flip(const struct triangulation *mesh, const double *metric, int32_t e)
{
    if (metric)
        return mesh->twins[e] > e;
    const double *a = place_of(mesh, e), *b = place_of(mesh, next_corner(e)), *c = place_of(mesh, last_corner(e));
    return (b[0] - a[0]) * (c[0] - a[0]) + (b[1] - a[1]) * (c[1] - a[1]) < 0;
}

/* Flip until no edge should be, or `most` flips; `stack` and `waiting` have room for all edges. Returns how many. */
static ptrdiff_t flip_to_delaunay(struct triangulation *mesh, const double *metric, int32_t n_edges, ptrdiff_t most,
                                  int32_t *stack, uint8_t *waiting)
{
    ptrdiff_t n_flips = 0;
    int32_t depth = 0;

    for (int32_t e = 0; e < n_edges; e++)
        waiting[e] = 0;
    for (int32_t start = 0; start < n_edges; start++) {
        if (!may_flip(mesh, metric, start))
            continue;
        stack[depth++] = start;
        waiting[start] = 1;
        while (depth) {
            int32_t e = stack[--depth];
            waiting[e] = 0;
            if (n_flips >= most || !should_flip(mesh, metric, e))
                continue;
            int32_t f = mesh->twins[e];
            flip_edge(mesh, e);
            n_flips++;
            int32_t outer[4] = {e, last_corner(e), f, last_corner(f)};
            for (int i = 0; i < 4; i++)
                if (!waiting[outer[i]]) {
                    waiting[outer[i]] = 1;
                    stack[depth++] = outer[i];
                }
        }
    }
    return n_flips;
}

#endif

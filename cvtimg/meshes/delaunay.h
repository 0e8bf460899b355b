/* Which edges of triangles in the plane are not constrained Delaunay, also in a metric. */
#ifndef CVTIMG_DELAUNAY_H
#define CVTIMG_DELAUNAY_H

#include "half_edges.h"

/* An edge is flipped if it fails the test by more than rounding does, */
#define SURELY 1e-10
/* and if no triangle gets less area than this part of what the two have. */
#define LEAST_SHARE 1e-12

/* Twice the area of a triangle: > 0 if it is counterclockwise. */
static inline double twice_area(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static inline const double *origin2(const struct half_edges *mesh, int32_t e)
{
    return mesh->points + 2 * (ptrdiff_t)mesh->vertices[e];
}

/* Whether the angles opposite to an edge add up to more than 180 degrees, by the sum of the metrics (xx, xy, yy) at the
 * four vertices, or in the plane. */
static int should_flip(const struct half_edges *mesh, const double *metric, int32_t e)
{
    int32_t f = mesh->twins[e];
    if (f < 0 || mesh->borders[e])
        return 0;
    const double *a = origin2(mesh, last_edge(e)), *b = origin2(mesh, e), *c = origin2(mesh, f);
    const double *d = origin2(mesh, last_edge(f));
    double xx = 1, xy = 0, yy = 1;

    if (metric) {
        int32_t quad[4] = {last_edge(e), e, f, last_edge(f)};
        xx = xy = yy = 0;
        for (int i = 0; i < 4; i++) {
            const double *m = metric + 3 * (ptrdiff_t)mesh->vertices[quad[i]];
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
static int may_flip(const struct half_edges *mesh, const double *metric, int32_t e)
{
    if (metric)
        return mesh->twins[e] > e;
    const double *a = origin2(mesh, last_edge(e)), *b = origin2(mesh, e), *c = origin2(mesh, next_edge(e));
    return (b[0] - a[0]) * (c[0] - a[0]) + (b[1] - a[1]) * (c[1] - a[1]) < 0;
}

#endif

/* Which edges between points on a sphere are not Delaunay: where their convex hull is not convex. */
#ifndef CVTIMG_SPHERE_DELAUNAY_H
#define CVTIMG_SPHERE_DELAUNAY_H

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

static inline int should_flip(const struct half_edges *mesh, const double *arcs, int32_t e)
{
    int32_t f = mesh->twins[e];
    (void)arcs;
    return is_above(origin3(mesh, e), origin3(mesh, f), origin3(mesh, last_edge(e)), origin3(mesh, last_edge(f)));
}

/* Whether the edge may have to flip, by the half arcs of both triangles: together they are the side of the dual cell, which
 * is negative then but for rounding. Roundings of vertices as near as 1e-7 change it by hundredths. */
static inline int may_flip(const struct half_edges *mesh, const double *arcs, int32_t e)
{
    int32_t f = mesh->twins[e];
    return arcs[e] + arcs[f] < UNSURE * (1 + fabs(arcs[e]) + fabs(arcs[f]));
}

static inline void update_arcs(const struct half_edges *mesh, double *arcs, int32_t e) { half_arcs(mesh, e / 3, arcs); }

#endif

/* Moments of the Voronoi cells of points on the unit sphere: the dual of their Delaunay triangulation. */
#ifndef CVTIMG_DUAL_CELLS_H
#define CVTIMG_DUAL_CELLS_H

#include "half_edges.h"

/* Below this, series are exact to rounding. */
#define SMALL 0.02

/* The circumcenter of a triangle: the unit normal of its plane. It begins at the least vertex, so that its bits are
 * the same in any triangulation that has this triangle. */
static void circumcenter(const struct globe *globe, int32_t t, double *center)
{
    int32_t e = 3 * t, first = e;

    for (int k = 1; k < 3; k++)
        if (globe->vertices[e + k] < globe->vertices[first])
            first = e + k;
    const double *a = origin_of(globe, first);
    double u[3], v[3], normal[3];
    subtract3(u, origin_of(globe, next_edge(first)), a);
    subtract3(v, origin_of(globe, last_edge(first)), a);
    cross3(normal, u, v);
    double scale = 1 / sqrt(dot3(normal, normal));
    for (int k = 0; k < 3; k++)
        center[k] = scale * normal[k];
}

/* atan2(y, x) where x > 0 is often much larger than |y|. */
static inline double angle_of(double y, double x)
{
    double z = y / x;

    if (!(x > 0 && fabs(z) < SMALL))
        return atan2(y, x);
    double s = z * z;
    return z * (1 - s * (1. / 3 - s * (1. / 5 - s * (1. / 7 - s / 9))));
}

/* The integral of x over the cell around the origin of edge `first`: half the sum, over its sides, of their length
 * times their unit normal, by the theorem of Gauss. */
static void uniform_moment(const struct globe *globe, const double *centers, int32_t first, double *moment)
{
    const double *a = origin_of(globe, first);
    int32_t e = first;
    double sum[3] = {0, 0, 0};

    do {
        int32_t f = globe->twins[e];
        const double *left = centers + 3 * (ptrdiff_t)(e / 3), *right = centers + 3 * (ptrdiff_t)(f / 3);
        double normal[3], across[3];
        subtract3(normal, a, origin_of(globe, f));
        cross3(across, right, left);
        double scale = 1 / sqrt(dot3(normal, normal));
        double half_arc = 0.5 * scale * angle_of(dot3(across, normal) * scale, dot3(right, left));
        for (int k = 0; k < 3; k++)
            sum[k] += half_arc * normal[k];
        e = next_edge(f);
    } while (e != first);
    for (int k = 0; k < 3; k++)
        moment[k] = sum[k];
}

/* The mass of the same cell, the integral of the density times x, and that of the density times the squared distance
 * to the generator, for a density that is linear on each triangle of the generator and the ends of a side. */
static void weighted_moment(const struct globe *globe, const double *centers, const double *at_points,
                            const double *at_centers, int32_t first, double *mass_to, double *moment, double *energy_to)
{
    const double *a = origin_of(globe, first);
    double at_a = at_points[globe->vertices[first]], mass = 0, energy = 0, sum[3] = {0, 0, 0};
    int32_t e = first;

    do {
        int32_t f = globe->twins[e], left = e / 3, right = f / 3;
        const double *q = centers + 3 * (ptrdiff_t)left, *r = centers + 3 * (ptrdiff_t)right;
        double area = 2 * angle_of(determinant(a, r, q), 1 + dot3(a, r) + dot3(r, q) + dot3(q, a));
        double at_q = at_centers[left], at_r = at_centers[right], all = at_a + at_r + at_q;
        double u[3], v[3];
        subtract3(u, r, a);
        subtract3(v, q, a);
        mass += area * all / 3;
        energy += area / 30 * (dot3(u, u) * (all + 2 * at_r) + dot3(u, v) * (all + at_r + at_q) +
                               dot3(v, v) * (all + 2 * at_q));
        for (int k = 0; k < 3; k++)
            sum[k] += area / 12 * ((all + at_a) * a[k] + (all + at_r) * r[k] + (all + at_q) * q[k]);
        e = next_edge(f);
    } while (e != first);
    for (int k = 0; k < 3; k++)
        moment[k] = sum[k];
    *mass_to = mass;
    *energy_to = energy;
}

#endif

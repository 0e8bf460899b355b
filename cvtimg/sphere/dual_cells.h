/* Moments of the Voronoi cells of points on the unit sphere: the dual of their Delaunay triangulation. */
#ifndef CVTIMG_DUAL_CELLS_H
#define CVTIMG_DUAL_CELLS_H

#include "half_edges.h"

/* Below this, series are exact to rounding. */
#define SMALL 0.02
#define HALF_CIRCLE 3.14159265358979323846

/* atan2(y, x) where x > 0 is often much larger than |y|. */
static inline double angle_of(double y, double x)
{
    double z = y / x;

    if (!(x > 0 && fabs(z) < SMALL))
        return atan2(y, x);
    double s = z * z;
    return z * (1 - s * (1. / 3 - s * (1. / 5 - s * (1. / 7 - s / 9))));
}

/* The arc of tangent `product` / `height` * length over the length, given the square of that. */
static inline double arc_by_length(double product, double height, double inverse, double square)
{
    double ratio = product * inverse, s = ratio * ratio * square;

    if (height > 0 && s < SMALL * SMALL)
        return ratio * (1 - s * (1. / 3 - s * (1. / 5 - s * (1. / 7 - s / 9))));
    return atan2(sqrt(square) * product, height) / sqrt(square);
}

/* For each edge of a triangle, the arc from its middle to the circumcenter, divided by its length; negative where the
 * circumcenter is beyond the edge. The tangent of the arc from a b is |a - b| (a - c).(b - c) / (2 det(a, b, c)), for unit
 * vectors. Returns whether the triangle turns counterclockwise. */
static inline int half_arcs(const struct half_edges *mesh, int32_t t, double *arcs)
{
    int32_t first = 3 * t, second = next_edge(first), third = last_edge(first);
    const double *a = origin3(mesh, first), *b = origin3(mesh, second), *c = origin3(mesh, third);
    double ab[3], bc[3], ca[3], normal[3];

    subtract3(ab, b, a);
    subtract3(bc, c, b);
    subtract3(ca, a, c);
    cross3(normal, ca, ab);
    double height = 2 * dot3(normal, a), inverse = 1 / height;
    double at_a = -dot3(ca, ab), at_b = -dot3(ab, bc), at_c = -dot3(bc, ca); /* |a - b|^2 is at_a + at_b */
    arcs[first] = arc_by_length(at_c, height, inverse, at_a + at_b);
    arcs[second] = arc_by_length(at_a, height, inverse, at_b + at_c);
    arcs[third] = arc_by_length(at_b, height, inverse, at_c + at_a);
    return height > 0;
}

/* The integral of x over the cell around the origin of edge `first`: half the sum, over its sides, of their length
 * times their unit normal, by the theorem of Gauss. */
static void uniform_moment(const struct half_edges *mesh, const double *arcs, int32_t first, double *moment)
{
    const double *a = origin3(mesh, first);
    int32_t e = first;
    double sum[3] = {0, 0, 0};

    do {
        int32_t f = mesh->twins[e];
        double normal[3], arc = arcs[e] + arcs[f];
        subtract3(normal, a, origin3(mesh, f));
        /* Sides are shorter than half a circle, and arcs around a point that is not inside may miss a whole one. */
        if (arc < -HALF_CIRCLE / 4 && arc * sqrt(dot3(normal, normal)) < -HALF_CIRCLE / 2)
            arc += 2 * HALF_CIRCLE / sqrt(dot3(normal, normal));
        for (int k = 0; k < 3; k++)
            sum[k] += arc * normal[k];
        e = next_edge(f);
    } while (e != first);
    for (int k = 0; k < 3; k++)
        moment[k] = 0.5 * sum[k];
}

/* The mass of the same cell, the integral of the density times x, and that of the density times the squared distance
 * to the generator, for a density that is linear on each triangle of the generator and the ends of a side. */
static void weighted_moment(const struct half_edges *mesh, const double *centers, const double *at_points,
                            const double *at_centers, int32_t first, double *mass_to, double *moment, double *energy_to)
{
    const double *a = origin3(mesh, first);
    double at_a = at_points[mesh->vertices[first]], mass = 0, energy = 0, sum[3] = {0, 0, 0};
    int32_t e = first;

    do {
        int32_t f = mesh->twins[e], left = e / 3, right = f / 3;
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

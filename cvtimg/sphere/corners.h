/* Angles of triangles that are out of bounds, and how they change with the corners. */
#ifndef CVTIMG_CORNERS_H
#define CVTIMG_CORNERS_H

#include "half_edges.h"

/* Add to the slopes of three vertices those of half the sum of the squares by which cosines at the corners of a triangle
 * are out of bounds, unless there are none; return whether one is. */
static int add_corner_slopes(const struct half_edges *mesh, int32_t t, double least_cosine, double largest_cosine,
                             double *slopes)
{
    int is_out = 0;

    for (int k = 0; k < 3; k++) {
        int32_t e = 3 * t + k, f = next_edge(e), g = last_edge(e);
        double u[3], v[3];
        subtract3(u, origin3(mesh, f), origin3(mesh, e));
        subtract3(v, origin3(mesh, g), origin3(mesh, e));
        double uu = 1 / sqrt(dot3(u, u)), vv = 1 / sqrt(dot3(v, v)), cosine = dot3(u, v) * uu * vv;
        double excess = cosine < least_cosine ? cosine - least_cosine : cosine - largest_cosine;
        if (cosine >= least_cosine && cosine <= largest_cosine)
            continue;
        is_out = 1;
        if (!slopes)
            break;
        double *at_e = slopes + 3 * (ptrdiff_t)mesh->vertices[e], *at_f = slopes + 3 * (ptrdiff_t)mesh->vertices[f];
        double *at_g = slopes + 3 * (ptrdiff_t)mesh->vertices[g];
        for (int i = 0; i < 3; i++) {
            double by_f = excess * uu * (v[i] * vv - cosine * u[i] * uu);
            double by_g = excess * vv * (u[i] * uu - cosine * v[i] * vv);
            at_f[i] += by_f;
            at_g[i] += by_g;
            at_e[i] -= by_f + by_g;
        }
    }
    return is_out;
}

#endif

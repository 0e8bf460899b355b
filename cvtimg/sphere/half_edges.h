/* A triangulation of the sphere as half-edges.
 *
 * Triangle t owns the edges 3 t, 3 t + 1, 3 t + 2, counterclockwise from outside. Edge e leads from vertices[e] to
 * vertices[next_edge(e)]; twins[e] is the same edge of the triangle beyond. The surface is closed: each edge has one. */
#ifndef CVTIMG_HALF_EDGES_H
#define CVTIMG_HALF_EDGES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

struct globe {
    const double *points; /* x, y, z of each vertex */
    int32_t *vertices;
    int32_t *twins;
};

static inline int32_t next_edge(int32_t e) { return e % 3 == 2 ? e - 2 : e + 1; }
static inline int32_t last_edge(int32_t e) { return e % 3 == 0 ? e + 2 : e - 1; }

/* The edge of a triangle from its least vertex: where sums begin whose bits are to be the same in any triangulation
 * that has this triangle. */
static inline int32_t least_edge(const int32_t *vertices, int32_t t)
{
    int32_t e = 3 * t, least = e;

    for (int k = 1; k < 3; k++)
        if (vertices[e + k] < vertices[least])
            least = e + k;
    return least;
}

static inline void join_twins(struct globe *globe, int32_t e, int32_t f)
{
    globe->twins[e] = f;
    globe->twins[f] = e;
}

static inline const double *origin_of(const struct globe *globe, int32_t e)
{
    return globe->points + 3 * (ptrdiff_t)globe->vertices[e];
}

static inline double dot3(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void cross3(double *to, const double *a, const double *b)
{
    to[0] = a[1] * b[2] - a[2] * b[1];
    to[1] = a[2] * b[0] - a[0] * b[2];
    to[2] = a[0] * b[1] - a[1] * b[0];
}

static inline double determinant(const double *a, const double *b, const double *c)
{
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
}

static inline void subtract3(double *to, const double *a, const double *b)
{
    for (int k = 0; k < 3; k++)
        to[k] = a[k] - b[k];
}

static inline double squared_distance(const double *a, const double *b)
{
    double d[3];
    subtract3(d, a, b);
    return dot3(d, d);
}

#endif

/* Triangles joined along half-edges, in the plane or in space, and flips until they are Delaunay.
 *
 * Triangle t owns the half-edges 3 t, 3 t + 1, 3 t + 2, counterclockwise. Half-edge e leads from vertices[e] to
 * vertices[next_edge(e)]; twins[e] leads back, in the triangle beyond, and is -1 on a boundary.
 *
 * C. L. Lawson, Software for C1 surface interpolation, in Mathematical Software III (1977) 161-194. */
#ifndef CVTIMG_HALF_EDGES_H
#define CVTIMG_HALF_EDGES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

/* Vertices with more triangles than this are not moved, collapsed or flipped to. */
#define MOST_AROUND 64

struct half_edges {
    const double *points; /* x, y or x, y, z of each vertex */
    int32_t *vertices;
    int32_t *twins;
    uint8_t *borders;  /* whether each edge must stay; NULL if none must */
    int32_t *outgoing; /* a half-edge out of each vertex; NULL if none is kept */
};

/* Whether an edge is to be flipped, and what follows a flip, given values of vertices or edges. */
typedef int edge_test(const struct half_edges *mesh, const double *values, int32_t e);
typedef void edge_update(const struct half_edges *mesh, double *values, int32_t e);

static inline int32_t next_edge(int32_t e) { return e % 3 == 2 ? e - 2 : e + 1; }
static inline int32_t last_edge(int32_t e) { return e % 3 == 0 ? e + 2 : e - 1; }
static inline int32_t turn_left(const struct half_edges *mesh, int32_t e) { return mesh->twins[last_edge(e)]; }
static inline int32_t end_of(const struct half_edges *mesh, int32_t e) { return mesh->vertices[next_edge(e)]; }

static inline void join_twins(struct half_edges *mesh, int32_t e, int32_t f)
{
    mesh->twins[e] = f;
    if (f >= 0)
        mesh->twins[f] = e;
}

/* List the half-edges out of the origin of e that belong to a triangle, counterclockwise: from e around, or from one
 * boundary to the other. Returns how many, or MOST_AROUND + 1 if there are more, of which the first are listed. */
static inline int half_edges_around(const struct half_edges *mesh, int32_t e, int32_t *around)
{
    int32_t first = e, before;
    int n = 0;

    while ((before = mesh->twins[first]) >= 0 && (first = next_edge(before)) != e)
        ;
    for (e = first; n < MOST_AROUND;) {
        around[n++] = e;
        e = turn_left(mesh, e);
        if (e < 0 || e == first)
            return n;
    }
    return MOST_AROUND + 1;
}

/* List the vertices that edges join to the origin of e, counterclockwise. Returns how many, or more than MOST_AROUND. */
static inline int vertices_around(const struct half_edges *mesh, int32_t e, int32_t found[MOST_AROUND + 1])
{
    int n = half_edges_around(mesh, e, found);

    if (n > MOST_AROUND)
        return n;
    int32_t last = last_edge(found[n - 1]);
    for (int i = 0; i < n; i++)
        found[i] = end_of(mesh, found[i]);
    if (mesh->twins[last] < 0)
        found[n++] = mesh->vertices[last];
    return n;
}

/* Replace the edge a b between the triangles a b c and b a d by c d: e is d b then, and its twin c a. */
static inline void flip_edge(struct half_edges *mesh, int32_t e)
{
    int32_t f = mesh->twins[e], e2 = last_edge(e), f2 = last_edge(f);
    int32_t beyond_e2 = mesh->twins[e2], beyond_f2 = mesh->twins[f2];

    mesh->vertices[e] = mesh->vertices[f2];
    mesh->vertices[f] = mesh->vertices[e2];
    join_twins(mesh, e, beyond_f2);
    join_twins(mesh, f, beyond_e2);
    join_twins(mesh, e2, f2);
    if (mesh->borders) {
        mesh->borders[e] = mesh->borders[f2];
        mesh->borders[f] = mesh->borders[e2];
        mesh->borders[e2] = mesh->borders[f2] = 0;
    }
    if (mesh->outgoing)
        for (int32_t k = 0, g = e, h = f; k < 2; k++, g = next_edge(g), h = next_edge(h)) {
            mesh->outgoing[mesh->vertices[g]] = g;
            mesh->outgoing[mesh->vertices[h]] = h;
        }
}

/* Flip the edges that are waiting, and those that this makes wrong. The stack has room for all edges, and `waiting`
 * marks those on it. Returns the flips, or `most` + 1 if that many were not enough. */
static inline ptrdiff_t flip_waiting(struct half_edges *mesh, double *values, edge_test should_flip,
                                     edge_update update, int32_t *stack, uint8_t *waiting, int32_t depth,
                                     ptrdiff_t most)
{
    ptrdiff_t n_flips = 0;

    while (depth) {
        int32_t e = stack[--depth];
        waiting[e] = 0;
        if (n_flips > most || !should_flip(mesh, values, e))
            continue;
        if (n_flips++ == most)
            continue;
        int32_t f = mesh->twins[e];
        flip_edge(mesh, e);
        if (update) {
            update(mesh, values, e);
            update(mesh, values, f);
        }
        int32_t outer[4] = {e, next_edge(e), f, next_edge(f)};
        for (int i = 0; i < 4; i++)
            if (!waiting[outer[i]]) {
                waiting[outer[i]] = 1;
                stack[depth++] = outer[i];
            }
    }
    return n_flips;
}

/* The same for all edges, but for those that surely need no flip, one after the other. */
static inline ptrdiff_t flip_all(struct half_edges *mesh, double *values, edge_test may_flip, edge_test should_flip,
                                 int32_t n_edges, int32_t *stack, uint8_t *waiting, ptrdiff_t most)
{
    ptrdiff_t n_flips = 0;

    for (int32_t e = 0; e < n_edges && n_flips <= most; e++)
        if (may_flip(mesh, values, e)) {
            stack[0] = e;
            waiting[e] = 1;
            n_flips += flip_waiting(mesh, values, should_flip, NULL, stack, waiting, 1, most - n_flips);
        }
    return n_flips;
}

/* Of triangles in space: */

static inline const double *origin3(const struct half_edges *mesh, int32_t e)
{
    return mesh->points + 3 * (ptrdiff_t)mesh->vertices[e];
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

/* Insertion of points into a Delaunay triangulation of the sphere, one after the other. */
#ifndef CVTIMG_INSERTION_H
#define CVTIMG_INSERTION_H

#include "delaunay.h"

/* A walk that takes more steps than this and this times the root of the number of triangles goes in circles. */
#define WALK_STEPS 40
#define WALK_FACTOR 8

/* Begin with four points, in an order such that the first three are counterclockwise from outside. */
static void start_from_four(struct half_edges *mesh, const int32_t *four)
{
    int32_t a = four[0], b = four[1], c = four[2], d = four[3];
    const int32_t vertices[12] = {a, b, c, a, d, b, b, d, c, c, d, a};
    const int32_t twins[6][2] = {{0, 5}, {1, 8}, {2, 11}, {3, 10}, {4, 6}, {7, 9}};

    for (int e = 0; e < 12; e++)
        mesh->vertices[e] = vertices[e];
    for (int i = 0; i < 6; i++)
        join_twins(mesh, twins[i][0], twins[i][1]);
}

/* Which edge of a triangle has `place` beyond it, seen from a point inside; -1 if none surely. */
static inline int32_t edge_towards(const struct half_edges *mesh, int32_t t, int first, const double *inside,
                                   const double *place)
{
    double ray[3], u[3], v[3];

    subtract3(ray, place, inside);
    for (int j = 0; j < 3; j++) {
        int32_t e = 3 * t + (j + first) % 3;
        subtract3(u, origin3(mesh, e), place);
        subtract3(v, origin3(mesh, next_edge(e)), place);
        double side = determinant(u, v, ray);
        if (side < 0 && side * side > ROUNDING * ROUNDING * dot3(u, u) * dot3(v, v) * dot3(ray, ray))
            return e;
    }
    return -1;
}

/* Find the triangle that the ray from inside to `place` meets, or, where rounding leads the walk in circles, any one
 * that has the place above it. Returns -1 if there is none. */
static int32_t find_triangle(const struct half_edges *mesh, int32_t n_triangles, int32_t t, const double *inside,
                             const double *place)
{
    ptrdiff_t most = WALK_STEPS + WALK_FACTOR * (ptrdiff_t)sqrt((double)n_triangles);

    for (ptrdiff_t step = 0; step < most; step++) {
        int32_t e = edge_towards(mesh, t, (int)(step % 3), inside, place);
        if (e < 0)
            return t;
        t = mesh->twins[e] / 3;
    }
    for (t = 0; t < n_triangles; t++)
        if (is_above(origin3(mesh, 3 * t), origin3(mesh, 3 * t + 1), origin3(mesh, 3 * t + 2), place))
            return t;
    return -1;
}

/* Divide triangle t by a new vertex, and flip until all is Delaunay again: an edge of which both triangles have the
 * new vertex never flips. The triangles n_triangles and n_triangles + 1 are new. Returns the flips, or -1 if there
 * were more than `most`. */
static ptrdiff_t insert_vertex(struct half_edges *mesh, int32_t n_triangles, int32_t t, int32_t vertex, int32_t *stack,
                               ptrdiff_t most)
{
    int32_t e = 3 * t, u = 3 * n_triangles, v = u + 3, depth = 0;
    int32_t a = mesh->vertices[e], b = mesh->vertices[e + 1], c = mesh->vertices[e + 2];
    int32_t beyond_bc = mesh->twins[e + 1], beyond_ca = mesh->twins[e + 2];
    const int32_t vertices[6] = {b, c, vertex, c, a, vertex};
    ptrdiff_t n_flips = 0;

    mesh->vertices[e + 2] = vertex;
    for (int i = 0; i < 6; i++)
        mesh->vertices[u + i] = vertices[i];
    join_twins(mesh, u, beyond_bc);
    join_twins(mesh, v, beyond_ca);
    join_twins(mesh, e + 1, u + 2);
    join_twins(mesh, u + 1, v + 2);
    join_twins(mesh, v + 1, e + 2);
    stack[depth++] = e;
    stack[depth++] = u;
    stack[depth++] = v;
    while (depth) {
        int32_t edge = stack[--depth];
        if (!should_flip(mesh, NULL, edge))
            continue;
        if (n_flips++ == most)
            return -1;
        int32_t twin = mesh->twins[edge];
        flip_edge(mesh, edge);
        stack[depth++] = edge;
        stack[depth++] = next_edge(twin);
    }
    return n_flips;
}

#endif

/* A triangulation with borders, which flips and moves keep.
 *
 * Triangle t has the corners 3 t, 3 t + 1, 3 t + 2, counter-clockwise in (x, y). An edge has the number of the corner
 * opposite to it. */
#ifndef CVTIMG_TOPOLOGY_H
#define CVTIMG_TOPOLOGY_H

#include <stddef.h>
#include <stdint.h>

/* More triangles than this at one vertex are not asked for. */
#define MOST_AROUND 64

struct triangulation {
    const double *points; /* x, y of each vertex */
    int32_t *vertices;    /* of each corner */
    int32_t *twins;       /* of each edge: the same edge of the triangle beyond, or -1 */
    uint8_t *borders;     /* of each edge: whether it must stay */
    int32_t *corners;     /* of each vertex: one of its corners */
};

static inline int32_t next_corner(int32_t c) { return c % 3 == 2 ? c - 2 : c + 1; }
static inline int32_t last_corner(int32_t c) { return c % 3 == 0 ? c + 2 : c - 1; }

/* Twice the area of a triangle: > 0 if it is counter-clockwise. */
static inline double twice_area(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static inline const double *place_of(const struct triangulation *mesh, int32_t corner)
{
    return mesh->points + 2 * (ptrdiff_t)mesh->vertices[corner];
}

static inline void join_edges(struct triangulation *mesh, int32_t edge, int32_t twin)
{
    mesh->twins[edge] = twin;
    if (twin >= 0)
        mesh->twins[twin] = edge;
}

/* Replace the edge between two triangles by the other diagonal of their quadrangle. */
static void flip_edge(struct triangulation *mesh, int32_t e)
{
    int32_t f = mesh->twins[e], e1 = next_corner(e), e2 = last_corner(e), f1 = next_corner(f), f2 = last_corner(f);
    int32_t a = mesh->vertices[e], b = mesh->vertices[e1], c = mesh->vertices[e2], d = mesh->vertices[f];
    int32_t beyond_bd = mesh->twins[f1], beyond_ca = mesh->twins[e1];
    uint8_t border_bd = mesh->borders[f1], border_ca = mesh->borders[e1];

    mesh->vertices[e2] = d; /* a b d */
    mesh->vertices[f2] = a; /* d c a */
    join_edges(mesh, e, beyond_bd);
    join_edges(mesh, f, beyond_ca);
    join_edges(mesh, e1, f1);
    mesh->borders[e] = border_bd;
    mesh->borders[f] = border_ca;
    mesh->borders[e1] = mesh->borders[f1] = 0;
    mesh->corners[a] = e;
    mesh->corners[b] = e1;
    mesh->corners[d] = f;
    mesh->corners[c] = f1;
}

/* Find the twin of each edge. Scratch: `first` for each vertex and `after` for each edge, lists of edges without a twin
 * by the lesser of their ends. */
static void find_twins(struct triangulation *mesh, int32_t n_vertices, int32_t n_edges, int32_t *first, int32_t *after)
{
    for (int32_t i = 0; i < n_vertices; i++)
        first[i] = -1;
    for (int32_t e = 0; e < n_edges; e++) {
        int32_t a = mesh->vertices[next_corner(e)], b = mesh->vertices[last_corner(e)];
        int32_t *link = first + (a < b ? a : b);
        /* An edge runs the other way around in the next triangle. */
        while (*link >= 0 && (mesh->vertices[next_corner(*link)] != b || mesh->vertices[last_corner(*link)] != a))
            link = after + *link;
        if (*link >= 0) {
            join_edges(mesh, e, *link);
            *link = after[*link];
        } else {
            mesh->twins[e] = after[e] = -1;
            *link = e;
        }
    }
}

/* List the corners at a vertex; return how many, or 0 if it is on the outer boundary or has too many. */
static int corners_around(const struct triangulation *mesh, int32_t vertex, int32_t *around)
{
    int32_t first = mesh->corners[vertex], c = first;
    int n = 0;

    do {
        if (n == MOST_AROUND)
            return 0;
        around[n++] = c;
        c = mesh->twins[next_corner(c)];
        if (c < 0)
            return 0;
        c = next_corner(c);
    } while (c != first);
    return n;
}

/* List the corners at a vertex from one outer edge to the other, or all around; return how many, or 0 if there are too
 * many. */
static int corners_of_fan(const struct triangulation *mesh, int32_t vertex, int32_t *around)
{
    int32_t first = mesh->corners[vertex], c = first;
    int n = 0;

    for (int32_t before = mesh->twins[last_corner(c)]; before >= 0; before = mesh->twins[last_corner(c)]) {
        c = last_corner(before);
        if (c == first)
            break;
    }
    first = c;
    do {
        if (n == MOST_AROUND)
            return 0;
        around[n++] = c;
        c = mesh->twins[next_corner(c)];
        if (c >= 0)
            c = next_corner(c);
    } while (c >= 0 && c != first);
    return n;
}

#endif

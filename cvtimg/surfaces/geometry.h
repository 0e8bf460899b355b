/* Flips, collapses of edges, cells and nearest faces of triangulated surfaces, as half-edges.
 *
 * The twin of a half-edge on a boundary is -1: no edge is flipped, no cell reaches, and no walk leads across. */
#ifndef CVTIMG_SURFACE_GEOMETRY_H
#define CVTIMG_SURFACE_GEOMETRY_H

#include "half_edges.h"

/* Cotangents of opposite angles add up to less than this if an edge is surely to be flipped. */
#define SURELY -1e-9
/* Triangles must not face away from the surface by more than the angle with this cosine. */
#define LEAST_COSINE 0.3

/* Cotangent of the angle at `apex`, opposite to the edge a b. */
static inline double cotangent(const double *apex, const double *a, const double *b)
{
    double u[3], v[3], normal[3];

    subtract3(u, a, apex);
    subtract3(v, b, apex);
    cross3(normal, u, v);
    return dot3(u, v) / sqrt(dot3(normal, normal) + 1e-300);
}

static int is_joined(const struct half_edges *mesh, int32_t e, int32_t vertex)
{
    int32_t around[MOST_AROUND + 1];
    int n = vertices_around(mesh, e, around);

    if (n > MOST_AROUND)
        return 1;
    for (int i = 0; i < n; i++)
        if (around[i] == vertex)
            return 1;
    return 0;
}

static inline void normal_of(double *normal, const double *a, const double *b, const double *c)
{
    double u[3], v[3];

    subtract3(u, b, a);
    subtract3(v, c, a);
    cross3(normal, u, v);
}

/* Whether the triangle of three vertices faces where the surface does at them, up to an angle with this cosine. */
static int faces_outward(const double *points, const double *normals, const int32_t *corners, double cosine)
{
    double normal[3], outward[3] = {0, 0, 0};

    normal_of(normal, points + 3 * (ptrdiff_t)corners[0], points + 3 * (ptrdiff_t)corners[1],
              points + 3 * (ptrdiff_t)corners[2]);
    for (int k = 0; k < 3; k++)
        for (int axis = 0; axis < 3; axis++)
            outward[axis] += normals[3 * (ptrdiff_t)corners[k] + axis];
    double dot = dot3(normal, outward);
    return dot > 0 && dot * dot >= cosine * cosine * dot3(normal, normal) * dot3(outward, outward);
}

/* Whether the angles opposite to an edge add up to more than 180 degrees, and the other diagonal is free and folds
 * nothing. */
static int should_turn(const struct half_edges *mesh, const double *normals, int32_t e)
{
    int32_t f = mesh->twins[e];
    if (f < 0)
        return 0;
    int32_t e2 = last_edge(e), f2 = last_edge(f);
    int32_t a = mesh->vertices[e], b = mesh->vertices[f], c = mesh->vertices[e2], d = mesh->vertices[f2];
    const double *at_a = origin3(mesh, e), *at_b = origin3(mesh, f);

    if (cotangent(origin3(mesh, e2), at_a, at_b) + cotangent(origin3(mesh, f2), at_a, at_b) >= SURELY)
        return 0;
    const int32_t first[3] = {d, b, c}, second[3] = {a, d, c};
    return c != d && faces_outward(mesh->points, normals, first, LEAST_COSINE) &&
           faces_outward(mesh->points, normals, second, LEAST_COSINE) && !is_joined(mesh, e2, d);
}

/* Whether an edge is left, and not tested from the other side. */
static int may_turn(const struct half_edges *mesh, const double *normals, int32_t e)
{
    (void)normals;
    return mesh->twins[e] >= e && mesh->vertices[e] >= 0;
}

/* Whether triangles at a vertex, the origins of `around`, face where the surface does and have no side longer than `most`
 * if it moves to the vertex `kept`; triangles that have both vanish. */
static int stays_sound(const struct half_edges *mesh, const double *normals, double most, const int32_t *around, int n,
                       int32_t kept)
{
    for (int i = 0; i < n; i++) {
        int32_t g = around[i], second = end_of(mesh, g), third = mesh->vertices[last_edge(g)];
        if (squared_distance(origin3(mesh, next_edge(g)), mesh->points + 3 * (ptrdiff_t)kept) > most * most)
            return 0;
        if (second == kept || third == kept)
            continue;
        int32_t corners[3] = {kept, second, third};
        if (!faces_outward(mesh->points, normals, corners, LEAST_COSINE))
            return 0;
    }
    return 1;
}

/* Whether the origin of e has triangles enough to lose one. */
static int may_lose_one(const struct half_edges *mesh, int32_t e)
{
    int32_t around[MOST_AROUND];
    int n = half_edges_around(mesh, e, around);

    return n > MOST_AROUND || n > (mesh->twins[last_edge(around[n - 1])] < 0 ? 1 : 3);
}

/* Remove the triangle of e, whose origin and end have become one: the two other sides, too. */
static void close_triangle(struct half_edges *mesh, int32_t e)
{
    int32_t one = mesh->twins[next_edge(e)], other = mesh->twins[last_edge(e)];

    join_twins(mesh, one < 0 ? other : one, one < 0 ? one : other);
    for (int k = 0; k < 3; k++)
        mesh->vertices[3 * (e / 3) + k] = -1;
}

/* Move the origin of e to its end, or the end to its origin if `back`, and remove the triangles at e, if the surface stays
 * one without folds, and no new edge is longer than `most`. A vertex on a boundary must move along it. */
static int collapse_edge(struct half_edges *mesh, const double *normals, double most, int32_t e, int back)
{
    int32_t f = mesh->twins[e], from = back ? next_edge(e) : e, to = back ? e : next_edge(e);
    int32_t kept = mesh->vertices[to], around[MOST_AROUND], near[MOST_AROUND + 1], beyond[MOST_AROUND + 1];
    int n_faces = half_edges_around(mesh, from, around), n_sides = f < 0 ? 1 : 2, common = 0;
    int n = vertices_around(mesh, from, near), m = vertices_around(mesh, to, beyond);

    if (n_faces > MOST_AROUND || n + m - 2 - n_sides > MOST_AROUND || n > MOST_AROUND || m > MOST_AROUND)
        return 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < m; j++)
            common += near[i] == beyond[j];
    if (common != n_sides || !may_lose_one(mesh, last_edge(e)) || (f >= 0 && !may_lose_one(mesh, last_edge(f))) ||
        !stays_sound(mesh, normals, most, around, n_faces, kept))
        return 0;
    for (int i = 0; i < n_faces; i++)
        mesh->vertices[around[i]] = kept;
    close_triangle(mesh, e);
    if (f >= 0)
        close_triangle(mesh, f);
    return 1;
}

/* Add a triangle to the cell of a vertex, a corner of it: its mass, and its first moment about that. Steps to the others
 * are u and v; the density is linear. */
static void add_part(int32_t vertex, const double *u, const double *v, double area, double here, double at_u, double at_v,
                     double *masses, double *pulls)
{
    double all = here + at_u + at_v;

    masses[vertex] += area * all / 3;
    for (int axis = 0; axis < 3; axis++)
        pulls[3 * (ptrdiff_t)vertex + axis] += area / 12 * (all * (u[axis] + v[axis]) + at_u * u[axis] + at_v * v[axis]);
}

/* Add mass and first moments of the cells of a triangle's corners, from corner to middles of sides to circumcenter, all
 * in its plane. Parts have signs: those of an obtuse triangle are made up for by its neighbor. The density is linear
 * from corners to middles to the circumcenter. */
static void add_kites(const struct half_edges *mesh, const double *density, int32_t t, double *masses, double *pulls)
{
    const int32_t *v = mesh->vertices + 3 * (ptrdiff_t)t;
    double squares[3], weights[3], center[3] = {0, 0, 0}, sum = 0, at_center = 0, normal[3];
    const double *p[3];

    for (int k = 0; k < 3; k++)
        p[k] = mesh->points + 3 * (ptrdiff_t)v[k];
    for (int k = 0; k < 3; k++)
        squares[k] = squared_distance(p[(k + 1) % 3], p[(k + 2) % 3]);
    for (int k = 0; k < 3; k++)
        sum += weights[k] = squares[k] * (squares[(k + 1) % 3] + squares[(k + 2) % 3] - squares[k]);
    normal_of(normal, p[0], p[1], p[2]);
    double area = 0.5 * sqrt(dot3(normal, normal));
    if (sum <= 0 || area <= 0)
        return;
    for (int k = 0; k < 3; k++)
        if (weights[k] < 0 && mesh->twins[3 * (ptrdiff_t)t + (k + 1) % 3] < 0) /* where there is no neighbor, to the centroid */
            weights[0] = weights[1] = weights[2] = sum / 3;
    double least = density[v[0]], largest = least;
    for (int k = 0; k < 3; k++) {
        double here = density[v[k]], share = weights[k] / sum;
        at_center += share * here;
        least = fmin(least, here), largest = fmax(largest, here);
        for (int i = 0; i < 3; i++)
            center[i] += share * (p[k][i] - p[0][i]);
    }
    at_center = fmin(fmax(at_center, least), largest);
    for (int k = 0; k < 3; k++) { /* side k, opposite to corner k: two halves, each with the circumcenter */
        double part = weights[k] / sum * area / 2;
        int ends[2] = {(k + 1) % 3, (k + 2) % 3};
        double between = (density[v[ends[0]]] + density[v[ends[1]]]) / 2;
        for (int h = 0; h < 2; h++) {
            int i = ends[h];
            double middle[3], inward[3];
            for (int axis = 0; axis < 3; axis++) {
                middle[axis] = (p[ends[1 - h]][axis] - p[i][axis]) / 2;
                inward[axis] = center[axis] + p[0][axis] - p[i][axis];
            }
            add_part(v[i], middle, inward, part, density[v[i]], between, at_center, masses, pulls);
        }
    }
}

/* The point of a triangle nearest to p. Returns the side it is on (0 for that from corner 0 to 1, ...), 3 + k if it is
 * corner k, or -1 if it is inside. C. Ericson, Real-Time Collision Detection (2005), section 5.1.5. */
static int nearest_in_triangle(const double *p, const double *a, const double *b, const double *c, double *nearest)
{
    double ab[3], ac[3], ap[3], bp[3], cp[3];

    subtract3(ab, b, a);
    subtract3(ac, c, a);
    subtract3(ap, p, a);
    subtract3(bp, p, b);
    subtract3(cp, p, c);
    double d1 = dot3(ab, ap), d2 = dot3(ac, ap), d3 = dot3(ab, bp), d4 = dot3(ac, bp), d5 = dot3(ab, cp);
    double d6 = dot3(ac, cp), along_b = 0, along_c = 0;
    double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    int where = -1;

    if (d1 <= 0 && d2 <= 0)
        where = 3;
    else if (d3 >= 0 && d4 <= d3)
        where = 4, along_b = 1;
    else if (vc <= 0 && d1 >= 0 && d3 <= 0)
        where = 0, along_b = d1 / (d1 - d3);
    else if (d6 >= 0 && d5 <= d6)
        where = 5, along_c = 1;
    else if (vb <= 0 && d2 >= 0 && d6 <= 0)
        where = 2, along_c = d2 / (d2 - d6);
    else if (va <= 0 && d4 >= d3 && d5 >= d6)
        where = 1, along_c = (d4 - d3) / (d4 - d3 + d5 - d6), along_b = 1 - along_c;
    else
        along_b = vb / (va + vb + vc), along_c = vc / (va + vb + vc);
    for (int k = 0; k < 3; k++)
        nearest[k] = a[k] + along_b * ab[k] + along_c * ac[k];
    return where;
}

static double distance_to_face(const struct half_edges *mesh, int32_t t, const double *p, double *nearest, int *where)
{
    *where = nearest_in_triangle(p, origin3(mesh, 3 * t), origin3(mesh, 3 * t + 1), origin3(mesh, 3 * t + 2),
                                 nearest);
    return squared_distance(p, nearest);
}

/* Walk from face to face while that brings the surface nearer to `place`, and move it there. Returns the last face. */
static int32_t walk_to_nearest(const struct half_edges *mesh, int32_t t, double *place)
{
    double nearest[3], best[3], least;
    int where;

    least = distance_to_face(mesh, t, place, best, &where);
    while (where >= 0) {
        int32_t from = 3 * t + where % 3, around[MOST_AROUND], next = -1;
        int n = where < 3 ? 1 : half_edges_around(mesh, from, around), next_where = -1;
        if (where < 3)
            around[0] = mesh->twins[from];
        for (int i = 0; i < n && i < MOST_AROUND; i++) {
            int side;
            if (around[i] < 0)
                continue;
            double distance = distance_to_face(mesh, around[i] / 3, place, nearest, &side);
            if (distance < least * (1 - 1e-12)) {
                least = distance, next = around[i] / 3, next_where = side;
                for (int k = 0; k < 3; k++)
                    best[k] = nearest[k];
            }
        }
        if (next < 0)
            break;
        t = next, where = next_where;
    }
    for (int k = 0; k < 3; k++)
        place[k] = best[k];
    return t;
}

#endif

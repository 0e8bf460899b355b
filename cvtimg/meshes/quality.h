/* Moves of vertices that make edges even, or triangles more equilateral. */
#ifndef CVTIMG_QUALITY_H
#define CVTIMG_QUALITY_H

#include "delaunay.h"

/* Making edges even must not flatten triangles: this part of the sum of their squared sides is twice the area of half as
 * good a triangle as an equilateral one. */
#define LEAST_SHAPE 0.144
/* What a triangle costs that has turned over. */
#define INFINITY_COST 1e30
/* Steps are shorter where edges hardly tell the direction: the part of the trace that is added to second derivatives. */
#define DAMPING 1e-3

/* List the half-edges out of a vertex; return how many, or 0 if there are too many. */
static int fan_of(const struct half_edges *mesh, int32_t vertex, int32_t *around)
{
    int n = half_edges_around(mesh, mesh->outgoing[vertex], around);
    return n > MOST_AROUND ? 0 : n;
}

static double squared_sides(const double *a, const double *b, const double *c)
{
    double x = b[0] - a[0], y = b[1] - a[1], u = c[0] - b[0], v = c[1] - b[1], p = a[0] - c[0], q = a[1] - c[1];
    return x * x + y * y + u * u + v * v + p * p + q * q;
}

/* Whether a triangle around a vertex gets flat, or flatter than it is, when the vertex moves to `place`. */
static int gets_flat(const struct half_edges *mesh, const int32_t *around, int n, const double *old,
                     const double *place)
{
    for (int i = 0; i < n; i++) {
        const double *b = origin2(mesh, next_edge(around[i])), *c = origin2(mesh, last_edge(around[i]));
        double area2 = twice_area(place, b, c), squares = squared_sides(place, b, c);
        if (area2 < LEAST_SHAPE * squares && area2 * squared_sides(old, b, c) < twice_area(old, b, c) * squares)
            return 1;
    }
    return 0;
}

/* What a triangle a b c costs, and how that changes with a: a power of (sum of squared sides) / (4 3^(1/2) area), which
 * is 1 for an equilateral triangle and grows without bound for flat ones. */
static double cost_of(const double *a, const double *b, const double *c, int power, double *slope, double *curvature)
{
    double abx = b[0] - a[0], aby = b[1] - a[1], acx = c[0] - a[0], acy = c[1] - a[1];
    double bcx = c[0] - b[0], bcy = c[1] - b[1], area2 = abx * acy - aby * acx, squares = squared_sides(a, b, c);

    if (area2 <= 0)
        return INFINITY_COST;
    double ratio = squares / (2 * sqrt(3) * area2), below = 1;
    for (int i = 1; i < power; i++)
        below *= ratio;
    double factor = power * below / (2 * sqrt(3) * area2);
    slope[0] += factor * (-2 * (abx + acx) + squares / area2 * bcy);
    slope[1] += factor * (-2 * (aby + acy) - squares / area2 * bcx);
    *curvature += 4 * factor;
    return ratio * below;
}

/* Move a vertex one step downhill on the cost of the triangles around it. */
static void smooth_vertex(struct half_edges *mesh, double *place, int32_t vertex, int power)
{
    int32_t around[MOST_AROUND];
    double slope[2] = {0, 0}, curvature = 0, cost = 0;
    int n = fan_of(mesh, vertex, around);

    for (int i = 0; i < n; i++)
        cost += cost_of(place, origin2(mesh, next_edge(around[i])), origin2(mesh, last_edge(around[i])), power, slope,
                        &curvature);
    if (!n || cost >= INFINITY_COST)
        return;
    for (double part = 1; part > 0.1; part /= 2) {
        double there[2] = {place[0] - part * slope[0] / curvature, place[1] - part * slope[1] / curvature};
        double less = 0, ignored[3] = {0, 0, 0};
        for (int i = 0; i < n && less < cost; i++)
            less += cost_of(there, origin2(mesh, next_edge(around[i])), origin2(mesh, last_edge(around[i])), power,
                            ignored, ignored + 2);
        if (less >= cost)
            continue;
        place[0] = there[0], place[1] = there[1];
        return;
    }
}

/* What the edges at a vertex cost when it is at `place`: the sum of (length^2 / `mean` - 1)^4, by what squared lengths are
 * worth halfway, and how that changes: slopes x, y and the matrix xx, xy, yy of second derivatives but for terms that
 * vanish with it. */
static double cost_of_edges(const struct half_edges *mesh, const double *worth, const int32_t *ends, int n,
                            int32_t vertex, const double *place, double mean, double *slope, double *curvature)
{
    double cost = 0;

    for (int i = 0; i < n; i++) {
        const double *end = mesh->points + 2 * (ptrdiff_t)ends[i];
        double x = place[0] - end[0], y = place[1] - end[1];
        double per_square = (worth[vertex] + worth[ends[i]]) / mean; /* twice */
        double excess = 0.5 * per_square * (x * x + y * y) - 1, square = excess * excess;
        cost += square * square;
        if (!slope)
            continue;
        double mx = per_square * x, my = per_square * y;
        slope[0] += 4 * excess * square * mx;
        slope[1] += 4 * excess * square * my;
        curvature[0] += 12 * square * mx * mx;
        curvature[1] += 12 * square * mx * my;
        curvature[2] += 12 * square * my * my;
    }
    return cost;
}

/* Find a step of a vertex downhill on the cost of its edges; along `tangent` if that is given. Returns whether there is
 * one that makes no triangle flat. */
static int step_to_even(const struct half_edges *mesh, const double *worth, int32_t vertex, const double *tangent,
                        double mean, double share, double *step)
{
    int32_t around[MOST_AROUND], ends[MOST_AROUND + 1];
    const double *place = mesh->points + 2 * (ptrdiff_t)vertex;
    double slope[2] = {0, 0}, curvature[3] = {0, 0, 0}, down[2];
    int n = fan_of(mesh, vertex, around);

    if (!n)
        return 0;
    int n_ends = vertices_around(mesh, around[0], ends);
    double cost = cost_of_edges(mesh, worth, ends, n_ends, vertex, place, mean, slope, curvature);
    if (tangent) {
        double x = tangent[0], y = tangent[1];
        double along = curvature[0] * x * x + 2 * curvature[1] * x * y + curvature[2] * y * y;
        double length = along > 0 ? -(slope[0] * x + slope[1] * y) / along : 0;
        down[0] = length * x, down[1] = length * y;
    } else {
        double damping = DAMPING * (curvature[0] + curvature[2]);
        double xx = curvature[0] + damping, xy = curvature[1], yy = curvature[2] + damping, size = xx * yy - xy * xy;
        if (size <= 0)
            return 0;
        down[0] = (xy * slope[1] - yy * slope[0]) / size;
        down[1] = (xy * slope[0] - xx * slope[1]) / size;
    }
    for (double part = share; part > 0.1 * share; part /= 2) {
        double there[2] = {place[0] + part * down[0], place[1] + part * down[1]};
        if (cost_of_edges(mesh, worth, ends, n_ends, vertex, there, mean, NULL, NULL) >= cost
            || gets_flat(mesh, around, n, place, there))
            continue;
        step[0] = part * down[0], step[1] = part * down[1];
        return 1;
    }
    return 0;
}

#endif

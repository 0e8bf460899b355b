/* Moments of the Voronoi cells of vertices, triangle by triangle, in a metric that is constant on each.
 *
 * A triangle without an obtuse angle has its circumcenter inside, where its three cells meet. So has a pair of
 * triangles where one is obtuse, and signed areas add up to those of the cells. At a border there is no other triangle:
 * there the cells of an obtuse triangle are cut at the border. */
#ifndef CVTIMG_CELL_MOMENTS_H
#define CVTIMG_CELL_MOMENTS_H

#include <math.h>

#include "topology.h"

/* A triangle lower than this part of its longest side is cut there too: its circumcenter is far away, */
#define FLAT 0.02
/* and one that is lower than this has no area. */
#define NO_AREA 1e-9

struct sums {
    double *inertia; /* xx, xy, yy of each vertex: mass of the cell times its metric */
    double *pull;    /* x, y: mass times metric times what leads from the vertex to the centroid */
    double energy;
};

/* Add the polygon from a vertex at `z` over `places`, all mapped to where the metric is Euclidean. */
static void add_polygon(const double *z, double places[][2], int n, double *mass, double *x, double *y, double *energy)
{
    for (int i = 0; i + 1 < n; i++) {
        double px = places[i][0] - z[0], py = places[i][1] - z[1];
        double qx = places[i + 1][0] - z[0], qy = places[i + 1][1] - z[1];
        double area = 0.5 * (px * qy - py * qx);
        *mass += area;
        *x += area * (px + qx) / 3;
        *y += area * (py + qy) / 3;
        *energy += area * (px * px + py * py + qx * qx + qy * qy + px * qx + py * qy) / 6;
    }
}

static void middle(double *to, const double *a, const double *b)
{
    to[0] = 0.5 * (a[0] + b[0]);
    to[1] = 0.5 * (a[1] + b[1]);
}

static void towards(double *to, const double *a, const double *b, double part)
{
    to[0] = a[0] + part * (b[0] - a[0]);
    to[1] = a[1] + part * (b[1] - a[1]);
}

/* The metric is L^T L with the upper triangular L = (l11 l12; 0 l22). */
static void add_triangle(const struct triangulation *mesh, const double *metric, int32_t t, struct sums *sums)
{
    const int32_t *vertex = mesh->vertices + 3 * (ptrdiff_t)t;
    const double *origin = mesh->points + 2 * (ptrdiff_t)vertex[0];
    double m[3] = {0, 0, 0}, y[3][2], squares[3], dots[3], cells[3][4][2];
    int n[3], cut = -1;

    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            m[i] += metric[3 * (ptrdiff_t)vertex[k] + i] / 3;
    double l11 = sqrt(m[0]), l12 = m[1] / l11, l22 = sqrt(fmax(m[2] - l12 * l12, 1e-300));
    for (int k = 0; k < 3; k++) {
        const double *at = mesh->points + 2 * (ptrdiff_t)vertex[k];
        y[k][0] = l11 * (at[0] - origin[0]) + l12 * (at[1] - origin[1]);
        y[k][1] = l22 * (at[1] - origin[1]);
    }
    double longest = 0, area2 = twice_area(y[0], y[1], y[2]);
    for (int k = 0; k < 3; k++) {
        const double *p = y[(k + 1) % 3], *q = y[(k + 2) % 3];
        squares[k] = (p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]);
        dots[k] = (p[0] - y[k][0]) * (q[0] - y[k][0]) + (p[1] - y[k][1]) * (q[1] - y[k][1]);
        longest = fmax(longest, squares[k]);
    }
    if (area2 <= NO_AREA * longest)
        return;
    for (int k = 0; k < 3; k++)
        if (dots[k] < 0 && (mesh->borders[3 * (ptrdiff_t)t + k] || area2 < FLAT * squares[k]))
            cut = k;
    if (cut >= 0) {
        int a = (cut + 1) % 3, b = (cut + 2) % 3;
        double near_a[2], near_b[2], beside_a[2], beside_b[2];
        /* Where the perpendicular bisectors of the two shorter sides meet the longest one. */
        towards(near_a, y[a], y[b], 0.5 * squares[b] / dots[a]);
        towards(near_b, y[b], y[a], 0.5 * squares[a] / dots[b]);
        middle(beside_a, y[cut], y[a]);
        middle(beside_b, y[cut], y[b]);
        const double *around[3][4] = {{near_a, beside_a}, {beside_b, near_b}, {beside_a, near_a, near_b, beside_b}};
        const int which[3] = {a, b, cut}, many[3] = {2, 2, 4};
        for (int c = 0; c < 3; c++) {
            n[which[c]] = many[c];
            for (int i = 0; i < many[c]; i++)
                towards(cells[which[c]][i], around[c][i], around[c][i], 0);
        }
    } else {
        double weights[3], sum = 0, center[2] = {0, 0};
        for (int k = 0; k < 3; k++)
            sum += weights[k] = squares[k] * dots[k];
        for (int k = 0; k < 3; k++) {
            center[0] += weights[k] / sum * y[k][0];
            center[1] += weights[k] / sum * y[k][1];
        }
        for (int k = 0; k < 3; k++) {
            n[k] = 3;
            middle(cells[k][0], y[k], y[(k + 1) % 3]);
            towards(cells[k][1], center, center, 0);
            middle(cells[k][2], y[k], y[(k + 2) % 3]);
        }
    }
    for (int k = 0; k < 3; k++) {
        double mass = 0, x = 0, up = 0;
        double *inertia = sums->inertia + 3 * (ptrdiff_t)vertex[k], *pull = sums->pull + 2 * (ptrdiff_t)vertex[k];
        add_polygon(y[k], cells[k], n[k], &mass, &x, &up, &sums->energy);
        for (int i = 0; i < 3; i++)
            inertia[i] += mass * m[i];
        pull[0] += l11 * x;
        pull[1] += l12 * x + l22 * up;
    }
}

#endif

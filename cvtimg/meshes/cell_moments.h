/* Moments of the Voronoi cells of vertices, triangle by triangle, in a metric that is constant on each.
 *
 * A triangle without an obtuse angle has its circumcenter inside, where its three cells meet. So has a pair of
 * triangles where one is obtuse, and signed areas add up to those of the cells. At a border there is no other triangle:
 * there the cells of an obtuse triangle are cut at the border. */
#ifndef CVTIMG_CELL_MOMENTS_H
#define CVTIMG_CELL_MOMENTS_H

#include "delaunay.h"

/* A triangle lower than this part of its longest side is cut there too: its circumcenter is far away, */
#define FLAT 0.02
/* and one that is lower than this has no area. */
#define NO_AREA 1e-9

struct sums {
    double *inertia; /* xx, xy, yy of each vertex: mass of the cell times its metric */
    double *pull;    /* x, y: mass times metric times what leads from the vertex to the centroid */
    double energy;
};

/* The part of a cell that lies in a triangle: its mass, and mass times the step from the vertex to its centroid. */
struct part {
    double mass, x, y;
};

/* Add the triangle from a vertex at `z` to p and q, in a metric with the root of its determinant. */
static void add_piece(const double *m, double root, const double *z, const double *p, const double *q,
                      struct part *part, double *energy)
{
    double px = p[0] - z[0], py = p[1] - z[1], qx = q[0] - z[0], qy = q[1] - z[1];
    double mass = 0.5 * root * (px * qy - py * qx), x = px + qx, y = py + qy;

    part->mass += mass;
    part->x += mass * x / 3;
    part->y += mass * y / 3;
    *energy += mass / 12
        * (m[0] * (px * px + qx * qx + x * x) + 2 * m[1] * (px * py + qx * qy + x * y)
           + m[2] * (py * py + qy * qy + y * y));
}

static void towards(double *to, const double *a, const double *b, double share)
{
    to[0] = a[0] + share * (b[0] - a[0]);
    to[1] = a[1] + share * (b[1] - a[1]);
}

/* Cut the cells of a triangle a b c, obtuse at c, where the perpendicular bisectors of its shorter sides meet a b: at
 * these shares of the way from a to b, and from b to a. */
static void cut_cells(const double *m, double root, const double *a, const double *b, const double *c, double from_a,
                      double from_b, struct part *of_a, struct part *of_b, struct part *of_c, double *energy)
{
    double near_a[2], near_b[2], beside_a[2], beside_b[2];

    towards(near_a, a, b, from_a);
    towards(near_b, b, a, from_b);
    towards(beside_a, c, a, 0.5);
    towards(beside_b, c, b, 0.5);
    add_piece(m, root, a, near_a, beside_a, of_a, energy);
    add_piece(m, root, b, beside_b, near_b, of_b, energy);
    add_piece(m, root, c, beside_a, near_a, of_c, energy);
    add_piece(m, root, c, near_a, near_b, of_c, energy);
    add_piece(m, root, c, near_b, beside_b, of_c, energy);
}

/* Add what a triangle holds of the cells of its vertices. */
static void add_triangle(const struct half_edges *mesh, const double *metric, int32_t t, struct sums *sums)
{
    const int32_t *vertex = mesh->vertices + 3 * (ptrdiff_t)t;
    const double *at[3];
    double m[3] = {0, 0, 0}, ways[3][2], squares[3], dots[3];
    struct part parts[3] = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    int cut = -1;

    for (int k = 0; k < 3; k++) {
        at[k] = mesh->points + 2 * (ptrdiff_t)vertex[k];
        for (int i = 0; i < 3; i++)
            m[i] += (1.0 / 3) * metric[3 * (ptrdiff_t)vertex[k] + i];
    }
    for (int k = 0; k < 3; k++) { /* along the side opposite to each corner */
        ways[k][0] = at[(k + 2) % 3][0] - at[(k + 1) % 3][0];
        ways[k][1] = at[(k + 2) % 3][1] - at[(k + 1) % 3][1];
        squares[k] = m[0] * ways[k][0] * ways[k][0] + 2 * m[1] * ways[k][0] * ways[k][1] + m[2] * ways[k][1] * ways[k][1];
    }
    for (int k = 0; k < 3; k++)
        dots[k] = 0.5 * (squares[(k + 1) % 3] + squares[(k + 2) % 3] - squares[k]);
    double root = sqrt(fmax(m[0] * m[2] - m[1] * m[1], 1e-300));
    double area2 = root * (ways[0][0] * ways[1][1] - ways[0][1] * ways[1][0]);
    if (area2 <= NO_AREA * fmax(squares[0], fmax(squares[1], squares[2])))
        return;
    for (int k = 0; k < 3; k++)
        if (dots[k] < 0 && (mesh->borders[3 * (ptrdiff_t)t + (k + 1) % 3] || area2 < FLAT * squares[k]))
            cut = k;
    if (cut >= 0) {
        int a = (cut + 1) % 3, b = (cut + 2) % 3;
        cut_cells(m, root, at[a], at[b], at[cut], 0.5 * squares[b] / dots[a], 0.5 * squares[a] / dots[b], parts + a,
                  parts + b, parts + cut, &sums->energy);
    } else {
        /* Bisectors divide it into two triangles at each side, of one area: with the middle and the circumcenter. */
        double areas[3], per_area = 1 / area2, radius = 0.25 * squares[0] * squares[1] * squares[2] * per_area * per_area;
        for (int k = 0; k < 3; k++) {
            areas[k] = 0.125 * per_area * squares[k] * dots[k];
            sums->energy += areas[k] * (radius + 0.5 * squares[k]) / 3;
        }
        for (int k = 0; k < 3; k++) {
            int a = (k + 1) % 3, b = (k + 2) % 3; /* their sides lead to the vertex and away from it */
            double mass = areas[a] + areas[b], to_a = areas[b] * (1.0 / 6) + 4 * areas[a] * per_area * mass / 3;
            double to_b = areas[a] * (1.0 / 6) + 4 * areas[b] * per_area * mass / 3;
            parts[k].mass = mass;
            parts[k].x = to_a * ways[b][0] - to_b * ways[a][0];
            parts[k].y = to_a * ways[b][1] - to_b * ways[a][1];
        }
    }
    for (int k = 0; k < 3; k++) {
        double *inertia = sums->inertia + 3 * (ptrdiff_t)vertex[k], *pull = sums->pull + 2 * (ptrdiff_t)vertex[k];
        for (int i = 0; i < 3; i++)
            inertia[i] += parts[k].mass * m[i];
        pull[0] += m[0] * parts[k].x + m[1] * parts[k].y;
        pull[1] += m[1] * parts[k].x + m[2] * parts[k].y;
    }
}

#endif

/* Moments of the Voronoi cells of vertices, triangle by triangle, in a metric that is constant on each.
 *
 * A triangle without an obtuse angle has its circumcenter inside, where its three cells meet. So has a pair of
 * triangles where one is obtuse, and signed areas add up to those of the cells. At a border there is no other triangle:
 * there the cells of an obtuse triangle meet at its centroid. */
#ifndef CVTIMG_CELL_MOMENTS_H
#define CVTIMG_CELL_MOMENTS_H

#include "delaunay.h"

/* So do those of a triangle lower than this part of its longest side: its circumcenter is far away. */
#define FLAT 0.02

struct sums {
    double *inertia; /* xx, xy, yy of each vertex: mass of the cell times its metric */
    double *pull;    /* x, y: mass times metric times what leads from the vertex to the centroid */
    double energy;
};

/* The part of a cell that lies in a triangle: its mass, and mass times the step from the vertex to its centroid. */
struct part {
    double mass, x, y;
};

/* Add what a triangle holds of the cells of its vertices. */
static void add_triangle(const struct half_edges *mesh, const double *metric, int32_t t, struct sums *sums)
{
    const int32_t *vertex = mesh->vertices + 3 * (ptrdiff_t)t;
    const double *at[3];
    double m[3] = {0, 0, 0}, ways[3][2], squares[3], dots[3];
    struct part parts[3] = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    int is_centroid = 0;

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
    if (area2 <= 0)
        return;
    for (int k = 0; k < 3; k++)
        if (dots[k] < 0 && (mesh->borders[3 * (ptrdiff_t)t + (k + 1) % 3] || area2 < FLAT * squares[k]))
            is_centroid = 1;
    if (is_centroid) {
        sums->energy += 5 * area2 / 216 * (squares[0] + squares[1] + squares[2]);
        for (int k = 0; k < 3; k++) { /* each corner has what is between the middles of its sides and the centroid */
            parts[k].mass = area2 / 6;
            parts[k].x = 7 * area2 / 216 * (ways[(k + 2) % 3][0] - ways[(k + 1) % 3][0]);
            parts[k].y = 7 * area2 / 216 * (ways[(k + 2) % 3][1] - ways[(k + 1) % 3][1]);
        }
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

/* Quality of triangles in a metric, moves that keep triangles from turning over, and moves that raise the worst. */
#ifndef CVTIMG_QUALITY_H
#define CVTIMG_QUALITY_H

#include <math.h>

#include "topology.h"

/* A move is halved so often before it is given up, */
#define HALVINGS 5
/* while it would leave a triangle with less than this part of its area. */
#define LEAST_AREA_LEFT 0.1

/* Whether all triangles around a vertex keep enough area when it moves to `place`. */
static int keeps_area(const struct triangulation *mesh, const int32_t *around, int n, const double *old,
                      const double *place)
{
    for (int i = 0; i < n; i++) {
        const double *b = place_of(mesh, next_corner(around[i])), *c = place_of(mesh, last_corner(around[i]));
        if (twice_area(place, b, c) <= LEAST_AREA_LEFT * twice_area(old, b, c))
            return 0;
    }
    return 1;
}

/* Move a vertex by `step`, or a part of it; `step` becomes what it was moved by. */
static void move_vertex(struct triangulation *mesh, double *place, int32_t vertex, double *step)
{
    int32_t around[MOST_AROUND];
    int n = corners_around(mesh, vertex, around);
    double part = 1, old[2] = {place[0], place[1]};

    for (int halving = 0; n && halving < HALVINGS; halving++, part /= 2) {
        double there[2] = {old[0] + part * step[0], old[1] + part * step[1]};
        if (!keeps_area(mesh, around, n, old, there))
            continue;
        step[0] *= part, step[1] *= part;
        place[0] = there[0], place[1] = there[1];
        return;
    }
    step[0] = step[1] = 0;
}

/* 4 3^(1/2) area / sum of the squared sides, in a metric: 1 for an equilateral triangle, 0 for one without area. */
static double shape_of(const double *a, const double *b, const double *c, const double *m, double root)
{
    const double *corners[4] = {a, b, c, a};
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double x = corners[k + 1][0] - corners[k][0], y = corners[k + 1][1] - corners[k][1];
        sum += m[0] * x * x + 2 * m[1] * x * y + m[2] * y * y;
    }
    return 2 * sqrt(3) * twice_area(a, b, c) * root / sum;
}

/* How good the triangles around a vertex are with it at `place`: the worst, and a little of their mean. */
static double worst_shape(const struct triangulation *mesh, const int32_t *around, int n, const double *place,
                          const double *m, double root)
{
    double worst = 1, sum = 0;
    for (int i = 0; i < n; i++) {
        double shape = shape_of(place, place_of(mesh, next_corner(around[i])), place_of(mesh, last_corner(around[i])),
                                m, root);
        worst = fmin(worst, shape);
        sum += shape;
    }
    return worst + 0.1 * sum / n;
}

/* Search around a vertex for a place where its worst triangle is better. */
static int polish_vertex(struct triangulation *mesh, double *place, int32_t vertex, const double *m, double below)
{
    static const double ways[8][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {.7, .7}, {-.7, .7}, {-.7, -.7}, {.7, -.7}};
    int32_t around[MOST_AROUND];
    int n = corners_around(mesh, vertex, around), moved = 0;
    double root = sqrt(fmax(m[0] * m[2] - m[1] * m[1], 0)), length = 0, worst = 1;

    for (int i = 0; i < n; i++) {
        const double *b = place_of(mesh, next_corner(around[i])), *c = place_of(mesh, last_corner(around[i]));
        worst = fmin(worst, shape_of(place, b, c, m, root));
        length += hypot(b[0] - place[0], b[1] - place[1]) / n;
    }
    if (!n || worst >= below)
        return 0;
    double best = worst_shape(mesh, around, n, place, m, root);
    for (double step = 0.2 * length; step > 0.005 * length; step /= 2)
        for (int way = 0, tries = 0; way < 8 && tries < 48; way++, tries++) {
            double there[2] = {place[0] + step * ways[way][0], place[1] + step * ways[way][1]};
            double value = worst_shape(mesh, around, n, there, m, root);
            if (value > best + 1e-7) {
                best = value;
                place[0] = there[0], place[1] = there[1];
                moved = 1, way = -1;
            }
        }
    return moved;
}

#endif

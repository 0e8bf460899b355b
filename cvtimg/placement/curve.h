/* Places along a Hilbert curve over a picture, so that equal weight lies between them. */
#ifndef CVTIMG_CURVE_H
#define CVTIMG_CURVE_H

#include <stddef.h>

struct walk {
    const float *weights;
    int width, height;
    double each, sum;  /* weight between places; weight until here */
    double *places;    /* x, y of each, in pixels */
    ptrdiff_t n, room; /* places found, and wanted */
};

static void visit_pixel(struct walk *walk, int x, int y)
{
    walk->sum += walk->weights[(ptrdiff_t)y * walk->width + x];
    while (walk->n < walk->room && walk->sum > (walk->n + 0.5) * walk->each) {
        walk->places[2 * walk->n] = x;
        walk->places[2 * walk->n + 1] = y;
        walk->n++;
    }
}

/* The square from (x, y) along the vectors u and v, which are as long as the same power of two: the curve enters it at
 * (x, y) and leaves it at the end of u. Squares outside of the picture are passed over. */
static void follow_curve(struct walk *walk, int x, int y, int ux, int uy, int vx, int vy)
{
    int left = x + (ux + vx < 0 ? ux + vx : 0), top = y + (uy + vy < 0 ? uy + vy : 0);
    int size = ux + uy < 0 ? -(ux + uy) : ux + uy;

    if (left >= walk->width || top >= walk->height)
        return;
    if (size == 1) {
        visit_pixel(walk, left, top);
        return;
    }
    ux /= 2, uy /= 2, vx /= 2, vy /= 2;
    follow_curve(walk, x, y, vx, vy, ux, uy);
    follow_curve(walk, x + vx, y + vy, ux, uy, vx, vy);
    follow_curve(walk, x + ux + vx, y + uy + vy, ux, uy, vx, vy);
    follow_curve(walk, x + 2 * ux + vx, y + 2 * uy + vy, -vx, -vy, -ux, -uy);
}

#endif

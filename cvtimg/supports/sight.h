/* Sight in a region of the plane whose boundary and slits are segments; and whether a place is inside. */
#ifndef CVTIMG_SIGHT_H
#define CVTIMG_SIGHT_H

#include <math.h>
#include <stdint.h>

/* Whether one of some barriers (x1, y1, x2, y2), longer by `slack` at both ends, separates two places. Places that are
   nearer to its line than `tolerance` are on it, and seen from both sides. */
static inline int is_blocked(double from_x, double from_y, double to_x, double to_y, const double *barriers,
                             const int32_t *at, const int32_t *end, double tolerance, double slack)
{
    for (; at < end; at++) {
        const double *barrier = barriers + 4 * (intptr_t)*at;
        double along_x = barrier[2] - barrier[0], along_y = barrier[3] - barrier[1];
        double length = sqrt(along_x * along_x + along_y * along_y);
        double side_from, side_to, share, place;
        along_x /= length;
        along_y /= length;
        side_from = along_x * (from_y - barrier[1]) - along_y * (from_x - barrier[0]);
        side_to = along_x * (to_y - barrier[1]) - along_y * (to_x - barrier[0]);
        if (side_from * side_to >= 0 || fabs(side_from) <= tolerance || fabs(side_to) <= tolerance)
            continue;
        share = side_from / (side_from - side_to);
        place = along_x * (from_x + share * (to_x - from_x) - barrier[0])
              + along_y * (from_y + share * (to_y - from_y) - barrier[1]);
        if (place > -slack && place < length + slack)
            return 1;
    }
    return 0;
}

/* Whether a ray to the right crosses a boundary of n segments an odd number of times. */
static inline int is_inside(double x, double y, const double *boundary, intptr_t n)
{
    int inside = 0;
    for (const double *side = boundary; side < boundary + 4 * n; side += 4)
        if ((side[1] > y) != (side[3] > y)
            && x < side[0] + (y - side[1]) / (side[3] - side[1]) * (side[2] - side[0]))
            inside = !inside;
    return inside;
}

#endif

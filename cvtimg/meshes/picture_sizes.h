/* Limits of the growth of sizes from pixel to pixel, in one pass down and one up.
 *
 * Two passes reach all: the best way from one pixel to another takes steps of two neighboring directions only, in any
 * order. G. Borgefors, Distance transformations in digital images, Computer Vision, Graphics, and Image Processing 34
 * (1986) 344-371, doi 10.1016/S0734-189X(86)80047-0. */
#ifndef CVTIMG_PICTURE_SIZES_H
#define CVTIMG_PICTURE_SIZES_H

#include <stddef.h>

static inline float lesser(float a, float b) { return a < b ? a : b; }

/* Lower a row to what the row before it allows. */
static void limit_from(float *restrict row, const float *restrict before, ptrdiff_t width, float straight, float aslant)
{
    for (ptrdiff_t x = 0; x < width; x++)
        row[x] = lesser(row[x], before[x] + straight);
    for (ptrdiff_t x = 1; x < width; x++)
        row[x] = lesser(row[x], before[x - 1] + aslant);
    for (ptrdiff_t x = 0; x + 1 < width; x++)
        row[x] = lesser(row[x], before[x + 1] + aslant);
}

static void limit_sizes(float *sizes, ptrdiff_t height, ptrdiff_t width, float straight, float aslant)
{
    for (ptrdiff_t y = 0; y < height; y++) {
        float *row = sizes + y * width;
        if (y)
            limit_from(row, row - width, width, straight, aslant);
        for (ptrdiff_t x = 1; x < width; x++)
            row[x] = lesser(row[x], row[x - 1] + straight);
    }
    for (ptrdiff_t y = height - 1; y >= 0; y--) {
        float *row = sizes + y * width;
        if (y + 1 < height)
            limit_from(row, row + width, width, straight, aslant);
        for (ptrdiff_t x = width - 2; x >= 0; x--)
            row[x] = lesser(row[x], row[x + 1] + straight);
    }
}

#endif

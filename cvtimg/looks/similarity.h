// Passes of SSIMULACRA2 over planes of float: the blur and the maps of errors.

#ifndef CVTIMG_SIMILARITY_H
#define CVTIMG_SIMILARITY_H

#include <math.h>
#include <stdint.h>
#include <string.h>

// Loops over pixels, entries and matches take half the time with AVX2, which the loader then chooses, with
// what is inside them; without multiply-add, which would round differently.
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__clang__)
#define LOOKS_CLONES __attribute__((target_clones("avx2", "default")))
#define LOOKS_INSIDE static inline __attribute__((always_inline))
#else
#define LOOKS_CLONES
#define LOOKS_INSIDE static inline
#endif

enum { BLUR_RADIUS = 5 };

// Sums of the weights of 11 pixels that are so far apart, in rows of their own or in one.
LOOKS_CLONES static void blur_along(const float *const *rows, const float *weights, Py_ssize_t width,
                                    float *restrict out) {
  for (Py_ssize_t x = 0; x < width; x++) {
    float sum = 0;
    for (int k = 0; k <= 2 * BLUR_RADIUS; k++) sum += weights[k] * rows[k][x];
    out[x] = sum;
  }
}

// Blur rows of a plane; outside are zeros at the sides, and mirrors above and below. `line` has width + 10.
static void blur_rows(const float *plane, const float *weights, Py_ssize_t height, Py_ssize_t width,
                      Py_ssize_t first, Py_ssize_t last, float *line, float *out) {
  const float *rows[2 * BLUR_RADIUS + 1], *shifted[2 * BLUR_RADIUS + 1];
  memset(line, 0, sizeof(float) * (size_t)(width + 2 * BLUR_RADIUS));
  for (int k = 0; k <= 2 * BLUR_RADIUS; k++) shifted[k] = line + k;
  for (Py_ssize_t y = first; y < last; y++) {
    for (int k = 0; k <= 2 * BLUR_RADIUS; k++) {
      Py_ssize_t from = y + k - BLUR_RADIUS;
      while (from < 0 || from >= height) from = from < 0 ? -1 - from : 2 * height - 1 - from;
      rows[k] = plane + from * width;
    }
    blur_along(rows, weights, width, line + BLUR_RADIUS);
    blur_along(shifted, weights, width, out + (y - first) * width);
  }
}

// The maps of errors of a plane a against b, given blurred planes, squares and products: sums of d and d^4 of structure,
// artifacts and lost detail, of each row.
LOOKS_CLONES static void sum_errors(const float *a, const float *b, const float *mean_a, const float *mean_b,
                                    const float *square_a, const float *square_b, const float *product,
                                    Py_ssize_t n_rows, Py_ssize_t width, double *sums) {
  for (Py_ssize_t y = 0; y < n_rows; y++) {
    float of_row[6] = {0};
    for (Py_ssize_t i = y * width; i < (y + 1) * width; i++) {
      const float gap = mean_a[i] - mean_b[i];
      const float alike = (1 - gap * gap) * (2 * (product[i] - mean_a[i] * mean_b[i]) + .0009f);
      const float spread = square_a[i] - mean_a[i] * mean_a[i] + square_b[i] - mean_b[i] * mean_b[i] + .0009f;
      const float rest = 1 - alike / spread, structure = rest > 0 ? rest : 0;
      const float more = (1 + fabsf(b[i] - mean_b[i])) / (1 + fabsf(a[i] - mean_a[i])) - 1;
      const float artifact = more > 0 ? more : 0, lost = more < 0 ? -more : 0;
      of_row[0] += structure;
      of_row[1] += structure * structure * (structure * structure);
      of_row[2] += artifact;
      of_row[3] += artifact * artifact * (artifact * artifact);
      of_row[4] += lost;
      of_row[5] += lost * lost * (lost * lost);
    }
    for (int j = 0; j < 6; j++) sums[6 * y + j] = of_row[j];
  }
}

#endif

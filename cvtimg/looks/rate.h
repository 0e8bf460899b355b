// Mapping to a palette by rate: one band of rows, each a shortest path over what deflate can store.
//
// A node is a pixel: the least cost of all before it, the error handed on to it along that path, and the last index. An
// edge is a literal, or a match: indices that repeat earlier ones at a distance, within the band. Costs are visible error
// plus the price of the bits. Places have four coordinates, the last of which may be 0 everywhere.

#ifndef CVTIMG_RATE_H
#define CVTIMG_RATE_H

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { RATE_WIDTH = 4, RATE_LONGEST = 258, RATE_FARTHEST = 32768 };
// How many of the nearest entries of a pixel and of the next one begin matches; how many earlier places of each pair are
// tried; how many pixels are compared for each pixel.
enum { RATE_NEAR = 8, RATE_TRIES = 6, RATE_STEPS = 100 };
// A match may begin with an index that costs so many bits more than the best literal, and goes on while it costs at most so
// many more than literals do.
static const float RATE_NEAR_BITS = 10, RATE_NEXT_BITS = 6, RATE_WORSE_BITS = 4;

typedef struct {
  Py_ssize_t width, n_entries, per_byte;
  const float *targets;      // (rows, width, 4) places of the pixels
  const float *visibility;   // (rows, width) how much a squared error counts
  const float *entries;      // (n_entries, 4) places of the palette
  const float *columns;      // (4, n_entries) the same
  const float *lengths;      // (RATE_LONGEST + 1) price of the length of a match, in bytes
  const float *distances;    // (RATE_FARTHEST + 1) price of its distance, in bytes
  float price, literal;      // price of a bit, and of an index by itself
  float strength, longest;   // share of the error that is handed on, and the greatest length of the error before that
  uint8_t *indices;          // (rows, width) OUT
} rate_band;

typedef struct {
  float cost, error[RATE_WIDTH];  // least cost of the pixels before, and what they hand on
  int32_t from, distance, last;   // where the last edge begins; distance of the match, in pixels, 0 for a literal
} rate_node;

typedef struct {
  rate_node *nodes;              // width + 1
  float *above, *below;          // (width + 2, 4) errors handed on from the row above, and to the row below
  float *floor;                  // width: what the best literal costs without the row's own errors
  float *squares;                // n_entries
  int32_t *newest, *older;       // 65536 and rows * width: the chains of equal pairs of indices
} rate_scratch;

static inline void rate_hand_on(const float *wanted, const float *given, const rate_band *band, float *error) {
  float size = 0;
  for (int c = 0; c < RATE_WIDTH; c++) {
    error[c] = wanted[c] - given[c];
    size += error[c] * error[c];
  }
  size = sqrtf(size);
  const float part = size > band->longest ? band->strength * band->longest / size : band->strength;
  for (int c = 0; c < RATE_WIDTH; c++) error[c] *= part;
}

static inline void rate_measure(const rate_band *band, const float *place, float weight, float *squares) {
  const Py_ssize_t k = band->n_entries;
  const float *x = band->columns, *y = x + k, *z = y + k, *t = z + k;
  for (Py_ssize_t i = 0; i < k; i++) {
    const float a = place[0] - x[i], b = place[1] - y[i], c = place[2] - z[i], d = place[3] - t[i];
    squares[i] = weight * ((a * a + b * b) + (c * c + d * d));
  }
}

// Keep the few entries with the least squares below a bound, nearest first; return how many.
static inline int rate_nearest(const float *squares, Py_ssize_t n_entries, float bound, int32_t *near) {
  int n = 0;
  for (Py_ssize_t i = 0; i < n_entries; i++) {
    if (squares[i] >= bound) continue;
    if (n < RATE_NEAR) n++;
    else if (squares[near[n - 1]] <= squares[i]) continue;
    int at = n - 1;
    for (; at > 0 && squares[near[at - 1]] > squares[i]; at--) near[at] = near[at - 1];
    near[at] = (int32_t)i;
  }
  return n;
}

static inline void rate_wanted(const float *target, const float *above, const float *error, float *place) {
  for (int c = 0; c < RATE_WIDTH; c++) place[c] = target[c] + above[c] + (error ? error[c] : 0);
}

static inline void rate_carry(rate_node *node, const float *error) {
  for (int c = 0; c < RATE_WIDTH; c++) node->error[c] = error[c] * (7 / 16.f);
}

// Follow a match from pixel `start` of a row, and shorten the paths to where it can end; return the compared pixels.
static int rate_follow(const rate_band *band, rate_scratch *scratch, Py_ssize_t row, Py_ssize_t start,
                       const uint8_t *source, Py_ssize_t limit, Py_ssize_t distance) {
  rate_node *nodes = scratch->nodes;
  const float *targets = band->targets + row * band->width * RATE_WIDTH, *visibility = band->visibility + row * band->width;
  const float away = band->distances[distance / band->per_byte], worse = RATE_WORSE_BITS * band->price;
  float cost = nodes[start].cost, floor = cost, error[RATE_WIDTH];
  memcpy(error, nodes[start].error, sizeof error);
  for (Py_ssize_t length = 1; length <= limit; length++) {
    const Py_ssize_t i = start + length - 1;
    const int32_t index = source ? source[length - 1] : nodes[start].last;
    const float *entry = band->entries + RATE_WIDTH * index;
    float place[RATE_WIDTH], square = 0;
    rate_wanted(targets + RATE_WIDTH * i, scratch->above + RATE_WIDTH * (i + 1), error, place);
    for (int c = 0; c < RATE_WIDTH; c++) square += (place[c] - entry[c]) * (place[c] - entry[c]);
    cost += visibility[i] * square;
    floor += scratch->floor[i];
    if (cost > floor + worse) return (int)length;
    rate_hand_on(place, entry, band, error);
    for (int c = 0; c < RATE_WIDTH; c++) error[c] *= 7 / 16.f;
    if (length >= 3 * band->per_byte) {
      rate_node *end = nodes + i + 1;
      const float all = cost + away + band->lengths[length / band->per_byte];
      if (all < end->cost) {
        *end = (rate_node){.cost = all, .from = (int32_t)start, .distance = (int32_t)distance, .last = index};
        memcpy(end->error, error, sizeof error);
      }
    }
  }
  return (int)limit;
}

// Go on from a pixel by a literal and by matches.
static void rate_extend(const rate_band *band, rate_scratch *scratch, Py_ssize_t row, Py_ssize_t i) {
  const Py_ssize_t width = band->width, stride = (width + 2 * band->per_byte - 1) / band->per_byte * band->per_byte;
  rate_node *node = scratch->nodes + i;
  const float *target = band->targets + (row * width + i) * RATE_WIDTH, *above = scratch->above + (i + 1) * RATE_WIDTH;
  const float *visibility = band->visibility + row * width + i;
  float place[RATE_WIDTH], error[RATE_WIDTH], least = FLT_MAX;
  int32_t best = 0, near[RATE_NEAR], next[RATE_NEAR];
  rate_wanted(target, above, node->error, place);
  rate_measure(band, place, visibility[0], scratch->squares);
  for (Py_ssize_t k = 0; k < band->n_entries; k++) {
    if (scratch->squares[k] < least) least = scratch->squares[k], best = (int32_t)k;
  }
  least += band->literal;
  if (node->cost + least < node[1].cost) {
    node[1] = (rate_node){.cost = node->cost + least, .from = (int32_t)i, .distance = 0, .last = best};
    rate_hand_on(place, band->entries + RATE_WIDTH * best, band, error);
    rate_carry(node + 1, error);
  }
  Py_ssize_t rest = width - i, most = RATE_LONGEST * band->per_byte;
  if (rest < 3 * band->per_byte) return;
  if (rest < most) most = rest;
  int steps = RATE_STEPS;
  if (node->last >= 0) steps -= rate_follow(band, scratch, row, i, NULL, most, band->per_byte);
  const int n_near = rate_nearest(scratch->squares, band->n_entries, least + RATE_NEAR_BITS * band->price, near);
  rate_wanted(target + RATE_WIDTH, above + RATE_WIDTH, NULL, place);
  rate_measure(band, place, visibility[1], scratch->squares);
  const float bound = scratch->floor[i + 1] + RATE_NEXT_BITS * band->price;
  const int n_next = rate_nearest(scratch->squares, band->n_entries, bound, next);
  for (int a = 0; a < n_near; a++) {
    for (int b = 0; b < n_next; b++) {
      int32_t at = scratch->newest[near[a] << 8 | next[b]];
      for (int tries = 0; at >= 0 && tries < RATE_TRIES && steps > 0; tries++, at = scratch->older[at]) {
        const Py_ssize_t column = at % width, distance = (row - at / width) * stride + i - column;
        if (distance > RATE_FARTHEST * band->per_byte) break;
        if (distance % band->per_byte) continue;
        const Py_ssize_t limit = width - column < most ? width - column : most;
        steps -= rate_follow(band, scratch, row, i, band->indices + at, limit, distance);
      }
    }
  }
}

// Write the indices of the shortest path.
static void rate_trace(const rate_band *band, rate_scratch *scratch, Py_ssize_t row) {
  const Py_ssize_t width = band->width, stride = (width + 2 * band->per_byte - 1) / band->per_byte * band->per_byte;
  rate_node *nodes = scratch->nodes;
  uint8_t *indices = band->indices + row * width;
  // The path is known from its end: mark where its edges end. The floor is not needed any more.
  uint8_t *ends = (uint8_t *)scratch->floor;
  memset(ends, 0, (size_t)width);
  for (int32_t end = (int32_t)width; end > 0; end = nodes[end].from) ends[end - 1] = 1;
  for (Py_ssize_t i = 0, start = 0; i < width; i++) {
    if (!ends[i]) continue;
    const rate_node *node = nodes + i + 1;
    if (!node->distance) {
      indices[i] = (uint8_t)node->last;
    } else {
      for (Py_ssize_t x = start; x <= i; x++) {
        // A run repeats what is beside it; other matches lie in rows above, each row followed by what begins the next.
        const Py_ssize_t above = node->distance == band->per_byte ? -1 : (node->distance + stride - 1 - x) / stride;
        const Py_ssize_t column = above < 0 ? x - 1 : x + above * stride - node->distance;
        indices[x] = band->indices[(row - (above < 0 ? 0 : above)) * width + column];
      }
    }
    start = i + 1;
  }
}

// Hand the errors of a finished row on to the next, and put its pairs into their chains.
static void rate_finish(const rate_band *band, rate_scratch *scratch, Py_ssize_t row) {
  const Py_ssize_t width = band->width;
  const float *targets = band->targets + row * width * RATE_WIDTH;
  const uint8_t *indices = band->indices + row * width;
  float carried[RATE_WIDTH] = {0};
  memset(scratch->below, 0, sizeof(float) * RATE_WIDTH * (size_t)(width + 2));
  for (Py_ssize_t i = 0; i < width; i++) {
    float place[RATE_WIDTH], error[RATE_WIDTH];
    rate_wanted(targets + RATE_WIDTH * i, scratch->above + RATE_WIDTH * (i + 1), carried, place);
    rate_hand_on(place, band->entries + RATE_WIDTH * indices[i], band, error);
    for (int c = 0; c < RATE_WIDTH; c++) {
      float *below = scratch->below + RATE_WIDTH * i + c;
      carried[c] = error[c] * (7 / 16.f);
      below[0] += error[c] * (3 / 16.f);
      below[RATE_WIDTH] += error[c] * (5 / 16.f);
      below[2 * RATE_WIDTH] += error[c] * (1 / 16.f);
    }
    if (i + 1 < width) {
      const int pair = indices[i] << 8 | indices[i + 1];
      scratch->older[row * width + i] = scratch->newest[pair];
      scratch->newest[pair] = (int32_t)(row * width + i);
    }
  }
  float *done = scratch->above;
  scratch->above = scratch->below;
  scratch->below = done;
}

static void rate_map_row(const rate_band *band, rate_scratch *scratch, Py_ssize_t row) {
  const Py_ssize_t width = band->width;
  for (Py_ssize_t i = 0; i <= width; i++) scratch->nodes[i] = (rate_node){.cost = i ? FLT_MAX : 0, .last = -1};
  for (Py_ssize_t i = 0; i < width; i++) {
    const Py_ssize_t at = row * width + i;
    float place[RATE_WIDTH], least = FLT_MAX;
    rate_wanted(band->targets + at * RATE_WIDTH, scratch->above + (i + 1) * RATE_WIDTH, NULL, place);
    rate_measure(band, place, band->visibility[at], scratch->squares);
    for (Py_ssize_t k = 0; k < band->n_entries; k++) {
      if (scratch->squares[k] < least) least = scratch->squares[k];
    }
    scratch->floor[i] = least + band->literal;
  }
  for (Py_ssize_t i = 0; i < width; i++) rate_extend(band, scratch, row, i);
  rate_trace(band, scratch, row);
  rate_finish(band, scratch, row);
}

#endif

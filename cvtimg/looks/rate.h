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

#include "similarity.h"  // LOOKS_CLONES, LOOKS_INSIDE

// Coordinates; the longest and the farthest match of deflate in bytes; the most matches followed from a pixel; how many of
// the nearest entries of a pixel, and of the next one, begin matches; how many earlier places of each pair are tried.
enum { RATE_WIDTH = 4, RATE_LONGEST = 258, RATE_FARTHEST = 32768, RATE_MOST_MATCHES = 256, RATE_NEAR = 6, RATE_LANES = 8 };
enum { RATE_ROOM = RATE_MOST_MATCHES + RATE_LANES };  // those of a pair are taken together
// The entries near a place are sought among the RATE_MANY nearest to the middle of its cell, which are known of RATE_CELLS cells.
enum { RATE_MANY = 16, RATE_CELL_BITS = 12, RATE_CELLS = 1 << RATE_CELL_BITS };
// Bits: a match costs at most the first number more than literals; it is given up when another is the second ahead.
static const float RATE_WORSE_BITS = 4, RATE_BEHIND_BITS = 30;
// Shares of an error that the next pixel, and those below it, get. More goes along the row than Floyd and Steinberg give:
// long repetitions of too bright or too dark indices, which show as streaks, get dearer with each pixel.
static const float RATE_RIGHT = 12 / 16.f, RATE_BELOW = 2 / 16.f, RATE_ASIDE = 1 / 16.f;

typedef struct {
  Py_ssize_t width, n_entries;
  int shift;                // of numbers of pixels to numbers of bytes
  int n_matches;            // that are followed from a pixel, at most
  const float *targets;     // (rows, width, 4) places of the pixels
  const float *visibility;  // (rows, width) how much a squared error counts
  const float *entries;     // (n_entries + 1, 4) places of the palette; the last is far from all pixels
  const float *lengths;     // (RATE_LONGEST + 1) price of the length of a match, in bytes
  const float *distances;   // (RATE_FARTHEST + 1) price of its distance, in bytes
  float price, literal;     // price of a bit, and of an index by itself
  float side;               // of the cubes of places that share their nearest entries
  float strength, longest;  // share of the error that is handed on, and the greatest length of the error before that
  uint8_t *indices;         // (rows, width) OUT
} rate_band;

typedef struct {
  float cost, error[RATE_WIDTH];  // least cost of the pixels before, and what they hand on
  int32_t from, distance, last;   // where the last edge begins; distance of the match, in pixels, 0 for a literal
} rate_node;

// The entries near a pixel, nearest first; the one far from all pixels where there are fewer.
typedef struct {
  float square[RATE_NEAR];
  uint8_t entry[RATE_NEAR];
} rate_near;

// A cube of places, and the entries nearest to its middle: no other one is within `reach` of it.
typedef struct {
  int32_t corner[RATE_WIDTH];
  float reach;
  uint8_t entries[RATE_MANY];
} rate_cell;

// Paths that are followed side by side: matches from a pixel, or the ways on to entries near it.
typedef struct {
  int n;
  int32_t at[RATE_ROOM];                   // where the repeated indices begin in the stream
  float cost[RATE_ROOM], away[RATE_ROOM];  // without the bits, and the price of the distance
  float error[RATE_WIDTH][RATE_ROOM], entry[RATE_WIDTH][RATE_ROOM];
} rate_paths;

typedef struct {
  rate_node *nodes;         // width + 1
  rate_cell *cells;         // RATE_CELLS
  rate_near *near;          // width: the nearest entries without the row's own errors
  float *above, *below;     // (width + 2, 4) errors handed on from the row above, and to the row below
  float *floor;             // width: what the best literal costs without the row's own errors
  uint16_t *stream;         // (rows + 1) * stride: indices as deflate sees them, n_entries between rows; then a run of each
  int32_t *recent;          // (65536, RATE_LANES): where each pair of indices was in the stream of late, newest first, or 0
  Py_ssize_t stride, run;   // length of a row in the stream, and where the runs begin
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

static inline void rate_wanted(const float *target, const float *above, const float *error, float *place) {
  for (int c = 0; c < RATE_WIDTH; c++) place[c] = target[c] + above[c] + (error ? error[c] : 0);
}

// Hand the error of a finished pixel on, in shares, to the next one and to the three below it.
static inline void rate_spread(const rate_band *band, const float *wanted, const float *given, float right, float below,
                               float aside, float *carried, float *three) {
  float error[RATE_WIDTH];
  rate_hand_on(wanted, given, band, error);
  for (int c = 0; c < RATE_WIDTH; c++) {
    carried[c] = error[c] * right;
    three[c] += error[c] * aside;
    three[c + RATE_WIDTH] += error[c] * below;
    three[c + 2 * RATE_WIDTH] += error[c] * aside;
  }
}

static inline float rate_square(const rate_band *band, const float *place, int entry) {
  const float *given = band->entries + RATE_WIDTH * entry;
  const float a = place[0] - given[0], b = place[1] - given[1], c = place[2] - given[2], d = place[3] - given[3];
  return (a * a + b * b) + (c * c + d * d);
}

// Find the entries nearest to a place.
static void rate_fill(const rate_band *band, const float *place, rate_cell *cell) {
  float squares[RATE_MANY];
  memset(cell->entries, (int)band->n_entries, RATE_MANY);
  int n = 0;
  for (int k = 0; k < band->n_entries; k++) {
    const float square = rate_square(band, place, k);
    if (n == RATE_MANY && square >= squares[n - 1]) continue;
    int at = n < RATE_MANY ? n++ : n - 1;
    for (; at > 0 && squares[at - 1] > square; at--) {
      squares[at] = squares[at - 1];
      cell->entries[at] = cell->entries[at - 1];
    }
    squares[at] = square;
    cell->entries[at] = (uint8_t)k;
  }
  cell->reach = band->n_entries > RATE_MANY ? sqrtf(squares[RATE_MANY - 1]) : FLT_MAX;
}

// The squared distances of a place to the entries of a cell; returns the least.
static inline float rate_measure(const rate_band *band, const rate_cell *cell, const float *place, float *squares) {
  float least = FLT_MAX;
  for (int i = 0; i < RATE_MANY; i++) {
    squares[i] = rate_square(band, place, cell->entries[i]);
    least = squares[i] < least ? squares[i] : least;
  }
  return least;
}

// Find the entries nearest to a place, in their order, among those near the middle of its cell. Squares have the order of
// their bits, of which the last ones tell which it is: so no two are equal, and each comes after as many as are less.
LOOKS_CLONES static void rate_look(const rate_band *band, rate_cell *cells, const float *place, float weight,
                                  rate_near *near) {
  static const uint32_t mix[RATE_WIDTH] = {0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D, 0x27D4EB2F};
  int32_t corner[RATE_WIDTH], keys[RATE_MANY], ranks[RATE_MANY] = {0}, ranked[RATE_MANY];
  float middle[RATE_WIDTH], squares[RATE_MANY], away = 0;
  uint32_t hash = 0;
  for (int c = 0; c < RATE_WIDTH; c++) {
    corner[c] = (int32_t)floorf(place[c] / band->side);
    middle[c] = band->side * ((float)corner[c] + .5f);
    away += (place[c] - middle[c]) * (place[c] - middle[c]);
    hash ^= mix[c] * (uint32_t)corner[c];
  }
  rate_cell *cell = cells + (hash >> (32 - RATE_CELL_BITS)), of_place;
  if (memcmp(cell->corner, corner, sizeof corner)) {
    memcpy(cell->corner, corner, sizeof corner);
    rate_fill(band, middle, cell);
  }
  // An entry that the cell lacks may be nearer where the ways from its middle to the place and on to the nearest entry
  // are longer than its reach (triangle inequality).
  if (sqrtf(away) + sqrtf(rate_measure(band, cell, place, squares)) > cell->reach) {
    cell = &of_place;
    rate_fill(band, place, cell);
    rate_measure(band, cell, place, squares);
  }
  for (int i = 0; i < RATE_MANY; i++) squares[i] *= weight;
  memcpy(keys, squares, sizeof keys);
  for (int i = 0; i < RATE_MANY; i++) keys[i] = (keys[i] & -RATE_MANY) | i;
  for (int j = 0; j < RATE_MANY; j++) {
    for (int i = 0; i < RATE_MANY; i++) ranks[i] += keys[j] < keys[i];
  }
  for (int i = 0; i < RATE_MANY; i++) ranked[ranks[i]] = i;
  for (int i = 0; i < RATE_NEAR; i++) {
    near->entry[i] = cell->entries[ranked[i]];
    near->square[i] = squares[ranked[i]];
  }
}

// Add the cost of a pixel to paths that go on to `entry`, and let them hand on what is left.
LOOKS_INSIDE void rate_add(const rate_band *band, int n, const float *place, float weight, rate_paths *paths) {
  const float longest = band->longest, part = band->strength * longest * RATE_RIGHT;
  const float p0 = place[0], p1 = place[1], p2 = place[2], p3 = place[3];
  float(*error)[RATE_ROOM] = paths->error, (*entry)[RATE_ROOM] = paths->entry;
  for (int m = 0; m < n; m++) {
    const float a = p0 + error[0][m] - entry[0][m], b = p1 + error[1][m] - entry[1][m];
    const float c = p2 + error[2][m] - entry[2][m], d = p3 + error[3][m] - entry[3][m];
    const float square = (a * a + b * b) + (c * c + d * d), size = sqrtf(square);
    const float handed = part / (size > longest ? size : longest);
    paths->cost[m] += weight * square;
    error[0][m] = a * handed, error[1][m] = b * handed, error[2][m] = c * handed, error[3][m] = d * handed;
  }
}

// Drop the matches that cost more than a bound, once they are many.
LOOKS_INSIDE void rate_drop(rate_paths *matches, float bound) {
  int n = 0;
  for (int m = 0; m < matches->n; m++) n += matches->cost[m] <= bound;
  if (n && 2 * n > matches->n) return;
  n = 0;
  for (int m = 0; m < matches->n; m++) {
    const int stays = matches->cost[m] <= bound;
    matches->cost[n] = matches->cost[m];
    matches->away[n] = matches->away[m];
    for (int c = 0; c < RATE_WIDTH; c++) matches->error[c][n] = matches->error[c][m];
    matches->at[n] = matches->at[m];
    n += stays;
  }
  matches->n = n;
}

// The distance from a place in the stream back to where a match repeats it, in pixels; that of a run is a byte.
static inline int32_t rate_distance(const rate_band *band, const rate_scratch *scratch, int32_t here, int32_t at) {
  return at < scratch->run ? here - at : 1 << band->shift;
}

// Follow matches on from the third pixel after `start` of a row, and shorten the paths to where they can end.
LOOKS_INSIDE void rate_follow(const rate_band *band, rate_scratch *scratch, rate_paths *matches, Py_ssize_t row,
                        Py_ssize_t start, Py_ssize_t limit) {
  const float *targets = band->targets + row * band->width * RATE_WIDTH;
  const float worse = RATE_WORSE_BITS * band->price, behind = RATE_BEHIND_BITS * band->price;
  float floor = scratch->nodes[start].cost + scratch->floor[start] + scratch->floor[start + 1];
  for (Py_ssize_t length = 3; matches->n && length <= limit; length++) {
    const Py_ssize_t i = start + length - 1;
    const uint16_t *source = scratch->stream + length - 1;
    const float bits = band->lengths[length >> band->shift];
    float place[RATE_WIDTH], first = FLT_MAX, least = FLT_MAX;
    rate_wanted(targets + RATE_WIDTH * i, scratch->above + RATE_WIDTH * (i + 1), NULL, place);
    for (int m = 0; m < matches->n; m++) {
      const float *given = band->entries + RATE_WIDTH * source[matches->at[m]];
      for (int c = 0; c < RATE_WIDTH; c++) matches->entry[c][m] = given[c];
    }
    rate_add(band, matches->n, place, band->visibility[row * band->width + i], matches);
    for (int m = 0; m < matches->n; m++) {
      const float cost = matches->cost[m], all = cost + matches->away[m] + bits;
      first = cost < first ? cost : first;
      least = all < least ? all : least;
    }
    rate_node *end = scratch->nodes + i + 1;
    if (length >= 3 << band->shift && least < end->cost) {
      int m = 0;
      while (m < matches->n - 1 && matches->cost[m] + matches->away[m] + bits > least) m++;
      const int32_t here = (int32_t)((row + 1) * scratch->stride + start);
      end->cost = least;
      end->from = (int32_t)start;
      end->distance = rate_distance(band, scratch, here, matches->at[m]);
      end->last = source[matches->at[m]];
      for (int c = 0; c < RATE_WIDTH; c++) end->error[c] = matches->error[c][m];
    }
    floor += scratch->floor[i];
    float bound = floor + worse < first + behind ? floor + worse : first + behind;
    // Half a literal less than where it is cheaper to begin the match here: what is dearer is rarely the best in the end.
    const float most = end->cost + band->lengths[3] - band->literal / 2;
    if (most < bound) bound = most;
    rate_drop(matches, bound);
  }
}

// Go on from pixel `i`, with its cost and its errors, to each of the entries near it, and to another one.
LOOKS_INSIDE void rate_branch(const rate_band *band, const rate_scratch *scratch, Py_ssize_t row, Py_ssize_t i,
                              float cost, const float *error, Py_ssize_t other, rate_paths *out) {
  const Py_ssize_t at = row * band->width + i;
  float place[RATE_WIDTH];
  rate_wanted(band->targets + RATE_WIDTH * at, scratch->above + RATE_WIDTH * (i + 1), error, place);
  for (int k = 0; k < RATE_LANES; k++) {
    const float *given = band->entries + RATE_WIDTH * (k < RATE_NEAR ? scratch->near[i].entry[k] : other);
    out->cost[k] = cost;
    for (int c = 0; c < RATE_WIDTH; c++) out->entry[c][k] = given[c], out->error[c][k] = 0;
  }
  rate_add(band, RATE_LANES, place, band->visibility[at], out);
}

// Let matches begin by a branch: there is room for RATE_LANES, however many of them count.
static inline void rate_take(rate_paths *matches, const rate_paths *branches, int branch) {
  for (int k = 0; k < RATE_LANES; k++) matches->cost[matches->n + k] = branches->cost[branch];
  for (int c = 0; c < RATE_WIDTH; c++) {
    for (int k = 0; k < RATE_LANES; k++) matches->error[c][matches->n + k] = branches->error[c][branch];
  }
}

// The latest places of the pairs of indices that begin at such a place in a byte.
static inline int32_t *rate_pairs(const rate_band *band, const rate_scratch *scratch, int32_t here) {
  return scratch->recent + RATE_LANES * ((here & ((1 << band->shift) - 1)) << 12);  // more than one have few indices
}

// Begin matches with pairs of indices near a pixel and the next one, and with a run of the last index, unless the two
// pixels alone cost too much.
LOOKS_INSIDE void rate_begin(const rate_band *band, const rate_scratch *scratch, Py_ssize_t row, Py_ssize_t i,
                                   const rate_paths *firsts, rate_paths *matches) {
  const rate_node *node = scratch->nodes + i;
  const int32_t here = (int32_t)((row + 1) * scratch->stride + i), farthest = RATE_FARTHEST << band->shift;
  const int32_t before = here > farthest ? here - farthest - 1 : 0, *pairs = rate_pairs(band, scratch, here);
  const float worse = RATE_WORSE_BITS * band->price, most = band->lengths[3] - band->literal / 2;
  float first = node->cost + scratch->floor[i] + worse, second = first + scratch->floor[i + 1];
  if (node[1].cost + most < first) first = node[1].cost + most;
  if (node[2].cost + most < second) second = node[2].cost + most;
  matches->n = 0;
  for (int a = 0; a <= RATE_NEAR; a++) {
    if (firsts->cost[a] >= first || (a < RATE_NEAR && matches->n == band->n_matches - 1)) continue;
    rate_paths seconds;
    float error[RATE_WIDTH];
    for (int c = 0; c < RATE_WIDTH; c++) error[c] = firsts->error[c][a];
    rate_branch(band, scratch, row, i + 1, firsts->cost[a], error, node->last, &seconds);
    for (int b = 0; a < RATE_NEAR && b < RATE_NEAR; b++) {
      if (seconds.cost[b] >= second) continue;
      const int32_t *at = pairs + RATE_LANES * (scratch->near[i].entry[a] << 8 | scratch->near[i + 1].entry[b]);
      memcpy(matches->at + matches->n, at, sizeof(int32_t) * RATE_LANES);
      rate_take(matches, &seconds, b);
      for (int k = 0; k < RATE_LANES; k++) matches->n += at[k] > before;
      if (matches->n >= band->n_matches) matches->n = band->n_matches - 1;  // one is left for the run
    }
    if (a == RATE_NEAR && seconds.cost[RATE_NEAR] < second) {
      matches->at[matches->n] = (int32_t)(scratch->run + node->last * (RATE_LONGEST << band->shift));
      rate_take(matches, &seconds, RATE_NEAR);
      matches->n++;
    }
  }
  for (int m = 0; m < matches->n; m++) {
    matches->away[m] = band->distances[rate_distance(band, scratch, here, matches->at[m]) >> band->shift];
  }
}

// Go on from a pixel by a literal and by matches.
LOOKS_CLONES static void rate_extend(const rate_band *band, rate_scratch *scratch, Py_ssize_t row, Py_ssize_t i) {
  rate_node *node = scratch->nodes + i;
  if (node[1].cost <= node->cost) return;  // what begins here costs no less than what begins at the next pixel
  rate_paths firsts, matches;
  rate_branch(band, scratch, row, i, node->cost, node->error, node->last, &firsts);
  int best = 0;
  for (int k = 1; k < RATE_NEAR; k++) best = firsts.cost[k] < firsts.cost[best] ? k : best;
  if (firsts.cost[best] + band->literal < node[1].cost) {
    node[1] = (rate_node){.cost = firsts.cost[best] + band->literal, .from = (int32_t)i, .distance = 0};
    node[1].last = scratch->near[i].entry[best];
    for (int c = 0; c < RATE_WIDTH; c++) node[1].error[c] = firsts.error[c][best];
  }
  const Py_ssize_t rest = band->width - i, longest = RATE_LONGEST << band->shift, limit = rest < longest ? rest : longest;
  if (limit < 3 << band->shift) return;
  rate_begin(band, scratch, row, i, &firsts, &matches);
  rate_follow(band, scratch, &matches, row, i, limit);
}

// Write the indices of the shortest path, which is known from its end.
static void rate_trace(const rate_band *band, rate_scratch *scratch, Py_ssize_t row) {
  uint16_t *stream = scratch->stream + (row + 1) * scratch->stride;
  for (int32_t end = (int32_t)band->width; end > 0; end = scratch->nodes[end].from) {
    const rate_node *node = scratch->nodes + end;
    const int repeats = node->distance > 1 << band->shift;  // what is in a row above, and neither a literal nor a run
    for (Py_ssize_t x = node->from; x < end; x++) {
      stream[x] = repeats ? stream[x - node->distance] : (uint16_t)node->last;
      band->indices[row * band->width + x] = (uint8_t)stream[x];
    }
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
    float place[RATE_WIDTH];
    rate_wanted(targets + RATE_WIDTH * i, scratch->above + RATE_WIDTH * (i + 1), carried, place);
    rate_spread(band, place, band->entries + RATE_WIDTH * indices[i], RATE_RIGHT, RATE_BELOW, RATE_ASIDE, carried,
                scratch->below + RATE_WIDTH * i);
    if (i + 1 < width) {
      const int32_t here = (int32_t)((row + 1) * scratch->stride + i);
      int32_t *at = rate_pairs(band, scratch, here) + RATE_LANES * (indices[i] << 8 | indices[i + 1]);
      for (int k = RATE_LANES - 1; k > 0; k--) at[k] = at[k - 1];
      at[0] = here;
    }
  }
  float *done = scratch->above;
  scratch->above = scratch->below;
  scratch->below = done;
}

static void rate_map_row(const rate_band *band, rate_scratch *scratch, Py_ssize_t row) {
  const Py_ssize_t width = band->width;
  const int32_t none = (int32_t)band->n_entries;
  for (Py_ssize_t i = 0; i <= width; i++) scratch->nodes[i] = (rate_node){.cost = i ? FLT_MAX : 0, .last = none};
  for (Py_ssize_t i = 0; i < width; i++) {
    const Py_ssize_t at = row * width + i;
    float place[RATE_WIDTH];
    rate_wanted(band->targets + at * RATE_WIDTH, scratch->above + (i + 1) * RATE_WIDTH, NULL, place);
    rate_look(band, scratch->cells, place, band->visibility[at], scratch->near + i);
    scratch->floor[i] = band->literal + scratch->near[i].square[0];
  }
  for (Py_ssize_t i = 0; i < width; i++) rate_extend(band, scratch, row, i);
  rate_trace(band, scratch, row);
  rate_finish(band, scratch, row);
}

#endif

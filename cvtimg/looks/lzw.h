// Mapping to a palette by rate for GIF: paths over the phrases that LZW has learned from the pixels before.
//
// A state is a phrase that the next index may lengthen at no cost; if the book does not have it, the phrase ends and its
// code is paid. Of all paths to a pixel with equal phrases the cheapest goes on, and of these the cheapest few. The book
// stays as it is while paths go ahead, and learns the pixels that are decided. It is that of Pillow's encoder: with other
// codes, or another moment at which it is emptied, files are larger by a fifth.

#ifndef CVTIMG_LZW_H
#define CVTIMG_LZW_H

#include "rate.h"

// Codes of the book, of which the first after those of single indices and of two signals is for a phrase; the code that
// stands for no phrase; the bits of codes.
enum { LZW_CODES = 4096, LZW_FIRST = 258, LZW_NONE = LZW_CODES, LZW_LEAST_BITS = 9, LZW_MOST_BITS = 12 };
// The most paths; the nearest entries of a pixel, by which they go on, and one for what a frame is drawn over; pixels that
// are decided at a time, and how many are looked ahead.
enum { LZW_MOST_PATHS = 64, LZW_CHOICES = RATE_NEAR + 1, LZW_DECIDED = 16, LZW_AHEAD = 16 };
// Bits by which a path may cost more than the cheapest before it is given up.
static const float LZW_BEHIND_BITS = 20;
// Shares of an error that the next pixel, and those below it, get. There are no long runs that would show as streaks.
static const float LZW_RIGHT = 7 / 16.f, LZW_BELOW = 5 / 16.f, LZW_ASIDE = 2 / 16.f;

typedef struct {
  int16_t (*longer)[256];  // LZW_CODES + 1: the code of a phrase and an index, or -1
  int next, bits, phrase;  // the next code, the bits of codes, and the phrase of the last pixels
} lzw_book;

// Paths to a pixel, the cheapest first.
typedef struct {
  int n;
  float cost[LZW_MOST_PATHS], error[RATE_WIDTH][LZW_MOST_PATHS];  // what is handed on to the pixel
  int16_t phrase[LZW_MOST_PATHS], index[LZW_MOST_PATHS], from[LZW_MOST_PATHS];  // of the pixel before, and its path
} lzw_paths;

typedef struct {
  float cost;
  int phrase, from, choice;
} lzw_candidate;

typedef struct {
  lzw_book book;
  int n_paths;
  const float *kept;     // (rows, width, 4) places of what a frame is drawn over, or NULL
  rate_cell *cells;      // RATE_CELLS
  float *above, *below;  // (width + 2, 4) errors handed on from the row above, and to the row below
  lzw_paths *paths;      // LZW_DECIDED + LZW_AHEAD + 1
  int16_t *slots;        // LZW_CODES: which candidate has a phrase, or -1
} lzw_scratch;

static void lzw_empty(lzw_book *book) {
  memset(book->longer, 0xff, sizeof(*book->longer) * LZW_CODES);
  book->next = LZW_FIRST;
  book->bits = LZW_LEAST_BITS;
}

static void lzw_open(lzw_book *book) {
  lzw_empty(book);
  for (int index = 0; index < 256; index++) book->longer[LZW_NONE][index] = (int16_t)index;
  book->phrase = LZW_NONE;
}

// Learn the next index.
static void lzw_learn(lzw_book *book, int index) {
  const int longer = book->longer[book->phrase][index];
  if (longer >= 0) {
    book->phrase = longer;
    return;
  }
  if (book->next == LZW_CODES) {
    lzw_empty(book);
  } else {
    if (book->next == 1 << book->bits && book->bits < LZW_MOST_BITS) book->bits++;
    book->longer[book->phrase][index] = (int16_t)book->next++;
  }
  book->phrase = index;
}

// What an index shows at a pixel.
static inline const float *lzw_shown(const rate_band *band, const lzw_scratch *scratch, Py_ssize_t at, int index) {
  return index < band->n_entries ? band->entries + RATE_WIDTH * index : scratch->kept + RATE_WIDTH * at;
}

// The indices by which paths go on from a pixel: the entries near it, and what the frame is drawn over, which is never
// drawn again.
static int lzw_choose(const rate_band *band, lzw_scratch *scratch, Py_ssize_t at, const float *place, int *choices) {
  rate_near near;
  rate_look(band, scratch->cells, place, band->visibility[at], &near);
  const float most = near.square[0] + LZW_BEHIND_BITS * band->price;
  int n = 0;
  for (int i = 0; i < RATE_NEAR && near.square[i] <= most; i++) {
    const float *entry = band->entries + RATE_WIDTH * near.entry[i];
    const int same = scratch->kept && !memcmp(entry, scratch->kept + RATE_WIDTH * at, RATE_WIDTH * sizeof(float));
    if (!same) choices[n++] = near.entry[i];
  }
  if (scratch->kept) choices[n++] = (int)band->n_entries;
  return n;
}

// The visible squared error of a choice on each path.
LOOKS_CLONES static void lzw_errors(const lzw_paths *paths, const float *base, const float *given, float weight,
                                   float *squares) {
  const float p0 = base[0] - given[0], p1 = base[1] - given[1], p2 = base[2] - given[2], p3 = base[3] - given[3];
  for (int i = 0; i < paths->n; i++) {
    const float a = p0 + paths->error[0][i], b = p1 + paths->error[1][i];
    const float c = p2 + paths->error[2][i], d = p3 + paths->error[3][i];
    squares[i] = weight * ((a * a + b * b) + (c * c + d * d));
  }
}

// Find where paths can go on to, the cheapest of each phrase.
static int lzw_candidates(const rate_band *band, lzw_scratch *scratch, Py_ssize_t at, const float *base,
                          const lzw_paths *paths, const int *choices, int n_choices, lzw_candidate *found) {
  const float code = band->price * (float)scratch->book.bits;
  float squares[LZW_MOST_PATHS], least = FLT_MAX;
  int n = 0;
  for (int choice = 0; choice < n_choices; choice++) {
    const int index = choices[choice];
    lzw_errors(paths, base, lzw_shown(band, scratch, at, index), band->visibility[at], squares);
    for (int from = 0; from < paths->n; from++) {
      const int longer = scratch->book.longer[paths->phrase[from]][index], phrase = longer < 0 ? index : longer;
      const float cost = paths->cost[from] + squares[from] + (longer < 0 ? code : 0);
      if (cost > least + LZW_BEHIND_BITS * band->price) continue;
      least = cost < least ? cost : least;
      int slot = scratch->slots[phrase];
      if (slot < 0) {
        slot = n++;
        scratch->slots[phrase] = (int16_t)slot;
      } else if (found[slot].cost <= cost) {
        continue;
      }
      found[slot] = (lzw_candidate){.cost = cost, .phrase = phrase, .from = from, .choice = choice};
    }
  }
  for (int i = 0; i < n; i++) scratch->slots[found[i].phrase] = -1;
  return n;
}

// Go on by a pixel with the cheapest paths.
static void lzw_extend(const rate_band *band, lzw_scratch *scratch, Py_ssize_t row, Py_ssize_t x,
                       const lzw_paths *before, lzw_paths *after) {
  const Py_ssize_t at = row * band->width + x;
  lzw_candidate found[LZW_MOST_PATHS * LZW_CHOICES], best[LZW_MOST_PATHS];
  int choices[LZW_CHOICES], n = 0;
  float base[RATE_WIDTH], place[RATE_WIDTH];
  rate_wanted(band->targets + RATE_WIDTH * at, scratch->above + RATE_WIDTH * (x + 1), NULL, base);
  for (int c = 0; c < RATE_WIDTH; c++) place[c] = base[c] + before->error[c][0];
  const int n_choices = lzw_choose(band, scratch, at, place, choices);
  const int n_found = lzw_candidates(band, scratch, at, base, before, choices, n_choices, found);
  for (int i = 0; i < n_found; i++) {
    if (n == scratch->n_paths && found[i].cost >= best[n - 1].cost) continue;
    int rank = n < scratch->n_paths ? n++ : n - 1;
    for (; rank > 0 && best[rank - 1].cost > found[i].cost; rank--) best[rank] = best[rank - 1];
    best[rank] = found[i];
  }
  const float bound = best[0].cost + LZW_BEHIND_BITS * band->price;
  for (after->n = 0; after->n < n && best[after->n].cost <= bound; after->n++) {
    const int i = after->n, from = best[i].from, index = choices[best[i].choice];
    float wanted[RATE_WIDTH], error[RATE_WIDTH];
    for (int c = 0; c < RATE_WIDTH; c++) wanted[c] = base[c] + before->error[c][from];
    rate_hand_on(wanted, lzw_shown(band, scratch, at, index), band, error);
    for (int c = 0; c < RATE_WIDTH; c++) after->error[c][i] = error[c] * LZW_RIGHT;
    after->cost[i] = best[i].cost;
    after->phrase[i] = (int16_t)best[i].phrase;
    after->index[i] = (int16_t)index;
    after->from[i] = (int16_t)from;
  }
}

// Decide the pixels from `start` of a row by paths that go on to `end`; return where the decided ones end.
static Py_ssize_t lzw_decide(const rate_band *band, lzw_scratch *scratch, Py_ssize_t row, Py_ssize_t start,
                             float *carried) {
  const Py_ssize_t rest = band->width - start, n = rest < LZW_DECIDED + LZW_AHEAD ? rest : LZW_DECIDED + LZW_AHEAD;
  const Py_ssize_t decided = n == rest ? n : LZW_DECIDED;
  uint8_t path[LZW_DECIDED + LZW_AHEAD];
  lzw_paths *paths = scratch->paths;
  paths[0].n = 1;
  paths[0].cost[0] = 0;
  paths[0].phrase[0] = (int16_t)scratch->book.phrase;
  for (int c = 0; c < RATE_WIDTH; c++) paths[0].error[c][0] = carried[c];
  for (Py_ssize_t i = 0; i < n; i++) lzw_extend(band, scratch, row, start + i, paths + i, paths + i + 1);
  for (Py_ssize_t i = n, which = 0; i > 0; which = paths[i--].from[which]) path[i - 1] = (uint8_t)paths[i].index[which];
  for (Py_ssize_t i = 0; i < decided; i++) {
    const Py_ssize_t x = start + i, at = row * band->width + x;
    float place[RATE_WIDTH];
    rate_wanted(band->targets + RATE_WIDTH * at, scratch->above + RATE_WIDTH * (x + 1), carried, place);
    rate_spread(band, place, lzw_shown(band, scratch, at, path[i]), LZW_RIGHT, LZW_BELOW, LZW_ASIDE, carried,
                scratch->below + RATE_WIDTH * x);
    lzw_learn(&scratch->book, path[i]);
    band->indices[at] = path[i];
  }
  return start + decided;
}

static void lzw_map(const rate_band *band, lzw_scratch *scratch, Py_ssize_t n_rows) {
  lzw_open(&scratch->book);
  for (Py_ssize_t row = 0; row < n_rows; row++) {
    float carried[RATE_WIDTH] = {0};
    memset(scratch->below, 0, sizeof(float) * RATE_WIDTH * (size_t)(band->width + 2));
    for (Py_ssize_t x = 0; x < band->width;) x = lzw_decide(band, scratch, row, x, carried);
    float *done = scratch->above;
    scratch->above = scratch->below;
    scratch->below = done;
  }
}

#endif

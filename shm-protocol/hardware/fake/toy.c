#include "toy.h"

/* Oscillates between margin and size - 1 - margin, one cell every `slowness` ticks. */
static int32_t drift(uint32_t size, int32_t margin, uint64_t tick, uint32_t slowness) {
  const int32_t span = (int32_t)size - 1 - 2 * margin;
  int32_t at;
  if (span <= 0) return (int32_t)size / 2;
  at = (int32_t)((tick / slowness) % (uint64_t)(2 * span));
  return margin + (at <= span ? at : 2 * span - at);
}

static int covers(int32_t row, int32_t column, int32_t centre_row, int32_t centre_column, int32_t radius) {
  const int32_t down = row - centre_row, across = column - centre_column;
  return down * down + across * across <= radius * radius;
}

int toy_hit(uint32_t rows, uint32_t columns, uint64_t tick, uint32_t row, uint32_t column) {
  const int32_t r = (int32_t)row, c = (int32_t)column;
  return covers(r, c, (int32_t)rows / 4, drift(columns, 3, tick, 5), 2) ||
         covers(r, c, drift(rows, 5, tick, 7), (int32_t)columns / 2, 4);
}

float toy_follow(float height, float target) { return height + (target - height) * 0.25f; }

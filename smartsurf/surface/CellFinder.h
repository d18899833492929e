// Finds the cells of one model near a place, whatever the layout, by buckets as wide as the pitch.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "smartsurf/surface/Actuator.h"

namespace smartsurf::surface {

class CellFinder {
 public:
  explicit CellFinder(const Place&);

  // Calls visit(cell, x, y) for every cell of the model whose centre lies in the square of `reach` about (x,
  // y), in an order that does not depend on the caller.
  template <class Visit>
  void near(float x, float y, float reach, Visit visit) const {
    const int row_begin = clamp_down(y - reach, low_y_, rows_), row_end = clamp_up(y + reach, low_y_, rows_);
    const int column_begin = clamp_down(x - reach, low_x_, columns_),
              column_end = clamp_up(x + reach, low_x_, columns_);
    for (int r = row_begin; r < row_end; ++r)
      for (int c = column_begin; c < column_end; ++c) {
        const auto bucket = static_cast<std::size_t>(r * columns_ + c);
        for (std::uint32_t k = first_[bucket]; k < first_[bucket + 1]; ++k) {
          const Centre& cell = cells_[k];
          if (std::abs(cell.x - x) <= reach && std::abs(cell.y - y) <= reach)
            visit(cell.index, cell.x, cell.y);
        }
      }
  }

 private:
  struct Centre {
    int index;
    float x, y;
  };
  int clamp_down(float u, float low, int count) const {
    return std::max(
        0, static_cast<int>(std::floor(std::clamp((u - low) / size_, -1.0F, static_cast<float>(count)))));
  }
  int clamp_up(float u, float low, int count) const {
    return std::min(
        count,
        static_cast<int>(std::floor(std::clamp((u - low) / size_, -1.0F, static_cast<float>(count)))) + 1);
  }

  float size_, low_x_ = 0.0F, low_y_ = 0.0F;  // of a bucket; of the first one's corner
  int rows_ = 0, columns_ = 0;
  std::vector<std::uint32_t> first_;  // of each bucket in cells_, and one more
  std::vector<Centre> cells_;         // by bucket, then ascending
};

}  // namespace smartsurf::surface

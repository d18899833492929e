// Finds the cells of one model near a point, in any layout, with a grid of buckets one pitch wide.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "smartsurf/surface/actuators/Actuator.h"

namespace smartsurf::surface {

class CellFinder {
 public:
  explicit CellFinder(const ActuatorContext&);

  // Calls visit(cell, x, y) for every cell of the model whose centre (x, y) lies within `radius` of the given
  // point along both axes. The order depends on the layout only.
  template <class Visit>
  void for_each_near(float x, float y, float radius, Visit visit) const {
    const int row_begin = first_bucket(y - radius, low_y_, rows_),
              row_end = end_bucket(y + radius, low_y_, rows_);
    const int column_begin = first_bucket(x - radius, low_x_, columns_),
              column_end = end_bucket(x + radius, low_x_, columns_);
    for (int r = row_begin; r < row_end; ++r)
      for (int c = column_begin; c < column_end; ++c) {
        const int bucket = r * columns_ + c;
        for (std::uint32_t k = bucket_begin_[bucket]; k < bucket_begin_[bucket + 1]; ++k) {
          const CellCentre& cell = cells_[k];
          if (std::abs(cell.x - x) <= radius && std::abs(cell.y - y) <= radius)
            visit(cell.index, cell.x, cell.y);
        }
      }
  }

 private:
  struct CellCentre {
    int index;
    float x, y;
  };
  int first_bucket(float coordinate, float low, int count) const {
    return std::max(0, bucket_at(coordinate, low, count));
  }
  int end_bucket(float coordinate, float low, int count) const {
    return std::min(count, bucket_at(coordinate, low, count) + 1);
  }
  int bucket_at(float coordinate, float low, int count) const {
    const float bucket = std::clamp((coordinate - low) / bucket_size_, -1.0F, static_cast<float>(count));
    return static_cast<int>(std::floor(bucket));
  }

  float bucket_size_, low_x_ = 0.0F, low_y_ = 0.0F;  // edge of a bucket; corner of the first bucket, u
  int rows_ = 0, columns_ = 0;                       // of buckets
  std::vector<std::uint32_t> bucket_begin_;          // buckets + 1: each bucket's first index in cells_
  std::vector<CellCentre> cells_;                    // by bucket, then ascending
};

}  // namespace smartsurf::surface

#include "smartsurf/surface/CellFinder.h"

#include <limits>

namespace smartsurf::surface {

CellFinder::CellFinder(const Place& place) : size_(std::max(place.field.pitch, 1e-3F)) {
  std::vector<Centre> all;
  float high_x = -std::numeric_limits<float>::infinity(), high_y = high_x;
  low_x_ = low_y_ = std::numeric_limits<float>::infinity();
  for (const Run& run : place.runs)
    for (int i = run.begin; i < run.end; ++i) {
      const Eigen::Vector2f at = place.field.centre(i);
      all.push_back({i, at.x(), at.y()});
      low_x_ = std::min(low_x_, at.x()), high_x = std::max(high_x, at.x());
      low_y_ = std::min(low_y_, at.y()), high_y = std::max(high_y, at.y());
    }
  if (all.empty()) {
    first_.assign(1, 0);
    low_x_ = low_y_ = 0.0F;
    return;
  }
  // Cells far apart must not cost a bucket for every pitch between them.
  size_ = std::max({size_, (high_x - low_x_) / 4096.0F, (high_y - low_y_) / 4096.0F});
  columns_ = static_cast<int>((high_x - low_x_) / size_) + 1;
  rows_ = static_cast<int>((high_y - low_y_) / size_) + 1;
  auto bucket_of = [this](const Centre& c) {
    return static_cast<std::size_t>(static_cast<int>((c.y - low_y_) / size_) * columns_ +
                                    static_cast<int>((c.x - low_x_) / size_));
  };
  first_.assign(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_) + 1, 0);
  for (const Centre& c : all) ++first_[bucket_of(c) + 1];
  for (std::size_t b = 1; b < first_.size(); ++b) first_[b] += first_[b - 1];
  cells_.resize(all.size());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for (const Centre& c : all) cells_[next[bucket_of(c)]++] = c;
}

}  // namespace smartsurf::surface

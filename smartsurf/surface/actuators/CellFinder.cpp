#include "smartsurf/surface/actuators/CellFinder.h"

#include <limits>

namespace smartsurf::surface {

CellFinder::CellFinder(const ActuatorContext& context) : bucket_size_(std::max(context.field.pitch, 1e-3F)) {
  std::vector<CellCentre> centres;
  float high_x = -std::numeric_limits<float>::infinity(), high_y = high_x;
  low_x_ = low_y_ = std::numeric_limits<float>::infinity();
  for (const CellRun& run : context.runs)
    for (int i = run.begin; i < run.end; ++i) {
      const Eigen::Vector2f centre = context.field.centre(i);
      centres.push_back({i, centre.x(), centre.y()});
      low_x_ = std::min(low_x_, centre.x()), high_x = std::max(high_x, centre.x());
      low_y_ = std::min(low_y_, centre.y()), high_y = std::max(high_y, centre.y());
    }
  if (centres.empty()) {
    bucket_begin_.assign(1, 0);
    low_x_ = low_y_ = 0.0F;
    return;
  }
  // Bounds the number of buckets when the cells are far apart.
  bucket_size_ = std::max({bucket_size_, (high_x - low_x_) / 4096.0F, (high_y - low_y_) / 4096.0F});
  columns_ = static_cast<int>((high_x - low_x_) / bucket_size_) + 1;
  rows_ = static_cast<int>((high_y - low_y_) / bucket_size_) + 1;
  auto bucket_of = [this](const CellCentre& c) {
    return static_cast<int>((c.y - low_y_) / bucket_size_) * columns_ +
           static_cast<int>((c.x - low_x_) / bucket_size_);
  };
  // Counting sort of the cells into buckets.
  bucket_begin_.assign(rows_ * columns_ + 1, 0);
  for (const CellCentre& c : centres) ++bucket_begin_[bucket_of(c) + 1];
  for (std::size_t b = 1; b < bucket_begin_.size(); ++b) bucket_begin_[b] += bucket_begin_[b - 1];
  cells_.resize(centres.size());
  std::vector<std::uint32_t> next(bucket_begin_.begin(), bucket_begin_.end() - 1);
  for (const CellCentre& c : centres) cells_[next[bucket_of(c)]++] = c;
}

}  // namespace smartsurf::surface

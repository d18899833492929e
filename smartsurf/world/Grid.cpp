#include "smartsurf/world/Grid.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

// Cells a body at most: a few bodies that fly far apart must not cost an array of empty cells.
constexpr int kCellsPerBody = 4, kFewestCells = 64;

}  // namespace

void Grid::build(std::span<const Vec3> position, std::span<const float> reach, float large) {
  small_.clear();
  large_.clear();
  Vec3 low = Vec3::Constant(1e30F), high = -low;
  float widest = 1e-3F;
  for (std::size_t i = 0; i < position.size(); ++i) {
    if (reach[i] > large || !position[i].allFinite()) {
      large_.push_back(static_cast<std::int32_t>(i));
      continue;
    }
    small_.push_back(static_cast<std::int32_t>(i));
    low = low.cwiseMin(position[i]);
    high = high.cwiseMax(position[i]);
    widest = std::max(widest, reach[i]);
  }
  origin_ = low;
  inverse_size_ = 1.0F / (2.0F * widest);
  const float most = static_cast<float>(kFewestCells + kCellsPerBody * static_cast<int>(small_.size()));
  float cells[3];
  for (int k = 0; k < 3; ++k)
    cells[k] = small_.empty() ? 1.0F : std::floor((high[k] - low[k]) * inverse_size_) + 1.0F;
  // Too many: the far ones share the last cells.
  for (int k = 0; k < 3; ++k) count_[k] = static_cast<int>(std::min(cells[k], 1024.0F));
  for (int k = 2;
       static_cast<float>(count_[0]) * static_cast<float>(count_[1]) * static_cast<float>(count_[2]) > most;
       k = (k + 2) % 3)
    count_[k] = std::max(1, count_[k] / 2);

  first_.assign(static_cast<std::size_t>(count_[0] * count_[1] * count_[2]) + 1, 0);
  small_cell_.resize(small_.size());
  for (std::size_t i = 0; i < small_.size(); ++i) {
    const Vec3& p = position[static_cast<std::size_t>(small_[i])];
    small_cell_[i] = index(cell_of(p.x(), 0), cell_of(p.y(), 1), cell_of(p.z(), 2));
    ++first_[static_cast<std::size_t>(small_cell_[i]) + 1];
  }
  for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
  order_.resize(small_.size());
  cell_.resize(small_.size());
  entry_.resize(small_.size());
  for (std::size_t i = 0; i < small_.size(); ++i) {
    const auto at = static_cast<std::size_t>(first_[static_cast<std::size_t>(small_cell_[i])]++);
    const auto body = static_cast<std::size_t>(small_[i]);
    order_[at] = small_[i];
    cell_[at] = small_cell_[i];
    entry_[at] = {position[body].x(), position[body].y(), position[body].z(), reach[body]};
  }
  for (std::size_t c = first_.size() - 1; c > 0; --c) first_[c] = first_[c - 1];
  first_[0] = 0;
}

}  // namespace smartsurf::world

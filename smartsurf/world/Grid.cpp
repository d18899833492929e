#include "smartsurf/world/Grid.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

// Cells a body at most: a few bodies that fly far apart must not cost an array of empty cells.
constexpr int kCellsPerBody = 4, kFewestCells = 64;

}  // namespace

// A counting sort: whoever brings them, in the end the bodies of a cell are in the order of their indices.
void Grid::build(const Input& in, std::span<const std::int32_t> own, const Member& member) {
  member.alone([&] {
    part_.resize(static_cast<std::size_t>(member.members));
    cell_of_body_.resize(in.position.size());
  });
  Part& part = part_[static_cast<std::size_t>(member.index)];
  measure(in, own, part);
  member.alone([&] { make_cells(in.position.size()); });
  count(in, own, part);
  member.alone([this] { find_cells(); });
  find_places(static_cast<std::size_t>(member.index));
  for (const std::int32_t body : own) {
    const std::int32_t cell = cell_of_body_[static_cast<std::size_t>(body)];
    if (cell >= 0) order_[static_cast<std::size_t>(part.next[static_cast<std::size_t>(cell)]++)] = body;
  }
  member.meet();
  fill_cells(in, member.share(count_[1]));
}

void Grid::measure(const Input& in, std::span<const std::int32_t> own, Part& part) {
  part.low = Vec3::Constant(1e30F);
  part.high = -part.low;
  part.widest = 1e-3F;
  part.large.clear();
  for (const std::int32_t body : own) {
    const auto i = static_cast<std::size_t>(body);
    const bool large = in.reach[i] > in.large || !in.position[i].allFinite();
    cell_of_body_[i] = large ? -1 : 0;
    if (large) {
      part.large.push_back(body);
      continue;
    }
    part.low = part.low.cwiseMin(in.position[i]);
    part.high = part.high.cwiseMax(in.position[i]);
    part.widest = std::max(part.widest, in.reach[i]);
  }
}

void Grid::make_cells(std::size_t bodies) {
  Vec3 low = part_.front().low, high = part_.front().high;
  float widest = 0.0F;
  large_.clear();
  for (const Part& part : part_) {
    low = low.cwiseMin(part.low);
    high = high.cwiseMax(part.high);
    widest = std::max(widest, part.widest);
    large_.insert(large_.end(), part.large.begin(), part.large.end());
  }
  std::sort(large_.begin(), large_.end());
  const std::size_t small = bodies - large_.size();
  origin_ = low;
  inverse_size_ = 1.0F / (2.0F * widest);
  const float most = static_cast<float>(kFewestCells + kCellsPerBody * static_cast<int>(small));
  float cells[3];
  for (int k = 0; k < 3; ++k)
    cells[k] = small == 0 ? 1.0F : std::floor((high[k] - low[k]) * inverse_size_) + 1.0F;
  // Too many: the far ones share the last cells.
  for (int k = 0; k < 3; ++k) count_[k] = static_cast<int>(std::min(cells[k], 1024.0F));
  for (int k = 2;
       static_cast<float>(count_[0]) * static_cast<float>(count_[1]) * static_cast<float>(count_[2]) > most;
       k = (k + 2) % 3)
    count_[k] = std::max(1, count_[k] / 2);
  first_.resize(static_cast<std::size_t>(count_[0] * count_[1] * count_[2]) + 1);
  order_.resize(small);
  cell_.resize(small);
  for (std::vector<float>* of : {&x_, &y_, &z_, &reach_}) of->resize(small + kSpare);
}

void Grid::count(const Input& in, std::span<const std::int32_t> own, Part& part) {
  part.count.assign(first_.size() - 1, 0);
  for (const std::int32_t body : own) {
    const auto i = static_cast<std::size_t>(body);
    if (cell_of_body_[i] < 0) continue;
    const Vec3& p = in.position[i];
    cell_of_body_[i] = index(cell_of(p.x(), 0), cell_of(p.y(), 1), cell_of(p.z(), 2));
    ++part.count[static_cast<std::size_t>(cell_of_body_[i])];
  }
}

void Grid::find_cells() {
  std::int32_t at = 0;
  for (std::size_t c = 0; c + 1 < first_.size(); ++c) {
    first_[c] = at;
    for (const Part& part : part_) at += part.count[c];
  }
  first_.back() = at;
}

void Grid::find_places(std::size_t member) {
  std::vector<std::int32_t>& next = part_[member].next;
  next.assign(first_.begin(), first_.end() - 1);
  for (std::size_t before = 0; before < member; ++before)
    for (std::size_t c = 0; c < next.size(); ++c) next[c] += part_[before].count[c];
}

// Those of these lines of cells along x, in every layer.
void Grid::fill_cells(const Input& in, Range lines) {
  for (int z = 0; z < count_[2]; ++z)
    for (int cell = index(0, lines.begin, z); cell < index(0, lines.end, z); ++cell) {
      const int begin = first_[static_cast<std::size_t>(cell)],
                end = first_[static_cast<std::size_t>(cell) + 1];
      if (part_.size() > 1 && end - begin > 1) std::sort(order_.begin() + begin, order_.begin() + end);
      for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
        const auto body = static_cast<std::size_t>(order_[k]);
        const Vec3& p = in.position[body];
        cell_[k] = cell;
        x_[k] = p.x();
        y_[k] = p.y();
        z_[k] = p.z();
        reach_[k] = in.reach[body];
      }
    }
}

}  // namespace smartsurf::world

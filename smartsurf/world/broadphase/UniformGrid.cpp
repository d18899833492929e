#include "smartsurf/world/broadphase/UniformGrid.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

// Bounds the number of cells, so that a few bodies far apart do not cost a huge array of empty cells.
constexpr int kCellsPerBody = 4, kMinCells = 64;

}  // namespace

// A parallel counting sort. fill_cell_lines() then sorts the bodies of each cell by index, so the order does
// not depend on which member inserted which body.
void UniformGrid::build(const Input& in, std::span<const std::int32_t> own, const Member& member) {
  member.single([&] {
    member_state_.resize(static_cast<std::size_t>(member.member_count));
    cell_of_body_.resize(in.position.size());
  });
  MemberState& state = member_state_[static_cast<std::size_t>(member.index)];
  compute_bounds(in, own, state);
  member.single([&] { resize_cells(in.position.size()); });
  count_bodies(in, own, state);
  member.single([this] { compute_cell_starts(); });
  compute_member_slots(static_cast<std::size_t>(member.index));
  for (const std::int32_t body : own) {
    const std::int32_t cell = cell_of_body_[static_cast<std::size_t>(body)];
    if (cell >= 0)
      sorted_bodies_[static_cast<std::size_t>(state.next_slot[static_cast<std::size_t>(cell)]++)] = body;
  }
  member.arrive_and_wait();
  fill_cell_lines(in, member.share(cell_count_[1]));
}

void UniformGrid::compute_bounds(const Input& in, std::span<const std::int32_t> own, MemberState& state) {
  state.low = Vec3::Constant(1e30F);
  state.high = -state.low;
  state.max_radius = 1e-3F;
  state.large.clear();
  for (const std::int32_t body : own) {
    const auto i = static_cast<std::size_t>(body);
    const bool large = in.radius[i] > in.large_radius || !in.position[i].allFinite();
    cell_of_body_[i] = large ? -1 : 0;
    if (large) {
      state.large.push_back(body);
      continue;
    }
    state.low = state.low.cwiseMin(in.position[i]);
    state.high = state.high.cwiseMax(in.position[i]);
    state.max_radius = std::max(state.max_radius, in.radius[i]);
  }
}

void UniformGrid::resize_cells(std::size_t bodies) {
  Vec3 low = member_state_.front().low, high = member_state_.front().high;
  float max_radius = 0.0F;
  large_bodies_.clear();
  for (const MemberState& state : member_state_) {
    low = low.cwiseMin(state.low);
    high = high.cwiseMax(state.high);
    max_radius = std::max(max_radius, state.max_radius);
    large_bodies_.insert(large_bodies_.end(), state.large.begin(), state.large.end());
  }
  std::sort(large_bodies_.begin(), large_bodies_.end());
  const std::size_t small = bodies - large_bodies_.size();
  origin_ = low;
  inverse_size_ = 1.0F / (2.0F * max_radius);
  const float max_cells = static_cast<float>(kMinCells + kCellsPerBody * static_cast<int>(small));
  float cells[3];
  for (int k = 0; k < 3; ++k)
    cells[k] = small == 0 ? 1.0F : std::floor((high[k] - low[k]) * inverse_size_) + 1.0F;
  // Too many cells: bodies beyond the last cell of an axis are clamped to it.
  for (int k = 0; k < 3; ++k) cell_count_[k] = static_cast<int>(std::min(cells[k], 1024.0F));
  for (int k = 2; static_cast<float>(cell_count_[0]) * static_cast<float>(cell_count_[1]) *
                      static_cast<float>(cell_count_[2]) >
                  max_cells;
       k = (k + 2) % 3)
    cell_count_[k] = std::max(1, cell_count_[k] / 2);
  cell_start_.resize(static_cast<std::size_t>(cell_count_[0] * cell_count_[1] * cell_count_[2]) + 1);
  sorted_bodies_.resize(small);
  sorted_cell_.resize(small);
  for (std::vector<float>* coordinates : {&x_, &y_, &z_, &radius_}) coordinates->resize(small + kSimdPadding);
}

void UniformGrid::count_bodies(const Input& in, std::span<const std::int32_t> own, MemberState& state) {
  state.cell_count.assign(cell_start_.size() - 1, 0);
  for (const std::int32_t body : own) {
    const auto i = static_cast<std::size_t>(body);
    if (cell_of_body_[i] < 0) continue;
    const Vec3& p = in.position[i];
    cell_of_body_[i] = index(cell_of(p.x(), 0), cell_of(p.y(), 1), cell_of(p.z(), 2));
    ++state.cell_count[static_cast<std::size_t>(cell_of_body_[i])];
  }
}

void UniformGrid::compute_cell_starts() {
  std::int32_t at = 0;
  for (std::size_t c = 0; c + 1 < cell_start_.size(); ++c) {
    cell_start_[c] = at;
    for (const MemberState& state : member_state_) at += state.cell_count[c];
  }
  cell_start_.back() = at;
}

void UniformGrid::compute_member_slots(std::size_t member) {
  std::vector<std::int32_t>& next = member_state_[member].next_slot;
  next.assign(cell_start_.begin(), cell_start_.end() - 1);
  for (std::size_t before = 0; before < member; ++before)
    for (std::size_t c = 0; c < next.size(); ++c) next[c] += member_state_[before].cell_count[c];
}

// Sorts the bodies of each cell and copies their spheres, for the given lines of cells along x in every
// layer.
void UniformGrid::fill_cell_lines(const Input& in, IndexRange lines) {
  for (int z = 0; z < cell_count_[2]; ++z)
    for (int cell = index(0, lines.begin, z); cell < index(0, lines.end, z); ++cell) {
      const int begin = cell_start_[static_cast<std::size_t>(cell)],
                end = cell_start_[static_cast<std::size_t>(cell) + 1];
      if (member_state_.size() > 1 && end - begin > 1)
        std::sort(sorted_bodies_.begin() + begin, sorted_bodies_.begin() + end);
      for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
        const auto body = static_cast<std::size_t>(sorted_bodies_[k]);
        const Vec3& p = in.position[body];
        sorted_cell_[k] = cell;
        x_[k] = p.x();
        y_[k] = p.y();
        z_[k] = p.z();
        radius_[k] = in.radius[body];
      }
    }
}

}  // namespace smartsurf::world

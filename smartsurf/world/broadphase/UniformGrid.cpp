#include "smartsurf/world/broadphase/UniformGrid.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

namespace smartsurf::world {
namespace {

// Above this number of cells the array over all cells would cost more than the bodies.
constexpr int kCellsPerBody = 4, kMinCells = 64;
// Cells per axis of a sparse grid, half of them on either side of the world's origin. Bodies beyond are as
// far away as their positions can distinguish, and share the outermost cells.
constexpr double kMaxCellsPerAxis = 1 << 21;
constexpr int kMinSlices = 24;  // slices are stacked along y if there are at least this many

}  // namespace

UniformGrid& UniformGrid::of_this_thread() {
  thread_local UniformGrid grid;
  return grid;
}

void UniformGrid::build(const Input& in, std::span<const std::int32_t> own, const Member& member) {
  member.single([&] {
    member_state_.resize(member.member_count);
    if (is_large_.size() < in.position.size()) is_large_.resize(in.position.size());
  });
  compute_bounds(in, own, member_state_[member.index]);
  member.single([&] {
    resize_cells(in.bodies.size());
    if (!is_dense_ && !is_few_ && key_of_body_.size() < is_large_.size())
      key_of_body_.resize(is_large_.size());
  });
  if (is_few_)
    member.single([&] { sort_few(in); });
  else if (is_dense_)
    sort_dense(in, member);
  else
    sort_sparse(in, own, member);
}

// An insertion sort by cell, stable over the bodies in ascending order.
void UniformGrid::sort_few(const Input& in) {
  std::uint64_t keys[kFew];
  int count = 0;
  for (const std::int32_t body : in.bodies) {
    if (is_large_[body]) continue;
    const std::uint64_t key = key_of(in.position[body]);
    int at = count++;
    for (; at > 0 && keys[at - 1] > key; --at) {
      keys[at] = keys[at - 1];
      sorted_bodies_[at] = sorted_bodies_[at - 1];
    }
    keys[at] = key;
    sorted_bodies_[at] = body;
  }
  fill_spheres(in, {0, count});
}

// A counting sort by cell. Each member sorts the bodies of its slices: most are its own, and it takes the few
// others from the lists of those who own them, so that few cache lines move between cores. The bodies of each
// cell are then sorted by index: the order does not depend on who owns which.
void UniformGrid::sort_dense(const Input& in, const Member& member) {
  MemberState& state = member_state_[member.index];
  const IndexRange slices = member.share(cell_count_[kSlice]);
  const auto is_in_slices = [slices](const CellBody& b) {
    return b.slice >= slices.begin && b.slice < slices.end;
  };
  state.in_slices.clear();
  state.elsewhere.clear();
  for (const std::int32_t i : state.small) {
    const Vec3& p = in.position[i];
    const int slice = cell_of(p, kSlice);
    const CellBody b{index(cell_of(p, kColumn), cell_of(p, kLayer), slice), slice, i};
    auto& bodies = is_in_slices(b) ? state.in_slices : state.elsewhere;
    bodies.push_back(b);
  }
  member.arrive_and_wait();
  for (const MemberState& other : member_state_)
    if (&other != &state)
      std::ranges::copy_if(other.elsewhere, std::back_inserter(state.in_slices), is_in_slices);

  const IndexRange rows{row_index(0, slices.begin), row_index(0, slices.end)};
  const int columns = cell_count_[kColumn];
  // Until the bodies are in place, the entry after that of a cell is its number of bodies, then the place of
  // the next one.
  std::int32_t* const next = cell_start_.data() + 1;
  std::fill(next + rows.begin * columns, next + rows.end * columns, 0);
  for (const CellBody& b : state.in_slices) ++next[b.cell];
  for (int row = rows.begin; row < rows.end; ++row) {
    const std::int32_t* const cells = next + row * columns;
    row_start_[row] = std::accumulate(cells, cells + columns, 0);
  }
  member.single([this] { compute_row_starts(); });
  if (rows.begin == rows.end) return;
  std::int32_t at = row_start_[rows.begin];
  for (int cell = rows.begin * columns; cell < rows.end * columns; ++cell)
    at += std::exchange(next[cell], at);
  for (const CellBody& b : state.in_slices) sorted_bodies_[next[b.cell]++] = b.body;
  const IndexRange sorted{row_start_[rows.begin], row_start_[rows.end]};
  if (member.member_count > 1) {
    at = sorted.begin;
    for (int cell = rows.begin * columns; cell < rows.end * columns; at = next[cell++])
      if (next[cell] > at + 1) std::sort(sorted_bodies_.begin() + at, sorted_bodies_.begin() + next[cell]);
  }
  fill_spheres(in, sorted);
}

// A radix sort by cell, stable over the bodies in ascending order.
void UniformGrid::sort_sparse(const Input& in, std::span<const std::int32_t> own, const Member& member) {
  for (const std::int32_t i : own)
    if (!is_large_[i]) key_of_body_[i] = key_of(in.position[i]);
  member.single([&] {
    collect_keys(in.bodies);
    sort_keys();
    find_rows();
  });
  fill_spheres(in, member.share(sorted_count()));
}

void UniformGrid::compute_bounds(const Input& in, std::span<const std::int32_t> own, MemberState& state) {
  state.low = Vec3::Constant(1e30F);
  state.high = -state.low;
  state.max_radius = 1e-3F;
  state.small.clear();
  state.large.clear();
  for (const std::int32_t i : own) {
    const bool large = in.radius[i] > in.large_radius || !in.position[i].allFinite();
    // Rarely written, so that the members' caches share it.
    if (is_large_[i] != large) is_large_[i] = large;
    auto& bodies = large ? state.large : state.small;
    bodies.push_back(i);
    if (large) continue;
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
  inverse_size_ = 1.0F / (2.0F * max_radius);
  const float max_cells = static_cast<float>(kMinCells + kCellsPerBody * static_cast<int>(small));
  float cells[3];
  for (int axis = 0; axis < 3; ++axis)
    cells[axis] = small <= 1 ? 1.0F : std::floor((high[axis] - low[axis]) * inverse_size_) + 1.0F;
  is_dense_ = cells[0] * cells[1] * cells[2] <= max_cells;
  axis_[kSlice] = cells[1] >= std::min(static_cast<float>(kMinSlices), cells[0]) ? 1 : 0;
  axis_[kColumn] = 1 - axis_[kSlice];
  for (const Coordinate k : {kColumn, kLayer, kSlice}) {
    const int axis = axis_[k];
    origin_[k] = low[axis];
    if (is_dense_) {
      cell_count_[k] = static_cast<int>(cells[axis]);
      continue;
    }
    const double size = 1.0 / static_cast<double>(inverse_size_);
    origin_[k] = std::max(low[axis], static_cast<float>(-0.5 * kMaxCellsPerAxis * size));
    const double count =
        std::floor((static_cast<double>(high[axis]) - static_cast<double>(origin_[k])) / size);
    cell_count_[k] = static_cast<int>(std::clamp(count + 1.0, 1.0, kMaxCellsPerAxis));
  }
  is_few_ = small <= kFew;
  if (is_few_)
    rows_.clear();
  else if (is_dense_)
    cell_start_.resize(cell_count_[0] * cell_count_[1] * cell_count_[2] + 1),
        row_start_.resize(cell_count_[kLayer] * cell_count_[kSlice] + 1);
  else
    keys_.resize(small), sorted_keys_.resize(small), rows_.reserve(small + 1);
  sorted_bodies_.resize(small);
  column_.resize(small);
  for (std::vector<float>* coordinates : {&x_, &y_, &z_, &radius_}) coordinates->resize(small + kSimdPadding);
}

// From the number of bodies of each row.
void UniformGrid::compute_row_starts() {
  std::int32_t at = 0;
  rows_.clear();
  for (int slice = 0, row = 0; slice < cell_count_[kSlice]; ++slice)
    for (int layer = 0; layer < cell_count_[kLayer]; ++layer, ++row) {
      const std::int32_t bodies = std::exchange(row_start_[row], at);
      if (bodies > 0) rows_.push_back({slice, layer, at});
      at += bodies;
    }
  row_start_.back() = at;
  rows_.push_back({cell_count_[kSlice], 0, at});
}

void UniformGrid::fill_spheres(const Input& in, IndexRange sorted) {
  for (Index k = sorted.begin; k < sorted.end; ++k) {
    const Index body = sorted_bodies_[k];
    const Vec3& p = in.position[body];
    if (!is_few_) column_[k] = cell_of(p, kColumn);
    x_[k] = p.x();
    y_[k] = p.y();
    z_[k] = p.z();
    radius_[k] = in.radius[body];
  }
}

// ---- sparse

void UniformGrid::collect_keys(std::span<const std::int32_t> bodies) {
  std::size_t count = 0;
  for (const std::int32_t body : bodies)
    if (!is_large_[body]) keys_[count++] = {key_of_body_[body], body};
}

void UniformGrid::sort_keys() {
  constexpr int kDigitBits = 11;
  constexpr std::uint64_t kDigits = 1 << kDigitBits;
  const std::uint64_t last = static_cast<std::uint64_t>(cell_count_[0]) *
                                 static_cast<std::uint64_t>(cell_count_[1]) *
                                 static_cast<std::uint64_t>(cell_count_[2]) -
                             1;
  for (int shift = 0; shift < 64 && last >> shift > 0; shift += kDigitBits) {
    std::int32_t slot[kDigits] = {};
    auto digit = [shift](const BodyKey& b) { return (b.key >> shift) % kDigits; };
    for (const BodyKey& b : keys_) ++slot[digit(b)];
    std::int32_t at = 0;
    for (std::int32_t& s : slot) at += std::exchange(s, at);
    for (const BodyKey& b : keys_) sorted_keys_[slot[digit(b)]++] = b;
    std::swap(keys_, sorted_keys_);
  }
}

void UniformGrid::find_rows() {
  rows_.clear();
  const auto columns = static_cast<std::uint64_t>(cell_count_[kColumn]),
             layers = static_cast<std::uint64_t>(cell_count_[kLayer]);
  std::uint64_t row_end = 0;
  for (std::size_t k = 0; k < keys_.size(); ++k) {
    sorted_bodies_[k] = keys_[k].body;
    if (keys_[k].key < row_end) continue;
    const std::uint64_t row = keys_[k].key / columns;
    row_end = (row + 1) * columns;
    rows_.push_back({static_cast<std::int32_t>(row / layers), static_cast<std::int32_t>(row % layers),
                     static_cast<std::int32_t>(k)});
  }
  rows_.push_back({cell_count_[kSlice], 0, static_cast<std::int32_t>(keys_.size())});
}

int UniformGrid::find_row(int layer, int slice) const {
  const auto row = std::lower_bound(
      rows_.begin(), rows_.end() - 1, std::pair(slice, layer),
      [](const Row& r, const std::pair<int, int>& wanted) { return std::pair(r.slice, r.layer) < wanted; });
  return static_cast<int>(row - rows_.begin());
}

IndexRange UniformGrid::find_in_row(const Row* row, int first, int last) const {
  const auto begin = column_.begin() + row->begin, end = column_.begin() + (row + 1)->begin;
  const auto from = std::lower_bound(begin, end, first);
  return {static_cast<int>(from - column_.begin()),
          static_cast<int>(std::upper_bound(from, end, last) - column_.begin())};
}

}  // namespace smartsurf::world

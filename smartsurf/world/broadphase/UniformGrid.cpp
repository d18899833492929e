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
  const auto nx = static_cast<std::uint64_t>(cell_count_[0]), ny = static_cast<std::uint64_t>(cell_count_[1]);
  std::uint64_t keys[kFew];
  int count = 0;
  for (const std::int32_t body : in.bodies) {
    if (is_large_[body]) continue;
    const Vec3& p = in.position[body];
    const auto cell = [&](int axis) { return static_cast<std::uint64_t>(cell_of(p[axis], axis)); };
    const std::uint64_t key = (cell(2) * ny + cell(1)) * nx + cell(0);
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

// A counting sort by cell. Each member sorts the bodies of its lines of cells, in all layers: most are its
// own, and it takes the few others from the lists of those who own them, so that few cache lines move between
// cores. The bodies of each cell are then sorted by index: the order does not depend on who owns which.
void UniformGrid::sort_dense(const Input& in, const Member& member) {
  MemberState& state = member_state_[member.index];
  const IndexRange lines = member.share(cell_count_[1]);
  const auto is_in_lines = [lines](const CellBody& b) { return b.line >= lines.begin && b.line < lines.end; };
  state.in_lines.clear();
  state.elsewhere.clear();
  for (const std::int32_t i : state.small) {
    const Vec3& p = in.position[i];
    const int line = cell_of(p.y(), 1);
    const CellBody b{index(cell_of(p.x(), 0), line, cell_of(p.z(), 2)), line, i};
    auto& bodies = is_in_lines(b) ? state.in_lines : state.elsewhere;
    bodies.push_back(b);
  }
  member.arrive_and_wait();
  for (const MemberState& other : member_state_)
    if (&other != &state)
      std::ranges::copy_if(other.elsewhere, std::back_inserter(state.in_lines), is_in_lines);

  const int row_cells = cell_count_[0];
  // Until the bodies are in place, the entry after that of a cell is its number of bodies, then the place of
  // the next one.
  std::int32_t* const next = cell_start_.data() + 1;
  const auto for_each_row = [&](auto&& visit) {
    for (int z = 0; z < cell_count_[2]; ++z)
      for (int y = lines.begin; y < lines.end; ++y) {
        const int row = z * cell_count_[1] + y;
        visit(row, next + row * row_cells);
      }
  };
  for_each_row([&](int, std::int32_t* cells) { std::fill_n(cells, row_cells, 0); });
  for (const CellBody& b : state.in_lines) ++next[b.cell];
  for_each_row([&](int row, const std::int32_t* cells) {
    row_start_[row] = std::accumulate(cells, cells + row_cells, 0);
  });
  member.single([this] { compute_row_starts(); });
  for_each_row([&](int row, std::int32_t* cells) {
    std::int32_t at = row_start_[row];
    for (int x = 0; x < row_cells; ++x) at += std::exchange(cells[x], at);
  });
  for (const CellBody& b : state.in_lines) sorted_bodies_[next[b.cell]++] = b.body;
  for_each_row([&](int row, const std::int32_t* ends) {
    const auto at = [this](std::int32_t k) { return sorted_bodies_.begin() + k; };
    if (member.member_count > 1)
      for (int x = 0; x < row_cells; ++x) std::sort(at(x == 0 ? row_start_[row] : ends[x - 1]), at(ends[x]));
    fill_spheres(in, {row_start_[row], row_start_[row + 1]});
  });
}

// A radix sort by cell, stable over the bodies in ascending order.
void UniformGrid::sort_sparse(const Input& in, std::span<const std::int32_t> own, const Member& member) {
  const auto nx = static_cast<std::uint64_t>(cell_count_[0]), ny = static_cast<std::uint64_t>(cell_count_[1]);
  for (const std::int32_t i : own) {
    if (is_large_[i]) continue;
    const Vec3& p = in.position[i];
    const auto x = static_cast<std::uint64_t>(cell_of(p.x(), 0)),
               y = static_cast<std::uint64_t>(cell_of(p.y(), 1)),
               z = static_cast<std::uint64_t>(cell_of(p.z(), 2));
    key_of_body_[i] = (z * ny + y) * nx + x;
  }
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
  origin_ = low;
  inverse_size_ = 1.0F / (2.0F * max_radius);
  const float max_cells = static_cast<float>(kMinCells + kCellsPerBody * static_cast<int>(small));
  float cells[3];
  for (int k = 0; k < 3; ++k)
    cells[k] = small <= 1 ? 1.0F : std::floor((high[k] - low[k]) * inverse_size_) + 1.0F;
  is_dense_ = cells[0] * cells[1] * cells[2] <= max_cells;
  for (int k = 0; k < 3; ++k) {
    if (is_dense_) {
      cell_count_[k] = static_cast<int>(cells[k]);
      continue;
    }
    const double size = 1.0 / static_cast<double>(inverse_size_);
    origin_[k] = std::max(low[k], static_cast<float>(-0.5 * kMaxCellsPerAxis * size));
    const double count = std::floor((static_cast<double>(high[k]) - static_cast<double>(origin_[k])) / size);
    cell_count_[k] = static_cast<int>(std::clamp(count + 1.0, 1.0, kMaxCellsPerAxis));
  }
  is_few_ = small <= kFew;
  if (is_few_)
    rows_.clear();
  else if (is_dense_)
    cell_start_.resize(cell_count_[0] * cell_count_[1] * cell_count_[2] + 1),
        row_start_.resize(cell_count_[1] * cell_count_[2] + 1);
  else
    keys_.resize(small), sorted_keys_.resize(small), rows_.reserve(small + 1);
  sorted_bodies_.resize(small);
  column_.resize(small);
  for (std::vector<float>* coordinates : {&x_, &y_, &z_, &radius_}) coordinates->resize(small + kSimdPadding);
}

// From the number of bodies of each row of cells along x.
void UniformGrid::compute_row_starts() {
  std::int32_t at = 0;
  rows_.clear();
  for (int z = 0, row = 0; z < cell_count_[2]; ++z)
    for (int y = 0; y < cell_count_[1]; ++y, ++row) {
      const std::int32_t bodies = std::exchange(row_start_[row], at);
      if (bodies > 0) rows_.push_back({y, z, at});
      at += bodies;
    }
  row_start_.back() = at;
  rows_.push_back({0, cell_count_[2], at});
}

void UniformGrid::fill_spheres(const Input& in, IndexRange sorted) {
  for (Index k = sorted.begin; k < sorted.end; ++k) {
    const Index body = sorted_bodies_[k];
    const Vec3& p = in.position[body];
    if (!is_few_) column_[k] = cell_of(p.x(), 0);
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
  const auto nx = static_cast<std::uint64_t>(cell_count_[0]), ny = static_cast<std::uint64_t>(cell_count_[1]);
  std::uint64_t row_end = 0;
  for (std::size_t k = 0; k < keys_.size(); ++k) {
    sorted_bodies_[k] = keys_[k].body;
    if (keys_[k].key < row_end) continue;
    const std::uint64_t row = keys_[k].key / nx;
    row_end = (row + 1) * nx;
    rows_.push_back({static_cast<std::int32_t>(row % ny), static_cast<std::int32_t>(row / ny),
                     static_cast<std::int32_t>(k)});
  }
  rows_.push_back({0, cell_count_[2], static_cast<std::int32_t>(keys_.size())});
}

int UniformGrid::find_row(int y, int z) const {
  const auto row = std::lower_bound(
      rows_.begin(), rows_.end() - 1, std::pair(z, y),
      [](const Row& r, const std::pair<int, int>& wanted) { return std::pair(r.z, r.y) < wanted; });
  return static_cast<int>(row - rows_.begin());
}

IndexRange UniformGrid::find_in_row(const Row* row, int x0, int x1) const {
  const auto begin = column_.begin() + row->begin, end = column_.begin() + (row + 1)->begin;
  const auto from = std::lower_bound(begin, end, x0);
  return {static_cast<int>(from - column_.begin()),
          static_cast<int>(std::upper_bound(from, end, x1) - column_.begin())};
}

}  // namespace smartsurf::world

// The broad phase: a uniform grid over bodies of similar size. The few much larger bodies are kept in a list
// and query the grid.
//
// Bodies are sorted by cell, so that neighbouring cells along x are contiguous in memory. Results and their
// order depend on positions and indices only, not on the number of members.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/world/Vec.h"
#include "smartsurf/world/broadphase/UniformGridKernels.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

class UniformGrid {
 public:
  // All bodies: position, and radius of the sphere within which the body can touch anything in this step, u.
  // Bodies with radius > large_radius or a non-finite position go to large_bodies().
  struct Input {
    std::span<const Vec3> position;
    std::span<const float> radius;
    float large_radius;
  };
  // Called by all members of the team; the `own` lists together contain every body once. Fastest if the
  // bodies of a member lie close together. A single member must list them in ascending order. Members must
  // pass a barrier before they query the grid.
  void build(const Input&, std::span<const std::int32_t> own, const Member&);

  std::int32_t body(int sorted) const { return sorted_bodies_[static_cast<std::size_t>(sorted)]; }
  int sorted_count() const { return static_cast<int>(sorted_bodies_.size()); }
  // Number of cells along x, y or z. Bodies are sorted by cell, x fastest, z slowest.
  int cell_count(int axis) const { return cell_count_[axis]; }
  // Position in sorted order of the first body in or after a cell. x and y may be one past the last cell.
  int first_in_cell(int x, int y, int z) const {
    return cell_start_[static_cast<std::size_t>(index(x, y, z))];
  }
  std::span<const std::int32_t> large_bodies() const { return large_bodies_; }

  // Calls found(i, j) once for every pair of bodies in the grid whose spheres overlap and whose first one in
  // sorted order lies in [begin, end).
  template <class Found>
  void for_each_pair(int begin, int end, Found found) const;
  // Calls found(i) for every body in the grid whose sphere's bounding box overlaps the box.
  template <class Found>
  void for_each_in_box(const Vec3& low, const Vec3& high, Found found) const;

 private:
  static constexpr int kMaxCellRuns = 5;  // of the 14 cells searched per body: half of its neighbourhood
  // Clamped to the grid; 0 for NaN.
  int cell_of(float u, int axis) const {
    const float c = (u - origin_[axis]) * inverse_size_;
    return !(c > 0.0F)                                      ? 0
           : c >= static_cast<float>(cell_count_[axis] - 1) ? cell_count_[axis] - 1
                                                            : static_cast<int>(c);
  }
  int index(int x, int y, int z) const { return (z * cell_count_[1] + y) * cell_count_[0] + x; }
  // Working memory of one member, on cache lines of its own.
  struct alignas(128) MemberState {
    Vec3 low, high;
    float max_radius;
    std::vector<std::int32_t> large;
    // Indexed by cell: number of the member's bodies, and slot in sorted order for the next one.
    std::vector<std::int32_t> cell_count, next_slot;
  };
  void compute_bounds(const Input&, std::span<const std::int32_t> own, MemberState&);
  void resize_cells(std::size_t bodies);
  void count_bodies(const Input&, std::span<const std::int32_t> own, MemberState&);
  void compute_cell_starts();
  void compute_member_slots(std::size_t member);
  void fill_cell_lines(const Input&, IndexRange lines);

  // Calls found(self, other) for the bodies in the runs whose spheres overlap that of the body at `self`.
  template <class Found>
  void test_runs(int self, std::span<const IndexRange> runs, Found& found) const;

  Vec3 origin_{0, 0, 0};
  float inverse_size_ = 1.0F;
  int cell_count_[3] = {1, 1, 1};
  std::vector<std::int32_t> cell_start_;  // indexed by cell: first sorted position; one more at the end
  std::vector<std::int32_t> sorted_bodies_, large_bodies_;  // body indices
  std::vector<std::int32_t> sorted_cell_;                   // indexed by sorted position
  std::vector<float> x_, y_, z_, radius_;   // indexed by sorted position; kSimdPadding more at the end
  std::vector<MemberState> member_state_;   // one per member
  std::vector<std::int32_t> cell_of_body_;  // indexed by body; −1 if large
};

template <class Found>
void UniformGrid::test_runs(int self, std::span<const IndexRange> runs, Found& found) const {
  constexpr int kMaxBatch = 256;
  std::int32_t overlapping[kMaxBatch + kSimdPadding];
  auto test_batch = [&](std::span<const IndexRange> state) {
    const int count =
        find_overlaps({x_.data(), y_.data(), z_.data(), radius_.data()}, self, state, overlapping);
    for (int k = 0; k < count; ++k)
      found(sorted_bodies_[static_cast<std::size_t>(self)],
            sorted_bodies_[static_cast<std::size_t>(overlapping[k])]);
  };
  int total = 0;
  for (const IndexRange& run : runs) total += run.end - run.begin;
  if (total <= kMaxBatch) return test_batch(runs);
  for (const IndexRange& run : runs)
    for (int from = run.begin; from < run.end; from += kMaxBatch) {
      const IndexRange state{from, std::min(run.end, from + kMaxBatch)};
      test_batch({&state, 1});
    }
}

template <class Found>
void UniformGrid::for_each_pair(int begin, int end, Found found) const {
  for (int self = begin; self < end; ++self) {
    const int cell = sorted_cell_[static_cast<std::size_t>(self)];
    const int cx = cell % cell_count_[0], cy = cell / cell_count_[0] % cell_count_[1],
              cz = cell / cell_count_[0] / cell_count_[1];
    const int x0 = cx > 0 ? cx - 1 : 0, x1 = cx + 1 < cell_count_[0] ? cx + 1 : cx;
    IndexRange runs[kMaxCellRuns] = {
        {self + 1, cell_start_[static_cast<std::size_t>(index(x1, cy, cz)) + 1]}};
    std::size_t n = 1;
    for (int z = cz; z <= cz + 1 && z < cell_count_[2]; ++z)
      for (int y = z == cz ? cy + 1 : cy - 1; y <= cy + 1; ++y)
        if (y >= 0 && y < cell_count_[1])
          runs[n++] = {cell_start_[static_cast<std::size_t>(index(x0, y, z))],
                       cell_start_[static_cast<std::size_t>(index(x1, y, z)) + 1]};
    test_runs(self, {runs, n}, found);
  }
}

template <class Found>
void UniformGrid::for_each_in_box(const Vec3& low, const Vec3& high, Found found) const {
  if (sorted_bodies_.empty()) return;
  // A cell is twice the largest radius wide, so spheres stick out of their cell by at most half its size.
  const float max_radius = 0.5F / inverse_size_;
  int from[3], to[3];
  for (int k = 0; k < 3; ++k)
    from[k] = cell_of(low[k] - max_radius, k), to[k] = cell_of(high[k] + max_radius, k);
  for (int z = from[2]; z <= to[2]; ++z)
    for (int y = from[1]; y <= to[1]; ++y) {
      const int last = cell_start_[static_cast<std::size_t>(index(to[0], y, z)) + 1];
      for (int k = cell_start_[static_cast<std::size_t>(index(from[0], y, z))]; k < last; ++k) {
        const auto i = static_cast<std::size_t>(k);
        const float radius = radius_[i];
        const bool overlaps = x_[i] + radius > low.x() && x_[i] - radius < high.x() &&
                              y_[i] + radius > low.y() && y_[i] - radius < high.y() &&
                              z_[i] + radius > low.z() && z_[i] - radius < high.z();
        if (overlaps) found(sorted_bodies_[i]);
      }
    }
}

}  // namespace smartsurf::world

// The broad phase: a uniform grid over bodies of similar size; the few much larger ones look into its cells.
//
// Bodies are sorted by cell, so that three neighbouring cells of a row are one run of memory. The order of
// what it finds depends on positions and indices alone.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/world/GridKernels.h"
#include "smartsurf/world/Team.h"
#include "smartsurf/world/Vec.h"

namespace smartsurf::world {

class Grid {
 public:
  // What build() sorts in: every body, where it is and the radius about it within which it can touch
  // anything. Ones with reach above `large` are kept apart.
  struct Input {
    std::span<const Vec3> position;
    std::span<const float> reach;
    float large;
  };
  // All members of the team together, each with bodies of its own that together are all; best those which lie
  // in its part of the table; one alone brings them in the order of their indices. The last of them may still
  // be at work: meet before asking.
  void build(const Input&, std::span<const std::int32_t> own, const Member&);

  std::int32_t body(int sorted) const { return order_[static_cast<std::size_t>(sorted)]; }
  int sorted() const { return static_cast<int>(order_.size()); }
  // Cells along x, y, z; sorted order is theirs, x running fastest, z slowest.
  int cells(int axis) const { return count_[axis]; }
  // The first body in or after a cell, in sorted order. x and y may be one more than there are.
  int first_in(int x, int y, int z) const { return first_[static_cast<std::size_t>(index(x, y, z))]; }
  std::span<const std::int32_t> large() const { return large_; }

  // Calls found(i, j), i ≠ j, for every pair of small bodies whose spheres meet, the earlier of which is at
  // [begin, end) in sorted order. Each pair once.
  template <class Found>
  void for_pairs(int begin, int end, Found found) const;
  // Calls found(i) for every small body whose sphere meets the box.
  template <class Found>
  void for_box(const Vec3& low, const Vec3& high, Found found) const;

 private:
  static constexpr int kMostRuns = 5;  // of cells that a body's pairs may lie in
  // 0 for what is not a number too.
  int cell_of(float u, int axis) const {
    const float c = (u - origin_[axis]) * inverse_size_;
    return !(c > 0.0F)                                 ? 0
           : c >= static_cast<float>(count_[axis] - 1) ? count_[axis] - 1
                                                       : static_cast<int>(c);
  }
  int index(int x, int y, int z) const { return (z * count_[1] + y) * count_[0] + x; }
  // Of one member.
  struct alignas(128) Part {
    Vec3 low, high;
    float widest;
    std::vector<std::int32_t> large;
    std::vector<std::int32_t> count, next;  // of each cell: its own bodies, and where the next one goes
  };
  void measure(const Input&, std::span<const std::int32_t> own, Part&);
  void make_cells(std::size_t bodies);
  void count(const Input&, std::span<const std::int32_t> own, Part&);
  void find_cells();
  void find_places(std::size_t member);
  void fill_cells(const Input&, Range lines);

  // Calls found(self, other) for those of the runs that meet the one at `self`.
  template <class Found>
  void scan(int self, std::span<const Range> runs, Found& found) const;

  Vec3 origin_{0, 0, 0};
  float inverse_size_ = 1.0F;
  int count_[3] = {1, 1, 1};
  std::vector<std::int32_t> first_;          // of each cell, in sorted order; one more at the end
  std::vector<std::int32_t> order_, large_;  // body indices
  std::vector<std::int32_t> cell_;           // of each sorted body
  std::vector<float> x_, y_, z_, reach_;     // of each sorted body, and kSpare more
  std::vector<Part> part_;                   // one a member
  std::vector<std::int32_t> cell_of_body_;   // −1: large
};

template <class Found>
void Grid::scan(int self, std::span<const Range> runs, Found& found) const {
  constexpr int kMost = 256;
  std::int32_t near[kMost + kSpare];
  auto look = [&](std::span<const Range> part) {
    const int count = find_near({x_.data(), y_.data(), z_.data(), reach_.data()}, self, part, near);
    for (int k = 0; k < count; ++k)
      found(order_[static_cast<std::size_t>(self)], order_[static_cast<std::size_t>(near[k])]);
  };
  int all = 0;
  for (const Range& run : runs) all += run.end - run.begin;
  if (all <= kMost) return look(runs);
  for (const Range& run : runs)
    for (int from = run.begin; from < run.end; from += kMost) {
      const Range part{from, std::min(run.end, from + kMost)};
      look({&part, 1});
    }
}

template <class Found>
void Grid::for_pairs(int begin, int end, Found found) const {
  for (int self = begin; self < end; ++self) {
    const int cell = cell_[static_cast<std::size_t>(self)];
    const int cx = cell % count_[0], cy = cell / count_[0] % count_[1], cz = cell / count_[0] / count_[1];
    const int x0 = cx > 0 ? cx - 1 : 0, x1 = cx + 1 < count_[0] ? cx + 1 : cx;
    Range runs[kMostRuns] = {{self + 1, first_[static_cast<std::size_t>(index(x1, cy, cz)) + 1]}};
    std::size_t n = 1;
    for (int z = cz; z <= cz + 1 && z < count_[2]; ++z)
      for (int y = z == cz ? cy + 1 : cy - 1; y <= cy + 1; ++y)
        if (y >= 0 && y < count_[1])
          runs[n++] = {first_[static_cast<std::size_t>(index(x0, y, z))],
                       first_[static_cast<std::size_t>(index(x1, y, z)) + 1]};
    scan(self, {runs, n}, found);
  }
}

template <class Found>
void Grid::for_box(const Vec3& low, const Vec3& high, Found found) const {
  if (order_.empty()) return;
  // Bodies of a cell reach out of it by no more than half its size.
  const float out = 0.5F / inverse_size_;
  int from[3], to[3];
  for (int k = 0; k < 3; ++k) from[k] = cell_of(low[k] - out, k), to[k] = cell_of(high[k] + out, k);
  for (int z = from[2]; z <= to[2]; ++z)
    for (int y = from[1]; y <= to[1]; ++y) {
      const int last = first_[static_cast<std::size_t>(index(to[0], y, z)) + 1];
      for (int k = first_[static_cast<std::size_t>(index(from[0], y, z))]; k < last; ++k) {
        const auto i = static_cast<std::size_t>(k);
        const float reach = reach_[i];
        const bool meets = x_[i] + reach > low.x() && x_[i] - reach < high.x() && y_[i] + reach > low.y() &&
                           y_[i] - reach < high.y() && z_[i] + reach > low.z() && z_[i] - reach < high.z();
        if (meets) found(order_[i]);
      }
    }
}

}  // namespace smartsurf::world

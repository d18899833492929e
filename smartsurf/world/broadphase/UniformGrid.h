// The broad phase: a uniform grid over bodies of similar size. The few much larger bodies are kept in a list
// and query the grid.
//
// A cell has a column, a layer and a slice. Layers are stacked along z, slices along y, or along x if the
// grid is longer there and has few cells along y, and columns follow each other along the axis that is left.
// Bodies are sorted by slice, then by layer, then by column: a region of slices is contiguous in memory, and
// so are neighbouring cells of a row, the columns of one layer and slice. While the cells are not many more
// than the bodies, an array over all cells holds where each begins; a sparse world has a list of its occupied
// rows instead, so that the cost depends on the bodies only, however far apart they are. A few bodies are
// sorted, for the order of the results, and all tested. Results and their order depend on positions and
// indices only, not on the number of members.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "smartsurf/world/body/Vec.h"
#include "smartsurf/world/broadphase/UniformGridKernels.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

class UniformGrid {
 public:
  // By body: position, and radius of the sphere within which it can touch anything in this step, u. Of these
  // bodies the grid holds those in `bodies`, ascending; those with radius > large_radius or a non-finite
  // position go to large_bodies(). The cost depends on the bodies in the grid only.
  struct Input {
    std::span<const Vec3> position;
    std::span<const float> radius;
    float large_radius;
    std::span<const std::int32_t> bodies;
  };
  // The calling thread's grid. A grid keeps nothing from step to step, so the worlds that a thread steps in
  // turn share its memory, which stays in the cache.
  static UniformGrid& of_this_thread();
  // Called by all members of the team; the `own` lists together are Input::bodies. Fastest if the
  // bodies of a member lie close together. A single member must list them in ascending order. Members must
  // pass a barrier before they query the grid.
  void build(const Input&, std::span<const std::int32_t> own, const Member&);

  std::int32_t body(int sorted) const { return sorted_bodies_[sorted]; }
  int sorted_count() const { return static_cast<int>(sorted_bodies_.size()); }
  // The axis along which slices are stacked: 0 (x) or 1 (y).
  int slice_axis() const { return axis_[kSlice]; }
  // An occupied row, of more than kFew bodies. Its bodies reach up to `begin` of the next row, in sorted
  // order.
  struct Row {
    std::int32_t slice, layer, begin;
  };
  // In sorted order, with one more at the end whose `begin` is sorted_count().
  std::span<const Row> rows() const { return rows_; }
  // The column of a body, of more than kFew.
  int column(int sorted) const { return column_[sorted]; }
  std::span<const std::int32_t> large_bodies() const { return large_bodies_; }

  // Calls found(i, j) once for every pair of bodies in the grid whose spheres overlap and whose first one in
  // sorted order lies in [begin, end).
  template <class Found>
  void for_each_pair(int begin, int end, Found found) const;
  // Calls found(i) for every body in the grid whose sphere's bounding box overlaps the box.
  template <class Found>
  void for_each_in_box(const Vec3& low, const Vec3& high, Found found) const;

 private:
  static constexpr std::size_t kFew = 16;  // so many are all tested with each other
  static constexpr int kMaxCellRuns = 5;   // of the 14 cells searched per body: half of its neighbourhood
  enum Coordinate { kColumn, kLayer, kSlice };
  // A coordinate of the cell of a position. Clamped to the grid; 0 for NaN. In double precision where there
  // are too many cells for single precision.
  int cell_of(const Vec3& position, Coordinate k) const {
    const float u = position[axis_[k]], origin = origin_[k];
    auto clamped = [last = cell_count_[k] - 1](auto c) {
      return !(c > 0) ? 0 : c >= static_cast<decltype(c)>(last) ? last : static_cast<int>(c);
    };
    if (is_dense_) return clamped((u - origin) * inverse_size_);
    return clamped((static_cast<double>(u) - static_cast<double>(origin)) *
                   static_cast<double>(inverse_size_));
  }
  // The place of a cell in the order of the cells.
  std::uint64_t key_of(const Vec3& position) const {
    const auto at = [&](Coordinate k) { return static_cast<std::uint64_t>(cell_of(position, k)); };
    const auto count = [&](Coordinate k) { return static_cast<std::uint64_t>(cell_count_[k]); };
    return (at(kSlice) * count(kLayer) + at(kLayer)) * count(kColumn) + at(kColumn);
  }
  // Dense only.
  int row_index(int layer, int slice) const { return slice * cell_count_[kLayer] + layer; }
  int index(int column, int layer, int slice) const {
    return row_index(layer, slice) * cell_count_[kColumn] + column;
  }
  // A body, its cell and that one's slice.
  struct CellBody {
    std::int32_t cell, slice, body;
  };
  // Working memory of one member, on cache lines of its own.
  struct alignas(128) MemberState {
    Vec3 low, high;
    float max_radius;
    std::vector<std::int32_t> small, large;      // of its bodies
    std::vector<CellBody> in_slices, elsewhere;  // dense: bodies in its slices; its bodies in others'
  };
  // A body and the place of its cell in the order of the cells.
  struct BodyKey {
    std::uint64_t key;
    std::int32_t body;
  };
  void compute_bounds(const Input&, std::span<const std::int32_t> own, MemberState&);
  void resize_cells(std::size_t bodies);
  void sort_few(const Input&);
  void sort_dense(const Input&, const Member&);
  void compute_row_starts();
  void sort_sparse(const Input&, std::span<const std::int32_t> own, const Member&);
  void collect_keys(std::span<const std::int32_t> bodies);
  void sort_keys();
  void find_rows();
  void fill_spheres(const Input&, IndexRange sorted);
  // The row of the body at a sorted position.
  const Row* row_of(int sorted) const {
    return &*std::ranges::upper_bound(rows_, sorted, {}, &Row::begin) - 1;
  }
  // Sparse only. Index of a row, or of the next one after it in sorted order.
  int find_row(int layer, int slice) const;
  // Sparse only. The bodies of a row in the columns `first` to `last`.
  IndexRange find_in_row(const Row* row, int first, int last) const;

  // Calls found(self, other) for the bodies in the runs whose spheres overlap that of the body at `self`.
  template <class Found>
  void test_runs(int self, std::span<const IndexRange> runs, Found& found) const;
  template <class Found>
  void for_each_pair_dense(int begin, int end, Found& found) const;
  template <class Found>
  void for_each_pair_sparse(int begin, int end, Found& found) const;
  // Calls found for the bodies at sorted positions [from, to) whose sphere's bounding box overlaps the box.
  template <class Found>
  void test_box(const Vec3& low, const Vec3& high, IndexRange sorted, Found& found) const;

  int axis_[3] = {0, 2, 1};      // by coordinate: along x, y or z
  float origin_[3] = {0, 0, 0};  // by coordinate, like the next
  int cell_count_[3] = {1, 1, 1};
  float inverse_size_ = 1.0F;
  bool is_dense_ = true, is_few_ = true;
  std::vector<std::int32_t>
      cell_start_;  // dense, by cell: first position in sorted order; one more at the end
  std::vector<std::int32_t> row_start_;  // dense, the same of rows, occupied or not
  std::vector<Row> rows_;
  std::vector<std::int32_t> sorted_bodies_, large_bodies_;  // body indices
  std::vector<std::int32_t> column_;                        // by sorted position
  std::vector<float> x_, y_, z_, radius_;    // by sorted position, kSimdPadding more at the end
  std::vector<MemberState> member_state_;    // one per member
  std::vector<std::uint8_t> is_large_;       // by body
  std::vector<std::uint64_t> key_of_body_;   // by body; sparse only
  std::vector<BodyKey> keys_, sorted_keys_;  // by sorted position
};

template <class Found>
void UniformGrid::test_runs(int self, std::span<const IndexRange> runs, Found& found) const {
  constexpr int kMaxBatch = 256;
  std::int32_t overlapping[kMaxBatch + kSimdPadding];
  const auto test_batch = [&](std::span<const IndexRange> state) {
    const int count =
        find_overlaps({x_.data(), y_.data(), z_.data(), radius_.data()}, self, state, overlapping);
    for (int k = 0; k < count; ++k) found(sorted_bodies_[self], sorted_bodies_[overlapping[k]]);
  };
  int total = 0;
  for (const IndexRange& run : runs) total += run.end - run.begin;
  if (total == 0) return;
  if (total <= kMaxBatch) return test_batch(runs);
  for (const IndexRange& run : runs)
    for (int from = run.begin; from < run.end; from += kMaxBatch) {
      const IndexRange state{from, std::min(run.end, from + kMaxBatch)};
      test_batch({&state, 1});
    }
}

template <class Found>
void UniformGrid::for_each_pair(int begin, int end, Found found) const {
  if (begin >= end) return;
  if (is_few_)
    for (IndexRange later{begin + 1, sorted_count()}; begin < end; ++begin, ++later.begin)
      test_runs(begin, {&later, 1}, found);
  else if (is_dense_)
    for_each_pair_dense(begin, end, found);
  else
    for_each_pair_sparse(begin, end, found);
}

template <class Found>
void UniformGrid::for_each_pair_dense(int begin, int end, Found& found) const {
  const Row* row = row_of(begin);
  for (int self = begin; self < end; ++self) {
    while (self >= (row + 1)->begin) ++row;
    const int at = column(self), first = at > 0 ? at - 1 : 0,
              last = at + 1 < cell_count_[kColumn] ? at + 1 : at;
    IndexRange runs[kMaxCellRuns] = {{self + 1, cell_start_[index(last, row->layer, row->slice) + 1]}};
    std::size_t n = 1;
    for (int slice = row->slice; slice <= row->slice + 1 && slice < cell_count_[kSlice]; ++slice)
      for (int layer = row->layer + (slice == row->slice ? 1 : -1); layer <= row->layer + 1; ++layer)
        if (layer >= 0 && layer < cell_count_[kLayer])
          runs[n++] = {cell_start_[index(first, layer, slice)], cell_start_[index(last, layer, slice) + 1]};
    // In a small world one run over the bodies between costs less: those that are not near do not overlap
    // either.
    constexpr int kShortRun = 16;
    const int end_of_runs = runs[n - 1].end;
    if (end_of_runs - self <= kShortRun) runs[0].end = end_of_runs, n = 1;
    test_runs(self, {runs, n}, found);
  }
}

// The neighbouring cells of a row's bodies advance along the neighbouring rows as the bodies do along theirs,
// so one cursor per row finds them all in a single pass.
template <class Found>
void UniformGrid::for_each_pair_sparse(int begin, int end, Found& found) const {
  const Row* row = row_of(begin);
  for (int self = begin; self < end; ++row) {
    IndexRange cursors[kMaxCellRuns] = {{self + 1, self + 1}};
    int row_ends[kMaxCellRuns] = {(row + 1)->begin};
    std::size_t n = 1;
    for (const auto& [layer, slice] :
         {std::pair{row->layer + 1, row->slice}, std::pair{row->layer - 1, row->slice + 1},
          std::pair{row->layer, row->slice + 1}, std::pair{row->layer + 1, row->slice + 1}}) {
      const Index r = find_row(layer, slice);
      if (r + 1 == std::ssize(rows_) || rows_[r].layer != layer || rows_[r].slice != slice) continue;
      const int first = find_in_row(&rows_[r], column(self) - 1, column(self)).begin;
      cursors[n] = {first, first};
      row_ends[n++] = rows_[r + 1].begin;
    }
    for (const int row_end = std::min(end, (row + 1)->begin); self < row_end; ++self) {
      cursors[0].begin = self + 1;
      cursors[0].end = std::max(cursors[0].end, self + 1);
      for (std::size_t k = 0; k < n; ++k) {
        IndexRange& near = cursors[k];
        if (k > 0)
          while (near.begin < row_ends[k] && column(near.begin) < column(self) - 1) ++near.begin;
        near.end = std::max(near.end, near.begin);
        while (near.end < row_ends[k] && column(near.end) <= column(self) + 1) ++near.end;
      }
      test_runs(self, {cursors, n}, found);
    }
  }
}

template <class Found>
void UniformGrid::test_box(const Vec3& low, const Vec3& high, IndexRange sorted, Found& found) const {
  for (Index i = sorted.begin; i < sorted.end; ++i) {
    const float radius = radius_[i];
    const bool overlaps = x_[i] + radius > low.x() && x_[i] - radius < high.x() && y_[i] + radius > low.y() &&
                          y_[i] - radius < high.y() && z_[i] + radius > low.z() && z_[i] - radius < high.z();
    if (overlaps) found(sorted_bodies_[i]);
  }
}

template <class Found>
void UniformGrid::for_each_in_box(const Vec3& low, const Vec3& high, Found found) const {
  if (sorted_bodies_.empty()) return;
  if (is_few_) return test_box(low, high, {0, sorted_count()}, found);
  // A cell is twice the largest radius wide, so spheres stick out of their cell by at most half its size.
  const Vec3 reach = Vec3::Constant(0.5F / inverse_size_);
  int from[3], to[3];
  for (const Coordinate k : {kColumn, kLayer, kSlice})
    from[k] = cell_of(low - reach, k), to[k] = cell_of(high + reach, k);
  if (is_dense_) {
    for (int slice = from[kSlice]; slice <= to[kSlice]; ++slice)
      for (int layer = from[kLayer]; layer <= to[kLayer]; ++layer)
        test_box(low, high,
                 {cell_start_[index(from[kColumn], layer, slice)],
                  cell_start_[index(to[kColumn], layer, slice) + 1]},
                 found);
    return;
  }
  auto row_at = [this](int layer, int slice) { return &rows_[find_row(layer, slice)]; };
  for (const Row* row = row_at(from[kLayer], from[kSlice]);
       row != &rows_.back() && row->slice <= to[kSlice];) {
    if (row->layer < from[kLayer])
      row = row_at(from[kLayer], row->slice);
    else if (row->layer > to[kLayer])
      row = row_at(from[kLayer], row->slice + 1);
    else
      test_box(low, high, find_in_row(row++, from[kColumn], to[kColumn]), found);
  }
}

}  // namespace smartsurf::world

// Partitions the bodies into slabs of the grid, so that each thread works on one region through a whole step:
// the region stays in the cache of its core, and only contacts across slab boundaries cause cache traffic.
// The narrow phase may hand slabs next to a boundary to the neighbour (SlabQueue).
//
// Slabs are stacked along y, or along x if the grid is longer there and has few cells along y. They depend on
// the bodies' positions only, not on the number of threads.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/UniformGrid.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

// The ranges of each slab's manifolds in a contact list.
struct SlabRanges {
  std::vector<IndexRange> range;
  std::vector<std::int32_t> first_range;  // indexed by slab: its first entry in `range`; one more at the end
  std::size_t manifold_count = 0;         // of all slabs

  // The ranges of several slabs.
  std::span<const IndexRange> of(IndexRange slabs) const {
    const std::size_t begin = first_range[slabs.begin];
    const std::size_t end = first_range[slabs.end];
    return std::span(range).subspan(begin, end - begin);
  }
};

class SpatialPartition {
 public:
  // Bodies of one slab that are contiguous in the grid's sorted order: positions [begin, end).
  struct BodyRun {
    int begin, end, slab;
  };

  // Partitions the bodies of the grid, which are some of `bodies`. Its large bodies form the last slab, which
  // has the last body run.
  void build(const UniformGrid&, int bodies);

  int slab_count() const { return static_cast<int>(first_row_.size()) - 1; }
  // In sorted order of the grid.
  std::span<const BodyRun> body_runs() const { return body_run_; }
  // Indices of a slab's body runs, in sorted order of the grid. Contiguous in memory from slab to slab.
  std::span<const std::int32_t> body_runs_of(int slab) const {
    const Index s = slab;
    return std::span(runs_by_slab_)
        .subspan(first_run_of_slab_[s], first_run_of_slab_[s + 1] - first_run_of_slab_[s]);
  }
  // Position of the slab's first body run, if runs are ordered by slab.
  std::size_t first_body_run_of(int slab) const { return first_run_of_slab_[slab]; }

  // The slabs of a member. Members get about equal numbers of bodies or, after set_contact_counts(), about
  // equal estimated work.
  IndexRange share(const Member&) const;
  // Number of contacts in each slab, as a weight for share().
  void set_contact_counts(std::span<const std::size_t> contacts);

  // ---- rows: one per body, ordered by slab; within a slab active bodies come first
  // Assigns the rows of the member's slabs. Members must pass a barrier before they read rows of others.
  void assign_rows(const BodyStore&, const UniformGrid&, const Member&);
  // Adds a row for a body that is not in the grid and not active, unless it has one: it moves no more than a
  // static body, but solvers read it. After assign_rows(), from one thread.
  void add_row(std::int32_t body);
  int row_count() const { return first_row_.empty() ? 0 : first_row_.back(); }
  IndexRange rows_of(int slab) const { return {first_row_[slab], first_row_[slab + 1]}; }
  IndexRange rows_of(IndexRange slabs) const { return {first_row_[slabs.begin], first_row_[slabs.end]}; }
  IndexRange active_rows_of(int slab) const { return {first_row_[slab], active_end_[slab]}; }
  std::size_t body(int row) const { return body_of_row_[row]; }
  // The member's bodies as of the last assign_rows().
  std::span<const std::int32_t> bodies_of(const Member& member) const {
    const IndexRange rows = rows_of(share(member));
    return std::span(body_of_row_).subspan(rows.begin, rows.end - rows.begin);
  }
  std::int32_t row(std::int32_t body) const { return row_of_body_[body]; }

 private:
  // A line of cells across the slabs, in one layer, and its bodies.
  struct Line {
    std::int32_t at, bodies;
  };
  void count_bodies_on_lines(const UniformGrid&, int axis);
  void find_slab_edges(const UniformGrid&, int axis);
  void find_body_runs(const UniformGrid&, int axis);
  void group_body_runs(int slabs);

  std::vector<Line> lines_;     // in ascending order
  std::vector<int> slab_edge_;  // by slab: its first line; one more at the end
  std::vector<BodyRun> body_run_;
  std::vector<std::int32_t> runs_by_slab_;  // indices in body_run_, grouped by slab
  std::vector<std::size_t> first_run_of_slab_;
  std::vector<std::int32_t> first_row_, active_end_;  // indexed by slab; first_row_ has one more at the end
  std::int32_t added_rows_ = 0;                       // by add_row(), at the end
  std::vector<std::int32_t> body_of_row_, row_of_body_;
  std::vector<long> weight_prefix_;  // indexed by slab: total weight of earlier slabs; one more at the end
};

}  // namespace smartsurf::world

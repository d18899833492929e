// Cuts the table into slabs, so that each thread works on one part of it through a whole step: what lies
// there stays in its core's cache, and only what touches across a border travels.
//
// Slabs follow each other along y, or along x where the grid is longer there and has few lines along y. They
// depend on where the bodies are, not on threads.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/world/BodyStore.h"
#include "smartsurf/world/broadphase/UniformGrid.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

// Where in a list of manifolds those of each slab are.
struct SlabRanges {
  std::vector<IndexRange> range;
  std::vector<std::int32_t> first_range;  // run of each slab, and one more at the end
  std::size_t manifold_count = 0;         // of them all

  // Those of some slabs.
  std::span<const IndexRange> of(IndexRange slabs) const {
    const auto begin = static_cast<std::size_t>(first_range[static_cast<std::size_t>(slabs.begin)]);
    const auto end = static_cast<std::size_t>(first_range[static_cast<std::size_t>(slabs.end)]);
    return std::span(range).subspan(begin, end - begin);
  }
};

class SpatialPartition {
 public:
  // Bodies of one slab that follow each other in the grid's order: [begin, end) of it.
  struct BodyRun {
    int begin, end, slab;
  };

  // Cuts what is in the grid. The grid's large bodies are the last slab and the last piece.
  void build(const UniformGrid&);

  int slab_count() const { return static_cast<int>(first_row_.size()) - 1; }
  // In the grid's order.
  std::span<const BodyRun> body_runs() const { return body_run_; }
  // The pieces of a slab, as indices, in the grid's order; those of all slabs follow each other in memory.
  std::span<const std::int32_t> body_runs_of(int slab) const {
    const auto s = static_cast<std::size_t>(slab);
    return std::span(runs_by_slab_)
        .subspan(first_run_of_slab_[s], first_run_of_slab_[s + 1] - first_run_of_slab_[s]);
  }
  std::size_t first_body_run_of(int slab) const { return first_run_of_slab_[static_cast<std::size_t>(slab)]; }

  // One member's slabs: about as many bodies as those of the others, or, once they are weighed, about as
  // much work with as many contacts as there are in each.
  IndexRange share(const Member&) const;
  void set_contact_counts(std::span<const std::size_t> contacts);

  // ---- a row a body, slab after slab, in each slab first those that move. Fixed bodies' rows mean nothing.
  // The member's slabs are listed; wait before asking.
  void assign_rows(const BodyStore&, const UniformGrid&, const Member&);
  int row_count() const { return first_row_.empty() ? 0 : first_row_.back(); }
  IndexRange rows_of(int slab) const {
    return {first_row_[static_cast<std::size_t>(slab)], first_row_[static_cast<std::size_t>(slab) + 1]};
  }
  IndexRange rows_of(IndexRange slabs) const {
    return {first_row_[static_cast<std::size_t>(slabs.begin)],
            first_row_[static_cast<std::size_t>(slabs.end)]};
  }
  IndexRange active_rows_of(int slab) const {
    return {first_row_[static_cast<std::size_t>(slab)], active_end_[static_cast<std::size_t>(slab)]};
  }
  std::size_t body(int row) const {
    return static_cast<std::size_t>(body_of_row_[static_cast<std::size_t>(row)]);
  }
  // The member's bodies as they were listed last.
  std::span<const std::int32_t> bodies_of(const Member& member) const {
    const IndexRange rows = rows_of(share(member));
    return std::span(body_of_row_)
        .subspan(static_cast<std::size_t>(rows.begin), static_cast<std::size_t>(rows.end - rows.begin));
  }
  std::int32_t row(std::int32_t body) const { return row_of_body_[static_cast<std::size_t>(body)]; }

 private:
  void find_slab_edges(const UniformGrid&, int axis);
  void find_body_runs(const UniformGrid&, int axis);
  void group_body_runs(int slabs);

  std::vector<std::int32_t> bodies_on_line_;  // of the grid's cells across the axis
  std::vector<int> slab_edge_;                // lines: where each slab begins, and one more at the end
  std::vector<BodyRun> body_run_;
  std::vector<std::int32_t> runs_by_slab_;
  std::vector<std::size_t> first_run_of_slab_;
  std::vector<std::int32_t> first_row_, active_end_;
  std::vector<std::int32_t> body_of_row_, row_of_body_;
  std::vector<long> weight_prefix_;  // of each slab, that of all before it; one more at the end
};

}  // namespace smartsurf::world

// Partitions the bodies into slabs of the grid, so that each thread works on one region through a whole step:
// the region stays in the cache of its core, and only contacts across slab boundaries cause cache traffic.
// The narrow phase may hand slabs next to a boundary to the neighbour (SlabQueue).
//
// A slab is some consecutive slices of the grid, whose bodies lie together in its sorted order. Slabs depend
// on the bodies' positions only, not on the number of threads.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/broadphase/UniformGrid.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

// The range of each slab's manifolds in a contact list, which are in the order of the slabs.
struct SlabRanges {
  std::vector<std::int32_t> first{0};  // by slab: its first manifold; one more at the end

  int manifold_count() const { return first.back(); }
  IndexRange of(IndexRange slabs) const { return {first[slabs.begin], first[slabs.end]}; }
};

class SpatialPartition {
 public:
  // Partitions the bodies of the grid, which are some of `bodies`. Its large bodies form the last slab.
  void build(const UniformGrid&, int bodies);

  int slab_count() const { return static_cast<int>(first_row_.size()) - 1; }
  // The bodies of a slab but the last one, as positions in the sorted order of the grid.
  IndexRange sorted_bodies_of(int slab) const { return rows_of(slab); }

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
  void find_first_rows(const UniformGrid&);

  std::vector<std::int32_t> first_row_, active_end_;  // indexed by slab; first_row_ has one more at the end
  std::int32_t added_rows_ = 0;                       // by add_row(), at the end
  std::vector<std::int32_t> body_of_row_, row_of_body_;
  std::vector<long> weight_prefix_;  // indexed by slab: total weight of earlier slabs; one more at the end
};

}  // namespace smartsurf::world

// Detects objects that leave the table: their centre was within the outline of the cells and above the
// minimum pin height, and no longer is. Fixed objects and objects that were never over the table do not
// count.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/state/StateArchive.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/scene/TableFootprint.h"

namespace smartsurf::simulation {

class DepartureTracker {
 public:
  explicit DepartureTracker(const scene::SurfaceSpec&);

  // Call once per snapshot, in order of time. catalogue: every object ever created, index = id. Allocates
  // only when the catalogue has grown or more objects leave at once than ever before.
  void update(const scene::Snapshot&, const std::vector<scene::ObjectSpec>& catalogue);

  bool is_on_table(const std::array<float, 3>& position) const noexcept;

  // The ids that left between the last two snapshots, ascending.
  std::span<const scene::ObjectId> departed() const noexcept { return departed_; }
  std::uint64_t total_departures() const noexcept { return total_departures_; }
  // Number of objects of the last snapshot, including fixed ones, that are not over the table.
  std::size_t off_table_count() const noexcept { return off_table_count_; }

  void archive(common::StateArchive& a) { a(was_on_table_, departed_, total_departures_, off_table_count_); }

 private:
  scene::TableFootprint footprint_;
  double min_height_;
  std::vector<char> was_on_table_;  // index = id
  std::vector<scene::ObjectId> departed_;
  std::uint64_t total_departures_ = 0;
  std::size_t off_table_count_ = 0;
};

}  // namespace smartsurf::simulation

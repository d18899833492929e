// Detects objects that leave the table: their centre was within the outline of its cells and above its lowest
// height, and is no longer. Fixed objects, and objects that never were over the table, do not count.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/scene/TableFootprint.h"

namespace smartsurf::run {

class DepartureTracker {
 public:
  explicit DepartureTracker(const scene::SurfaceSpec&);

  // Once for each snapshot, in the order of time. catalogue: every object ever created, index = id. Allocates
  // only when it has grown, or as many objects leave as never before.
  void update(const scene::Snapshot&, const std::vector<scene::ObjectSpec>& catalogue);

  // Those that left between the last two snapshots, ascending.
  std::span<const scene::ObjectId> departed() const noexcept { return departed_; }
  std::uint64_t total_departures() const noexcept { return total_departures_; }
  // Objects of the last snapshot, fixed ones and all, that are not over the table.
  std::size_t off_table_count() const noexcept { return off_table_count_; }

 private:
  bool is_on_table(const std::array<float, 3>& position) const noexcept;

  scene::TableFootprint footprint_;
  double min_height_;
  std::vector<char> was_on_table_;  // by id
  std::vector<scene::ObjectId> departed_;
  std::uint64_t total_departures_ = 0;
  std::size_t off_table_count_ = 0;
};

}  // namespace smartsurf::run

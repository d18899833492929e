#include "smartsurf/simulation/DepartureTracker.h"

namespace smartsurf::simulation {

DepartureTracker::DepartureTracker(const scene::SurfaceSpec& surface)
    : footprint_(surface), min_height_(surface.pin.min_height) {}

bool DepartureTracker::is_on_table(const std::array<float, 3>& p) const noexcept {
  return p[2] > min_height_ && footprint_.contains(p[0], p[1]);
}

void DepartureTracker::update(const scene::Snapshot& snapshot,
                              const std::vector<scene::ObjectSpec>& catalogue) {
  was_on_table_.resize(catalogue.size(), 0);
  departed_.clear();
  off_table_count_ = 0;
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    const scene::ObjectId id = snapshot.id[i];
    const bool on_table = is_on_table(snapshot.position[i]);
    off_table_count_ += on_table ? 0 : 1;
    if (was_on_table_[id] != 0 && !on_table && !catalogue[id].fixed) departed_.push_back(id);
    was_on_table_[id] = on_table ? 1 : 0;
  }
  total_departures_ += departed_.size();
}

}  // namespace smartsurf::simulation

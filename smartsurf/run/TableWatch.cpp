#include "smartsurf/run/TableWatch.h"

namespace smartsurf::run {

TableWatch::TableWatch(const scene::SurfaceSpec& surface)
    : outline_(surface), lowest_(surface.pin.min_height) {}

bool TableWatch::is_over(const std::array<float, 3>& p) const noexcept {
  return p[2] > lowest_ && outline_.holds(p[0], p[1]);
}

void TableWatch::watch(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue) {
  was_over_.resize(catalogue.size(), 0);
  left_.clear();
  off_ = 0;
  for (std::size_t i = 0; i < snapshot.objects(); ++i) {
    const scene::ObjectId id = snapshot.id[i];
    const bool over = is_over(snapshot.position[i]);
    off_ += over ? 0 : 1;
    if (was_over_[id] != 0 && !over && !catalogue[id].fixed) left_.push_back(id);
    was_over_[id] = over ? 1 : 0;
  }
  left_so_far_ += left_.size();
}

}  // namespace smartsurf::run

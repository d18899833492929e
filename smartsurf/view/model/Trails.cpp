#include "smartsurf/view/model/Trails.h"

#include <algorithm>
#include <cmath>

#include "smartsurf/view/model/Palette.h"
#include "smartsurf/view/model/Signal.h"

namespace smartsurf::view {
namespace {

constexpr std::size_t kMaxPoints = 400;  // per object

}  // namespace

void Trails::clear() {
  points_.clear();
  started_ = false;
}

void Trails::add_points(const scene::Snapshot& snapshot) {
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    std::deque<Point>& trail = points_[snapshot.id[i]];
    const auto& p = snapshot.position[i];
    const bool moved =
        trail.empty() || std::hypot(p[0] - trail.back().position[0], p[1] - trail.back().position[1],
                                    p[2] - trail.back().position[2]) > min_step_;
    if (moved) trail.push_back({p, snapshot.time_s});
  }
}

void Trails::add(const FrameInput& input, double length_s) {
  const scene::Snapshot& snapshot = input.snapshot;
  const bool continues =
      started_ && length_s <= length_s_ && snapshot.time_s >= now_s_ && snapshot.time_s <= now_s_ + length_s;
  if (!continues) clear();
  points_.resize(input.catalogue.size());
  if (!continues && input.history)
    for (std::uint64_t frame = input.history->frame_at(snapshot.time_s - length_s);
         frame < input.history->end() && input.history->time_s(frame) < snapshot.time_s; ++frame)
      add_points(input.history->snapshot(frame));
  started_ = true;
  now_s_ = snapshot.time_s;
  length_s_ = length_s;
  add_points(snapshot);
  for (auto& trail : points_)
    while (!trail.empty() && (trail.front().time_s < now_s_ - length_s_ || trail.size() > kMaxPoints))
      trail.pop_front();
}

void Trails::append_lines(const std::vector<scene::ObjectSpec>& catalogue, std::vector<Line>& lines) const {
  for (std::size_t id = 0; id < points_.size() && id < catalogue.size(); ++id) {
    const scene::Colour& c = catalogue[id].colour;
    const auto& trail = points_[id];
    const auto radius = static_cast<float>(catalogue[id].half_extents().maxCoeff());
    const auto is_inside = [&](const std::array<float, 3>& p) {
      const auto& end = trail.back().position;
      return std::hypot(p[0] - end[0], p[1] - end[1], p[2] - end[2]) < radius;
    };
    for (std::size_t i = 1; i < trail.size(); ++i) {
      if (is_inside(trail[i - 1].position) && is_inside(trail[i].position)) continue;  // hidden by the object
      const double age = (now_s_ - trail[i].time_s) / std::max(length_s_, 1e-9);
      lines.push_back({trail[i - 1].position,
                       trail[i].position,
                       {to_byte(c.r), to_byte(c.g), to_byte(c.b), to_byte(static_cast<float>(1.0 - age))}});
    }
  }
}

}  // namespace smartsurf::view

#include "smartsurf/view/model/Trails.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::view {
namespace {

constexpr std::size_t kMostPoints = 400;  // of one object

std::uint8_t byte(float value) {
  return static_cast<std::uint8_t>(std::clamp(value, 0.0F, 1.0F) * 255.0F + 0.5F);
}

}  // namespace

void Trails::clear() { points_.clear(); }

void Trails::add(const FrameInput& moment, double length_s) {
  const scene::Snapshot& snapshot = moment.snapshot;
  if (snapshot.time_s < now_s_ || snapshot.time_s > now_s_ + length_s) clear();
  now_s_ = snapshot.time_s;
  length_s_ = length_s;
  points_.resize(moment.catalogue.size());
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    std::deque<Point>& way = points_[snapshot.id[i]];
    const auto& p = snapshot.position[i];
    const bool moved = way.empty() || std::hypot(p[0] - way.back().at[0], p[1] - way.back().at[1],
                                                 p[2] - way.back().at[2]) > least_step_;
    if (moved) way.push_back({p, now_s_});
  }
  for (auto& way : points_)
    while (!way.empty() && (way.front().time_s < now_s_ - length_s_ || way.size() > kMostPoints))
      way.pop_front();
}

void Trails::append_lines(const std::vector<scene::ObjectSpec>& catalogue, std::vector<Line>& lines) const {
  for (std::size_t id = 0; id < points_.size() && id < catalogue.size(); ++id) {
    const scene::Colour& c = catalogue[id].colour;
    const auto& way = points_[id];
    for (std::size_t i = 1; i < way.size(); ++i) {
      const double age = (now_s_ - way[i].time_s) / std::max(length_s_, 1e-9);
      lines.push_back(
          {way[i - 1].at,
           way[i].at,
           {byte(0.85F * c.r), byte(0.85F * c.g), byte(0.85F * c.b), byte(static_cast<float>(1.0 - age))}});
    }
  }
}

}  // namespace smartsurf::view

#include "smartsurf/view/model/PlotHistory.h"

#include <cmath>
#include <limits>

namespace smartsurf::view {
namespace {

constexpr std::size_t kMostSamples = 600;
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

}  // namespace

void PlotHistory::sample(const char* name, const char* unit, float value) {
  if (next_trace_ == traces_.size()) traces_.push_back({name, unit, {}});
  std::vector<float>& values = traces_[next_trace_++].values;
  if (values.size() == kMostSamples) values.erase(values.begin());
  values.push_back(value);
}

void PlotHistory::add(const Thing& thing, const scene::SurfaceSpec& surface, const FrameInput& moment) {
  const scene::Snapshot& snapshot = moment.snapshot;
  if (!(thing == thing_) || (!times_.empty() && snapshot.time_s < times_.back())) {
    traces_.clear();
    times_.clear();
    thing_ = thing;
  }
  if (!times_.empty() && snapshot.time_s == times_.back()) return;
  if (times_.size() == kMostSamples) times_.erase(times_.begin());
  times_.push_back(snapshot.time_s);
  next_trace_ = 0;
  if (thing.kind == Thing::Kind::kObject) {
    const auto i = index_of(snapshot, thing.object);
    const auto& v = i ? snapshot.velocity[*i] : std::array<float, 3>{kNone, kNone, kNone};
    const auto& w = i ? snapshot.angular_velocity[*i] : std::array<float, 3>{kNone, kNone, kNone};
    sample("z", "u", i ? snapshot.position[*i][2] : kNone);
    sample("speed", "u/s", std::hypot(v[0], v[1], v[2]));
    sample("spin", "rad/s", std::hypot(w[0], w[1], w[2]));
    return;
  }
  const std::size_t cell = static_cast<std::size_t>(surface.index(thing.row, thing.column));
  if (moment.channels.empty()) sample("height", "u", snapshot.height[cell]);
  for (const Channel& channel : moment.channels)
    sample(channel.name.c_str(), channel.unit.c_str(), channel.values.empty() ? kNone : channel.values[cell]);
}

}  // namespace smartsurf::view

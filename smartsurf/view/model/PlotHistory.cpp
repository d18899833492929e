#include "smartsurf/view/model/PlotHistory.h"

#include <cmath>
#include <limits>

namespace smartsurf::view {
namespace {

constexpr std::size_t kMaxSamples = 600;
constexpr float kNoValue = std::numeric_limits<float>::quiet_NaN();

}  // namespace

void PlotHistory::add_sample(const char* name, const char* unit, float value) {
  if (next_series_ == series_.size()) series_.push_back({name, unit, {}});
  std::vector<float>& values = series_[next_series_++].values;
  if (values.size() == kMaxSamples) values.erase(values.begin());
  values.push_back(value);
}

void PlotHistory::add(const SceneItem& item, const scene::SurfaceSpec& surface, const FrameInput& input) {
  const scene::Snapshot& snapshot = input.snapshot;
  if (!(item == item_) || (!times_.empty() && snapshot.time_s < times_.back())) {
    series_.clear();
    times_.clear();
    item_ = item;
  }
  if (!times_.empty() && snapshot.time_s == times_.back()) return;
  if (times_.size() == kMaxSamples) times_.erase(times_.begin());
  times_.push_back(snapshot.time_s);
  next_series_ = 0;
  if (item.kind == SceneItem::Kind::kObject) {
    const auto i = find_object_index(snapshot, item.object);
    const auto& v = i ? snapshot.velocity[*i] : std::array<float, 3>{kNoValue, kNoValue, kNoValue};
    const auto& w = i ? snapshot.angular_velocity[*i] : std::array<float, 3>{kNoValue, kNoValue, kNoValue};
    add_sample("z", "u", i ? snapshot.position[*i][2] : kNoValue);
    add_sample("speed", "u/s", std::hypot(v[0], v[1], v[2]));
    add_sample("spin", "rad/s", std::hypot(w[0], w[1], w[2]));
    return;
  }
  const std::size_t cell = static_cast<std::size_t>(surface.index(item.row, item.column));
  if (input.channels.empty()) add_sample("height", "u", snapshot.height[cell]);
  for (const Channel& channel : input.channels)
    add_sample(channel.name.c_str(), channel.unit.c_str(),
               channel.values.empty() ? kNoValue : channel.values[cell]);
}

}  // namespace smartsurf::view

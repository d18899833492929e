#include "smartsurf/view/model/Signal.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/text/Number.h"

namespace smartsurf::view {
namespace {

constexpr std::string_view kMetricPrefix = "metric:";

}  // namespace

std::string to_string(const Signal& signal) {
  switch (signal.kind) {
    case Signal::Kind::kObject:
      return signal.quantity + ":" + std::to_string(signal.object);
    case Signal::Kind::kCell:
      return signal.quantity + ":" + std::to_string(signal.row) + "," + std::to_string(signal.column);
    case Signal::Kind::kMetric:
      return std::string(kMetricPrefix) + signal.quantity;
    case Signal::Kind::kRun:
      break;
  }
  return signal.quantity;
}

std::optional<Signal> parse_signal(std::string_view text) {
  Signal signal;
  if (text.starts_with(kMetricPrefix) && text.size() > kMetricPrefix.size()) {
    signal.kind = Signal::Kind::kMetric;
    signal.quantity = text.substr(kMetricPrefix.size());
    return signal;
  }
  const std::size_t colon = text.rfind(':');  // the channels "command: NAME" have one too
  signal.quantity = text.substr(0, colon);
  const bool is_object_quantity =
      std::ranges::find(kObjectQuantities, signal.quantity) != kObjectQuantities.end();
  if (colon == text.npos) {
    if (signal.quantity.empty() || is_object_quantity) return std::nullopt;
    if (std::ranges::find(kRunQuantities, signal.quantity) == kRunQuantities.end())
      signal.kind = Signal::Kind::kMetric;
    return signal;
  }
  const std::string_view index = text.substr(colon + 1);
  const std::size_t comma = index.find(',');
  if (comma == index.npos) {
    signal.kind = Signal::Kind::kObject;
    return is_object_quantity && common::parse_number(index, signal.object) ? std::optional(signal)
                                                                            : std::nullopt;
  }
  signal.kind = Signal::Kind::kCell;
  const bool valid = common::parse_number(index.substr(0, comma), signal.row) &&
                     common::parse_number(index.substr(comma + 1), signal.column) && signal.row >= 0 &&
                     signal.column >= 0 && !signal.quantity.empty();
  return valid ? std::optional(signal) : std::nullopt;
}

std::string unit_of(const Signal& signal, std::span<const Channel> channels) {
  if (signal.kind == Signal::Kind::kCell) {
    const auto channel = std::ranges::find(channels, signal.quantity, &Channel::name);
    return channel != channels.end() ? channel->unit : "";
  }
  if (signal.kind != Signal::Kind::kObject) return "";
  return signal.quantity == "speed" ? "u/s" : signal.quantity == "spin" ? "rad/s" : "u";
}

std::vector<Signal> signals_of(const SceneItem& item, std::span<const Channel> channels) {
  std::vector<Signal> signals;
  if (item.kind == SceneItem::Kind::kObject)
    for (const char* quantity : kObjectQuantities)
      signals.push_back({Signal::Kind::kObject, quantity, item.object, 0, 0});
  else
    for (const Channel& channel : channels)
      signals.push_back({Signal::Kind::kCell, channel.name, 0, item.row, item.column});
  return signals;
}

double object_value(const Signal& signal, const scene::Snapshot& snapshot) {
  const auto i = find_object_index(snapshot, signal.object);
  if (!i) return std::numeric_limits<double>::quiet_NaN();
  const auto norm = [](const std::array<float, 3>& v) {
    return std::hypot(double{v[0]}, double{v[1]}, double{v[2]});
  };
  if (signal.quantity == "speed") return norm(snapshot.velocity[*i]);
  if (signal.quantity == "spin") return norm(snapshot.angular_velocity[*i]);
  return snapshot.position[*i][signal.quantity[0] - 'x'];
}

std::uint64_t History::frame_at(double time) const {
  std::uint64_t low = begin(), high = end();
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (time_s(middle) < time)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

}  // namespace smartsurf::view

#include "smartsurf/surface/actuators/ActuatorFaults.h"

#include <algorithm>
#include <cmath>

#include "common/hash/SplitMix64.h"

namespace smartsurf::surface {
namespace {

// A hash of seed and counter: a cell's draw does not depend on the number of cells.
std::uint64_t draw(std::uint64_t seed, std::uint64_t counter) {
  return common::splitmix64(common::splitmix64(seed) ^ counter);
}

double uniform_random(std::uint64_t seed, std::uint64_t counter) {
  return static_cast<double>(draw(seed, counter) >> 11) * 0x1p-53;
}

}  // namespace

ActuatorFaults::ActuatorFaults(const scene::SurfaceSpec& surface,
                               std::span<const scene::ActuatorChannel> channels,
                               const scene::CellChannels& cell_channels, std::span<const int> actuated_cells,
                               const FaultMap& map, std::uint64_t seed)
    : cells_(surface.cell_count()), common_latency_(surface.faults.actuator.latency_ticks) {
  for (const scene::ActuatorChannel& channel : channels)
    channels_.push_back({channel, {}, {}, {}, common_latency_});
  draw_faults(surface.faults.actuator, cell_channels, actuated_cells, seed);
  for (const FaultEntry& entry : map.entries())
    for (std::size_t c = 0; c < channels_.size(); ++c) {
      ChannelFaults& channel = channels_[c];
      // Sensors have gains and offsets, too: an entry of all channels means theirs.
      const bool is_of_all = entry.channel.empty() && !needs_actuator_channel(entry.fault) &&
                             std::ranges::count(kActuatorFaults, entry.fault) > 0;
      if (entry.channel != channel.info.name && !is_of_all) continue;
      const std::size_t cell = surface.index(entry.row, entry.column);
      const scene::ActuatorChannel* own = cell_channels.find(c, cell);
      if (own == nullptr && is_of_all) continue;
      apply_entry(map, entry, channel, own == nullptr ? channel.info : *own, cell);
    }
}

void ActuatorFaults::set_cell(ChannelFaults& channel, std::size_t cell, float gain, float offset) {
  if (channel.gain.empty()) {
    channel.gain.assign(cells_, 1.0F);
    channel.offset.assign(cells_, 0.0F);
  }
  channel.gain[cell] = gain;
  channel.offset[cell] = offset;
}

// Sorts the cells by hash; the first are stuck, the next dead, the next weak.
void ActuatorFaults::draw_faults(const scene::ActuatorFaultSpec& spec,
                                 const scene::CellChannels& cell_channels,
                                 std::span<const int> actuated_cells, std::uint64_t seed) {
  std::vector<int> order(actuated_cells.begin(), actuated_cells.end());
  std::ranges::sort(
      order, {}, [seed](int cell) { return std::pair(draw(seed, static_cast<std::uint64_t>(cell)), cell); });
  const auto count = [&](double fraction) {
    return static_cast<std::size_t>(std::llround(fraction * static_cast<double>(actuated_cells.size())));
  };
  const std::size_t stuck_end = count(spec.stuck_fraction), dead_end = stuck_end + count(spec.dead_fraction),
                    weak_end = dead_end + count(spec.weak_fraction);
  for (std::size_t k = 0; k < std::min(weak_end, order.size()); ++k)
    for (std::size_t c = 0; c < channels_.size(); ++c) {
      const int cell = order[k];
      const scene::ActuatorChannel* own = cell_channels.find(c, cell);
      if (own == nullptr) continue;
      const double stuck_at =
          uniform_random(seed, (c + 1) * 0x100000000ULL + static_cast<std::uint64_t>(cell));
      if (k < stuck_end)
        set_cell(channels_[c], cell, 0.0F,
                 static_cast<float>(own->minimum + (own->maximum - own->minimum) * stuck_at));
      else if (k < dead_end)
        set_cell(channels_[c], cell, 0.0F, static_cast<float>(own->safe_value));
      else
        set_cell(channels_[c], cell, static_cast<float>(spec.weak_gain),
                 static_cast<float>((1.0 - spec.weak_gain) * own->safe_value));
    }
}

void ActuatorFaults::apply_entry(const FaultMap& map, const FaultEntry& entry, ChannelFaults& channel,
                                 const scene::ActuatorChannel& own, std::size_t cell) {
  const auto require_value = [&](double low, double high) {
    if (entry.value && *entry.value >= low && *entry.value <= high) return *entry.value;
    map.refuse(entry, "value of '" + entry.fault + "'" +
                          (entry.value ? " = " + scene::format_number(*entry.value) : " is missing") +
                          ": must be in [" + scene::format_number(low) + ", " + scene::format_number(high) +
                          "]");
  };
  if (entry.fault == "stuck") {
    set_cell(channel, cell, 0.0F, static_cast<float>(require_value(own.minimum, own.maximum)));
  } else if (entry.fault == "dead") {
    if (entry.value) map.refuse(entry, "'dead' takes no value");
    set_cell(channel, cell, 0.0F, static_cast<float>(own.safe_value));
  } else if (entry.fault == "weak") {
    const double gain = require_value(0.0, 1.0);
    set_cell(channel, cell, static_cast<float>(gain), static_cast<float>((1.0 - gain) * own.safe_value));
  } else if (entry.fault == "gain" || entry.fault == "offset") {
    const bool is_gain = entry.fault == "gain";
    const auto value = static_cast<float>(is_gain ? require_value(-1e3, 1e3) : require_value(-1e6, 1e6));
    const float gain = channel.gain.empty() ? 1.0F : channel.gain[cell];
    const float offset = channel.offset.empty() ? 0.0F : channel.offset[cell];
    set_cell(channel, cell, is_gain ? value : gain, is_gain ? offset : value);
  } else if (entry.fault == "late") {
    const double late = require_value(0.0, 1000.0);
    if (late != std::round(late))
      map.refuse(entry,
                 "value of 'late' = " + scene::format_number(late) + ": must be a whole number, 0 to 1000");
    if (channel.latency.empty()) channel.latency.assign(cells_, static_cast<std::uint16_t>(common_latency_));
    const auto latency = common_latency_ + static_cast<int>(late);
    channel.latency[cell] = static_cast<std::uint16_t>(latency);
    channel.max_latency = std::max(channel.max_latency, latency);
  } else {
    map.refuse_fault(entry, "an actuator", kActuatorFaults);
  }
}

}  // namespace smartsurf::surface

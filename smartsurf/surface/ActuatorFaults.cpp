#include "smartsurf/surface/ActuatorFaults.h"

#include <algorithm>
#include <cmath>

namespace smartsurf::surface {
namespace {

const std::vector<std::string> kFaults{"stuck", "dead", "weak", "late"};

// One step of SplitMix64: a hash of a counter, so that a cell's luck does not depend on how many others there
// are.
std::uint64_t hash(std::uint64_t value) {
  value += 0x9e3779b97f4a7c15ULL;
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9ULL;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebULL;
  return value ^ (value >> 31);
}

double uniform(std::uint64_t seed, std::uint64_t counter) {
  return static_cast<double>(hash(hash(seed) ^ counter) >> 11) * 0x1p-53;
}

}  // namespace

ActuatorFaults::ActuatorFaults(const scene::SurfaceSpec& surface,
                               std::span<const scene::ActuatorChannel> channels, std::span<const int> acting,
                               const FaultMap& map, std::uint64_t seed)
    : cells_(static_cast<std::size_t>(surface.cells())), common_latency_(surface.faults.actuator.latency) {
  for (const scene::ActuatorChannel& channel : channels)
    channel_.push_back({channel, {}, {}, {}, common_latency_});
  draw(surface.faults.actuator, acting, seed);
  for (const FaultEntry& entry : map.entries())
    for (Channel& channel : channel_) {
      if (entry.channel != channel.is.name &&
          !(entry.channel.empty() && std::ranges::count(kFaults, entry.fault)))
        continue;
      apply(map, entry, channel, static_cast<std::size_t>(surface.index(entry.row, entry.column)));
    }
}

void ActuatorFaults::set(Channel& channel, std::size_t cell, float gain, float offset) {
  if (channel.gain.empty()) {
    channel.gain.assign(cells_, 1.0F);
    channel.offset.assign(cells_, 0.0F);
  }
  channel.gain[cell] = gain;
  channel.offset[cell] = offset;
}

// Cells in the order of their luck: the first are stuck, the next dead, the next weak.
void ActuatorFaults::draw(const scene::ActuatorFaultSpec& spec, std::span<const int> acting,
                          std::uint64_t seed) {
  std::vector<int> order(acting.begin(), acting.end());
  std::ranges::sort(order, {}, [seed](int cell) {
    return std::pair(hash(hash(seed) ^ static_cast<std::uint64_t>(cell)), cell);
  });
  const auto count = [&](double fraction) {
    return static_cast<std::size_t>(std::llround(fraction * static_cast<double>(acting.size())));
  };
  const std::size_t stuck = count(spec.stuck), dead = stuck + count(spec.dead),
                    weak = dead + count(spec.weak_fraction);
  for (std::size_t k = 0; k < std::min(weak, order.size()); ++k)
    for (std::size_t c = 0; c < channel_.size(); ++c) {
      const auto cell = static_cast<std::size_t>(order[k]);
      const scene::ActuatorChannel& is = channel_[c].is;
      const double somewhere = uniform(seed, (c + 1) * 0x100000000ULL + cell);
      if (k < stuck)
        set(channel_[c], cell, 0.0F, static_cast<float>(is.minimum + (is.maximum - is.minimum) * somewhere));
      else if (k < dead)
        set(channel_[c], cell, 0.0F, static_cast<float>(is.safe));
      else
        set(channel_[c], cell, static_cast<float>(spec.weak_gain),
            static_cast<float>((1.0 - spec.weak_gain) * is.safe));
    }
}

void ActuatorFaults::apply(const FaultMap& map, const FaultEntry& entry, Channel& channel, std::size_t cell) {
  const scene::ActuatorChannel& is = channel.is;
  const auto need = [&](double low, double high) {
    if (entry.value && *entry.value >= low && *entry.value <= high) return *entry.value;
    map.refuse(entry, "value of '" + entry.fault + "'" +
                          (entry.value ? " = " + scene::text_of(*entry.value) : " is missing") +
                          ": must be in [" + scene::text_of(low) + ", " + scene::text_of(high) + "]");
  };
  if (entry.fault == "stuck") {
    set(channel, cell, 0.0F, static_cast<float>(need(is.minimum, is.maximum)));
  } else if (entry.fault == "dead") {
    if (entry.value) map.refuse(entry, "'dead' takes no value");
    set(channel, cell, 0.0F, static_cast<float>(is.safe));
  } else if (entry.fault == "weak") {
    const double gain = need(0.0, 1.0);
    set(channel, cell, static_cast<float>(gain), static_cast<float>((1.0 - gain) * is.safe));
  } else if (entry.fault == "late") {
    if (channel.late.empty()) channel.late.assign(cells_, static_cast<std::uint16_t>(common_latency_));
    const auto late = common_latency_ + static_cast<int>(need(0.0, 1000.0));
    channel.late[cell] = static_cast<std::uint16_t>(late);
    channel.greatest_latency = std::max(channel.greatest_latency, late);
  } else {
    const std::string near = scene::nearest_name(entry.fault, kFaults);
    map.refuse(entry,
               "fault '" + entry.fault.substr(0, 40) + "': no fault of an actuator" +
                   (near.empty() ? "; known: stuck, dead, weak, late" : " (did you mean '" + near + "'?)"));
  }
}

}  // namespace smartsurf::surface

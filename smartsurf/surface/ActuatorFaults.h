// What faults make of commands: of a stuck, a dead, a weak and a late cell.
//
//   value felt = gain·command + offset: stuck 0·c + value, dead 0·c + safe, weak g·c + (1 − g)·safe; late: an
//   older command
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/FaultMap.h"

namespace smartsurf::surface {

class ActuatorFaults {
 public:
  // acting: the cells that have an actuator, ascending; of these the fractions are taken. The same seed hits
  // the same cells, and a greater fraction hits them and others. Throws scene::InputError for an entry of the
  // map that is no fault of an actuator.
  ActuatorFaults(const scene::SurfaceSpec&, std::span<const scene::ActuatorChannel> channels,
                 std::span<const int> acting, const FaultMap&, std::uint64_t seed);

  bool any(int channel) const noexcept { return !channel_[static_cast<std::size_t>(channel)].gain.empty(); }
  // Control periods by which any cell of the channel is late, at most; and one cell.
  int latency(int channel) const noexcept {
    return channel_[static_cast<std::size_t>(channel)].greatest_latency;
  }
  int latency(int channel, std::size_t cell) const noexcept {
    const auto& late = channel_[static_cast<std::size_t>(channel)].late;
    return late.empty() ? common_latency_ : late[cell];
  }
  float felt(int channel, std::size_t cell, float command) const noexcept {
    const Channel& c = channel_[static_cast<std::size_t>(channel)];
    return c.gain[cell] * command + c.offset[cell];
  }

 private:
  struct Channel {
    scene::ActuatorChannel is;
    std::vector<float> gain, offset;  // rows × columns; empty: no faults
    std::vector<std::uint16_t> late;  // rows × columns; empty: all by the common latency
    int greatest_latency = 0;
  };
  void draw(const scene::ActuatorFaultSpec&, std::span<const int> acting, std::uint64_t seed);
  void set(Channel&, std::size_t cell, float gain, float offset);
  void apply(const FaultMap&, const FaultEntry&, Channel&, std::size_t cell);

  std::size_t cells_;
  int common_latency_;
  std::vector<Channel> channel_;
};

}  // namespace smartsurf::surface

// Applies the faults of single cells to commands.
//
// effective command = gain·command + offset:
//   stuck  0·c + value, in the cell's own range
//   dead   0·c + safe, the cell's own safe value
//   weak   g·c + (1 − g)·safe
//   gain   g·c + offset
//   offset gain·c + o
//   late   an older command
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/scene/CellChannels.h"
#include "smartsurf/surface/FaultMap.h"

namespace smartsurf::surface {

class ActuatorFaults {
 public:
  // actuated_cells: the cells that have an actuator, ascending; the fractions of the spec refer to these. The
  // same seed selects the same cells, and a larger fraction selects a superset. Throws scene::InputError for
  // a map entry that is not an actuator fault.
  ActuatorFaults(const scene::SurfaceSpec&, std::span<const scene::ActuatorChannel> channels,
                 const scene::CellChannels&, std::span<const int> actuated_cells, const FaultMap&,
                 std::uint64_t seed);

  bool has_faults(int channel) const noexcept { return !channels_[channel].gain.empty(); }
  // Latency in control periods: the maximum over the channel's cells, and of one cell.
  int latency(int channel) const noexcept { return channels_[channel].max_latency; }
  int latency(int channel, std::size_t cell) const noexcept {
    const auto& latencies = channels_[channel].latency;
    return latencies.empty() ? common_latency_ : latencies[cell];
  }
  // Precondition: has_faults(channel).
  float effective_command(int channel, std::size_t cell, float command) const noexcept {
    const ChannelFaults& c = channels_[channel];
    return c.gain[cell] * command + c.offset[cell];
  }

 private:
  struct ChannelFaults {
    scene::ActuatorChannel info;
    std::vector<float> gain, offset;     // rows × columns; empty without faults
    std::vector<std::uint16_t> latency;  // rows × columns, control periods; empty: common_latency_ for all
    int max_latency = 0;
  };
  void draw_faults(const scene::ActuatorFaultSpec&, const scene::CellChannels&,
                   std::span<const int> actuated_cells, std::uint64_t seed);
  void set_cell(ChannelFaults&, std::size_t cell, float gain, float offset);
  // own: the channel of the cell's own actuator.
  void apply_entry(const FaultMap&, const FaultEntry&, ChannelFaults&, const scene::ActuatorChannel& own,
                   std::size_t cell);

  std::size_t cells_;
  int common_latency_;
  std::vector<ChannelFaults> channels_;
};

}  // namespace smartsurf::surface

// What a real sensor makes of the truth, for all cells of one sensor (docs/sensors.md has the equations):
//
//   truth → late by some ticks → gain·x + offset → + drift + noise → steps → within the range → stuck, dead,
//   lost
//
// Every random number is a function of seed, channel, cell and tick alone (CounterRandom).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/FaultMap.h"

namespace smartsurf::surface {

class SensorErrorModel {
 public:
  // Of one of the scene's sensors; what the user set for all sensors holds where its own values say nothing.
  // Throws scene::InputError for a calibration that does not fit, or an entry of the map for one of the
  // sensor's channels that is no fault of a sensor.
  SensorErrorModel(const scene::SensorSpec&, const scene::SceneSpec&, const FaultMap&);

  // Whether there are any: otherwise the truth is what is read.
  bool is_active() const noexcept { return active_; }

  // Makes the readings of this tick; ticks come one after the other, from 0. truth: one span a channel, which
  // are the same memory at each call.
  void apply(std::uint64_t tick, std::span<const std::span<const float>> truth, common::ThreadPool&);
  // components × rows × columns, as the truth.
  std::span<const float> values(int channel) const noexcept {
    return channels_[static_cast<std::size_t>(channel)].readings;
  }

 private:
  enum class CellState : std::uint8_t { kWorking, kDead, kStuck };
  struct ChannelState {
    scene::SensorChannel description;
    std::uint64_t stream = 0;  // of its random numbers
    // One a cell; empty where all cells are alike: gain 1, offset 0, working.
    std::vector<float> gain, offset;
    std::vector<CellState> state;
    std::vector<float> stuck_value;              // what a stuck cell reads
    std::vector<float> drift = {};               // the drift so far, as the truth; empty: none
    std::vector<std::vector<float>> delay_line;  // the truth of the last ticks, in a ring; empty: no latency
    std::span<const float> truth;                // what is being read
    std::vector<float> readings;
  };

  void allocate_buffers();
  void draw_faults(const scene::ParameterValues& sensor_values, const scene::ParameterValues& shared_values);
  void load_fault_map(const FaultMap&);
  void apply_fault(const FaultMap&, const FaultEntry&, ChannelState&);
  void set_calibration(std::size_t cell, const ChannelState&, std::vector<float>& gain_or_offset,
                       double value);
  void load_calibration(const scene::CalibrationFile&);
  void set_cell_fault(std::size_t cell, ChannelState&, CellState, double value);
  bool is_mask(const ChannelState& c) const {
    return mask_ >= 0 && &c == &channels_[static_cast<std::size_t>(mask_)];
  }
  const scene::SensorChannel& measured_channel(const ChannelState&) const;
  void compute_readings(std::uint64_t tick, std::size_t first, std::size_t last) noexcept;
  void compute_channel(std::uint64_t tick, ChannelState&, std::size_t first, std::size_t last) noexcept;

  int rows_, columns_;
  std::size_t cells_;
  double period_s_;
  std::uint64_t seed_;
  int mask_;
  double noise_ = 0.0, quantize_ = 0.0, drift_ = 0.0, dropout_ = 0.0;
  int latency_ = 0;
  bool active_ = false;
  std::vector<ChannelState> channels_;
};

}  // namespace smartsurf::surface

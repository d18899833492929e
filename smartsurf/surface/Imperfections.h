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

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/FaultMap.h"

namespace smartsurf::surface {

class WorkerPool;

class Imperfections {
 public:
  // Of one of the scene's sensors; what the user set for all sensors holds where its own values say nothing.
  // Throws scene::InputError for a calibration that does not fit, or an entry of the map for one of the
  // sensor's channels that is no fault of a sensor.
  Imperfections(const scene::SensorSpec&, const scene::SceneSpec&, const FaultMap&);

  // Whether there are any: otherwise the truth is what is read.
  bool any() const noexcept { return any_; }

  // Makes the readings of this tick; ticks come one after the other, from 0. truth: one span a channel, which
  // are the same memory at each call.
  void apply(std::uint64_t tick, std::span<const std::span<const float>> truth, WorkerPool&);
  // components × rows × columns, as the truth.
  std::span<const float> values(int channel) const noexcept {
    return channels_[static_cast<std::size_t>(channel)].readings;
  }

 private:
  enum class State : std::uint8_t { kWorks, kDead, kStuck };
  struct Channel {
    scene::SensorChannel description;
    std::uint64_t stream = 0;  // of its random numbers
    // One a cell; empty where all cells are alike: gain 1, offset 0, working.
    std::vector<float> gain, offset;
    std::vector<State> state;
    std::vector<float> stuck;              // what a stuck cell reads
    std::vector<float> walk = {};          // the drift so far, as the truth; empty: none
    std::vector<std::vector<float>> past;  // the truth of the last ticks, in a ring; empty: no latency
    std::span<const float> truth;          // what is being read
    std::vector<float> readings;
  };

  void reserve();
  void draw_faults(const scene::ParameterValues& own, const scene::ParameterValues& common);
  void read_map(const FaultMap&);
  void apply_fault(const FaultMap&, const FaultEntry&, Channel&);
  void calibrate(std::size_t cell, const Channel&, std::vector<float>& gain_or_offset, double value);
  void read_calibration(const scene::CalibrationFile&);
  void break_cell(std::size_t cell, Channel&, State, double value);
  bool is_mask(const Channel& c) const {
    return mask_ >= 0 && &c == &channels_[static_cast<std::size_t>(mask_)];
  }
  const scene::SensorChannel& measure(const Channel&) const;
  void read_cells(std::uint64_t tick, std::size_t first, std::size_t last) noexcept;
  void read_channel(std::uint64_t tick, Channel&, std::size_t first, std::size_t last) noexcept;

  int rows_, columns_;
  std::size_t cells_;
  double period_s_;
  std::uint64_t seed_;
  int mask_;
  double noise_ = 0.0, quantize_ = 0.0, drift_ = 0.0, dropout_ = 0.0;
  int latency_ = 0;
  bool any_ = false;
  std::vector<Channel> channels_;
};

}  // namespace smartsurf::surface

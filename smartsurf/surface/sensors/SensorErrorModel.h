// Applies measurement errors and faults to the true values of one sensor (docs/sensors.md has the equations):
//
//   true value → latency → gain·x + offset → + drift + noise → quantization → clamp to the range
//              → stuck and dead cells → dropout
//   no detection → false hit: a uniformly distributed value
//
// The mask follows the readings: a cell detects if its reading differs from that for no detection.
//
// Every random number is a function of seed, channel, cell and tick (CounterRandom).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/state/StateArchive.h"
#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/surface/FaultMap.h"

namespace smartsurf::surface {

class SensorErrorModel {
 public:
  // The errors of the spec, completed by the scene's errors for all sensors. Throws scene::InputError for an
  // invalid calibration, or a map entry for one of the sensor's channels that is not a sensor fault.
  SensorErrorModel(const scene::SensorSpec&, const scene::SceneSpec&, const FaultMap&);

  // True if the sensor has any errors. If not, its readings are the true values, and apply() must not be
  // called.
  bool is_active() const noexcept { return active_; }

  // Computes the readings of a tick. Ticks must be consecutive, from 0. truth: one span per channel, each
  // components × rows × columns. Does not allocate.
  void apply(std::uint64_t tick, std::span<const std::span<const float>> truth, common::ThreadPool&);
  // The readings after the last apply(): components × rows × columns, as in `truth`.
  std::span<const float> values(int channel) const noexcept { return channels_[channel].readings; }

  void archive(common::StateArchive& a) {
    for (ChannelState& c : channels_) a(c.drift, c.delay_line, c.readings);
  }

 private:
  enum class CellState : std::uint8_t { kWorking, kDead, kStuck };
  struct ChannelState {
    scene::SensorChannel description;
    std::uint64_t stream = 0;  // of random numbers
    // One per cell; empty if all cells have gain 1, offset 0 and work.
    std::vector<float> gain, offset;
    std::vector<CellState> state;
    std::vector<float> stuck_value;  // reading of a stuck cell
    // Laid out as the truth.
    std::vector<float> drift = {};               // accumulated drift; empty without drift
    std::vector<std::vector<float>> delay_line;  // ring of the truth of the last ticks; empty without latency
    std::span<const float> truth;                // delayed truth of the current tick
    std::vector<float> readings;
  };

  void allocate_buffers();
  void draw_faults(const scene::ParameterValues& sensor_values, const scene::ParameterValues& shared_values);
  void load_fault_map(const FaultMap&);
  void apply_fault(const FaultMap&, const FaultEntry&, ChannelState&);
  void set_calibration(std::size_t cell, const ChannelState&, std::vector<float>& gain_or_offset,
                       double value);
  void load_calibration(const scene::CalibrationFile&);
  void set_cell_fault(std::size_t cell, ChannelState&, CellState, double value,
                      const scene::SensorChannel& of);
  bool is_mask(const ChannelState& c) const { return mask_ >= 0 && &c == &channels_[mask_]; }
  const scene::SensorChannel& measured_channel(const ChannelState&) const;
  void compute_readings(std::uint64_t tick, std::size_t first, std::size_t last) noexcept;
  void compute_channel(std::uint64_t tick, ChannelState&, std::size_t first, std::size_t last) noexcept;
  // The reading of a false hit; uniform: in [0, 1).
  float false_reading(const scene::SensorChannel&, double uniform) const noexcept;
  void compute_mask(std::size_t first, std::size_t last) noexcept;

  int rows_, columns_;
  std::size_t cells_;
  double period_s_;
  std::uint64_t seed_;
  int mask_;  // index of the mask channel, or −1
  double noise_ = 0.0, quantize_ = 0.0, drift_ = 0.0, dropout_ = 0.0, false_hits_ = 0.0;
  int latency_ = 0;
  bool active_ = false;
  bool mask_follows_readings_ = false;  // the errors of the first channel decide what is detected
  std::vector<ChannelState> channels_;
};

}  // namespace smartsurf::surface

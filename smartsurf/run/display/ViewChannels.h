// The channels of a running simulation as the view shows them: heights, sensors and actuator targets.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/run/ShownRegisters.h"
#include "smartsurf/run/display/RunHistory.h"
#include "smartsurf/simulation/Simulation.h"
#include "smartsurf/view/model/FrameInput.h"

namespace smartsurf::run {

class ViewChannels {
 public:
  // registers: of the APRON program; those that are named are channels, too. Null: none.
  explicit ViewChannels(std::shared_ptr<const ShownRegisters> registers = nullptr)
      : registers_(std::move(registers)) {}

  // The values of the present. A channel with several components is one channel NAME[0], NAME[1], … for each.
  // The result is valid until the next call.
  std::span<const view::Channel> update(const simulation::Simulation&);
  // The values of an earlier tick.
  std::span<const view::Channel> show(const RunHistory&, const RunHistory::Frame&);

 private:
  void init_channels(const simulation::Simulation&);

  std::vector<view::Channel> channels_;
  std::shared_ptr<const ShownRegisters> registers_;
  std::size_t register_count_ = 0;  // the last of channels_
  std::vector<float> missing_;      // the values of a register before the program's first answer
};

// Both throw scene::InputError, which begins with the flag, for what the surface does not have. hint: ends
// the message.
void require_channel(const std::string& flag, const std::string& name,
                     std::span<const view::Channel> channels, const std::string& hint = "");
void require_signal(const std::string& flag, const view::Signal& signal, const scene::SurfaceSpec& surface,
                    std::span<const view::Channel> channels);
// Throws scene::InputError, which begins with the flag, unless `name` is one of the metrics.
void require_metric(const std::string& flag, const std::string& name,
                    const std::vector<std::string>& metrics);

// The load-bearing contacts, with the mean force of the last physics step, mass·u/s².
std::vector<view::ContactMark> contact_marks(const simulation::Simulation&);

// NAME[component], or NAME if there is only one.
std::string component_name(const std::string& name, int component, int components);

// A channel's name, unit and range, without values.
view::Channel height_channel(const scene::SurfaceSpec&);
view::Channel sensor_channel(const scene::SurfaceSpec&, const std::string& name);
view::Channel actuator_channel(const scene::SurfaceSpec&, const std::string& name);
// A register of the APRON program; its range is that of its values.
view::Channel register_channel(const std::string& name);

}  // namespace smartsurf::run

// The channels of a running simulation as the view shows them: heights, sensors and actuator targets.
#pragma once

#include <span>
#include <vector>

#include "smartsurf/simulation/Simulation.h"
#include "smartsurf/view/model/FrameInput.h"

namespace smartsurf::run {

class ViewChannels {
 public:
  // snapshot: the current one of the simulation, or an earlier one, for which only the heights have values.
  // The result is valid until the next call.
  std::span<const view::Channel> update(const simulation::Simulation&, const scene::Snapshot& snapshot);

 private:
  void init_channels(const simulation::Simulation&);

  std::vector<view::Channel> channels_;
};

// The load-bearing contacts, with the mean force of the last physics step, mass·u/s².
std::vector<view::ContactMark> contact_marks(const simulation::Simulation&);

// A channel's name, unit and range, without values.
view::Channel height_channel(const scene::SurfaceSpec&);
view::Channel sensor_channel(const scene::SurfaceSpec&, const std::string& name);
view::Channel actuator_channel(const scene::SurfaceSpec&, const std::string& name);

}  // namespace smartsurf::run

// The channels of a running simulation as the view shows them: heights, sensors and actuator targets.
#pragma once

#include <span>
#include <vector>

#include "smartsurf/run/Simulation.h"
#include "smartsurf/view/model/FrameInput.h"

namespace smartsurf::run {

class ViewChannels {
 public:
  // Valid until the next call. shown: of the simulation now, or a state of its past: of that only the heights
  // are known, and the other channels have no values.
  std::span<const view::Channel> update(const Simulation&, const scene::Snapshot& snapshot);

 private:
  void init_channels(const Simulation&);

  std::vector<view::Channel> channels_;
};

// The contacts that bear a load, with the mean force of the last physics step.
std::vector<view::ContactMark> contact_marks(const Simulation&);

// A channel's name and range; without values.
view::Channel height_channel(const scene::SurfaceSpec&);
view::Channel sensor_channel(const scene::SurfaceSpec&, const std::string& name);
view::Channel actuator_channel(const scene::SurfaceSpec&, const std::string& name);

}  // namespace smartsurf::run

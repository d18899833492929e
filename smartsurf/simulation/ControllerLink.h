// A controller in this process and the simulation that it commands: what the shared memory is between
// processes.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "common/controller/Controller.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::simulation {

class Simulation;

class ControllerLink {
 public:
  explicit ControllerLink(std::shared_ptr<const common::ControllerFactory> factory)
      : factory_(std::move(factory)) {}

  // Restarts the controller; creates another one if the surface is not that of the previous episode. Throws
  // common::UserError if it cannot control this surface.
  void start_episode(const scene::SceneSpec&);

  // Shows the simulation's latest sensor frame to the controller and passes its answer to the actuators.
  // Returns false if the controller has left. Throws scene::InputError if it fails. Does not allocate
  // otherwise.
  bool command(Simulation&);

  // The latest answer: channels × rows × columns, before it is clamped.
  std::span<const float> targets() const noexcept { return targets_; }

 private:
  std::shared_ptr<const common::ControllerFactory> factory_;
  common::ControlledSurface surface_;
  std::unique_ptr<common::Controller> controller_;
  std::vector<bool> is_whole_;                      // by sensor channel: transferred as whole numbers
  std::vector<std::vector<float>> whole_readings_;  // of those; of others empty
  std::vector<float> occupancy_;  // the readings of the last channel, if there are empty cells
  std::vector<float> targets_;
  std::vector<std::span<const float>> frame_;
  std::vector<std::span<float>> answer_;
};

}  // namespace smartsurf::simulation

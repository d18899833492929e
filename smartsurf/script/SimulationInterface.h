// What a running script may ask of the simulation. smartsurf/run implements it; scripts see object ids and
// plain values only.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/scene/ObjectState.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::script {

using scene::ObjectState;
using scene::ObjectStateUpdate;

// Called only from inside Experiment::start, tick and finish, on their thread; nothing is kept past the call.
// Arguments are checked before: ids that are passed to anything but alive() are alive, rows, columns and
// channel names exist, numbers are finite. A request that the script's author got wrong in another way (a
// target while a controller is attached) is refused by throwing scene::InputError with one clause, without
// file and line: the script's own place is put in front. Any other exception passes through Experiment's
// functions unchanged.
class SimulationInterface {
 public:
  SimulationInterface() = default;
  SimulationInterface(const SimulationInterface&) = delete;
  SimulationInterface& operator=(const SimulationInterface&) = delete;
  virtual ~SimulationInterface() = default;

  // The new object's id, by which the script and the recordings know it.
  virtual scene::ObjectId spawn(const scene::ObjectSpec&) = 0;
  virtual void remove(scene::ObjectId) = 0;
  virtual bool is_alive(scene::ObjectId) const = 0;
  virtual ObjectState state(scene::ObjectId) const = 0;
  virtual std::string label(scene::ObjectId) const = 0;
  // Ids of the live objects, ascending; of those with this label where one is given.
  virtual std::vector<scene::ObjectId> find_objects(const std::optional<std::string>& label) const = 0;

  // Applies a force (mass·u/s²) at `point` (world coordinates; the centre of mass where absent) for
  // `seconds`, beginning with the coming physics step.
  virtual void apply_force(scene::ObjectId, const Eigen::Vector3d& force,
                           const std::optional<Eigen::Vector3d>& point, double seconds) = 0;
  virtual void set_state(scene::ObjectId, const ObjectStateUpdate&) = 0;

  // Sets what an actuator channel aims at, one cell (row and column count from 0, row 0 north) or all of them
  // (rows × columns, row-major).
  virtual void set_target(const std::string& channel, int row, int column, float value) = 0;
  virtual void set_targets(const std::string& channel, std::span<const float> values) = 0;
  // The last reading of a sensor channel at a cell, and what a perfect sensor would read there: component
  // `component`.
  virtual float sense(const std::string& channel, int row, int column, int component) const = 0;
  virtual float read_ground_truth(const std::string& channel, int row, int column, int component) const = 0;

  virtual void stop() = 0;   // ends the run after the current tick; a window stays open
  virtual void quit() = 0;   // ends the run after the current tick and closes the window
  virtual void pause() = 0;  // where nobody can continue (headless), the host may refuse
  // Simulated seconds per wall second; nullopt = as fast as possible.
  virtual void set_real_time_factor(std::optional<double> factor) = 0;
};

}  // namespace smartsurf::script

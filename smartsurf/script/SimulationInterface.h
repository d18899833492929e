// The interface through which a running script accesses the simulation. smartsurf/simulation implements it.
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

// Called only from inside Experiment's functions, on their thread. References must not be kept past the call.
//
// The caller checks arguments: ids are alive (except for is_alive), rows, columns and channel names exist,
// numbers are finite. For any other misuse by the script (a target while a controller is attached), throw
// scene::InputError with one clause, without file and line; the script's location is prepended. Other
// exceptions pass through Experiment's functions unchanged.
class SimulationInterface {
 public:
  SimulationInterface() = default;
  SimulationInterface(const SimulationInterface&) = delete;
  SimulationInterface& operator=(const SimulationInterface&) = delete;
  virtual ~SimulationInterface() = default;

  // Returns the id of the new object, which scripts and recordings use.
  virtual scene::ObjectId spawn(const scene::ObjectSpec&) = 0;
  virtual void remove(scene::ObjectId) = 0;
  virtual bool is_alive(scene::ObjectId) const = 0;
  virtual ObjectState state(scene::ObjectId) const = 0;
  // True if the object's centre is over the cells and no lower than the lowest top.
  virtual bool is_on_table(scene::ObjectId) const = 0;
  virtual std::string label(scene::ObjectId) const = 0;
  virtual bool is_fixed(scene::ObjectId) const = 0;
  // The ids of all live objects in ascending order, restricted to `label` if given.
  virtual std::vector<scene::ObjectId> find_objects(const std::optional<std::string>& label) const = 0;

  // Applies a force (mass·u/s²) for `seconds`, starting with the next physics step. `point` is in world
  // coordinates; nullopt = the centre of mass.
  virtual void apply_force(scene::ObjectId, const Eigen::Vector3d& force,
                           const std::optional<Eigen::Vector3d>& point, double seconds) = 0;
  virtual void set_state(scene::ObjectId, const ObjectStateUpdate&) = 0;

  // Joints, as of world/Engine.h. All but has_joint() require that the joint exists.
  virtual scene::JointId add_joint(const scene::JointSpec&) = 0;
  virtual bool has_joint(scene::JointId) const = 0;
  virtual scene::JointKind joint_kind(scene::JointId) const = 0;
  virtual void remove_joint(scene::JointId) = 0;
  virtual void set_motor(scene::JointId, const scene::JointMotor&) = 0;
  virtual void set_spring(scene::JointId, const scene::JointSpring&) = 0;
  virtual scene::JointState joint_state(scene::JointId) const = 0;

  // Sets the target of an actuator channel for one cell (zero-based, row 0 is north, column 0 is west) or for
  // all cells (rows × columns, row-major).
  virtual void set_target(const std::string& channel, int row, int column, float value) = 0;
  virtual void set_targets(const std::string& channel, std::span<const float> values) = 0;
  // One component of a sensor channel at a cell: the last reading, and the exact value without sensor errors.
  virtual float sense(const std::string& channel, int row, int column, int component) const = 0;
  virtual float read_ground_truth(const std::string& channel, int row, int column, int component) const = 0;

  // Ends the run after the current tick; a window stays open and shows the message, one line or "".
  // success: whether the run reached its aim, if the script says so.
  virtual void stop(std::string message, std::optional<bool> success) = 0;
  virtual void quit() = 0;   // ends the run after the current tick and closes the window
  virtual void pause() = 0;  // may be rejected in headless mode, where nothing can resume the run
  // Simulated seconds per wall second; nullopt = as fast as possible.
  virtual void set_real_time_factor(std::optional<double> factor) = 0;
};

}  // namespace smartsurf::script

// The simulated surface, advanced one control period at a time: script, actuators, physics, snapshot,
// sensors. Independent of clocks, windows and shared memory; the caller runs the phases in order.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/state/StateArchive.h"
#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/ChannelData.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/script/Experiment.h"
#include "smartsurf/script/SimulationInterface.h"
#include "smartsurf/simulation/DepartureTracker.h"
#include "smartsurf/simulation/Nuisances.h"
#include "smartsurf/surface/ActuatorArray.h"
#include "smartsurf/surface/SensorArray.h"
#include "smartsurf/world/Engine.h"

namespace smartsurf::simulation {

// Requests of the script to the run, which reads and clears them after each tick.
struct ScriptRequests {
  bool stop = false, quit = false, pause = false;
  std::string stop_message;  // one line, or ""
  std::optional<bool> success;
  bool pace_changed = false;
  std::optional<double> pace;  // nullopt: as fast as possible
};

// Loads the files that the experiment refers to. Throws scene::InputError if one does not fit the surface.
void validate_surface(const scene::SceneSpec&);

class Simulation final : public script::SimulationInterface {
 public:
  // Draws the nuisances of the experiment's scene and sets them in it.
  // scripted_actuators: the script sets the actuators; otherwise cells:target() and cells:targets() throw
  // scene::InputError. The experiment must outlive the simulation. Throws scene::InputError if this build
  // lacks the scene's engine, and as Nuisances does.
  Simulation(script::Experiment&, int threads, bool scripted_actuators);

  const scene::SceneSpec& scene() const { return experiment_.scene(); }
  const world::Engine& engine() const { return *engine_; }

  // The phases of a tick, in this order.

  // Runs the script's event handlers. Throws scene::InputError for an error in the script.
  void run_script();
  // Does what the script's teleport does, updates the snapshot. Returns false if the object is not alive.
  bool place(scene::ObjectId, const script::ObjectStateUpdate&);
  // Applied in every coming step, besides those of actuators and script. False if the object is not alive.
  bool set_wrench(scene::ObjectId, const surface::Wrench&);
  // Receives the targets of the tick by set_targets(), indexed by channel of actuators().
  surface::ActuatorArray& actuator_array() noexcept { return actuator_array_; }
  // Sets and returns the target of one cell, independent of what drives the actuators; for user interaction.
  void override_actuator_target(int channel, int row, int column, float target) noexcept {
    actuator_array_.set_target(channel, row, column, target);
  }
  float actuator_target(int channel, int row, int column) const noexcept {
    return actuator_array_.targets(channel)[scene().surface.index(row, column)];
  }
  void plan_actuators() noexcept;  // these three once per physics step
  bool step_physics();             // false: failure() says why the step did not take place
  void commit_actuators() noexcept;
  void finish_tick();  // increments the tick and takes the snapshot
  void sense();        // computes the sensor frames of that snapshot

  // After a step of physics: why the run cannot continue, in one line, or nullopt.
  std::optional<std::string> failure() const;

  // The state after the last tick.

  const scene::Snapshot& snapshot() const {
    if (is_partial_) complete_snapshot();
    return snapshot_;
  }
  // The same, but the hash and the actuators' state may be those of an earlier tick.
  const scene::Snapshot& partial_snapshot() const noexcept { return snapshot_; }
  // From now on a tick's snapshot is completed only if snapshot() is called: hash and actuators' state take a
  // few per cent of a small world's step.
  void complete_snapshots_when_asked() noexcept { completes_when_asked_ = true; }
  // Every object ever created, index = id.
  const std::vector<scene::ObjectSpec>& catalogue() const noexcept { return catalogue_; }
  // Every joint ever created, index = id.
  const std::vector<scene::JointSpec>& joints() const noexcept { return joints_; }
  // The load-bearing contacts of the last physics step. Allocates.
  std::vector<world::ContactPoint> contacts() const { return engine_->contacts(); }
  // The episode's nuisances, with the values drawn.
  const std::vector<scene::Variation>& nuisances() const noexcept { return nuisances_.drawn(); }
  const DepartureTracker& departures() const noexcept { return departures_; }
  // Number of the script's targets that were replaced, because they were NaN or out of range.
  std::uint64_t clamped_targets() const noexcept { return clamped_targets_; }
  // Number of NaN targets, from the script or a controller.
  std::uint64_t nan_targets() const noexcept { return actuator_array_.nan_targets(); }
  std::span<const scene::ChannelData> sensors() const noexcept { return sensors_; }
  std::span<const scene::ChannelData> actuators() const noexcept { return actuators_; }
  ScriptRequests take_requests() noexcept;

  // Saves or restores the state between two ticks, except the experiment's: into a simulation of the same
  // experiment and seed. Throws common::UserError for what cannot be saved, and for a damaged state.
  void archive(common::StateArchive&);

  // script::SimulationInterface
  scene::ObjectId spawn(const scene::ObjectSpec&) override;
  void remove(scene::ObjectId) override;
  bool is_alive(scene::ObjectId) const override;
  script::ObjectState state(scene::ObjectId) const override;
  bool is_on_table(scene::ObjectId) const override;
  std::string label(scene::ObjectId) const override;
  std::vector<scene::ObjectId> find_objects(const std::optional<std::string>& label) const override;
  void apply_force(scene::ObjectId, const Eigen::Vector3d& force, const std::optional<Eigen::Vector3d>& point,
                   double seconds) override;
  void set_state(scene::ObjectId, const script::ObjectStateUpdate&) override;
  bool is_fixed(scene::ObjectId id) const override { return catalogue_[id].fixed; }
  scene::JointId add_joint(const scene::JointSpec&) override;
  bool has_joint(scene::JointId id) const override { return engine_->has_joint(id); }
  scene::JointKind joint_kind(scene::JointId id) const override { return joints_[id].kind; }
  void remove_joint(scene::JointId id) override { engine_->remove_joint(id); }
  void set_motor(scene::JointId id, const scene::JointMotor& motor) override {
    engine_->set_motor(id, motor);
  }
  void set_spring(scene::JointId id, const scene::JointSpring& spring) override {
    engine_->set_spring(id, spring);
  }
  scene::JointState joint_state(scene::JointId id) const override { return engine_->joint_state(id); }
  void set_target(const std::string& channel, int row, int column, float value) override;
  void set_targets(const std::string& channel, std::span<const float> values) override;
  float sense(const std::string& channel, int row, int column, int component) const override;
  float read_ground_truth(const std::string& channel, int row, int column, int component) const override;
  void stop(std::string message, std::optional<bool> success) override;
  void quit() override { requests_.quit = true; }
  void pause() override { requests_.pause = true; }
  void set_real_time_factor(std::optional<double> factor) override;

 private:
  void add_wrenches();
  void require_scripted_actuators() const;
  void collect_channels();
  void take_snapshot();
  void complete_snapshot() const;
  void archive_object(common::StateArchive&, scene::ObjectSpec&);
  int find_actuator_channel(const std::string& name) const;
  int find_sensor_channel(const std::string& name) const;
  std::size_t plane_index(int row, int column, int component) const;

  script::Experiment& experiment_;
  Nuisances nuisances_;  // before all that reads the scene
  bool scripted_actuators_;
  common::ThreadPool pool_;
  surface::ActuatorArray actuator_array_;
  surface::SensorArray sensor_array_;
  std::unique_ptr<world::Engine> engine_;
  std::vector<scene::ObjectSpec> catalogue_;
  std::vector<scene::JointSpec> joints_;  // every joint ever created, index = id
  DepartureTracker departures_;
  std::uint64_t clamped_targets_ = 0;
  struct ObjectWrench {
    scene::ObjectId id;
    surface::Wrench wrench;
  };
  std::vector<ObjectWrench> wrenches_;  // of set_wrench(), but those that are zero, ascending by id
  mutable scene::Snapshot snapshot_;
  bool completes_when_asked_ = false;
  mutable bool is_partial_ = false;
  bool tick_started_ = false;  // actuator_array_.begin_tick() was called for the current tick
  std::vector<scene::ChannelData> sensors_, actuators_;
  ScriptRequests requests_;
};

}  // namespace smartsurf::simulation

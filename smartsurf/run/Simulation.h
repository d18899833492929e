// The simulated surface, advancing one control period at a time: script, actuators, physics, snapshot,
// sensors. It knows neither clocks nor windows nor shared memory; whoever drives it calls the phases in
// order.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "smartsurf/record/Recorder.h"
#include "smartsurf/run/TableWatch.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/script/Experiment.h"
#include "smartsurf/script/Host.h"
#include "smartsurf/surface/ActuatorArray.h"
#include "smartsurf/surface/SensorArray.h"
#include "smartsurf/surface/WorkerPool.h"
#include "smartsurf/world/World.h"

namespace smartsurf::run {

// What a script asked of the run as a whole; read and cleared by the run after each tick.
struct ScriptRequests {
  bool stop = false, quit = false, pause = false;
  bool pace_changed = false;
  std::optional<double> pace;  // nullopt: as fast as possible
};

// Reads the tables that the experiment names: throws scene::InputError where one does not fit the surface.
void check_surface(const scene::SceneSpec&);

class Simulation final : public script::Host {
 public:
  // With `scripted_actuators` the script sets the actuators; otherwise its cells:target is refused.
  Simulation(script::Experiment&, int threads, bool scripted_actuators);

  const scene::SceneSpec& scene() const { return experiment_.scene(); }

  // ---- the phases of a tick, in this order
  // ----------------------------------------------------------------- Throws scene::InputError for a mistake
  // in the script.
  void run_script();
  void actuate(int channel, std::span<const float> targets) noexcept;  // of actuators(); rows × columns
  // By hand: what one cell of the channel is told, whoever drives the others; and what it was told last.
  void hold_cell(int channel, int row, int column, float target) noexcept {
    cells_.set_target(channel, row, column, target);
  }
  float told(int channel, int row, int column) const noexcept {
    return cells_.targets(channel)[static_cast<std::size_t>(scene().surface.index(row, column))];
  }
  void plan_cells() noexcept;  // these three once a physics step
  void step_physics();
  void move_cells() noexcept;
  void look();   // counts the tick and takes the snapshot
  void sense();  // sensor frames of that snapshot

  std::optional<scene::ObjectId> first_not_finite() const { return world_.first_not_finite(); }

  // ---- what there is after the last tick
  // --------------------------------------------------------------------
  const scene::Snapshot& snapshot() const noexcept { return snapshot_; }
  // Every object ever created, index = id.
  const std::vector<scene::ObjectSpec>& catalogue() const noexcept { return catalogue_; }
  // The contacts of the last physics step that bore any load. Allocates.
  std::vector<world::ContactPoint> contacts() const { return world_.contacts(); }
  const TableWatch& table() const noexcept { return table_; }
  std::span<const record::Channel> sensors() const noexcept { return sensors_; }
  std::span<const record::Channel> actuators() const noexcept { return actuators_; }
  ScriptRequests take_requests() noexcept;

  // ---- script::Host
  // -------------------------------------------------------------------------------------------
  scene::ObjectId spawn(const scene::ObjectSpec&) override;
  void remove(scene::ObjectId) override;
  bool alive(scene::ObjectId) const override;
  script::ObjectState state(scene::ObjectId) const override;
  std::string label(scene::ObjectId) const override;
  std::vector<scene::ObjectId> objects(const std::optional<std::string>& label) const override;
  void push(scene::ObjectId, const Eigen::Vector3d& force, const std::optional<Eigen::Vector3d>& point,
            double seconds) override;
  void place(scene::ObjectId, const script::Placement&) override;
  void target(const std::string& channel, int row, int column, float value) override;
  void targets(const std::string& channel, std::span<const float> values) override;
  float sense(const std::string& channel, int row, int column, int component) const override;
  float truth(const std::string& channel, int row, int column, int component) const override;
  void stop() override { requests_.stop = true; }
  void quit() override { requests_.quit = true; }
  void pause() override { requests_.pause = true; }
  void pace(std::optional<double> factor) override;

 private:
  void require_scripted_actuators() const;
  void list_channels();
  void take_snapshot();
  int actuator_channel(const std::string& name) const;
  int sensor_channel(const std::string& name) const;
  std::size_t place_in_planes(int row, int column, int component) const;

  script::Experiment& experiment_;
  bool scripted_actuators_;
  surface::WorkerPool pool_;
  surface::ActuatorArray cells_;
  surface::SensorArray senses_;
  world::World world_;
  std::vector<scene::ObjectSpec> catalogue_;
  TableWatch table_;
  scene::Snapshot snapshot_;
  bool tick_began_ = false;  // whether the actuators know of the tick that runs
  std::vector<record::Channel> sensors_, actuators_;
  ScriptRequests requests_;
};

}  // namespace smartsurf::run

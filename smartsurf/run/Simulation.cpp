#include "smartsurf/run/Simulation.h"

#include <algorithm>
#include <cassert>

namespace smartsurf::run {

Simulation::Simulation(script::Experiment& experiment, int threads, bool scripted_actuators)
    : experiment_(experiment),
      scripted_actuators_(scripted_actuators),
      pool_(threads),
      field_(experiment.scene().surface),
      world_(experiment.scene(), field_.field(), &pool_),
      catalogue_(experiment.scene().objects) {
  for (const auto& sensor : scene().surface.sensors) proximity_.emplace_back(scene().surface, sensor.range);
  list_channels();
  world_.snapshot(snapshot_);
  sense();
  experiment_.start(*this);
}

void Simulation::list_channels() {
  const auto& surface = scene().surface;
  sensor_names_ = surface.sensor_channels();
  for (std::size_t i = 0; i < proximity_.size(); ++i) {
    sensors_.push_back({sensor_names_[2 * i], surface.rows, surface.columns, 1, proximity_[i].distance()});
    sensors_.push_back({sensor_names_[2 * i + 1], surface.rows, surface.columns, 1, proximity_[i].hit()});
  }
  actuators_.push_back({"height", surface.rows, surface.columns, 1, field_.target()});
}

void Simulation::run_script() { experiment_.tick(snapshot_.time_s, snapshot_.tick); }

void Simulation::actuate(std::span<const float> height_targets) noexcept {
  field_.set_targets(height_targets);
}

void Simulation::plan_pins() noexcept { field_.plan(scene().world.dt_s); }
void Simulation::step_physics() { world_.step(); }
void Simulation::move_pins() noexcept { field_.commit(scene().world.dt_s); }

void Simulation::look() {
  world_.snapshot(snapshot_);
  ++snapshot_.tick;
  // Counted, not summed: the same time at the same tick, however long the run.
  snapshot_.time_s = static_cast<double>(snapshot_.tick) * scene().world.control_period_s;
}

void Simulation::sense() {
  for (auto& p : proximity_) p.sense(snapshot_, catalogue_, pool_);
}

ScriptRequests Simulation::take_requests() noexcept { return std::exchange(requests_, {}); }

scene::ObjectId Simulation::spawn(const scene::ObjectSpec& spec) {
  catalogue_.push_back(spec);
  const scene::ObjectId id = world_.add(spec);
  assert(id + 1 == catalogue_.size());
  return id;
}

void Simulation::remove(scene::ObjectId id) { world_.remove(id); }
bool Simulation::alive(scene::ObjectId id) const { return world_.alive(id); }

script::ObjectState Simulation::state(scene::ObjectId id) const { return world_.state(id); }

std::string Simulation::label(scene::ObjectId id) const { return catalogue_[id].label; }

std::vector<scene::ObjectId> Simulation::objects(const std::optional<std::string>& label) const {
  std::vector<scene::ObjectId> found;
  for (scene::ObjectId id = 0; id < catalogue_.size(); ++id)
    if (world_.alive(id) && (!label || catalogue_[id].label == *label)) found.push_back(id);
  return found;
}

void Simulation::push(scene::ObjectId id, const Eigen::Vector3d& force,
                      const std::optional<Eigen::Vector3d>& point, double seconds) {
  world_.push(id, force, point, seconds);
}

void Simulation::place(scene::ObjectId id, const script::Placement& placement) {
  world_.place(id, placement);
}

void Simulation::require_scripted_actuators() const {
  if (!scripted_actuators_)
    throw scene::InputError(
        "the controller drives the actuators: cells:target and cells:targets need --no-controller");
}

void Simulation::target(const std::string&, int row, int column, float value) {
  require_scripted_actuators();
  field_.set_target(row, column, value);
}

void Simulation::targets(const std::string&, std::span<const float> values) {
  require_scripted_actuators();
  field_.set_targets(values);
}

float Simulation::sense(const std::string& channel, int row, int column) const {
  for (const auto& c : sensors_)
    if (c.name == channel) return c.values[static_cast<std::size_t>(row * c.columns + column)];
  throw scene::InputError("no sensor channel '" + channel + "'");
}

void Simulation::pace(std::optional<double> factor) {
  requests_.pace_changed = true;
  requests_.pace = factor;
}

}  // namespace smartsurf::run

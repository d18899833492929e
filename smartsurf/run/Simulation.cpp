#include "smartsurf/run/Simulation.h"

#include <algorithm>
#include <cassert>

namespace smartsurf::run {
namespace {

surface::FaultMap fault_map(const scene::SurfaceSpec& surface) {
  if (!surface.faults.map) return {};
  surface::FaultMap map(*surface.faults.map, surface.rows, surface.columns);
  std::vector<std::string> channels = surface.sensor_channels();
  for (const auto& channel : surface.actuator_channels()) channels.push_back(channel.name);
  map.require_channels(channels);
  // What an entry says of every channel of its cell, sensors and actuators each pass over where it is not
  // theirs.
  static const std::vector<std::string> kFaults{"stuck",     "dead",       "weak", "late",
                                                "stuck_low", "stuck_high", "gain", "offset"};
  for (const surface::FaultEntry& entry : map.entries())
    if (entry.channel.empty() && std::ranges::find(kFaults, entry.fault) == kFaults.end())
      map.refuse(entry, "fault '" + entry.fault.substr(0, 40) + "': no fault of an actuator or a sensor");
  return map;
}

}  // namespace

void check_surface(const scene::SceneSpec& scene) {
  const surface::FaultMap map = fault_map(scene.surface);
  const surface::ActuatorArray cells(scene.surface, map, scene.world.seed);
  const surface::SensorArray senses(scene, cells.field(), map);
}

Simulation::Simulation(script::Experiment& experiment, int threads, bool scripted_actuators)
    : experiment_(experiment),
      scripted_actuators_(scripted_actuators),
      pool_(threads),
      cells_(experiment.scene().surface, fault_map(experiment.scene().surface), experiment.scene().world.seed,
             &pool_),
      senses_(experiment.scene(), cells_.field(), fault_map(experiment.scene().surface)),
      world_(experiment.scene(), cells_.field(), &pool_),
      catalogue_(experiment.scene().objects),
      table_(experiment.scene().surface) {
  list_channels();
  take_snapshot();
  table_.watch(snapshot_, catalogue_);
  sense();
  experiment_.start(*this);
}

void Simulation::list_channels() {
  const auto& surface = scene().surface;
  for (std::size_t k = 0; k < senses_.channels().size(); ++k) {
    const scene::SensorChannel& channel = senses_.channels()[k];
    sensors_.push_back({channel.name, surface.rows, surface.columns, channel.components,
                        senses_.readings(static_cast<int>(k))});
  }
  for (std::size_t k = 0; k < cells_.channels().size(); ++k)
    actuators_.push_back(
        {cells_.channels()[k].name, surface.rows, surface.columns, 1, cells_.targets(static_cast<int>(k))});
}

void Simulation::run_script() {
  experiment_.leave(snapshot_.time_s, snapshot_.tick, table_.left());
  if (scene().world.off_table == scene::OffTable::kRemove)
    for (const scene::ObjectId id : table_.left()) world_.remove(id);
  experiment_.tick(snapshot_.time_s, snapshot_.tick);
}

void Simulation::actuate(int channel, std::span<const float> targets) noexcept {
  cells_.set_targets(channel, targets);
}

void Simulation::plan_cells() noexcept {
  if (!std::exchange(tick_began_, true)) cells_.begin_tick();
  cells_.plan(scene().world.dt_s);
}

void Simulation::step_physics() {
  if (cells_.exerts_forces())
    cells_.forces(scene().world.dt_s, world_.bodies(), catalogue_, world_.wrenches());
  world_.step();
  senses_.feel(cells_.field().impulse);
}

void Simulation::move_cells() noexcept { cells_.commit(scene().world.dt_s); }

void Simulation::take_snapshot() {
  world_.snapshot(snapshot_);
  cells_.show(snapshot_.motion);
}

void Simulation::look() {
  take_snapshot();
  tick_began_ = false;
  ++snapshot_.tick;
  // Counted, not summed: the same time at the same tick, however long the run.
  snapshot_.time_s = static_cast<double>(snapshot_.tick) * scene().world.control_period_s;
  table_.watch(snapshot_, catalogue_);
}

void Simulation::sense() { senses_.sense(snapshot_, catalogue_, pool_); }

ScriptRequests Simulation::take_requests() noexcept { return std::exchange(requests_, {}); }

scene::ObjectId Simulation::spawn(const scene::ObjectSpec& spec) {
  const scene::ObjectId id = world_.add(spec);
  catalogue_.push_back(spec);
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

int Simulation::actuator_channel(const std::string& name) const {
  const auto it = std::ranges::find(actuators_, name, &record::Channel::name);
  if (it == actuators_.end()) throw scene::InputError("no actuator channel '" + name + "'");
  return static_cast<int>(it - actuators_.begin());
}

void Simulation::target(const std::string& channel, int row, int column, float value) {
  require_scripted_actuators();
  cells_.set_target(actuator_channel(channel), row, column, value);
}

void Simulation::targets(const std::string& channel, std::span<const float> values) {
  require_scripted_actuators();
  cells_.set_targets(actuator_channel(channel), values);
}

int Simulation::sensor_channel(const std::string& name) const {
  const auto it = std::ranges::find(sensors_, name, &record::Channel::name);
  if (it == sensors_.end()) throw scene::InputError("no sensor channel '" + name + "'");
  return static_cast<int>(it - sensors_.begin());
}

std::size_t Simulation::place_in_planes(int row, int column, int component) const {
  const auto& surface = scene().surface;
  return static_cast<std::size_t>(component) * static_cast<std::size_t>(surface.cells()) +
         static_cast<std::size_t>(surface.index(row, column));
}

float Simulation::sense(const std::string& channel, int row, int column, int component) const {
  return senses_.readings(sensor_channel(channel))[place_in_planes(row, column, component)];
}

float Simulation::truth(const std::string& channel, int row, int column, int component) const {
  return senses_.truth(sensor_channel(channel))[place_in_planes(row, column, component)];
}

void Simulation::pace(std::optional<double> factor) {
  requests_.pace_changed = true;
  requests_.pace = factor;
}

}  // namespace smartsurf::run

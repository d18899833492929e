#include "smartsurf/simulation/Simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>

#include "common/arithmetic/StandardArithmetic.h"
#include "smartsurf/world/bullet/EngineFactory.h"

namespace smartsurf::simulation {
namespace {

std::string describe_object(const scene::ObjectSpec& object) {
  return fmt::format("extents {:.4g} x {:.4g} x {:.4g} u, {}", 2.0 * object.half_extents().x(),
                     2.0 * object.half_extents().y(), 2.0 * object.half_extents().z(),
                     object.mass ? fmt::format("mass {:.4g}", *object.mass)
                                 : fmt::format("volume {:.4g} u³", object.volume()));
}

surface::FaultMap load_fault_map(const scene::SurfaceSpec& surface) {
  if (!surface.faults.fault_map && surface.faults.cells.empty()) return {};
  surface::FaultMap map(surface.faults, surface.rows, surface.columns);
  std::vector<std::string> channels = surface.sensor_channels();
  for (const auto& channel : surface.actuator_channels()) channels.push_back(channel.name);
  map.require_channels(channels);
  // An entry without a channel applies to all channels of its cell. Actuators and sensors each ignore the
  // faults of the other, so a fault that no channel of the surface has must be rejected here.
  const bool has_sensors = !surface.sensor_channels().empty();
  std::vector<std::string> known = surface::kActuatorFaults;
  if (has_sensors)
    for (const std::string& fault : surface::kSensorFaults)
      if (std::ranges::find(known, fault) == known.end()) known.push_back(fault);
  for (const surface::FaultEntry& entry : map.entries()) {
    if (!entry.channel.empty()) continue;
    if (std::ranges::find(known, entry.fault) == known.end())
      map.refuse_fault(entry, has_sensors ? "an actuator or a sensor" : "an actuator", known);
    if (!has_sensors && surface::needs_actuator_channel(entry.fault))
      map.refuse(entry, "channel is empty: fault '" + entry.fault +
                            "' of an actuator must name one of its channels");
  }
  return map;
}

}  // namespace

void validate_surface(const scene::SceneSpec& scene) {
  const surface::FaultMap faults = load_fault_map(scene.surface);
  const surface::ActuatorArray actuators(scene.surface, faults, scene.world.seed);
  const surface::SensorArray sensors(scene, actuators.field(), faults);
}

Simulation::Simulation(script::Experiment& experiment, int threads, bool scripted_actuators)
    : experiment_(experiment),
      nuisances_(experiment.mutable_scene(), experiment.variations()),
      scripted_actuators_(scripted_actuators),
      pool_(threads),
      actuator_array_(experiment.scene().surface, load_fault_map(experiment.scene().surface),
                      experiment.scene().world.seed, &pool_),
      sensor_array_(experiment.scene(), actuator_array_.field(), load_fault_map(experiment.scene().surface)),
      engine_(world::make_engine(experiment.scene(), actuator_array_.field(), &pool_)),
      catalogue_(experiment.scene().objects),
      joints_(experiment.scene().joints),
      departures_(experiment.scene().surface) {
  collect_channels();
  if (!sensor_array_.needs_impulses() && !actuator_array_.needs_impulses())
    engine_->write_impulses_when_asked();
  take_snapshot();
  experiment_.start(*this);
  if (experiment_.has_reset_hook()) take_snapshot();
  departures_.update(snapshot_, catalogue_);
  sense();
}

void Simulation::collect_channels() {
  const auto& surface = scene().surface;
  for (std::size_t i = 0; i < sensor_array_.channels().size(); ++i) {
    const scene::SensorChannel& channel = sensor_array_.channels()[i];
    sensors_.push_back({channel.name, surface.rows, surface.columns, channel.components,
                        sensor_array_.readings(static_cast<int>(i))});
  }
  for (std::size_t i = 0; i < actuator_array_.channels().size(); ++i)
    actuators_.push_back({actuator_array_.channels()[i].name, surface.rows, surface.columns, 1,
                          actuator_array_.targets(static_cast<int>(i))});
}

void Simulation::run_script() {
  experiment_.notify_departures(snapshot_.time_s, snapshot_.tick, departures_.departed());
  if (scene().world.off_table == scene::OffTablePolicy::kRemove)
    for (const scene::ObjectId id : departures_.departed()) engine_->remove(id);
  experiment_.tick(snapshot_.time_s, snapshot_.tick);
}

void Simulation::plan_actuators() noexcept {
  if (!std::exchange(tick_started_, true)) actuator_array_.begin_tick();
  actuator_array_.plan(scene().world.dt_s);
}

bool Simulation::step_physics() {
  if (actuator_array_.exerts_forces())
    actuator_array_.add_forces(scene().world.dt_s, engine_->bodies(), catalogue_, engine_->wrenches());
  if (actuator_array_.refused_output()) return false;
  if (!wrenches_.empty()) add_wrenches();
  engine_->step();
  const surface::Field& field = actuator_array_.field();
  sensor_array_.accumulate_impulses(field.impulse, field.tip_impulse, field.skin.impulse);
  return !engine_->is_overloaded();
}

void Simulation::add_wrenches() {
  const std::span<const scene::ObjectId> ids = engine_->bodies().id;
  const std::span<surface::Wrench> wrenches = engine_->wrenches();
  for (const ObjectWrench& w : wrenches_) {
    const auto it = std::ranges::lower_bound(ids, w.id);
    if (it == ids.end() || *it != w.id) continue;  // removed by the script
    surface::Wrench& of_body = wrenches[it - ids.begin()];
    of_body.force += w.wrench.force;
    of_body.torque += w.wrench.torque;
  }
}

bool Simulation::place(scene::ObjectId id, const script::ObjectStateUpdate& update) {
  if (!engine_->set_state(id, update)) return false;
  take_snapshot();
  return true;
}

bool Simulation::set_wrench(scene::ObjectId id, const surface::Wrench& wrench) {
  if (!engine_->alive(id)) return false;
  const auto it = std::ranges::lower_bound(wrenches_, id, {}, &ObjectWrench::id);
  const bool is_known = it != wrenches_.end() && it->id == id;
  if (wrench.is_zero() && is_known)
    wrenches_.erase(it);
  else if (is_known)
    it->wrench = wrench;
  else if (!wrench.is_zero())
    wrenches_.insert(it, {id, wrench});
  return true;
}

void Simulation::commit_actuators() noexcept { actuator_array_.commit(scene().world.dt_s); }

void Simulation::take_snapshot() {
  is_partial_ = completes_when_asked_;
  engine_->snapshot(snapshot_, !is_partial_);
  if (!is_partial_) actuator_array_.write_cell_motion(snapshot_.actuator_state);
  actuator_array_.write_joint_positions(snapshot_.joint_position);
}

// Before anything changes the state after the tick.
void Simulation::complete_snapshot() const {
  const common::StandardArithmetic arithmetic;
  is_partial_ = false;
  engine_->snapshot(snapshot_);
  actuator_array_.write_cell_motion(snapshot_.actuator_state);
}

void Simulation::finish_tick() {
  take_snapshot();
  tick_started_ = false;
  ++snapshot_.tick;
  // Computed from the tick rather than accumulated, so that rounding errors do not add up.
  snapshot_.time_s = static_cast<double>(snapshot_.tick) * scene().world.control_period_s;
  departures_.update(snapshot_, catalogue_);
}

void Simulation::sense() { sensor_array_.sense(snapshot_, catalogue_, pool_); }

// An object that was created during the run. Its solid must be that of a declared object.
void Simulation::archive_object(common::StateArchive& a, scene::ObjectSpec& o) {
  a(o.shape, o.radius, o.height, o.size, o.position, o.orientation, o.velocity, o.angular_velocity, o.mass,
    o.centre_of_mass, o.inertia, o.friction, o.fixed, o.material, o.colour, o.label, o.magnetic_pole,
    o.magnetic_moment);
  const std::span declared(scene().objects);
  std::uint64_t twin = 0;  // declared object with the same solid, plus one; 0: no solid
  if (o.solid && a.saves()) {
    const auto it = std::ranges::find(declared, o.solid, &scene::ObjectSpec::solid);
    if (it == declared.end())
      throw common::UserError(
          "an object was created from a mesh or hull during the run: declare one of its kind while the "
          "script loads");
    twin = static_cast<std::uint64_t>(it - declared.begin()) + 1;
  }
  a(twin);
  if (a.saves()) return;
  if (twin > declared.size()) throw common::UserError("the saved state is damaged");
  o.solid = twin == 0 ? nullptr : declared[twin - 1].solid;
}

void Simulation::archive(common::StateArchive& a) {
  const std::size_t declared = scene().objects.size();
  const auto count = a.value(static_cast<std::uint64_t>(catalogue_.size()));
  if (count < declared || count > UINT32_MAX) throw common::UserError("the saved state is damaged");
  catalogue_.resize(count);
  for (std::size_t id = declared; id < count; ++id) archive_object(a, catalogue_[id]);
  a(joints_);
  if (a.saves()) engine_->write_impulses();  // to the field, which the actuators save
  actuator_array_.archive(a);
  engine_->archive(a, catalogue_, declared);
  departures_.archive(a);
  a(wrenches_);
  a(snapshot_.tick, snapshot_.time_s);
  const std::uint64_t hash = a.value(a.saves() ? snapshot().state_hash : 0);
  if (!a.saves()) {
    take_snapshot();
    if (snapshot().state_hash != hash) throw common::UserError("the saved state is damaged");
    requests_ = {};
  }
  sensor_array_.archive(a, snapshot_, catalogue_, pool_);
}

std::optional<std::string> Simulation::failure() const {
  if (engine_->is_overloaded())
    return fmt::format("failed at tick {}: too many of the {} objects overlap: place them apart",
                       snapshot_.tick + 1, catalogue_.size());
  if (const auto refused = actuator_array_.refused_output()) {
    if (refused->is_force)
      return fmt::format("failed at tick {}: an actuator exerts {} on object {}", snapshot_.tick + 1,
                         refused->what, engine_->bodies().id[refused->index]);
    const int columns = scene().surface.columns;
    return fmt::format("failed at tick {}: the actuator of row {}, column {} gives it {}", snapshot_.tick + 1,
                       refused->index / columns + 1, refused->index % columns + 1, refused->what);
  }
  if (const auto object = engine_->first_non_finite()) {
    return fmt::format(
        "failed at tick {}: object {} has a position or velocity that is not finite: its size, mass or speed "
        "differs too much from its neighbours', or its joint is too stiff, for a step of {} s: take a "
        "smaller dt ({})",
        snapshot_.tick + 1, *object, scene().world.dt_s, describe_object(catalogue_[*object]));
  }
  return std::nullopt;
}

ScriptRequests Simulation::take_requests() noexcept { return std::exchange(requests_, {}); }

void Simulation::stop(std::string message, std::optional<bool> success) {
  requests_.stop = true;
  requests_.stop_message = std::move(message);
  requests_.success = success;
}

scene::ObjectId Simulation::spawn(const scene::ObjectSpec& spec) {
  snapshot();
  scene::ObjectSpec varied = spec;
  nuisances_.apply(scene(), varied);
  const scene::ObjectId id = engine_->add(varied);
  catalogue_.push_back(std::move(varied));
  assert(id + 1 == catalogue_.size());
  return id;
}

scene::JointId Simulation::add_joint(const scene::JointSpec& spec) {
  if (const std::string error = world::validate_for_engine(spec, scene().world.engine); !error.empty())
    throw scene::InputError(error);
  joints_.push_back(spec);
  return engine_->add_joint(spec);
}

void Simulation::remove(scene::ObjectId id) {
  snapshot();
  engine_->remove(id);
}

bool Simulation::is_alive(scene::ObjectId id) const { return engine_->alive(id); }

script::ObjectState Simulation::state(scene::ObjectId id) const { return engine_->state(id); }

bool Simulation::is_on_table(scene::ObjectId id) const {
  const Eigen::Vector3f p = engine_->state(id).position.cast<float>();
  return departures_.is_on_table({p.x(), p.y(), p.z()});
}

std::string Simulation::label(scene::ObjectId id) const {
  if (id >= catalogue_.size())
    throw scene::InputError("object " + std::to_string(id) + ": there are " +
                            std::to_string(catalogue_.size()));
  return catalogue_[id].label;
}

std::vector<scene::ObjectId> Simulation::find_objects(const std::optional<std::string>& label) const {
  std::vector<scene::ObjectId> found;
  for (scene::ObjectId id = 0; id < catalogue_.size(); ++id)
    if (engine_->alive(id) && (!label || catalogue_[id].label == *label)) found.push_back(id);
  return found;
}

void Simulation::apply_force(scene::ObjectId id, const Eigen::Vector3d& force,
                             const std::optional<Eigen::Vector3d>& point, double seconds) {
  engine_->apply_force(id, force, point, seconds);
}

void Simulation::set_state(scene::ObjectId id, const script::ObjectStateUpdate& update) {
  snapshot();
  engine_->set_state(id, update);
}

void Simulation::require_scripted_actuators() const {
  if (!scripted_actuators_)
    throw scene::InputError(
        "the controller drives the actuators: cells:target and cells:targets need --no-controller");
}

int Simulation::find_actuator_channel(const std::string& name) const {
  const auto it = std::ranges::find(actuators_, name, &scene::ChannelData::name);
  if (it == actuators_.end()) throw scene::InputError("no actuator channel '" + name + "'");
  return static_cast<int>(it - actuators_.begin());
}

void Simulation::set_target(const std::string& channel, int row, int column, float value) {
  require_scripted_actuators();
  clamped_targets_ += actuator_array_.set_target(find_actuator_channel(channel), row, column, value);
}

void Simulation::set_targets(const std::string& channel, std::span<const float> values) {
  require_scripted_actuators();
  clamped_targets_ += actuator_array_.set_targets(find_actuator_channel(channel), values);
}

int Simulation::find_sensor_channel(const std::string& name) const {
  const auto it = std::ranges::find(sensors_, name, &scene::ChannelData::name);
  if (it == sensors_.end()) throw scene::InputError("no sensor channel '" + name + "'");
  return static_cast<int>(it - sensors_.begin());
}

std::size_t Simulation::plane_index(int row, int column, int component) const {
  const auto& surface = scene().surface;
  return component * surface.cell_count() + surface.index(row, column);
}

float Simulation::sense(const std::string& channel, int row, int column, int component) const {
  return sensor_array_.readings(find_sensor_channel(channel))[plane_index(row, column, component)];
}

float Simulation::read_ground_truth(const std::string& channel, int row, int column, int component) const {
  return sensor_array_.truth(find_sensor_channel(channel))[plane_index(row, column, component)];
}

void Simulation::set_real_time_factor(std::optional<double> factor) {
  requests_.pace_changed = true;
  requests_.pace = factor;
}

}  // namespace smartsurf::simulation

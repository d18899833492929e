#include "smartsurf/run/display/UserInteraction.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "smartsurf/scene/CellChannels.h"

namespace smartsurf::run {
namespace {

constexpr std::string_view kHeightChannel = "height";
constexpr double kSpringFrequency_Hz = 1.5;
constexpr double kMaxAcceleration = 400.0;  // u/s²; limits the effect of pointer jumps

double object_mass(const scene::SceneSpec& scene, const scene::ObjectSpec& object) {
  return object.mass.value_or(scene.materials[object.material].density * object.volume());
}

// Applies a critically damped spring between the grip and the target, and compensates gravity. The frequency
// is limited so that a force that is constant over a control period stays stable.
void apply_spring_force(const view::Pull& pull, simulation::Simulation& simulation) {
  const scene::SceneSpec& scene = simulation.scene();
  const scene::ObjectState state = simulation.state(pull.object);
  const double max_omega = 0.5 / scene.world.control_period_s;
  const double omega = std::min(2.0 * std::numbers::pi * kSpringFrequency_Hz, max_omega);
  const Eigen::Vector3d arm = state.orientation * pull.local_anchor;
  const Eigen::Vector3d velocity = state.velocity + state.angular_velocity.cross(arm);
  Eigen::Vector3d acceleration =
      omega * omega * (pull.target - state.position - arm) - 2.0 * omega * velocity - scene.world.gravity;
  if (acceleration.norm() > kMaxAcceleration) acceleration *= kMaxAcceleration / acceleration.norm();
  const double mass = object_mass(scene, simulation.catalogue()[pull.object]);
  simulation.apply_force(pull.object, mass * acceleration, state.position + arm,
                         scene.world.control_period_s);
}

}  // namespace

bool UserInteraction::apply(InteractionRequests& requests, simulation::Simulation& simulation) {
  bool interacted = apply_poke(requests.poke, simulation);
  if (requests.pull && simulation.is_alive(requests.pull->object)) {
    apply_spring_force(*requests.pull, simulation);
    interacted = true;
  }
  for (const scene::ObjectSpec& object : requests.dropped_objects) {
    simulation.spawn(object);
    interacted = true;
  }
  requests.dropped_objects.clear();
  for (const view::Fault& fault : requests.faults) apply_fault(fault, simulation);
  interacted |= !requests.faults.empty() || !faulty_cells_.empty();
  requests.faults.clear();
  for (const CellOverride& cell : faulty_cells_) write_targets(cell, cell.targets, simulation);
  return interacted;
}

UserInteraction::CellOverride UserInteraction::capture_targets(int row, int column,
                                                               const simulation::Simulation& simulation) {
  CellOverride cell{row, column, {}, {}};
  const int channels = static_cast<int>(simulation.actuators().size());
  for (int k = 0; k < channels; ++k)
    cell.original_targets.push_back(simulation.actuator_target(k, row, column));
  cell.targets = cell.original_targets;
  return cell;
}

void UserInteraction::write_targets(const CellOverride& cell, const std::vector<float>& targets,
                                    simulation::Simulation& simulation) {
  for (std::size_t k = 0; k < targets.size(); ++k)
    simulation.override_actuator_target(static_cast<int>(k), cell.row, cell.column, targets[k]);
}

// A stuck cell keeps its current height and targets; a dead cell moves to its safe values.
void UserInteraction::apply_fault(const view::Fault& fault, simulation::Simulation& simulation) {
  CellOverride cell = capture_targets(fault.row, fault.column, simulation);
  std::erase_if(faulty_cells_, [&](const CellOverride& other) {
    const bool same = other.row == fault.row && other.column == fault.column;
    if (same) cell.original_targets = other.original_targets;
    return same;
  });
  if (fault.kind == view::FaultKind::kNone) return write_targets(cell, cell.original_targets, simulation);
  const scene::SurfaceSpec& surface = simulation.scene().surface;
  const scene::CellChannels cell_channels(surface);
  const int index = surface.index(fault.row, fault.column);
  for (std::size_t k = 0; k < cell.targets.size(); ++k) {
    const scene::ActuatorChannel* own = cell_channels.find(k, index);
    if (own == nullptr) continue;
    if (fault.kind == view::FaultKind::kDead)
      cell.targets[k] = static_cast<float>(own->safe_value);
    else if (own->name == kHeightChannel)
      cell.targets[k] = simulation.snapshot().height[index] - surface.base_height(index);
  }
  faulty_cells_.push_back(std::move(cell));
}

// Does nothing if the actuators have no height channel.
bool UserInteraction::apply_poke(const std::optional<view::Poke>& poke, simulation::Simulation& simulation) {
  const bool same =
      poke && poked_cell_ && poked_cell_->row == poke->row && poked_cell_->column == poke->column;
  if (poked_cell_ && !same) {
    write_targets(*poked_cell_, poked_cell_->original_targets, simulation);
    poked_cell_.reset();
  }
  const auto channels = simulation.actuators();
  const auto height = std::ranges::find(channels, kHeightChannel, &scene::ChannelData::name);
  if (!poke || height == channels.end()) return false;
  if (!poked_cell_) poked_cell_ = capture_targets(poke->row, poke->column, simulation);
  const scene::SurfaceSpec& surface = simulation.scene().surface;
  const float base = surface.base_height(surface.index(poke->row, poke->column));
  simulation.override_actuator_target(static_cast<int>(height - channels.begin()), poke->row, poke->column,
                                      static_cast<float>(poke->height) - base);
  return true;
}

}  // namespace smartsurf::run

#include "smartsurf/run/Hand.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

namespace smartsurf::run {
namespace {

constexpr std::string_view kHeight = "height";
constexpr double kSpringFrequency_Hz = 1.5;
constexpr double kMostAcceleration = 400.0;  // u/s²: a jump of the pointer must not shoot the object away

double mass_of(const scene::SceneSpec& scene, const scene::ObjectSpec& object) {
  return object.mass.value_or(scene.materials[static_cast<std::size_t>(object.material)].density *
                              object.volume());
}

// A spring and a damper between the grip and the target, and the object's weight taken off it. Soft enough
// for the force to stand still through a control period.
void pull(const view::Pull& wish, Simulation& simulation) {
  const scene::SceneSpec& scene = simulation.scene();
  const scene::ObjectState state = simulation.state(wish.object);
  const double stiffest = 0.5 / scene.world.control_period_s;
  const double omega = std::min(2.0 * std::numbers::pi * kSpringFrequency_Hz, stiffest);
  const Eigen::Vector3d arm = state.orientation * wish.grip;
  const Eigen::Vector3d velocity = state.velocity + state.angular_velocity.cross(arm);
  Eigen::Vector3d acceleration =
      omega * omega * (wish.target - state.position - arm) - 2.0 * omega * velocity - scene.world.gravity;
  if (acceleration.norm() > kMostAcceleration) acceleration *= kMostAcceleration / acceleration.norm();
  const double mass = mass_of(scene, simulation.catalogue()[wish.object]);
  simulation.push(wish.object, mass * acceleration, state.position + arm, scene.world.control_period_s);
}

}  // namespace

bool Hand::apply(HandWishes& wishes, Simulation& simulation) {
  bool touched = hold(wishes.poke, simulation);
  if (wishes.pull && simulation.alive(wishes.pull->object)) {
    pull(*wishes.pull, simulation);
    touched = true;
  }
  for (const scene::ObjectSpec& object : wishes.drops) {
    simulation.spawn(object);
    touched = true;
  }
  wishes.drops.clear();
  for (const view::Fault& fault : wishes.faults) break_cell(fault, simulation);
  touched |= !wishes.faults.empty() || !broken_.empty();
  wishes.faults.clear();
  for (const Held& cell : broken_) tell(cell, cell.commands, simulation);
  return touched;
}

Hand::Held Hand::hold_as_told(int row, int column, const Simulation& simulation) {
  Held cell{row, column, {}, {}};
  const int channels = static_cast<int>(simulation.actuators().size());
  for (int k = 0; k < channels; ++k) cell.before.push_back(simulation.told(k, row, column));
  cell.commands = cell.before;
  return cell;
}

void Hand::tell(const Held& cell, const std::vector<float>& commands, Simulation& simulation) {
  for (std::size_t k = 0; k < commands.size(); ++k)
    simulation.hold_cell(static_cast<int>(k), cell.row, cell.column, commands[k]);
}

// Stuck: it stays as it is. Dead: it goes where cells go that nobody drives.
void Hand::break_cell(const view::Fault& fault, Simulation& simulation) {
  Held cell = hold_as_told(fault.row, fault.column, simulation);
  std::erase_if(broken_, [&](const Held& other) {
    const bool same = other.row == fault.row && other.column == fault.column;
    if (same) cell.before = other.before;
    return same;
  });
  if (fault.kind == view::FaultKind::kNone) return tell(cell, cell.before, simulation);
  const scene::SurfaceSpec& surface = simulation.scene().surface;
  const std::vector<scene::ActuatorChannel> channels = surface.actuator_channels();
  const float height =
      simulation.snapshot().height[static_cast<std::size_t>(surface.index(fault.row, fault.column))];
  for (std::size_t k = 0; k < channels.size(); ++k) {
    if (fault.kind == view::FaultKind::kDead)
      cell.commands[k] = static_cast<float>(channels[k].safe);
    else if (channels[k].name == kHeight)
      cell.commands[k] = height;
  }
  broken_.push_back(std::move(cell));
}

// Only cells that have a height can be poked.
bool Hand::hold(const std::optional<view::Poke>& poke, Simulation& simulation) {
  const bool same = poke && held_ && held_->row == poke->row && held_->column == poke->column;
  if (held_ && !same) {
    tell(*held_, held_->before, simulation);
    held_.reset();
  }
  const auto channels = simulation.actuators();
  const auto height = std::ranges::find(channels, kHeight, &record::Channel::name);
  if (!poke || height == channels.end()) return false;
  if (!held_) held_ = hold_as_told(poke->row, poke->column, simulation);
  simulation.hold_cell(static_cast<int>(height - channels.begin()), poke->row, poke->column,
                       static_cast<float>(poke->height));
  return true;
}

}  // namespace smartsurf::run

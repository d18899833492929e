#include "smartsurf/run/Hand.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace smartsurf::run {
namespace {

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
  for (const Broken& cell : broken_) simulation.hold_cell(cell.row, cell.column, cell.command);
  return touched;
}

// Stuck: it stays where it is. Dead: it falls to where cells are that nobody drives.
void Hand::break_cell(const view::Fault& fault, Simulation& simulation) {
  float before = simulation.told(fault.row, fault.column);
  std::erase_if(broken_, [&](const Broken& cell) {
    const bool same = cell.row == fault.row && cell.column == fault.column;
    if (same) before = cell.before;
    return same;
  });
  const scene::SurfaceSpec& surface = simulation.scene().surface;
  const auto cell = static_cast<std::size_t>(surface.index(fault.row, fault.column));
  if (fault.kind == view::FaultKind::kNone)
    simulation.hold_cell(fault.row, fault.column, before);
  else
    broken_.push_back({fault.row, fault.column,
                       fault.kind == view::FaultKind::kStuck ? simulation.snapshot().height[cell]
                                                             : static_cast<float>(surface.pin.min_height),
                       before});
}

bool Hand::hold(const std::optional<view::Poke>& poke, Simulation& simulation) {
  const bool same = poke && held_ && held_->row == poke->row && held_->column == poke->column;
  if (held_ && !same) {
    simulation.hold_cell(held_->row, held_->column, held_->before);
    held_.reset();
  }
  if (!poke) return false;
  if (!held_) held_ = Held{poke->row, poke->column, simulation.told(poke->row, poke->column)};
  simulation.hold_cell(poke->row, poke->column, static_cast<float>(poke->height));
  return true;
}

}  // namespace smartsurf::run
